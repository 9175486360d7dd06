//! Whether matches can be right, and if not, which of the usual mistakes explains them.
//!
//! Right matches lie near their true epipolar lines, or near the points that a homography takes them to, and few others
//! do. They are measured again as if x and y, or the images, had been exchanged, or as if the points were pixels of a
//! smaller image. That is done even where most lie near as they are: in small images with a short baseline, points at
//! half their size are only a few pixels from their lines. Points that are enlarged lie farther from their lines, unless
//! the mistake was made. So a mistake that takes the median distance to less than half was made.

use matchbench_vision::geometry::{RelativePose, essential_from_pose, transfer};
use nalgebra::{Matrix3, Point2};

use super::CheckPair;

/// Pixels from the true epipolar line or point within which a match may be right.
pub(super) const NEAR_PX: f64 = 5.0;
/// Share of matches within [`NEAR_PX`] from which on the points count as right; of random points about 2 % are.
pub(super) const SOUND: f64 = 0.2;
/// Share of matches near their places, after a mistake is undone, from which on this mistake may be the explanation.
const EXPLAINS: f64 = 0.5;
/// Their median distance must be less than this part of that of the matches as they are.
const NEARER: f64 = 0.5;
/// How far outside of its image a point may lie once a mistake is undone, as a share of the image's size.
const SLACK: f64 = 0.02;
/// Long sides of images that learned matchers are often given, in pixels.
const USUAL_SIZES: [usize; 9] = [320, 480, 512, 640, 840, 1024, 1200, 1280, 1600];
/// Sizes of maps of features, as fractions of the image.
const USUAL_FRACTIONS: [(usize, &str); 3] = [(2, "half"), (4, "a quarter"), (8, "an eighth")];

/// The matches of a pair whose truth is known.
pub(super) struct Judged<'a> {
    pair: &'a CheckPair,
    known: Known<'a>,
    rows: &'a [[f32; 5]],
}

/// A usual mistake in points.
pub(super) struct Mistake {
    /// What was done, in words.
    pub words: String,
    undo: Undo,
}

#[derive(Clone, Copy)]
enum Undo {
    Nothing,
    ExchangeAxes,
    ExchangeImages,
    /// Images were resized to this long side.
    Enlarge(usize),
    /// Images were divided by this number.
    Multiply(usize),
}

impl<'a> Judged<'a> {
    /// `None` if nothing is known that tells right matches from others.
    pub(super) fn of(pair: &'a CheckPair, rows: &'a [[f32; 5]]) -> Option<Self> {
        let known = Known::of(pair)?;
        Some(Self { pair, known, rows })
    }

    pub(super) fn pair(&self) -> &CheckPair {
        self.pair
    }

    /// Where matches belong, in a word.
    pub(super) fn noun(&self) -> &'static str {
        match self.known {
            Known::Lines(_) => "lines",
            Known::Places(_) => "places",
        }
    }

    /// How far the matches lie from where the truth puts them.
    pub(super) fn distances(&self) -> Distances {
        self.without(Undo::Nothing)
            .unwrap_or_else(|| Distances(Vec::new()))
    }

    /// The same once a mistake is undone.
    pub(super) fn distances_without(&self, mistake: &Mistake) -> Distances {
        self.without(mistake.undo)
            .unwrap_or_else(|| Distances(Vec::new()))
    }

    /// `None` if the mistake was not made, since points would lie outside of their images.
    fn without(&self, undo: Undo) -> Option<Distances> {
        let distances = self.rows.iter().map(|row| {
            let [xa, ya, xb, yb] = self.undone(undo, row)?;
            let [a, b] = [Point2::new(xa, ya), Point2::new(xb, yb)];
            Some(self.known.distance(self.pair, a, b))
        });
        Some(Distances(distances.collect::<Option<_>>()?))
    }

    /// The points of a match without a mistake; `None` if one of them would lie outside of its image.
    fn undone(&self, undo: Undo, row: &[f32; 5]) -> Option<[f64; 4]> {
        let [xa, ya, xb, yb] = [row[0], row[1], row[2], row[3]].map(f64::from);
        let scaled = |[a, b]: [f64; 2]| {
            let back = |x: f64, s: f64| (x + 0.5) * s - 0.5;
            [back(xa, a), back(ya, a), back(xb, b), back(yb, b)]
        };
        let points = match undo {
            Undo::Nothing => return Some([xa, ya, xb, yb]),
            Undo::ExchangeAxes => [ya, xa, yb, xb],
            Undo::ExchangeImages => [xb, yb, xa, ya],
            Undo::Enlarge(to) => {
                scaled((self.pair.sizes).map(|size| size.width.max(size.height) as f64 / to as f64))
            }
            Undo::Multiply(by) => scaled([by as f64; 2]),
        };
        let inside = |x: f64, length: usize| {
            let slack = SLACK * length as f64;
            (-0.5 - slack..=length as f64 - 0.5 + slack).contains(&x)
        };
        let [a, b] = self.pair.sizes;
        let [xa, ya, xb, yb] = points;
        let are_inside = inside(xa, a.width)
            && inside(ya, a.height)
            && inside(xb, b.width)
            && inside(yb, b.height);
        are_inside.then_some(points)
    }
}

