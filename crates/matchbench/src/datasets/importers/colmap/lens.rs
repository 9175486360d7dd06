//! Converts COLMAP's camera models to ours. COLMAP has the origin of pixels at the corner of the image, we have
//! it at the centre of the first pixel. The coefficients are the same.
//!
//! | model | parameters |
//! | --- | --- |
//! | SIMPLE_PINHOLE | f cx cy |
//! | PINHOLE | fx fy cx cy |
//! | SIMPLE_RADIAL | f cx cy k1 |
//! | RADIAL | f cx cy k1 k2 |
//! | OPENCV | fx fy cx cy k1 k2 p1 p2 |
//! | OPENCV_FISHEYE | fx fy cx cy k1 k2 k3 k4 |
//! | FULL_OPENCV | fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6, where k4, k5 and k6 must be 0, since our lens model has no denominator |

use matchbench_vision::geometry::{Camera, Distortion, Fisheye, Lens};

use crate::datasets::DatasetError;
use crate::datasets::importers::list;

/// All models of COLMAP 4.2 in the order of their numbers in binary files, each with its number of parameters.
pub(in crate::datasets::importers) const MODELS: [(&str, usize); 18] = [
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
    ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
    ("SIMPLE_DIVISION", 4),
    ("DIVISION", 5),
    ("SIMPLE_FISHEYE", 3),
    ("FISHEYE", 4),
    ("EUCM", 6),
    ("EQUIRECTANGULAR", 2),
];

/// What to do with images whose lens is not supported.
const UNDISTORT: &str = "undistort the images with COLMAP's image_undistorter and import the model that it writes, \
                         whose cameras are PINHOLE";

/// Why a camera cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::datasets::importers) struct Unusable {
    pub(in crate::datasets::importers) what: String,
    /// How to mend it, where it is not by writing the file again.
    pub(in crate::datasets::importers) remedy: Option<&'static str>,
}

impl<T: Into<String>> From<T> for Unusable {
    fn from(what: T) -> Self {
        Self {
            what: what.into(),
            remedy: None,
        }
    }
}

impl Unusable {
    /// A lens that is not supported.
    fn lens(what: String) -> Self {
        Self {
            what,
            remedy: Some(UNDISTORT),
        }
    }

    /// The error, once it is known what is wrong where; it keeps the remedy that is its own.
    pub(in crate::datasets::importers) fn placed(
        self,
        error: impl FnOnce(String) -> DatasetError,
    ) -> DatasetError {
        let placed = error(self.what);
        match self.remedy {
            None => placed,
            Some(remedy) => DatasetError {
                remedy: remedy.into(),
                ..placed
            },
        }
    }
}

