//! An import that may be asked for several times: an existing dataset must be the one that the import would
//! make.

use std::path::Path;

use super::{ImportOptions, ImportReport, make};
use crate::counted::counted;
use crate::datasets::{DatasetError, Pair, Sequence};

/// Imports as [`import`](super::import) does. If the dataset exists already, it must be the one that this
/// import would make; then nothing is done and the result is `None`.
///
/// # Errors
/// As [`import`](super::import); or if another dataset exists there.
pub fn import_once(
    kind: &str,
    src: &Path,
    out: &Path,
    options: &ImportOptions<'_>,
) -> Result<Option<ImportReport>, DatasetError> {
    let made = make(kind, src, options)?;
    let is_there = std::fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_some());
    if !is_there {
        made.write(out, options.images)?;
        return Ok(Some(made.report()));
    }
    let there = Sequence::open(out)?;
    match difference(&there, &made.sequence) {
        None => Ok(None),
        Some(what) => Err(DatasetError::new(
            out,
            format!(
                "another dataset is there than {} gives now: {what}",
                src.display()
            ),
            "remove this folder, and it is imported again; or name another",
        )),
    }
}

/// Largest difference of an entry of two poses that are the same but for rounding.
const ROUNDED: f64 = 1e-9;
/// The same for homographies of norm 1. It is less than a thousandth of a pixel in images of thousands of pixels.
const ROUNDED_HOMOGRAPHY: f64 = 1e-12;

/// The first difference between the dataset that is `there` and the one that was `made` from the same images.
/// Rounded poses and homographies are not a difference.
fn difference(there: &Sequence, made: &Sequence) -> Option<String> {
    let (found, expected) = (there.frames.len(), made.frames.len());
    if found != expected {
        return Some(format!(
            "it has {} and not {expected}",
            counted(found, "image")
        ));
    }
    let real = |path: &Path| std::fs::canonicalize(path).unwrap_or(path.to_owned());
    for (there, made) in there.frames.iter().zip(&made.frames) {
        // The images of a rendered scene exist only in its own dataset.
        let is_made = made.image.as_os_str().is_empty();
        if !is_made && real(&there.image) != real(&made.image) {
            return Some(format!(
                "its images are elsewhere, {}",
                there.image.display()
            ));
        }
        if there.camera != made.camera {
            return Some(format!("{} has another camera", there.image.display()));
        }
        if there.turn != made.turn {
            return Some(format!("{} has another turn", there.image.display()));
        }
        let is_same_depth = match (&there.depth, &made.depth) {
            (Some(there), Some(made)) => {
                there.unit == made.unit && (is_made || real(&there.path) == real(&made.path))
            }
            (there, made) => there.is_some() == made.is_some(),
        };
        if !is_same_depth {
            return Some(format!("{} has other depth", there.image.display()));
        }
    }
    let numbers = |sequence: &Sequence| -> Vec<(u32, u32)> {
        (sequence.pairs.iter())
            .map(|pair| (pair.a, pair.b))
            .collect()
    };
    if numbers(there) != numbers(made) {
        return Some("it has other pairs".to_owned());
    }
    let both = || there.pairs.iter().zip(&made.pairs);
    if both().any(|(there, made)| is_other_pose(there, made)) {
        return Some("its true poses are others".to_owned());
    }
    (both().any(|(there, made)| is_other_homography(there, made)))
        .then(|| "its true homographies are others".to_owned())
}

fn is_other_pose(there: &Pair, made: &Pair) -> bool {
    match (there.pose(), made.pose()) {
        (Some(there), Some(made)) => {
            (there.to_homogeneous() - made.to_homogeneous()).amax() > ROUNDED
        }
        (there, made) => there.is_some() != made.is_some(),
    }
}

fn is_other_homography(there: &Pair, made: &Pair) -> bool {
    match (there.homography(), made.homography()) {
        (Some(there), Some(made)) => {
            let (there, made) = (there.normalize(), made.normalize());
            // A homography is the same with the opposite sign.
            (there - made).amax().min((there + made).amax()) > ROUNDED_HOMOGRAPHY
        }
        (there, made) => there.is_some() != made.is_some(),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Matrix3};

    use super::*;
    use crate::datasets::{DepthFile, DepthUnit, Truth, Turn, testing};

    #[test]
    fn every_truth_of_a_dataset_counts() {
        let plane = Matrix3::new(1.0, 0.0, 5.0, 0.0, 1.0, -3.0, 1e-5, 0.0, 1.0);
        let mut made = testing::sequence(3);
        made.pairs[0].truth = Truth::Both {
            b_from_a: Isometry3::identity(),
            homography: plane,
        };
        made.frames[1].depth = Some(DepthFile {
            path: "1.png".into(),
            unit: DepthUnit::MILLIMETRES,
        });
        for frame in &mut made.frames {
            frame.image = "image.png".into();
        }
        let changed = |change: fn(&mut Sequence)| {
            let mut there = made.clone();
            change(&mut there);
            difference(&there, &made).unwrap_or_default()
        };
        assert_eq!(changed(|_| ()), "");
        let set = |there: &mut Sequence, homography| {
            there.pairs[0].truth = Truth::Both {
                b_from_a: Isometry3::identity(),
                homography,
            };
        };
        let mut there = made.clone();
        set(&mut there, plane * -3.0);
        assert_eq!(difference(&there, &made), None);
        set(
            &mut there,
            plane + Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e-8, 0.0, 0.0),
        );
        let what = difference(&there, &made).unwrap();
        assert!(what.contains("homographies"), "{what}");
        let lost = changed(|there| there.pairs[0].truth = Truth::Pose(Isometry3::identity()));
        assert!(lost.contains("homographies"), "{lost}");
        assert!(changed(|there| there.frames[1].depth = None).contains("depth"));
        let moved = changed(|there| {
            let depth = there.frames[1].depth.as_mut().unwrap();
            depth.path = "2.png".into();
        });
        assert!(moved.contains("depth"), "{moved}");
        let unit = changed(|there| {
            let depth = there.frames[1].depth.as_mut().unwrap();
            depth.unit.per_unit = 5000.0;
        });
        assert!(unit.contains("depth"), "{unit}");
        assert!(changed(|there| there.frames[2].turn = Turn::Half).contains("turn"));
    }
}
