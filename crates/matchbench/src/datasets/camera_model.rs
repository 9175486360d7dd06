//! The camera models that COLMAP and PoseLib name, as far as they are ours. The coefficients are the same.
//!
//! | model | parameters |
//! | --- | --- |
//! | SIMPLE_PINHOLE | f cx cy |
//! | PINHOLE | fx fy cx cy |
//! | SIMPLE_RADIAL | f cx cy k1 |
//! | RADIAL | f cx cy k1 k2 |
//! | OPENCV | fx fy cx cy k1 k2 p1 p2 |
//! | SIMPLE_FISHEYE | f cx cy |
//! | FISHEYE | fx fy cx cy |
//! | SIMPLE_RADIAL_FISHEYE | f cx cy k1 |
//! | RADIAL_FISHEYE | f cx cy k1 k2 |
//! | OPENCV_FISHEYE | fx fy cx cy k1 k2 k3 k4 |
//! | FULL_OPENCV | fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6, where k4, k5 and k6 must be 0, since our lens model has no denominator |

use matchbench_vision::geometry::{Camera, CameraError, Distortion, Fisheye, Lens};

/// The models with their parameters.
const MODELS: [(&str, &str); 11] = [
    ("SIMPLE_PINHOLE", "f cx cy"),
    ("PINHOLE", "fx fy cx cy"),
    ("SIMPLE_RADIAL", "f cx cy k1"),
    ("RADIAL", "f cx cy k1 k2"),
    ("OPENCV", "fx fy cx cy k1 k2 p1 p2"),
    ("SIMPLE_FISHEYE", "f cx cy"),
    ("FISHEYE", "fx fy cx cy"),
    ("SIMPLE_RADIAL_FISHEYE", "f cx cy k1"),
    ("RADIAL_FISHEYE", "f cx cy k1 k2"),
    ("OPENCV_FISHEYE", "fx fy cx cy k1 k2 k3 k4"),
    ("FULL_OPENCV", "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6"),
];

/// Why parameters are no camera.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraModelError {
    /// The model is none of those that are supported.
    #[error("the camera model {0} is not supported: {known} are", known = known())]
    Unknown(String),
    /// The lens has a denominator, with these coefficients.
    #[error(
        "the camera model FULL_OPENCV is supported without k4, k5 and k6, which are {}, {} and {}",
        .0[0], .0[1], .0[2]
    )]
    Denominator([f64; 3]),
    /// The number of parameters is another.
    #[error("{found} parameters do not belong to the model {model}, which has {parameters}")]
    Count {
        /// The model.
        model: &'static str,
        /// The names of its parameters.
        parameters: &'static str,
        /// The number of parameters that were given.
        found: usize,
    },
    /// A parameter has a value that none can have.
    #[error(transparent)]
    Value(#[from] CameraError),
}

fn known() -> String {
    let [first @ .., last] = MODELS.map(|(name, _)| name);
    format!("{} and {last}", first.join(", "))
}

