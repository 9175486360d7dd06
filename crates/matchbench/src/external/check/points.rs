//! Whether matches can be right, and if not, which of the usual mistakes explains them.
//!
//! Right matches lie near their true epipolar lines, or near the points that a homography takes them to, and few others
//! do. Where most do not, they are measured again as if x and y, or the images, had been exchanged, or as if the points
//! were pixels of a resized image.

use matchbench_vision::geometry::{RelativePose, essential_from_pose, transfer};
use nalgebra::{Matrix3, Point2};

use super::CheckPair;

/// Pixels from the true epipolar line or point within which a match may be right.
pub(super) const NEAR_PX: f64 = 5.0;
/// Share of matches within [`NEAR_PX`] from which on the points count as right; of random points about 2 % are.
pub(super) const SOUND: f64 = 0.2;
/// Share within [`NEAR_PX`], after a mistake is undone, from which on this mistake is the explanation.
pub(super) const EXPLAINS: f64 = 0.5;
/// Long sides of images that learned matchers are often given, in pixels.
const USUAL_SIZES: [usize; 9] = [320, 480, 512, 640, 840, 1024, 1200, 1280, 1600];

/// The usual mistake that brings most matches near where the truth puts them, if one does, and how many.
pub(super) fn mistake(
    pair: &CheckPair,
    known: &Known<'_>,
    rows: &[[f32; 5]],
) -> Option<(String, f64)> {
    let mut candidates = vec![
        (
            "x and y were exchanged".to_owned(),
            share_of(pair, known, rows, |[xa, ya, xb, yb]| [ya, xa, yb, xb]),
        ),
        (
            "a and b were exchanged".to_owned(),
            share_of(pair, known, rows, |[xa, ya, xb, yb]| [xb, yb, xa, ya]),
        ),
    ];
    let [long_a, long_b] = pair.sizes.map(|size| size.width.max(size.height) as f64);
    for size in USUAL_SIZES {
        let [a, b] = [long_a, long_b].map(|long| long / size as f64);
        let scaled = |[xa, ya, xb, yb]: [f64; 4]| {
            let back = |x: f64, s: f64| (x + 0.5) * s - 0.5;
            [back(xa, a), back(ya, a), back(xb, b), back(yb, b)]
        };
        let what = format!("they are pixels of images that were resized to {size}");
        candidates.push((what, share_of(pair, known, rows, scaled)));
    }
    (candidates.into_iter())
        .filter(|(_, share)| *share >= EXPLAINS)
        .max_by(|(_, x), (_, y)| x.total_cmp(y))
}

/// Share of the matches that lie near where the truth puts them.
pub(super) fn share_near(pair: &CheckPair, known: &Known<'_>, rows: &[[f32; 5]]) -> f64 {
    share_of(pair, known, rows, |points| points)
}

/// The same after `change`.
fn share_of(
    pair: &CheckPair,
    known: &Known<'_>,
    rows: &[[f32; 5]],
    change: impl Fn([f64; 4]) -> [f64; 4],
) -> f64 {
    let near = |row: &&[f32; 5]| {
        let [xa, ya, xb, yb] = change([row[0], row[1], row[2], row[3]].map(f64::from));
        known.distance(pair, Point2::new(xa, ya), Point2::new(xb, yb)) < NEAR_PX
    };
    rows.iter().filter(near).count() as f64 / rows.len().max(1) as f64
}

/// What the truth says of where the matches of a pair are.
pub(super) enum Known<'a> {
    /// On epipolar lines, by this essential matrix.
    Lines(Matrix3<f64>),
    /// Where this homography takes them.
    Places(&'a Matrix3<f64>),
}

impl<'a> Known<'a> {
    /// What is known of a pair; `None` without a homography, and without a pose or with one that has no baseline.
    pub(super) fn of(pair: &'a CheckPair) -> Option<Self> {
        let pose = pair.truth.pose().and_then(RelativePose::from_isometry);
        let lines = pose.map(|pose| Self::Lines(essential_from_pose(&pose)));
        lines.or_else(|| pair.truth.homography().map(Self::Places))
    }

    /// In a word.
    pub(super) fn noun(&self) -> &'static str {
        match self {
            Self::Lines(_) => "lines",
            Self::Places(_) => "places",
        }
    }

    /// Pixels from `b` to where a match of `a` belongs in image b.
    fn distance(&self, pair: &CheckPair, a: Point2<f64>, b: Point2<f64>) -> f64 {
        match self {
            Self::Lines(essential) => {
                let (a, b) = (pair.cameras[0].normalize(a), pair.cameras[1].normalize(b));
                let line = essential * a.to_homogeneous();
                let distance = b.to_homogeneous().dot(&line).abs() / line.xy().norm();
                distance * pair.cameras[1].fx
            }
            Self::Places(homography) => (transfer(homography, a) - b).norm(),
        }
    }
}
