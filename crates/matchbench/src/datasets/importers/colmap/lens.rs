//! Converts COLMAP's camera models to ours. COLMAP has the origin of pixels at the corner of the image, we have
//! it at the centre of the first pixel. Radial and tangential terms are the same.
//!
//! | model | parameters |
//! | --- | --- |
//! | SIMPLE_PINHOLE | f cx cy |
//! | PINHOLE | fx fy cx cy |
//! | SIMPLE_RADIAL | f cx cy k1 |
//! | RADIAL | f cx cy k1 k2 |
//! | OPENCV | fx fy cx cy k1 k2 p1 p2 |
//! | FULL_OPENCV | fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6, where k4, k5 and k6 must be 0, since our lens model has no denominator |

use matchbench_vision::geometry::{Camera, Distortion};

use crate::datasets::importers::list;

/// All of COLMAP's models in the order of their numbers in binary files, each with its number of parameters.
pub(super) const MODELS: [(&str, usize); 11] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
];

/// The camera of a model with these parameters.
pub(in crate::datasets::importers) fn camera(
    model: &str,
    params: &[f64],
) -> Result<Camera, String> {
    let full = |[k1, k2, p1, p2, k3]: [f64; 5]| {
        let lens = Distortion { k1, k2, p1, p2, k3 };
        [k1, k2, p1, p2, k3]
            .iter()
            .any(|&k| k != 0.0)
            .then_some(lens)
    };
    let lens = |k1, k2, p1, p2| full([k1, k2, p1, p2, 0.0]);
    let (pinhole, distortion) = match (model, params) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => ([f, f, cx, cy], None),
        ("PINHOLE", &[fx, fy, cx, cy]) => ([fx, fy, cx, cy], None),
        ("SIMPLE_RADIAL", &[f, cx, cy, k1]) => ([f, f, cx, cy], lens(k1, 0.0, 0.0, 0.0)),
        ("RADIAL", &[f, cx, cy, k1, k2]) => ([f, f, cx, cy], lens(k1, k2, 0.0, 0.0)),
        ("OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2]) => ([fx, fy, cx, cy], lens(k1, k2, p1, p2)),
        ("FULL_OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6]) => {
            if [k4, k5, k6].iter().any(|&k| k != 0.0) {
                return Err(format!(
                    "the camera model FULL_OPENCV is supported without k4, k5 and k6, which are {k4}, {k5} and {k6}; \
                     COLMAP's image_undistorter makes PINHOLE of any"
                ));
            }
            ([fx, fy, cx, cy], full([k1, k2, p1, p2, k3]))
        }
        (
            known @ ("SIMPLE_PINHOLE" | "PINHOLE" | "SIMPLE_RADIAL" | "RADIAL" | "OPENCV"
            | "FULL_OPENCV"),
            _,
        ) => {
            return Err(format!(
                "{} parameters do not belong to the model {known}",
                params.len()
            ));
        }
        (other, _) => {
            return Err(format!(
                "the camera model {other} is not supported: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, \
                 RADIAL, OPENCV and FULL_OPENCV are; COLMAP's image_undistorter makes PINHOLE of any"
            ));
        }
    };
    let [fx, fy, cx, cy] = pinhole;
    let pinhole = list::camera(&[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0])?;
    if !params.iter().all(|parameter| parameter.is_finite()) {
        return Err("a parameter is not finite".to_owned());
    }
    let camera = list::from_corner(Camera {
        distortion,
        ..pinhole
    });
    camera.check().map_err(|error| error.to_string())?;
    Ok(camera)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_supported_model_is_read_and_others_are_named() {
        let params = [500.0, 510.0, 320.0, 240.0, 0.1, 0.2, 0.3, 0.4];
        let found = camera("OPENCV", &params).unwrap();
        assert_eq!(
            (found.fx, found.fy, found.cx, found.cy),
            (500.0, 510.0, 319.5, 239.5)
        );
        let lens = found.distortion.unwrap();
        assert_eq!(
            (lens.k1, lens.k2, lens.p1, lens.p2, lens.k3),
            (0.1, 0.2, 0.3, 0.4, 0.0)
        );
        let simple = camera("SIMPLE_RADIAL", &[500.0, 320.0, 240.0, 0.1]).unwrap();
        assert_eq!((simple.fy, simple.distortion.unwrap().k1), (500.0, 0.1));
        assert_eq!(
            camera("RADIAL", &[9.0, 3.0, 2.0, 0.0, 0.0])
                .unwrap()
                .distortion,
            None
        );
        for (model, parameters) in MODELS {
            let answer = camera(model, &vec![1.0; parameters]);
            match answer {
                Ok(_) => assert!(parameters <= 8),
                Err(what) => assert!(what.contains(&format!("model {model} is ")), "{what}"),
            }
        }
        let mut params = vec![
            500.0, 510.0, 320.0, 240.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.0, 0.0, 0.0,
        ];
        let lens = camera("FULL_OPENCV", &params).unwrap().distortion.unwrap();
        assert_eq!((lens.k1, lens.p2, lens.k3), (0.1, 0.4, 0.5));
        params[11] = 1e-3;
        let divided = camera("FULL_OPENCV", &params).unwrap_err();
        assert!(divided.contains("0, 0 and 0.001"), "{divided}");
        assert!(
            camera("PINHOLE", &[1.0; 3])
                .unwrap_err()
                .contains("3 parameters")
        );
        assert!(camera("PINHOLE", &[-1.0; 4]).is_err());
        assert!(camera("RADIAL", &[9.0, 3.0, 2.0, f64::NAN, 0.0]).is_err());
    }
}
