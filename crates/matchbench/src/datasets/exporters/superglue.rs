//! SuperGlue's list of pairs, in the form that its importer describes: T and K of the pixels as stored, turns
//! in quarters counterclockwise. The format has no lens distortion, so a dataset with distortion is refused.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Translation3};

use super::{cannot_say, names, stored_camera};
use crate::datasets::text::matrix_rows;
use crate::datasets::{DatasetError, Sequence};
use crate::files::write_unnamed;

pub(super) fn write(sequence: &Sequence, out: &Path) -> Result<PathBuf, DatasetError> {
    let (root, names) = names(sequence)?;
    let cameras = (sequence.frames.iter())
        .map(|frame| match stored_camera(frame)? {
            (camera, _) if camera.distortion.is_none() => Ok(camera),
            _ => Err(cannot_say(
                frame,
                "lens distortion has no place in a SuperGlue list",
            )),
        })
        .collect::<Result<Vec<_>, _>>()?;
    let mut text = String::new();
    for pair in &sequence.pairs {
        let (a, b) = (pair.a as usize, pair.b as usize);
        let (from, to) = (&sequence.frames[a], &sequence.frames[b]);
        let b_from_a = pair.pose().ok_or_else(|| {
            cannot_say(
                from,
                "a pair whose truth is a homography has no place in a SuperGlue list",
            )
        })?;
        let mut words = vec![
            names[a].clone(),
            names[b].clone(),
            u8::from(from.turn).to_string(),
            u8::from(to.turn).to_string(),
        ];
        for camera in [cameras[a], cameras[b]] {
            let k = camera.matrix().transpose();
            words.extend(k.iter().map(|number| format!("{number:?}")));
        }
        let turned = [from, to]
            .map(|frame| Isometry3::from_parts(Translation3::identity(), frame.turn.rotation()));
        let stored = if from.turn.is_none() && to.turn.is_none() {
            *b_from_a
        } else {
            turned[1].inverse() * b_from_a * turned[0]
        };
        words.extend(matrix_rows(&stored).map(|number| format!("{number:?}")));
        words.push("0.0 0.0 0.0 1.0".to_owned());
        writeln!(text, "{}", words.join(" ")).expect("writing to a string cannot fail");
    }
    write_unnamed(out, text.as_bytes()).map_err(|error| DatasetError::io(out, &error))?;
    Ok(root)
}
