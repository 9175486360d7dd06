//! Lenses: where they show the point that an ideal camera sees, by one of two models.

use nalgebra::{Matrix2, Point2};

use super::distortion::Distortion;
use super::fisheye::Fisheye;

/// The distortion of a lens.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(try_from = "Coefficients", into = "Coefficients")
)]
pub enum Lens {
    /// Radial and tangential distortion, for all but very wide lenses.
    Brown(Distortion),
    /// A fisheye.
    Fisheye(Fisheye),
}

impl From<Distortion> for Lens {
    fn from(distortion: Distortion) -> Self {
        Self::Brown(distortion)
    }
}

impl From<Fisheye> for Lens {
    fn from(fisheye: Fisheye) -> Self {
        Self::Fisheye(fisheye)
    }
}

impl Lens {
    /// The coefficients with their names, in OpenCV's order.
    pub fn coefficients(&self) -> Vec<(&'static str, f64)> {
        match *self {
            Self::Brown(Distortion { k1, k2, p1, p2, k3 }) => {
                vec![("k1", k1), ("k2", k2), ("p1", p1), ("p2", p2), ("k3", k3)]
            }
            Self::Fisheye(Fisheye { k1, k2, k3, k4 }) => {
                vec![("k1", k1), ("k2", k2), ("k3", k3), ("k4", k4)]
            }
        }
    }

    /// The radial and tangential distortion, if the lens is no fisheye.
    pub fn brown(&self) -> Option<Distortion> {
        match *self {
            Self::Brown(distortion) => Some(distortion),
            Self::Fisheye(_) => None,
        }
    }

    /// Where the lens moves the point that an ideal camera sees at `p` (depth 1).
    pub fn distort(&self, p: Point2<f64>) -> Point2<f64> {
        match self {
            Self::Brown(lens) => lens.distort(p),
            Self::Fisheye(lens) => lens.distort(p),
        }
    }

    /// Inverse of [`Lens::distort`] where the model has one, see [`Distortion::undistort`] and [`Fisheye::undistort`].
    pub fn undistort(&self, seen: Point2<f64>) -> Point2<f64> {
        match self {
            Self::Brown(lens) => lens.undistort(seen),
            Self::Fisheye(lens) => lens.undistort(seen),
        }
    }

    /// Derivative of [`Lens::distort`] at `p`.
    pub fn derivative(&self, p: Point2<f64>) -> Matrix2<f64> {
        match self {
            Self::Brown(lens) => lens.derivative(p),
            Self::Fisheye(lens) => lens.derivative(p),
        }
    }
}

/// The coefficients as files have them: `k1 k2 p1 p2 k3`, or `k1 k2 k3 k4` of a fisheye.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Coefficients {
    k1: f64,
    k2: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    p1: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    p2: Option<f64>,
    k3: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    k4: Option<f64>,
}

#[cfg(feature = "serde")]
impl From<Lens> for Coefficients {
    fn from(lens: Lens) -> Self {
        match lens {
            Lens::Brown(Distortion { k1, k2, p1, p2, k3 }) => Self {
                k1,
                k2,
                p1: Some(p1),
                p2: Some(p2),
                k3,
                k4: None,
            },
            Lens::Fisheye(Fisheye { k1, k2, k3, k4 }) => Self {
                k1,
                k2,
                p1: None,
                p2: None,
                k3,
                k4: Some(k4),
            },
        }
    }
}

#[cfg(feature = "serde")]
impl TryFrom<Coefficients> for Lens {
    type Error = &'static str;

    fn try_from(numbers: Coefficients) -> Result<Self, Self::Error> {
        let Coefficients { k1, k2, k3, .. } = numbers;
        match (numbers.p1, numbers.p2, numbers.k4) {
            (Some(p1), Some(p2), None) => Ok(Distortion { k1, k2, p1, p2, k3 }.into()),
            (None, None, Some(k4)) => Ok(Fisheye { k1, k2, k3, k4 }.into()),
            _ => Err("a lens has k1, k2, p1, p2 and k3, a fisheye k1, k2, k3 and k4"),
        }
    }
}
