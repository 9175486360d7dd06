//! How hard a pair is, told from its true pose and cameras alone: baseline, angle, overlap.
//!
//! With depth a run measures how much of each image the other shows, and records it
//! ([`PairGeometry::measure`]). Without depth, nobody knows how much of image `a` is seen in image `b`. But the poses
//! allow at most some overlap: the share of rays of `a` that would end in `b` at any depth, the lesser of both
//! directions. [`PairGeometry::overlap`] estimates it: it tries the depths [`DEPTHS`] (in baselines, and infinity) for
//! each of a grid of rays. Images that look past each other have 0, whatever the scene; 1 says only that the poses do
//! not exclude full overlap.
//!
//! The size of an image is taken as twice its principal point, which needs no file.

use std::collections::BTreeMap;

use matchbench_vision::geometry::Camera;
use nalgebra::{Isometry3, Point2, Vector3};

use super::ResultSet;
use crate::datasets::Sequence;

/// Depths that are tried, in baselines; 0 stands for infinity.
const DEPTHS: [f64; 16] = [
    0.0, 64.0, 32.0, 16.0, 11.0, 8.0, 5.6, 4.0, 2.8, 2.0, 1.7, 1.4, 1.2, 1.0, 0.7, 0.5,
];
/// Rays of an image: so many columns and rows.
const RAYS: (u32, u32) = (12, 9);

/// What the true pose says about a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairGeometry {
    /// Distance of the two cameras, in the dataset's unit of length; `None` where the dataset is not at hand.
    pub baseline: Option<f64>,
    /// Angle between the optical axes, in degrees; `None` where the dataset is not at hand.
    pub view_angle: Option<f64>,
    /// Share of one image that is seen in the other, in `[0, 1]`, or about the largest share that the poses allow.
    pub overlap: f64,
    /// Whether the overlap was measured by depth.
    pub is_measured: bool,
}

/// The geometry of every pair `(a, b)` of one dataset.
pub type DatasetGeometry = BTreeMap<(u32, u32), PairGeometry>;

impl PairGeometry {
    /// The geometry of two cameras at the pose `b_from_a`.
    pub fn new(a: &Camera, b: &Camera, b_from_a: &Isometry3<f64>) -> Self {
        let axis = b_from_a.rotation * Vector3::z();
        let back = b_from_a.inverse();
        let overlap = share_seen(a, b, b_from_a).min(share_seen(b, a, &back));
        Self {
            baseline: Some(b_from_a.translation.vector.norm()),
            view_angle: Some(libm::acos(axis.z.clamp(-1.0, 1.0)).to_degrees()),
            overlap,
            is_measured: false,
        }
    }

    /// The geometry of every pair of a sequence whose pose is known.
    pub fn of_sequence(sequence: &Sequence) -> DatasetGeometry {
        (sequence.pairs.iter())
            .filter_map(|pair| {
                let camera = |frame: u32| &sequence.frames[frame as usize].camera;
                let geometry = Self::new(camera(pair.a), camera(pair.b), pair.pose()?);
                Some(((pair.a, pair.b), geometry))
            })
            .collect()
    }

    /// Puts the overlaps that the records of `results` hold in the place of bounds; of pairs whose poses are not
    /// known they are all that is.
    pub fn measure(geometry: &mut DatasetGeometry, results: &ResultSet) {
        for pair in &results.pairs {
            let Some(overlap) = pair.by_depth.as_ref().and_then(|by_depth| by_depth.overlap) else {
                continue;
            };
            let known = geometry.entry((pair.a, pair.b)).or_insert(Self {
                baseline: None,
                view_angle: None,
                overlap,
                is_measured: true,
            });
            (known.overlap, known.is_measured) = (overlap, true);
        }
    }
}

/// The share of rays of `a` that end inside image `b` at one of the [`DEPTHS`] or another.
fn share_seen(a: &Camera, b: &Camera, b_from_a: &Isometry3<f64>) -> f64 {
    let direction = (b_from_a.translation.vector.try_normalize(0.0)).unwrap_or_default();
    let translations = DEPTHS.map(|depth| match depth {
        0.0 => Vector3::zeros(),
        depth => direction / depth,
    });
    let (columns, rows) = RAYS;
    let rays = (0..columns * rows).map(|ray| {
        let at = |index: u32, count: u32| (f64::from(index) + 0.5) / f64::from(count);
        let (x, y) = (at(ray % columns, columns), at(ray / columns, rows));
        a.normalize(Point2::new(2.0 * a.cx * x, 2.0 * a.cy * y))
    });
    let seen = rays.filter(|ray| {
        let turned = b_from_a.rotation * ray.to_homogeneous();
        translations.iter().any(|translation| {
            let point = turned + translation;
            let at_depth_1 = Point2::new(point.x / point.z, point.y / point.z);
            point.z > 0.0 && (b.seen_at(at_depth_1)).is_some_and(|pixel| is_inside(b, pixel))
        })
    });
    seen.count() as f64 / f64::from(columns * rows)
}

