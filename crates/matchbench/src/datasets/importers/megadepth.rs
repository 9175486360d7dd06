//! MegaDepth-1500: pairs of photographs of two places of MegaDepth (Li, Snavely: "MegaDepth: Learning
//! Single-View Depth Prediction from Internet Photos", CVPR 2018). The pairs were chosen by LoFTR (Sun, Shen,
//! Wang, Bao, Zhou: "LoFTR: Detector-Free Local Feature Matching with Transformers", CVPR 2021).
//!
//! LoFTR's files are named `.npz` but are pickles of a dictionary, which are read without being executed. They
//! have `image_paths`, `intrinsics` (3 x 3) and `poses` (4 x 4, world to camera, no unit), each with `None` for
//! photographs that no pair needs; and `pair_infos`, a list of `((i, j), overlap, ...)`. A folder of such files
//! gives one dataset; the published five files have 300 pairs each.
//!
//! glue-factory publishes the same pairs (and other sets) as two text files. `views.txt` has one view per line:
//! `name R (9) t (3) MODEL width height params`, world to camera. `pairs.txt` beside it has two names per line;
//! further columns are ignored. Images that exist must have the size in `views.txt`.
//!
//! Both come from COLMAP. cx, cy are half the size of the undistorted images, so the origin is the corner of
//! the image, and half a pixel is subtracted here. Names are relative to the image root. This is the given folder,
//! or else that of the file; for `views.txt` it is `images/` beside it, where that exists and no view lies beside the file.
//!
//! Depth is taken where its file exists: LoFTR's `depth_paths` (below the same root), or glue-factory's
//! `depths/NAME.h5` beside `views.txt`. It has the unit of length of the poses.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::iter;
use std::path::{Path, PathBuf};

use matchbench_vision::geometry::Camera;
use matchbench_vision::image::Size;
use nalgebra::Isometry3;

use super::colmap::lens;
use super::list::{NamedFrames, camera, check_camera_size, from_corner, size};
use super::pickle::{Id, Pickled, Value};
use super::{ImportOptions, Imported, base_name};
use crate::datasets::images::files_ending_in;
use crate::datasets::pairs::relative_pose;
use crate::datasets::text::{self, TextFile};
use crate::datasets::{DatasetError, DepthFile, DepthUnit, Frame, Pair, Turn};
use crate::files::read_file;

/// Longest path of an image or of its depth in one of LoFTR's files, in bytes: that of a path on most systems.
const MAX_NAME: usize = 4096;

pub(super) fn read(src: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let views = if src.is_dir() {
        src.join("views.txt")
    } else {
        src.to_owned()
    };
    if views
        .extension()
        .is_some_and(|extension| extension == "txt")
        && views.is_file()
    {
        return read_views(&views, options);
    }
    let files = if src.is_dir() {
        pickles(src)?
    } else {
        vec![src.to_owned()]
    };
    let beside = if src.is_dir() {
        src
    } else {
        src.parent().unwrap_or(Path::new(""))
    };
    let root = options.root(beside);
    let mut frames = NamedFrames::default();
    let mut pairs = Vec::new();
    for file in &files {
        let bytes = read_file(file).map_err(|error| DatasetError::io(file, &error))?;
        let fail = |what: String| {
            DatasetError::new(
                file,
                what,
                "give the file as LoFTR publishes it in its assets",
            )
        };
        if bytes.starts_with(b"PK\x03\x04") {
            return Err(DatasetError::new(
                file,
                "it is a zip archive, as numpy.savez writes, and LoFTR's files are pickles of one dictionary",
                "give the file as LoFTR publishes it in its assets, or write its arrays with \
                 `pickle.dump(dict(numpy.load(FILE, allow_pickle=True)), open(NEW, \"wb\"))`",
            ));
        }
        let pickled = Pickled::parse(&bytes).map_err(fail)?;
        Listing::new(&pickled)
            .and_then(|listing| listing.pairs(&root, &mut frames, &mut pairs))
            .map_err(fail)?;
    }
    let origin = format!("MegaDepth, LoFTR's {}", base_name(src));
    Ok(Imported::listed(origin, frames.into_frames(), pairs))
}

/// The visible `.npz` files of a folder, sorted by name.
fn pickles(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let mut files = files_ending_in(&["npz"], folder)?;
    files.sort();
    if files.is_empty() {
        return Err(DatasetError::new(
            folder,
            "there is neither an .npz nor views.txt",
            "give LoFTR's files or glue-factory's",
        ));
    }
    Ok(files)
}

