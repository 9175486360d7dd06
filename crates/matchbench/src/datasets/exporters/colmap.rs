//! A COLMAP model as text: a camera for every frame (equal cameras are written once), cam_from_world for every
//! frame that has a pose, no keypoints and no points. COLMAP has the origin at the corner of the image, so half
//! a pixel is added. The camera model is PINHOLE, or OPENCV if there is lens distortion, or FULL_OPENCV if that
//! has k3, or OPENCV_FISHEYE of a fisheye.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use matchbench_vision::geometry::{Camera, Lens};
use matchbench_vision::image::Size;
use nalgebra::{Isometry3, Translation3};

use super::{cannot_say, names, stored_camera};
use crate::datasets::write::write_folder;
use crate::datasets::{DatasetError, Sequence};
use crate::files::write_unnamed;

/// The list of pairs beside the model, by names.
pub(super) const PAIRS: &str = "pairs.txt";

const INFALLIBLE: &str = "writing to a string cannot fail";

pub(super) fn write(sequence: &Sequence, out: &Path) -> Result<PathBuf, DatasetError> {
    let (root, names) = names(sequence)?;
    let mut named = HashMap::new();
    let mut cameras: Vec<(Camera, Size)> = Vec::new();
    let mut camera_text = String::from("# id MODEL width height parameters\n");
    let mut image_text =
        String::from("# id qw qx qy qz tx ty tz camera name, then keypoints: none\n");
    for (index, (frame, name)) in sequence.frames.iter().zip(&names).enumerate() {
        if let Some(first) = named.insert(name, index) {
            let what = format!(
                "frames {first} and {index} are one image, which a COLMAP model has only once"
            );
            return Err(cannot_say(frame, &what));
        }
        let camera = stored_camera(frame)?;
        let number = cameras.iter().position(|known| *known == camera);
        let number = number.unwrap_or_else(|| {
            cameras.push(camera);
            let row = camera_row(&camera.0, camera.1);
            writeln!(camera_text, "{} {row}", cameras.len()).expect(INFALLIBLE);
            cameras.len() - 1
        });
        let turned = frame.world_from_camera.ok_or_else(|| {
            cannot_say(
                frame,
                "the frame has no pose, which a COLMAP model cannot do without",
            )
        })?;
        let turn = Isometry3::from_parts(Translation3::identity(), frame.turn.rotation());
        let pose = (turned * turn).inverse();
        let (q, t) = (pose.rotation.quaternion(), pose.translation.vector);
        writeln!(
            image_text,
            "{} {:?} {:?} {:?} {:?} {:?} {:?} {:?} {} {name}\n",
            index + 1,
            q.w,
            q.i,
            q.j,
            q.k,
            t.x,
            t.y,
            t.z,
            number + 1
        )
        .expect(INFALLIBLE);
    }
    let mut pair_text = String::new();
    for pair in &sequence.pairs {
        let (a, b) = (&names[pair.a as usize], &names[pair.b as usize]);
        writeln!(pair_text, "{a} {b}").expect(INFALLIBLE);
    }
    let files = [
        ("cameras.txt", &*camera_text),
        ("images.txt", &image_text),
        ("points3D.txt", "# no points\n"),
        (PAIRS, &pair_text),
    ];
    write_folder(out, |folder| {
        files.iter().try_for_each(|(name, text)| {
            let path = folder.join(name);
            write_unnamed(&path, text.as_bytes()).map_err(|error| DatasetError::io(&path, &error))
        })
    })?;
    Ok(root)
}

fn camera_row(camera: &Camera, size: Size) -> String {
    let &Camera {
        fx,
        fy,
        cx,
        cy,
        distortion,
    } = camera;
    let mut params = vec![fx, fy, cx + 0.5, cy + 0.5];
    let model = match distortion {
        None => "PINHOLE",
        Some(Lens::Fisheye(lens)) => {
            params.extend([lens.k1, lens.k2, lens.k3, lens.k4]);
            "OPENCV_FISHEYE"
        }
        Some(Lens::Brown(lens)) => {
            params.extend([lens.k1, lens.k2, lens.p1, lens.p2]);
            if lens.k3 == 0.0 {
                "OPENCV"
            } else {
                params.extend([lens.k3, 0.0, 0.0, 0.0]);
                "FULL_OPENCV"
            }
        }
    };
    let params: Vec<_> = params.iter().map(|number| format!("{number:?}")).collect();
    format!(
        "{model} {} {} {}",
        size.width,
        size.height,
        params.join(" ")
    )
}
