//! A sequence, which is one dataset: frames, and pairs of frames with their truth.

use std::path::{Path, PathBuf};

use matchbench_vision::geometry::Camera;
use matchbench_vision::image::{GrayImage, Size};
use nalgebra::{Isometry3, Matrix3};

use super::names::{ImageNames, Named};
use super::{DatasetError, Depth, DepthFile, Turn, read_gray, read_planes, read_size};

/// One dataset: frames and the pairs that a matcher is judged on.
#[derive(Clone, Debug, PartialEq)]
pub struct Sequence {
    /// Its name in tables: the name of its folder.
    pub name: String,
    /// The images, in the order by which pairs number them.
    pub frames: Vec<Frame>,
    /// The pairs to be matched, in the order of the pairs file.
    pub pairs: Vec<Pair>,
}

/// An image and the camera that took it.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// The image file.
    pub image: PathBuf,
    /// What the image was called before it was copied or linked into the dataset, or what the link to it was called, if
    /// that is known and another name: its path below the folder of all images, with `/`. Files of matches may name it
    /// so.
    pub name: Option<String>,
    /// How its stored pixels are turned before they are used.
    pub turn: Turn,
    /// The camera of the turned image.
    pub camera: Camera,
    /// Pose of the (turned) camera, camera-to-world, if the dataset has it.
    pub world_from_camera: Option<Isometry3<f64>>,
    /// Its depth, if the dataset has it.
    pub depth: Option<DepthFile>,
}

/// Two frames and the truth about them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// Index of the first frame.
    pub a: u32,
    /// Index of the second frame.
    pub b: u32,
    /// What is known about them.
    pub truth: Truth,
}

/// What a dataset knows about a pair. An estimate is judged by the truth of its own kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Truth {
    /// `b_from_a`: takes a point from camera `a` to camera `b`, in the dataset's unit of length.
    Pose(Isometry3<f64>),
    /// Maps pixels of `a`, as `(x, y, 1)`, to those of `b`, up to scale. It exists if the scene is a plane or
    /// the camera only rotated.
    Homography(Matrix3<f64>),
    /// Both.
    Both {
        /// As in [`Truth::Pose`].
        b_from_a: Isometry3<f64>,
        /// As in [`Truth::Homography`].
        homography: Matrix3<f64>,
    },
}

impl Sequence {
    /// The frame that somebody calls so: by its number, counted from 0, or by the name that its image has, or had before
    /// it was copied or linked into the dataset, with or without folders and ending.
    ///
    /// # Errors
    /// If there is no such frame, or several images have this name.
    pub fn frame_called(&self, name: &str) -> Result<u32, DatasetError> {
        let known = self.frames.len();
        if let Ok(number) = name.parse::<u32>()
            && (number as usize) < known
        {
            return Ok(number);
        }
        let file = |number: u32| self.frames[number as usize].image.clone();
        let images = ImageNames::of(self.frames.iter().map(|frame| &*frame.image));
        let former = ImageNames::of(self.frames.iter().map(Frame::former_image));
        let named = match [images, former].map(|names| names.whole(name)) {
            [Some(now), Some(before)] => Some(now.and(before)),
            [now, before] => now.or(before),
        };
        match named {
            Some(Named::One(number)) => Ok(number),
            Some(Named::Several(one, other)) => Err(DatasetError::new(
                file(one),
                format!("`{name}` may be this image or {}", file(other).display()),
                "name a folder too, or give its number",
            )),
            None => Err(DatasetError::new(
                &*self.name,
                format!("there is no image `{name}`"),
                format!("give its name, or its number, which is below {known}"),
            )),
        }
    }

    /// The first frame whose stored pixels are turned before they are used; programs from outside would see them as
    /// they are stored.
    pub fn turned(&self) -> Option<&Frame> {
        self.frames.iter().find(|frame| !frame.turn.is_none())
    }
}

impl Frame {
    /// A frame whose image is used as it is stored, and whose camera and pose (camera-to-world) are known.
    pub fn with_pose(
        image: impl Into<PathBuf>,
        camera: Camera,
        world_from_camera: Isometry3<f64>,
    ) -> Self {
        Self {
            image: image.into(),
            name: None,
            turn: Turn::None,
            camera,
            world_from_camera: Some(world_from_camera),
            depth: None,
        }
    }

    /// What its image was called before it was copied or linked into the dataset, or what the link to it is called; its
    /// path, where that is the same.
    pub(crate) fn former_image(&self) -> &Path {
        self.name.as_ref().map_or(&self.image, Path::new)
    }

    /// The same frame with its depth, if there is any.
    #[must_use]
    pub fn with_depth(self, depth: Option<DepthFile>) -> Self {
        Self { depth, ..self }
    }