/// The parts of one of LoFTR's pickles.
struct Listing<'a> {
    pickled: &'a Pickled,
    images: &'a [Id],
    intrinsics: &'a [Id],
    poses: &'a [Id],
    /// None where no depth is known.
    depths: &'a [Id],
    pairs: &'a [Id],
}

impl<'a> Listing<'a> {
    fn new(pickled: &'a Pickled) -> Result<Self, String> {
        let part = |key: &str| match pickled.get(pickled.root(), key) {
            Some(Value::Objects(items) | Value::List(items)) => Ok(&items[..]),
            Some(_) => Err(format!("`{key}` is no list")),
            None => Err(format!("there is no `{key}`")),
        };
        Ok(Self {
            pickled,
            images: part("image_paths")?,
            intrinsics: part("intrinsics")?,
            poses: part("poses")?,
            depths: part("depth_paths").unwrap_or_default(),
            pairs: part("pair_infos")?,
        })
    }

    fn pairs(
        &self,
        root: &Path,
        frames: &mut NamedFrames,
        pairs: &mut Vec<Pair>,
    ) -> Result<(), String> {
        // A pickle can refer to one pair, or to one long name, many times with few bytes.
        let mut numbers = HashMap::new();
        let mut seen = HashSet::new();
        for (row, &info) in self.pairs.iter().enumerate() {
            let mut number = |image: usize| {
                if let Some(&number) = numbers.get(&image) {
                    return Ok(number);
                }
                let number = self.frame(image, root, frames)?;
                numbers.insert(image, number);
                Ok::<u32, String>(number)
            };
            let found = self.pair(info).and_then(|[i, j]| {
                if i == j {
                    return Err(format!("image {i} is matched with itself"));
                }
                if !seen.insert([i, j]) {
                    return Err(format!(
                        "images {i} and {j} are a pair of this file already; take one of them out"
                    ));
                }
                Ok((number(i)?, number(j)?))
            });
            let (a, b) = found.map_err(|what| format!("pair {row}: {what}"))?;
            let pose = |number: u32| {
                let frame: &Frame = frames.frame(number);
                frame.world_from_camera.expect("all of these have poses")
            };
            let b_from_a = relative_pose(&pose(a), &pose(b));
            pairs.push(Pair::with_pose(a, b, b_from_a));
        }
        Ok(())
    }

    /// The two images of an entry `((i, j), overlap, ...)`.
    fn pair(&self, info: Id) -> Result<[usize; 2], String> {
        let wrong = || "the two numbers of its images are missing".to_owned();
        let Value::List(info) = self.pickled.value(info) else {
            return Err(wrong());
        };
        let numbers: Vec<f64> = match info.first().map(|&id| self.pickled.value(id)) {
            Some(Value::Array(array)) if array.shape().iter().product::<usize>() == 2 => {
                array.to_vec()
            }
            Some(Value::List(items)) if items.len() == 2 => (items.iter())
                .filter_map(|&id| match self.pickled.value(id) {
                    Value::Number(number) => Some(*number),
                    _ => None,
                })
                .collect(),
            _ => return Err(wrong()),
        };
        let [i, j] = numbers[..] else {
            return Err(wrong());
        };
        let index = |number: f64| {
            let count = self.images.len();
            let known = number >= 0.0 && number < count as f64 && number.fract() == 0.0;
            if known {
                Ok(number as usize)
            } else {
                Err(format!("there is no image {number} of {count}"))
            }
        };
        Ok([index(i)?, index(j)?])
    }

    fn frame(&self, image: usize, root: &Path, frames: &mut NamedFrames) -> Result<u32, String> {
        let value = |list: &[Id]| list.get(image).map(|&id| self.pickled.value(id));
        let (Some(Value::Text(name)), Some(Value::Array(k)), Some(Value::Array(pose))) = (
            value(self.images),
            value(self.intrinsics),
            value(self.poses),
        ) else {
            return Err(format!("image {image} has no path, K or pose"));
        };
        let depth = match value(self.depths) {
            Some(Value::Text(depth)) => Some(depth),
            _ => None,
        };
        if let Some(long) = iter::once(name)
            .chain(depth)
            .find(|path| path.len() > MAX_NAME)
        {
            return Err(format!(
                "the path of image {image} or of its depth has {} bytes, more than {MAX_NAME}",
                long.len()
            ));
        }
        if k.shape() != [3, 3] || pose.shape() != [4, 4] {
            return Err(format!("K or pose of image {image} has another shape"));
        }
        let pose: [f64; 16] = (pose.to_decimals().try_into()).expect("4 x 4 numbers");
        let pose = text::rigid_motion_4x4(&pose);
        let camera = camera(&k.to_decimals());
        let of_image = |what: String| format!("image {name}: {what}");
        let camera_from_world = pose.map_err(of_image)?;
        let camera = from_corner(camera.map_err(of_image)?);
        let pose = camera_from_world.inverse();
        let number = frames.number(root.join(name), Turn::None, camera, Some(pose));
        if let Some(depth) = depth {
            frames.set_depth(number, depth_at(root.join(depth)));
        }
        // Another file may name the image too.
        let known = frames.frame(number).world_from_camera;
        if known.is_some_and(|known| !is_same(&known, &pose)) {
            return Err(of_image(
                "another file has another pose of it; import files of other reconstructions apart"
                    .into(),
            ));
        }
        Ok(number)
    }
}