/// The camera of a model with these parameters.
pub(in crate::datasets::importers) fn camera(
    model: &str,
    params: &[f64],
) -> Result<Camera, Unusable> {
    let full = |[k1, k2, p1, p2, k3]: [f64; 5]| {
        let lens = Distortion { k1, k2, p1, p2, k3 };
        [k1, k2, p1, p2, k3]
            .iter()
            .any(|&k| k != 0.0)
            .then_some(Lens::Brown(lens))
    };
    let lens = |k1, k2, p1, p2| full([k1, k2, p1, p2, 0.0]);
    let (pinhole, distortion) = match (model, params) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => ([f, f, cx, cy], None),
        ("PINHOLE", &[fx, fy, cx, cy]) => ([fx, fy, cx, cy], None),
        ("SIMPLE_RADIAL", &[f, cx, cy, k1]) => ([f, f, cx, cy], lens(k1, 0.0, 0.0, 0.0)),
        ("RADIAL", &[f, cx, cy, k1, k2]) => ([f, f, cx, cy], lens(k1, k2, 0.0, 0.0)),
        ("OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2]) => ([fx, fy, cx, cy], lens(k1, k2, p1, p2)),
        ("OPENCV_FISHEYE", &[fx, fy, cx, cy, k1, k2, k3, k4]) => {
            let lens = Fisheye { k1, k2, k3, k4 };
            // Without coefficients too, it shows angles.
            ([fx, fy, cx, cy], Some(Lens::Fisheye(lens)))
        }
        ("FULL_OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6]) => {
            if [k4, k5, k6].iter().any(|&k| k != 0.0) {
                return Err(Unusable::lens(format!(
                    "the camera model FULL_OPENCV is supported without k4, k5 and k6, which are {k4}, {k5} and {k6}"
                )));
            }
            ([fx, fy, cx, cy], full([k1, k2, p1, p2, k3]))
        }
        (
            known @ ("SIMPLE_PINHOLE" | "PINHOLE" | "SIMPLE_RADIAL" | "RADIAL" | "OPENCV"
            | "OPENCV_FISHEYE" | "FULL_OPENCV"),
            _,
        ) => {
            let count = params.len();
            return Err(format!("{count} parameters do not belong to the model {known}").into());
        }
        (other, _) => {
            return Err(Unusable::lens(format!(
                "the camera model {other} is not supported: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, \
                 RADIAL, OPENCV, OPENCV_FISHEYE and FULL_OPENCV are"
            )));
        }
    };
    let [fx, fy, cx, cy] = pinhole;
    let pinhole = list::camera(&[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0])?;
    if !params.iter().all(|parameter| parameter.is_finite()) {
        return Err("a parameter is not finite".into());
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
        let lens = found.distortion.unwrap().brown().unwrap();
        assert_eq!(
            (lens.k1, lens.k2, lens.p1, lens.p2, lens.k3),
            (0.1, 0.2, 0.3, 0.4, 0.0)
        );
        let simple = camera("SIMPLE_RADIAL", &[500.0, 320.0, 240.0, 0.1]).unwrap();
        assert_eq!(
            (simple.fy, simple.distortion.unwrap().brown().unwrap().k1),
            (500.0, 0.1)
        );
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
                Err(Unusable { what, remedy }) => {
                    assert!(what.contains(&format!("model {model} is ")), "{what}");
                    assert_eq!(remedy, Some(UNDISTORT));
                }
            }
        }
        let mut params = vec![
            500.0, 510.0, 320.0, 240.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.0, 0.0, 0.0,
        ];
        let lens = camera("FULL_OPENCV", &params).unwrap();
        let lens = lens.distortion.unwrap().brown().unwrap();
        assert_eq!((lens.k1, lens.p2, lens.k3), (0.1, 0.4, 0.5));
        params[11] = 1e-3;
        let divided = camera("FULL_OPENCV", &params).unwrap_err();
        assert!(divided.what.contains("0, 0 and 0.001"), "{divided:?}");
        let few = camera("PINHOLE", &[1.0; 3]).unwrap_err();
        assert!(
            few.what.contains("3 parameters") && few.remedy.is_none(),
            "{few:?}"
        );
        assert!(camera("PINHOLE", &[-1.0; 4]).is_err());
        assert!(camera("RADIAL", &[9.0, 3.0, 2.0, f64::NAN, 0.0]).is_err());
    }

    #[test]
    fn these_models_are_read_and_no_others() {
        let read: Vec<&str> = (MODELS.iter())
            .filter(|(model, parameters)| {
                // The last three of FULL_OPENCV must be 0.
                let params: Vec<f64> = (0..*parameters)
                    .map(|place| if place < 4 { 1.0 } else { 0.0 })
                    .collect();
                camera(model, &params).is_ok()
            })
            .map(|(model, _)| *model)
            .collect();
        let expected = [
            "SIMPLE_PINHOLE",
            "PINHOLE",
            "SIMPLE_RADIAL",
            "RADIAL",
            "OPENCV",
            "FULL_OPENCV",
        ];
        assert_eq!(read, expected);
    }

    #[test]
    fn each_radial_term_is_in_its_place() {
        let found = camera("RADIAL", &[500.0, 320.0, 240.0, 0.1, -0.2]).unwrap();
        assert_eq!((found.fx, found.fy), (500.0, 500.0));
        let expected = Distortion {
            k1: 0.1,
            k2: -0.2,
            ..Distortion::default()
        };
        assert_eq!(found.distortion, Some(expected));
    }
}