    /// The pixels of its image, turned.
    ///
    /// # Errors
    /// If the file cannot be read or is no complete image.
    pub fn pixels(&self) -> Result<GrayImage, DatasetError> {
        Ok(self.turn.pixels(read_gray(&self.image)?))
    }

    /// Its image for people to look at, turned: one grey plane, or red, green and blue planes.
    ///
    /// # Errors
    /// If the file cannot be read or is no complete image.
    pub fn planes(&self) -> Result<Vec<GrayImage>, DatasetError> {
        let planes = read_planes(&self.image)?.into_iter();
        Ok(planes.map(|plane| self.turn.pixels(plane)).collect())
    }

    /// Its depth, turned; `None` if the dataset has none.
    ///
    /// # Errors
    /// If the file cannot be read, is not a depth image, or does not belong to the image of the frame; or if
    /// the size of the image cannot be read.
    pub fn read_depth(&self) -> Result<Option<Depth>, DatasetError> {
        let Some(depth) = &self.depth else {
            return Ok(None);
        };
        depth.read(read_size(&self.image)?, self.turn).map(Some)
    }

    /// The size of its image, turned, from the header of the file alone.
    ///
    /// # Errors
    /// If the file cannot be read or its header is not that of an image.
    pub fn size(&self) -> Result<Size, DatasetError> {
        Ok(self.turn.size(read_size(&self.image)?))
    }
}

impl Pair {
    /// A pair whose relative pose is known.
    pub fn with_pose(a: u32, b: u32, b_from_a: Isometry3<f64>) -> Self {
        let truth = Truth::Pose(b_from_a);
        Self { a, b, truth }
    }

    /// A pair of images whose pixels are related by a homography.
    pub fn with_homography(a: u32, b: u32, b_from_a: Matrix3<f64>) -> Self {
        let truth = Truth::Homography(b_from_a);
        Self { a, b, truth }
    }

    /// The true pose `b_from_a`, if it is known.
    pub fn pose(&self) -> Option<&Isometry3<f64>> {
        self.truth.pose()
    }

    /// The true homography from `a` to `b`, if it is known.
    pub fn homography(&self) -> Option<&Matrix3<f64>> {
        self.truth.homography()
    }
}

impl Truth {
    /// The pose `b_from_a`, if it is known.
    pub fn pose(&self) -> Option<&Isometry3<f64>> {
        match self {
            Self::Pose(b_from_a) | Self::Both { b_from_a, .. } => Some(b_from_a),
            Self::Homography(_) => None,
        }
    }

    /// The homography from `a` to `b`, if it is known.
    pub fn homography(&self) -> Option<&Matrix3<f64>> {
        match self {
            Self::Homography(homography) | Self::Both { homography, .. } => Some(homography),
            Self::Pose(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_called_by_its_number_or_by_its_name_if_no_other_has_it() {
        let frame = |image: &str| {
            let camera = Camera::pinhole(1.0, 1.0, 0.0, 0.0);
            Frame::with_pose(image, camera, Isometry3::identity())
        };
        let sequence = Sequence {
            name: "office".into(),
            frames: ["/a/day/7.png", "/a/night/7.png", "/a/night/door.jpg"]
                .map(frame)
                .into(),
            pairs: Vec::new(),
        };
        let called = |name: &str| sequence.frame_called(name);
        for (name, number) in [
            ("1", 1),
            ("door.jpg", 2),
            ("door", 2),
            ("day/7", 0),
            ("/a/night/7.png", 1),
        ] {
            let name = name.trim_start_matches('/');
            assert_eq!(called(name).expect(name), number, "{name}");
        }
        let several = called("7.png").expect_err("two images").to_string();
        assert!(
            several.contains("/a/day/7.png") && several.contains("/a/night/7.png"),
            "{several}"
        );
        let none = called("3").expect_err("three images").to_string();
        assert_eq!(
            none,
            "office: there is no image `3`; give its name, or its number, which is below 3"
        );
    }

    #[test]
    fn a_copy_is_called_as_its_image_was_if_none_is_called_so_now() {
        let copies = [("0000.png", "0001.png"), ("0001.png", "0002.png")];
        let frame = |(image, former): (&str, &str)| Frame {
            name: Some(former.into()),
            ..Frame::with_pose(
                image,
                Camera::pinhole(1.0, 1.0, 0.0, 0.0),
                Isometry3::identity(),
            )
        };
        let sequence = Sequence {
            name: "office".into(),
            frames: copies.map(frame).into(),
            pairs: Vec::new(),
        };
        let called = |name: &str| sequence.frame_called(name).ok();
        assert_eq!(called("0000.png"), Some(0));
        assert_eq!(called("0002.png"), Some(1));
        assert_eq!(called("0001.png"), None, "frame 1 now, frame 0 before");
    }
}