/// The depth in a file, if it exists.
fn depth_at(path: PathBuf) -> Option<DepthFile> {
    path.is_file().then_some(DepthFile {
        path,
        unit: DepthUnit::UNITS,
    })
}

/// Whether two poses are the same but for rounding.
fn is_same(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    let (a, b) = (a.to_homogeneous(), b.to_homogeneous());
    (a - b).amax() <= 1e-6 * a.amax()
}

fn read_views(file: &Path, options: &ImportOptions<'_>) -> Result<Imported, DatasetError> {
    let folder = file.parent().unwrap_or(Path::new(""));
    let list = TextFile::read(file)?;
    let mut views = HashMap::new();
    for (line, row) in list.rows() {
        let View {
            name,
            camera,
            size,
            pose,
        } = view(row).map_err(|wrong| wrong.placed(|what| list.error_at(line, what)))?;
        if views.insert(name, (line, camera, size, pose)).is_some() {
            return Err(list.error_at(line, format!("{name} stands here a second time")));
        }
    }
    let images = folder.join("images");
    let beside_list = || views.keys().any(|name| folder.join(name).is_file());
    let root = if images.is_dir() && !beside_list() {
        options.root(&images)
    } else {
        options.root(folder)
    };
    let depths = folder.join("depths");
    let pairs_file = TextFile::read(&folder.join("pairs.txt"))?;
    let mut frames = NamedFrames::default();
    let mut pairs = Vec::new();
    let mut named = BTreeMap::new();
    for (line, row) in pairs_file.rows() {
        let mut names = row.split_whitespace();
        let mut next = || {
            let name = names.next().ok_or("two names are expected")?;
            let view = views.get(name);
            let (line, camera, size, pose) =
                *view.ok_or_else(|| format!("{name} is not in views.txt"))?;
            named.insert(line, (name, size));
            let number = frames.number(root.join(name), Turn::None, camera, Some(pose));
            frames.set_depth(number, depth_at(depths.join(name).with_extension("h5")));
            Ok::<_, String>((number, pose))
        };
        let both = next().and_then(|a| Ok((a, next()?)));
        let ((a, from_a), (b, from_b)) = both.map_err(|what| pairs_file.error_at(line, what))?;
        if a == b {
            return Err(pairs_file.error_at(line, "the image is matched with itself"));
        }
        pairs.push(Pair::with_pose(a, b, relative_pose(&from_a, &from_b)));
    }
    for (line, (name, size)) in named {
        let image = root.join(name);
        if image.is_file() {
            let whose = format!("the camera of {name}");
            check_camera_size(&image, size, &whose, |what| list.error_at(line, what))?;
        }
    }
    let origin = format!("glue-factory, {}", base_name(folder));
    Ok(Imported::listed(origin, frames.into_frames(), pairs))
}

/// A line of `views.txt`.
struct View<'a> {
    name: &'a str,
    camera: Camera,
    /// The size of the images of the camera.
    size: Size,
    pose: Isometry3<f64>,
}

fn view(row: &str) -> Result<View<'_>, lens::Unusable> {
    let words: Vec<&str> = row.split_whitespace().collect();
    let [name, pose @ ..] = &words[..] else {
        return Err("the line is empty".into());
    };
    let Some((pose, camera)) = pose.split_at_checked(12) else {
        return Err("name, R (9), t (3), MODEL, width, height and parameters are expected".into());
    };
    let m: [f64; 12] = text::exactly(&pose.join(" "))?;
    let motion = [
        m[0], m[1], m[2], m[9], m[3], m[4], m[5], m[10], m[6], m[7], m[8], m[11],
    ];
    let [model, width, height, params @ ..] = camera else {
        return Err("the camera is missing: MODEL, width, height, parameters".into());
    };
    let params = text::numbers(&params.join(" "))?;
    let camera_from_world = text::rigid_motion(&motion)?;
    Ok(View {
        name,
        camera: lens::camera(model, &params)?,
        size: size(width, height)?,
        pose: camera_from_world.inverse(),
    })
}