/// The camera of a model with these parameters. Its principal point has the same origin as the parameters: COLMAP counts
/// from the corner of the first pixel, everything here from its centre. A lens without distortion is none.
///
/// ```
/// use matchbench::datasets::camera_of_model;
///
/// let camera = camera_of_model("SIMPLE_RADIAL", &[500.0, 320.0, 240.0, 0.1])?;
/// assert_eq!((camera.fx, camera.fy, camera.cx), (500.0, 500.0, 320.0));
/// # Ok::<(), matchbench::datasets::CameraModelError>(())
/// ```
///
/// # Errors
/// If the model is not supported, or has other parameters, or one of them has a value that none can have.
pub fn camera_of_model(model: &str, params: &[f64]) -> Result<Camera, CameraModelError> {
    let &(model, parameters) = (MODELS.iter().find(|(name, _)| *name == model))
        .ok_or_else(|| CameraModelError::Unknown(model.to_owned()))?;
    let names: Vec<&str> = parameters.split(' ').collect();
    if names.len() != params.len() {
        return Err(CameraModelError::Count {
            model,
            parameters,
            found: params.len(),
        });
    }
    let find = |name| Some(params[names.iter().position(|other| *other == name)?]);
    let [k1, k2, k3, k4, k5, k6, p1, p2] =
        ["k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"].map(|name| find(name).unwrap_or(0.0));
    let focal = |name| find("f").or(find(name)).expect("every model has one");
    let centre = |name| find(name).expect("every model has it");
    let lens = if model.ends_with("FISHEYE") {
        // Without coefficients too, it shows angles.
        Some(Fisheye { k1, k2, k3, k4 }.into())
    } else if [k4, k5, k6] != [0.0; 3] {
        return Err(CameraModelError::Denominator([k4, k5, k6]));
    } else {
        let distortion = Distortion { k1, k2, p1, p2, k3 };
        (distortion != Distortion::default()).then_some(Lens::Brown(distortion))
    };
    let camera = Camera {
        fx: focal("fx"),
        fy: focal("fy"),
        cx: centre("cx"),
        cy: centre("cy"),
        distortion: lens,
    };
    camera.check()?;
    Ok(camera)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_parameter_goes_to_its_place() {
        let brown = |k1, k2, p1, p2, k3| Some(Lens::Brown(Distortion { k1, k2, p1, p2, k3 }));
        let fisheye = Fisheye {
            k1: 0.1,
            k2: 0.2,
            k3: 0.3,
            k4: 0.4,
        };
        let fish = |k1, k2| {
            let (k3, k4) = (0.0, 0.0);
            Some(Fisheye { k1, k2, k3, k4 }.into())
        };
        let pixels = [500.0, 510.0, 320.0, 240.0];
        let expected = [
            ("SIMPLE_PINHOLE", 0, None),
            ("PINHOLE", 0, None),
            ("SIMPLE_RADIAL", 1, brown(0.1, 0.0, 0.0, 0.0, 0.0)),
            ("RADIAL", 2, brown(0.1, 0.2, 0.0, 0.0, 0.0)),
            ("OPENCV", 4, brown(0.1, 0.2, 0.3, 0.4, 0.0)),
            ("SIMPLE_FISHEYE", 0, Some(Fisheye::default().into())),
            ("FISHEYE", 0, Some(Fisheye::default().into())),
            ("SIMPLE_RADIAL_FISHEYE", 1, fish(0.1, 0.0)),
            ("RADIAL_FISHEYE", 2, fish(0.1, 0.2)),
            ("OPENCV_FISHEYE", 4, Some(fisheye.into())),
            ("FULL_OPENCV", 8, brown(0.1, 0.2, 0.3, 0.4, 0.5)),
        ];
        for (model, coefficients, distortion) in expected {
            let has_one_focal = model.starts_with("SIMPLE") || model.starts_with("RADIAL");
            let given = &pixels[usize::from(has_one_focal)..];
            let lens = &[0.1, 0.2, 0.3, 0.4, 0.5, 0.0, 0.0, 0.0][..coefficients];
            let [.., cx, cy] = pixels;
            let fx = given[0];
            let camera = Camera {
                distortion,
                ..Camera::pinhole(fx, 510.0, cx, cy)
            };
            let found = camera_of_model(model, &[given, lens].concat());
            assert_eq!(found, Ok(camera), "{model}");
        }
    }

    #[test]
    fn a_lens_without_distortion_is_none_but_a_fisheye() {
        let params = [[9.0, 9.0, 3.0, 2.0], [0.0; 4], [0.0; 4]].concat();
        let lens = |model, count| camera_of_model(model, &params[..count]).unwrap().distortion;
        assert_eq!(lens("OPENCV", 8), None);
        assert_eq!(lens("FULL_OPENCV", 12), None);
        assert_eq!(lens("OPENCV_FISHEYE", 8), Some(Fisheye::default().into()));
    }

    #[test]
    fn what_is_no_camera_is_refused_in_words() {
        let said = |model, params: &[f64]| camera_of_model(model, params).unwrap_err().to_string();
        let few = said("PINHOLE", &[1.0; 3]);
        assert!(
            few.contains("3 parameters") && few.ends_with("has fx fy cx cy"),
            "{few}"
        );
        let other = said("FOV", &[1.0; 5]);
        assert!(
            other.ends_with("OPENCV_FISHEYE and FULL_OPENCV are"),
            "{other}"
        );
        let mut full = [1.0; 12];
        full[9..].copy_from_slice(&[0.0, 0.0, 1e-3]);
        let divided = said("FULL_OPENCV", &full);
        assert!(divided.contains("0, 0 and 0.001"), "{divided}");
        assert!(said("PINHOLE", &[-1.0; 4]).contains("positive"));
        let none = said("RADIAL", &[9.0, 3.0, 2.0, f64::NAN, 0.0]);
        assert!(none.contains("k1 is NaN"), "{none}");
    }
}
