//! COLMAP models as binary files, little-endian.
//!
//! ```text
//! cameras.bin  u64 count; each: u32 id, i32 model, u64 width, u64 height, f64 params...
//! images.bin   u64 count; each: u32 id, f64 qw qx qy qz tx ty tz, u32 camera, name ending with 0,
//!              u64 keypoints; each: f64 x, f64 y, u64 point (2^64 - 1 for none)
//! ```
//!
//! No count is trusted: items are read one by one until the file ends.

use std::path::Path;

use matchbench_vision::image::Size;

use super::{Cameras, Photograph, distinct, lens};
use crate::counted::counted;
use crate::datasets::DatasetError;
use crate::datasets::text;
use crate::files::read_file;

/// What to do with a model that has cameras of which nothing is known.
const AS_TEXT: &str = "write the model as text (COLMAP's model_converter, --output_type TXT), where cameras that no \
                       image has are passed over";

pub(super) fn cameras(path: &Path) -> Result<Cameras, DatasetError> {
    parse(path, |bytes| {
        let mut cameras = Cameras::new();
        for _ in 0..bytes.u64()? {
            let id = bytes.u32()?;
            let number = bytes.u32()?;
            let model = lens::MODELS.get(number as usize);
            // Of a later model it is not known where its parameters end.
            let &(model, parameters) = model.ok_or_else(|| lens::Unusable {
                what: format!("the camera model {number} is not known"),
                remedy: Some(AS_TEXT),
            })?;
            // A side that is no usize is that of no image.
            let mut side = || Ok::<_, String>(usize::try_from(bytes.u64()?).unwrap_or(usize::MAX));
            let size = Size::new(side()?, side()?);
            let params: Vec<f64> = (0..parameters)
                .map(|_| bytes.f64())
                .collect::<Result<_, _>>()?;
            let camera = lens::camera(model, &params).map(|camera| (camera, size));
            if cameras.insert(id, camera).is_some() {
                return Err(format!("the camera {id} is there a second time").into());
            }
        }
        Ok(cameras)
    })
}

pub(super) fn images(path: &Path) -> Result<Vec<Photograph>, DatasetError> {
    parse(path, |bytes| {
        let mut images = Vec::new();
        for _ in 0..bytes.u64()? {
            let id = bytes.u32()?;
            let mut number = || bytes.f64();
            let [w, x, y, z] = [number()?, number()?, number()?, number()?];
            let at = [number()?, number()?, number()?];
            let pose = text::quaternion_motion(at, [x, y, z, w]);
            let camera_from_world = pose.map_err(|what| format!("image {id}: {what}"))?;
            let camera = bytes.u32()?;
            let name = bytes.name()?;
            let mut points = Vec::new();
            for _ in 0..bytes.u64()? {
                let _at = (bytes.f64()?, bytes.f64()?);
                let point = bytes.u64()?;
                if point != u64::MAX {
                    points.push(point);
                }
            }
            let points = distinct(points);
            images.push(Photograph {
                name,
                camera,
                camera_from_world,
                points,
            });
        }
        Ok(images)
    })
}

fn parse<T>(
    path: &Path,
    read: impl FnOnce(&mut Bytes<'_>) -> Result<T, lens::Unusable>,
) -> Result<T, DatasetError> {
    let data = read_file(path).map_err(|error| DatasetError::io(path, &error))?;
    let mut bytes = Bytes { rest: &data };
    let parsed = read(&mut bytes).and_then(|parsed| match bytes.rest.len() {
        0 => Ok(parsed),
        more => Err(format!("after the end: {}", counted(more, "byte")).into()),
    });
    let fail = |what| DatasetError::new(path, what, "export the model from COLMAP again");
    parsed.map_err(|wrong| wrong.placed(fail))
}

struct Bytes<'a> {
    rest: &'a [u8],
}

impl Bytes<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let (bytes, rest) = self.rest.split_first_chunk().ok_or("the file is cut off")?;
        self.rest = rest;
        Ok(*bytes)
    }

    fn u32(&mut self) -> Result<u32, String> {
        Ok(u32::from_le_bytes(self.take()?))
    }

    fn u64(&mut self) -> Result<u64, String> {
        Ok(u64::from_le_bytes(self.take()?))
    }

    fn f64(&mut self) -> Result<f64, String> {
        Ok(f64::from_le_bytes(self.take()?))
    }

    fn name(&mut self) -> Result<String, String> {
        let end = self.rest.iter().position(|&byte| byte == 0);
        let (name, rest) = self.rest.split_at(end.ok_or("the file is cut off")?);
        self.rest = &rest[1..];
        Ok(String::from_utf8_lossy(name).into_owned())
    }
}