fn is_inside(camera: &Camera, pixel: Point2<f64>) -> bool {
    (0.0..=2.0 * camera.cx).contains(&pixel.x) && (0.0..=2.0 * camera.cy).contains(&pixel.y)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use matchbench_vision::geometry::{Distortion, Lens};
    use nalgebra::{Translation3, UnitQuaternion};

    use super::super::{Failure, PairResult};
    use super::*;
    use crate::records::ByDepth;

    const CAMERA: Camera = Camera::pinhole(320.0, 320.0, 320.0, 240.0);

    fn geometry(turn: f64, translation: [f64; 3]) -> PairGeometry {
        let pose = Isometry3::from_parts(
            Translation3::from(Vector3::from(translation)),
            UnitQuaternion::from_axis_angle(&Vector3::y_axis(), turn),
        );
        PairGeometry::new(&CAMERA, &CAMERA, &pose)
    }

    /// Both cameras see 49 degrees to either side, so that there is nothing both see from 98 degrees on.
    #[test]
    fn a_lens_that_bends_shows_nothing_from_beside_the_image() {
        let camera = Camera {
            distortion: Some(Lens::Brown(Distortion {
                k1: -0.1,
                ..Distortion::default()
            })),
            ..Camera::pinhole(1000.0, 1000.0, 1000.0, 20.0)
        };
        let overlap = |degrees: f64| {
            let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), degrees.to_radians());
            let pose = Isometry3::from_parts(Translation3::identity(), turn);
            PairGeometry::new(&camera, &camera, &pose).overlap
        };
        assert_eq!([100.0, 110.0, 120.0].map(overlap), [0.0; 3]);
        // Counted by another program, which inverts r (1 - r^2 / 10) by its roots; 68 with those from beside the image.
        assert_eq!(overlap(40.0), 59.0 / 108.0);
    }

    #[test]
    fn without_motion_all_is_seen() {
        let same = geometry(0.0, [0.0; 3]);
        assert_eq!((same.baseline, same.overlap), (Some(0.0), 1.0));
        assert!(same.view_angle.unwrap() < 1e-6);
    }

    #[test]
    fn cameras_that_look_away_share_nothing() {
        let away = geometry(PI, [0.0, 0.0, 1.0]);
        assert!((away.view_angle.unwrap() - 180.0).abs() < 1e-4);
        // Back to back: the ray along the axis meets at no depth.
        assert_eq!(geometry(PI, [0.0, 0.0, -1.0]).overlap, 0.0);
    }

    #[test]
    fn measured_overlaps_take_the_place_of_bounds() {
        let by_depth = |overlap| {
            Some(Box::new(ByDepth {
                overlap,
                judged: 0,
                within: [0; 10],
                repeated: None,
            }))
        };
        let result = |b, overlap| PairResult {
            by_depth: by_depth(overlap),
            ..PairResult::failed(0, b, Failure::NoSupport)
        };
        let results = ResultSet {
            dataset: "room".into(),
            matcher: "sift".into(),
            estimator: "best".into(),
            repetitions: 1,
            ignored: 0,
            lacking: 0,
            pairs: vec![result(1, Some(0.25)), result(2, Some(0.5)), result(3, None)],
        };
        let same = geometry(0.0, [0.0; 3]);
        let mut known: DatasetGeometry = [((0, 1), same), ((0, 3), same)].into();
        PairGeometry::measure(&mut known, &results);
        let overlap = |b| (known[&(0, b)].overlap, known[&(0, b)].is_measured);
        assert_eq!([overlap(1), overlap(3)], [(0.25, true), (1.0, false)]);
        assert_eq!((overlap(2), known[&(0, 2)].baseline), ((0.5, true), None));
    }

    #[test]
    fn half_a_field_of_view_is_half_the_image_and_depth_can_make_up_for_it() {
        // The field of view is 90 degrees: turned by 45, the middle comes to the edge.
        let turned = geometry(PI / 4.0, [0.0; 3]);
        assert!((turned.overlap - 0.5).abs() < 0.1, "{turned:?}");
        assert!((turned.view_angle.unwrap() - 45.0).abs() < 1e-9);
        // A step to the side that keeps an object in view.
        let around = geometry(PI / 4.0, [-1.0, 0.0, 0.4]);
        assert!(around.overlap > turned.overlap + 0.2, "{around:?}");
    }

    /// Of 12 columns and 9 rows of rays the middle 6 and 5 end in the middle half of the image.
    #[test]
    fn the_overlap_is_that_of_the_image_that_shows_more_alone() {
        let near = Camera::pinhole(640.0, 640.0, 320.0, 240.0);
        for [a, b] in [[&CAMERA, &near], [&near, &CAMERA]] {
            let overlap = PairGeometry::new(a, b, &Isometry3::identity()).overlap;
            assert_eq!(overlap, 30.0 / 108.0);
        }
    }

    /// Half a baseline is the least depth: what two cameras see that look at each other is 1 in front of the second then, which
    /// shows a third to either side, and a quarter up and down.
    #[test]
    fn nothing_is_nearer_than_half_a_baseline() {
        let narrow = Camera::pinhole(960.0, 960.0, 320.0, 240.0);
        let facing = Isometry3::from_parts(
            Translation3::new(0.0, 0.0, 1.0),
            UnitQuaternion::from_axis_angle(&Vector3::y_axis(), PI),
        );
        // Of 12 columns and 9 rows the middle 4 and 3.
        let overlap = PairGeometry::new(&CAMERA, &narrow, &facing).overlap;
        assert_eq!(overlap, 12.0 / 108.0);
    }
}
