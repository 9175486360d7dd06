//! Options as messages call them, which is as whoever reads the message gives them: on the command line or in Python.
//!
//! A message says which [`Asked`] it is about, and the front door that shows messages says once which it is
//! ([`FrontDoor::open`]); a program that never says so has the words of the command line. Notes and reasons of failures
//! that are recorded keep the words of the one that recorded them.

use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};

/// Through which the messages of this process are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrontDoor {
    /// The command: `--pixel-center 0`.
    CommandLine,
    /// The package: `pixel_center=0`.
    Python,
}

static IN_PYTHON: AtomicBool = AtomicBool::new(false);

impl FrontDoor {
    /// Makes all messages of this process use the words of this front door.
    pub fn open(self) {
        IN_PYTHON.store(self == Self::Python, Ordering::Relaxed);
    }

    /// The one that was opened last.
    pub fn now() -> Self {
        if IN_PYTHON.load(Ordering::Relaxed) {
            Self::Python
        } else {
            Self::CommandLine
        }
    }
}

/// What is given to an option.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Takes {
    Nothing,
    Number,
    Text,
    /// Names; on the command line with commas between them.
    Names,
}

/// An option that both front doors have. As text it is its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Asked {
    command: &'static str,
    python: &'static str,
    takes: Takes,
}

/// Where the centre of the first pixel is, in files of matches.
pub const PIXEL_CENTER: Asked = Asked::new("--pixel-center", "pixel_center", Takes::Number);
/// Which format files of matches have.
pub const MATCHES_FORMAT: Asked = Asked::new("--matches-format", "format", Takes::Text);
/// The size of the images that points of files belong to.
pub const RESIZED: Asked = Asked::new("--resized", "resized", Takes::Text);
/// Whether matches are those that the tool verified.
pub const VERIFIED: Asked = Asked::new("--verified", "verified", Takes::Nothing);
/// Estimators of a run.
pub const ESTIMATORS: Asked = Asked::new("--estimator", "estimators", Takes::Names);
/// Evaluation protocols of a run.
pub const PROTOCOLS: Asked = Asked::new("--protocol", "protocols", Takes::Names);
/// Parameters of matchers and estimators.
pub const SETTINGS: Asked = Asked::new("--set", "settings", Takes::Text);
/// The folder of kept features.
pub const CACHE: Asked = Asked::new("--cache", "cache", Takes::Text);
/// How many threads compute.
pub const THREADS: Asked = Asked::new("--threads", "threads", Takes::Number);
/// Which sequence is imported.
pub const SEQUENCE: Asked = Asked::new("--sequence", "sequence", Takes::Text);
/// Which camera of several is imported.
pub const SENSOR: Asked = Asked::new("--sensor", "sensor", Takes::Text);
/// By which rule pairs are chosen.
pub const PAIRS: Asked = Asked::new("--pairs", "pairs", Takes::Text);
/// A file with K.
pub const CAMERA: Asked = Asked::new("--camera", "camera", Takes::Text);
/// A file with poses.
pub const POSES: Asked = Asked::new("--poses", "poses", Takes::Text);
/// A file with the pose of the camera on the body whose poses a source has.
pub const BODY_FROM_CAMERA: Asked =
    Asked::new("--body-from-camera", "body_from_camera", Takes::Text);
/// Largest difference in time between an image and its pose.
pub const TOLERANCE: Asked = Asked::new("--tolerance", "tolerance", Takes::Number);
/// Whether poses are interpolated.
pub const INTERPOLATE: Asked = Asked::new("--interpolate", "interpolate", Takes::Nothing);
/// The folder to which names of images are relative.
pub const IMAGE_ROOT: Asked = Asked::new("--image-root", "image_root", Takes::Text);
/// A file with calibration matrices.
pub const INTRINSICS: Asked = Asked::new("--intrinsics", "intrinsics", Takes::Text);
/// Where images of a dataset will be.
pub const IMAGES: Asked = Asked::new("--images", "images", Takes::Text);

impl Asked {
    const fn new(command: &'static str, python: &'static str, takes: Takes) -> Self {
        Self {
            command,
            python,
            takes,
        }
    }

    /// The name on the command line, for commands that are written down.
    pub fn on_command_line(self) -> &'static str {
        self.command
    }

    /// The option with this value, as it is given.
    pub fn with(self, value: &str) -> String {
        self.worded(FrontDoor::now(), value)
    }

    fn worded(self, door: FrontDoor, value: &str) -> String {
        let Self {
            command, python, ..
        } = self;
        match (door, self.takes) {
            (FrontDoor::CommandLine, _) => format!("{command} {value}"),
            (FrontDoor::Python, Takes::Nothing | Takes::Number) => format!("{python}={value}"),
            (FrontDoor::Python, Takes::Text) => format!("{python}=\"{value}\""),
            (FrontDoor::Python, Takes::Names) => {
                let names: Vec<&str> = value.split(',').collect();
                format!("{python}={names:?}")
            }
        }
    }
}

impl fmt::Display for Asked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match FrontDoor::now() {
            FrontDoor::CommandLine => self.command,
            FrontDoor::Python => self.python,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_called_as_they_are_given() {
        // `open` is for a whole process, and other tests of this one read messages.
        assert_eq!(FrontDoor::now(), FrontDoor::CommandLine);
        assert_eq!(PIXEL_CENTER.to_string(), "--pixel-center");
        assert_eq!(PIXEL_CENTER.with("0"), "--pixel-center 0");
        let [command, python] = [FrontDoor::CommandLine, FrontDoor::Python]
            .map(|door| move |asked: Asked, value| asked.worded(door, value));
        assert_eq!(command(PROTOCOLS, "a,b"), "--protocol a,b");
        assert_eq!(python(PROTOCOLS, "a,b"), "protocols=[\"a\", \"b\"]");
        assert_eq!(python(PIXEL_CENTER, "0"), "pixel_center=0");
        assert_eq!(python(RESIZED, "WxH"), "resized=\"WxH\"");
    }
}
