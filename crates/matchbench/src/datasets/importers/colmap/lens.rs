//! Cameras of COLMAP's files. COLMAP has the origin of pixels at the corner of the image, we have it at the centre of
//! the first pixel.

use matchbench_vision::geometry::Camera;

use crate::datasets::importers::list;
use crate::datasets::{CameraModelError, DatasetError, camera_of_model};

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

impl From<CameraModelError> for Unusable {
    fn from(error: CameraModelError) -> Self {
        use CameraModelError::{Count, Denominator, Unknown, Value};
        Self {
            what: error.to_string(),
            remedy: match error {
                Unknown(_) | Denominator(_) => Some(UNDISTORT),
                Count { .. } | Value(_) => None,
            },
        }
    }
}

impl Unusable {
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
    Ok(list::from_corner(camera_of_model(model, params)?))
}

#[cfg(test)]
mod tests {
    use matchbench_vision::geometry::Distortion;

    use super::*;

    #[test]
    fn cameras_are_moved_to_our_origin_and_lenses_that_are_not_supported_have_a_remedy() {
        let params = [500.0, 510.0, 320.0, 240.0, 0.1, 0.2, 0.3, 0.4];
        let found = camera("OPENCV", &params).unwrap();
        assert_eq!(
            (found.fx, found.fy, found.cx, found.cy),
            (500.0, 510.0, 319.5, 239.5)
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
        let few = camera("PINHOLE", &[1.0; 3]).unwrap_err();
        assert!(
            few.what.contains("3 parameters") && few.remedy.is_none(),
            "{few:?}"
        );
        assert_eq!(camera("PINHOLE", &[-1.0; 4]).unwrap_err().remedy, None);
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
            "OPENCV_FISHEYE",
            "FULL_OPENCV",
            "SIMPLE_RADIAL_FISHEYE",
            "RADIAL_FISHEYE",
            "SIMPLE_FISHEYE",
            "FISHEYE",
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
        assert_eq!(found.distortion, Some(expected.into()));
    }
}