/// Distances of matches from where the truth puts them, in pixels.
pub(super) struct Distances(Vec<f64>);

impl Distances {
    /// Share of them below [`NEAR_PX`].
    pub(super) fn share_near(&self) -> f64 {
        let near = self.0.iter().filter(|distance| **distance < NEAR_PX);
        near.count() as f64 / self.0.len().max(1) as f64
    }

    /// Infinite if there are none; one that is no number counts as infinite.
    pub(super) fn median(&self) -> f64 {
        let mut sorted = self.0.clone();
        sorted.sort_by(f64::total_cmp);
        let median = sorted.get(sorted.len() / 2).copied();
        median
            .filter(|median| !median.is_nan())
            .unwrap_or(f64::INFINITY)
    }

    fn most_are_near(&self) -> bool {
        self.share_near() >= EXPLAINS
    }
}

/// The usual mistake that brings most matches of all pairs together near where the truth puts them, and much nearer
/// than they are, if one does.
pub(super) fn mistake(pairs: &[Judged<'_>]) -> Option<Mistake> {
    let without = |undo: Undo| {
        let distances = pairs.iter().map(|judged| judged.without(undo));
        let distances = distances.collect::<Option<Vec<_>>>()?;
        Some(Distances(
            distances.into_iter().flat_map(|pair| pair.0).collect(),
        ))
    };
    let mut undos = vec![
        ("x and y were exchanged".to_owned(), Undo::ExchangeAxes),
        ("a and b were exchanged".to_owned(), Undo::ExchangeImages),
    ];
    undos.extend(USUAL_SIZES.map(|size| {
        let words = format!("they are pixels of images that were resized to {size}");
        (words, Undo::Enlarge(size))
    }));
    undos.extend(USUAL_FRACTIONS.map(|(by, fraction)| {
        let words = format!("they are pixels of images of {fraction} of the size");
        (words, Undo::Multiply(by))
    }));
    let as_they_are = without(Undo::Nothing)?.median();
    let medians = undos.into_iter().filter_map(|(words, undo)| {
        let distances = without(undo)?;
        let median = distances.median();
        let explains = distances.most_are_near() && median < NEARER * as_they_are;
        explains.then_some((Mistake { words, undo }, median))
    });
    // The first of equal ones: a size says more than a fraction.
    let nearest = medians.reduce(|one, other| if other.1 < one.1 { other } else { one });
    nearest.map(|(mistake, _)| mistake)
}

/// What the truth says of where the matches of a pair are.
enum Known<'a> {
    /// On epipolar lines, by this essential matrix.
    Lines(Matrix3<f64>),
    /// Where this homography takes them.
    Places(&'a Matrix3<f64>),
}

impl<'a> Known<'a> {
    /// What is known of a pair; `None` without a homography, and without a pose or with one that has no baseline.
    fn of(pair: &'a CheckPair) -> Option<Self> {
        let pose = pair.truth.pose().and_then(RelativePose::from_isometry);
        let lines = pose.map(|pose| Self::Lines(essential_from_pose(&pose)));
        lines.or_else(|| pair.truth.homography().map(Self::Places))
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
