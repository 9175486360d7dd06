//! Small datasets for the tests of this room.

use std::path::PathBuf;

use matchbench_vision::geometry::Camera;
use matchbench_vision::image::{GrayImage, Size};
use nalgebra::{Isometry3, Vector3};
use tempfile::TempDir;

use super::{About, Frame, ImageStorage, PairRule, Sequence, Turn, write_native};

pub(super) const CAMERA: Camera = Camera::pinhole(20.5, 21.0, 11.5, 8.25);

/// A pose that turns and moves with `index`, with digits that no short decimal has.
pub(super) fn pose(index: usize) -> Isometry3<f64> {
    let i = index as f64;
    Isometry3::new(
        Vector3::new(i / 3.0, -0.1 * i, 1e-7 * i),
        Vector3::new(0.1 * i, 0.2, -0.05 * i),
    )
}

pub(super) fn frames(count: usize) -> Vec<Frame> {
    (0..count)
        .map(|index| Frame {
            image: PathBuf::new(),
            name: None,
            turn: Turn::None,
            camera: CAMERA,
            world_from_camera: Some(pose(index)),
            depth: None,
        })
        .collect()
}

pub(super) fn pixels(index: usize) -> GrayImage {
    GrayImage::from_fn(Size::new(24, 17), |x, y| (x * 7 + y * 3 + index) as u8)
}

/// All pairs of `count` frames.
pub(super) fn sequence(count: usize) -> Sequence {
    let (frames, pairs) = PairRule::All.apply(frames(count)).unwrap();
    Sequence {
        name: String::new(),
        frames,
        pairs,
    }
}

/// A sound dataset of four frames on disk.
pub(crate) fn dataset() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("small");
    let about = About {
        origin: "a test".into(),
        notes: Vec::new(),
        ..About::default()
    };
    let images = ImageStorage::Rendered {
        pixels: &pixels,
        depth: &|_| unreachable!("its frames have none"),
    };
    write_native(&dir, &sequence(4), &about, images).unwrap();
    (folder, dir)
}

/// A TIFF file of one strip, with these tags and their values besides those of the strip.
pub(super) fn tiff(tags: &[(u16, u32)], strip: &[u8]) -> Vec<u8> {
    const LONG: u16 = 4;
    let mut tags = tags.to_vec();
    // Behind the head of the file, the directory and the end of directories.
    let at = 8 + 2 + 12 * (tags.len() + 2) + 4;
    tags.extend([(273, at as u32), (279, strip.len() as u32)]);
    tags.sort_unstable();
    let mut file = b"II*\0\x08\0\0\0".to_vec();
    file.extend((tags.len() as u16).to_le_bytes());
    for (tag, value) in tags {
        file.extend([tag, LONG].map(u16::to_le_bytes).as_flattened());
        file.extend([1, value].map(u32::to_le_bytes).as_flattened());
    }
    file.extend([0; 4]);
    file.extend(strip);
    file
}
