//! `dataset.toml`: the properties of a dataset that the authors' format cannot express.
//!
//! ```toml
//! version = 1
//! origin = "TUM RGB-D, rgbd_dataset_freiburg1_desk; pairs fragments:15"
//! property = "indoor, office"          # what the images show, for the report
//! import = ["tum", "rgbd_dataset_freiburg1_desk", "--pairs", "fragments:15"]   # of what `matchbench import` made it
//! notes = ["2 images without a pose were left out: ..."]
//! image_root = "/data/rgbd_dataset_freiburg1_desk"   # the one line to change if images move
//! distortion = { k1 = 0.2624, k2 = -0.9531, p1 = -0.0054, p2 = 0.0026, k3 = 1.1633 }
//! depth = { per_unit = 5000, invalid = 65535 }       # stored values in the poses' unit of length, and one that,
//!                                                    # as 0 does, says that nothing was measured
//!
//! [[frames]]                       # one per frame, in order
//! image = "rgb/1305031452.791720.png"
//! name = "1305031452.791720.png"   # what the image was called, if not so
//! depth = "depth/1305031452.809301.png"
//! camera = { fx = 517.3, fy = 516.5, cx = 318.6, cy = 255.3 }   # where it has its own
//! turn = 1                         # quarter turns counterclockwise before it is looked at;
//!                                  # camera, pose and pairs are those of the turned image
//! ```
//!
//! Every key but `version` may be absent; an unknown key is an error.

use std::path::{MAIN_SEPARATOR, Path, PathBuf};

use matchbench_vision::geometry::{Camera, Lens};
use serde::de::Error as _;
use serde::ser::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::text::TextFile;
use super::{DatasetError, DepthFile, DepthUnit, Turn};
use crate::counted::counted;

/// File name of the manifest.
pub(super) const FILE: &str = "dataset.toml";
/// The version of the format written here.
pub(super) const VERSION: u32 = 1;

/// Most problems of one manifest that are reported.
const MAX_PROBLEMS: usize = 20;

/// Longest path in a manifest, in bytes. No system opens a longer one.
const MAX_PATH_BYTES: usize = 4096;

/// Most bytes of the paths of all frames together, each behind `image_root`: every frame has its whole path in memory,
/// and a short file can have many frames.
const MAX_PATHS_BYTES: usize = 256 << 20;

/// The contents of `dataset.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Manifest {
    /// [`VERSION`].
    pub(super) version: u32,
    /// Name of the dataset, if it is not the folder's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) name: Option<String>,
    /// Where the data come from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) origin: Option<String>,
    /// What the images show, in a few words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) property: Option<String>,
    /// The arguments with which it was imported, see [`About::import`](super::About::import).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) import: Vec<String>,
    /// Notes of the importer.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) notes: Vec<String>,
    /// Folder to which relative image paths are relative; itself relative to the folder of the dataset.
    #[serde(
        default,
        deserialize_with = "path",
        skip_serializing_if = "Option::is_none"
    )]
    pub(super) image_root: Option<PathBuf>,
    /// Lens distortion of the camera in `camera.txt`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) distortion: Option<Lens>,
    /// How the depth of frames is stored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) depth: Option<DepthUnit>,
    /// One entry per frame, or none at all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) frames: Vec<ManifestFrame>,
}

/// What is said about one frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ManifestFrame {
    /// Its image, if it is not `Images/%04d.*`.
    #[serde(
        default,
        deserialize_with = "path",
        serialize_with = "with_slashes",
        skip_serializing_if = "Option::is_none"
    )]
    pub(super) image: Option<PathBuf>,
    /// What the image was called, see [`Frame::name`](super::Frame::name).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) name: Option<String>,
    /// Its depth.
    #[serde(
        default,
        deserialize_with = "path",
        serialize_with = "with_slashes",
        skip_serializing_if = "Option::is_none"
    )]
    pub(super) depth: Option<PathBuf>,
    /// Its camera, if it is not that of `camera.txt`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) camera: Option<Camera>,
    /// How its stored pixels are turned.
    #[serde(default, skip_serializing_if = "Turn::is_none")]
    pub(super) turn: Turn,
}

/// What `dataset.toml` says about a dataset as a whole.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct About {
    /// Where the data come from, in one line.
    pub origin: String,
    /// What the images show, in a few words; empty if not given.
    pub property: String,
    /// The arguments of `matchbench import` that make the same dataset from the same data: kind, source and
    /// options, without a name of the dataset. Paths do not have the folders above the source, which are
    /// private to one machine. Empty if not known.
    pub import: Vec<String>,
    /// What a user of the data should know.
    pub notes: Vec<String>,
}

/// What the `dataset.toml` of the dataset in `dir` says about the dataset as a whole; empty if there is no such
/// file.
///
/// # Errors
/// If that file cannot be read.
pub fn describe(dir: &Path) -> Result<About, DatasetError> {
    let path = dir.join(FILE);
    if !path.exists() {
        return Ok(About::default());
    }
    let manifest = Manifest::parse(&TextFile::read(&path)?)?;
    Ok(About {
        origin: manifest.origin.unwrap_or_default(),
        property: manifest.property.unwrap_or_default(),
        import: manifest.import,
        notes: manifest.notes,
    })
}

impl Default for Manifest {
    fn default() -> Self {
        Self {
            version: VERSION,
            name: None,
            origin: None,
            property: None,
            import: Vec::new(),
            notes: Vec::new(),
            image_root: None,
            distortion: None,
            depth: None,
            frames: Vec::new(),
        }
    }
}

impl Manifest {
    /// Reads a manifest.
    pub(super) fn parse(file: &TextFile) -> Result<Self, DatasetError> {
        let manifest: Self = toml::from_str(file.text()).map_err(|error| {
            let what = file.error(
                error.message().replace('\n', ", "),
                "correct this line; the reference of dataset.toml lists all keys",
            );
            match error.span() {
                Some(span) => what.at(line_of(file.text(), span.start)),
                None => what,
            }
        })?;
        if manifest.version != VERSION {
            return Err(file.error(
                format!("version {} of dataset.toml is not known", manifest.version),
                format!("use a newer matchbench, or write version = {VERSION}"),
            ));
        }
        if let Some(name) = &manifest.name
            && !is_plain_name(name)
        {
            return Err(file.error(
                format!("`{name}` cannot be the name of a dataset: it names folders of results"),
                "use letters, digits, dots, dashes and underscores",
            ));
        }
        if let Some(root) = &manifest.image_root
            && let Some((what, remedy)) = manifest.wrong_root(root)
        {
            let is_it = |line: &str| line.trim_start().starts_with("image_root");
            let line = file.text().lines().position(is_it);
            let error = file.error(what, remedy);
            return Err(match line {
                Some(before) => error.at(before + 1),
                None => error,
            });
        }
        Ok(manifest)
    }

    /// Why the frames cannot start from this root, and what to do.
    fn wrong_root(&self, root: &Path) -> Option<(String, &'static str)> {
        let paths = (self.frames.iter()).flat_map(|frame| [&frame.image, &frame.depth]);
        let lengths = paths.flatten().map(|path| path.as_os_str().len());
        let (count, bytes) = lengths.fold((0, 0), |(count, bytes), length| {
            (count + 1, bytes + root.as_os_str().len() + length)
        });
        if count == 0 {
            return Some((
                "`image_root` is given, but no frame names an image or depth, which would start from it".to_owned(),
                "name them under [[frames]], or leave `image_root` out: images are then those in Images",
            ));
        }
        (bytes > MAX_PATHS_BYTES).then(|| {
            (
                format!(
                    "behind this `image_root`, {} have {bytes} bytes, and no more than {MAX_PATHS_BYTES} are read",
                    counted(count, "path")
                ),
                "give a shorter one, such as a link to this folder",
            )
        })
    }

    /// Reads as much of a manifest as possible, and notes what is wrong. A line that is invalid on its own is
    /// removed, so that the rest can be checked; this is done at most [`MAX_PROBLEMS`] times.
    pub(super) fn parse_all(file: &TextFile) -> (Option<Self>, Vec<DatasetError>) {
        let mut lines: Vec<&str> = file.text().lines().collect();
        let mut problems = Vec::new();
        loop {
            let error = match Self::parse(&TextFile::new(&file.path, &lines.join("\n"))) {
                Ok(manifest) => return (Some(manifest), problems),
                Err(error) => error,
            };
            // A field may seem missing only because its line was removed.
            if !problems.is_empty() && error.what.contains("missing field") {
                return (None, problems);
            }
            let line = (error.line).and_then(|line| lines.get_mut(line.checked_sub(1)?));
            problems.push(error);
            match line {
                Some(line) if is_setting(line) && problems.len() < MAX_PROBLEMS => *line = "",
                _ => return (None, problems),
            }
        }
    }

    /// How the pixels of frame `index` are turned.
    pub(super) fn turn(&self, index: usize) -> Turn {
        self.frames
            .get(index)
            .map_or(Turn::None, |frame| frame.turn)
    }

    /// What the image of frame `index` was called, if the manifest has it.
    pub(super) fn name_of(&self, index: usize) -> Option<String> {
        self.frames.get(index)?.name.clone()
    }

    /// The path of the image of frame `index`, if the manifest has it.
    pub(super) fn image(&self, dataset: &Path, index: usize) -> Option<PathBuf> {
        let image = self.frames.get(index)?.image.as_ref()?;
        Some(self.image_root(dataset).join(image))
    }

    /// The file of the depth of frame `index`, if the manifest has it.
    pub(super) fn depth(&self, dataset: &Path, index: usize) -> Option<DepthFile> {
        let depth = self.frames.get(index)?.depth.as_ref()?;
        Some(DepthFile {
            path: self.image_root(dataset).join(depth),
            unit: self.depth?,
        })
    }

    /// The folder to which relative paths of images and depth are relative.
    pub(super) fn image_root(&self, dataset: &Path) -> PathBuf {
        dataset.join(self.image_root.as_deref().unwrap_or(Path::new("")))
    }
}

/// A path that a system can open.
fn path<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<PathBuf>, D::Error> {
    let path = PathBuf::deserialize(deserializer)?;
    match path.as_os_str().len() {
        0..=MAX_PATH_BYTES => Ok(Some(path)),
        bytes => Err(D::Error::custom(format!(
            "a path of {bytes} bytes, where {MAX_PATH_BYTES} are the most"
        ))),
    }
}

/// Writes a path so that every system reads it: Windows takes `/` too.
#[allow(clippy::ref_option)] // as serde calls it
fn with_slashes<S: Serializer>(path: &Option<PathBuf>, serializer: S) -> Result<S::Ok, S::Error> {
    let text = path.as_ref().map(|path| {
        let text = path.to_str();
        text.map(|text| text.replace(MAIN_SEPARATOR, "/"))
            .ok_or_else(|| S::Error::custom("the path is no UTF-8"))
    });
    text.transpose()?.serialize(serializer)
}

/// Longest name of a dataset. File systems allow 255 bytes, and some file names have an ending added.
const MAX_NAME_BYTES: usize = 200;

/// Whether `name` can be the name of a folder on every system.
fn is_plain_name(name: &str) -> bool {
    (1..=MAX_NAME_BYTES).contains(&name.len())
        && !name.starts_with('.')
        && name
            .chars()
            .all(|c| c.is_alphanumeric() || "._- +@".contains(c))
}

/// Whether a line is a complete `key = value`.
fn is_setting(line: &str) -> bool {
    !line.trim_start().starts_with('[')
        && toml::from_str::<toml::Table>(line).is_ok_and(|table| !table.is_empty())
}

fn line_of(text: &str, byte: usize) -> usize {
    text.bytes().take(byte).filter(|&b| b == b'\n').count() + 1
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use matchbench_vision::geometry::Distortion;

    use super::*;

    fn parse(text: &str) -> Result<Manifest, DatasetError> {
        Manifest::parse(&TextFile::new(Path::new("dataset.toml"), text))
    }

    #[test]
    fn a_root_that_nothing_starts_from_is_named_with_its_line() {
        let error = parse("version = 1\nimage_root = 'x'\n[[frames]]\nturn = 1\n").unwrap_err();
        assert_eq!(error.line, Some(2));
        assert!(error.what.contains("image_root"), "{error}");
        let depth = "version = 1\nimage_root = 'x'\n[[frames]]\ndepth = 'd.png'\n";
        assert!(parse(depth).is_ok());
    }

    #[test]
    fn paths_that_no_system_opens_are_named_with_their_line() {
        let long = "r".repeat(MAX_PATH_BYTES + 1);
        for (text, line) in [
            (
                format!("version = 1\nimage_root = '{long}'\n[[frames]]\nimage = 'a'\n"),
                2,
            ),
            (format!("version = 1\n[[frames]]\nimage = '{long}'\n"), 3),
            (
                format!("version = 1\n[[frames]]\nimage = 'a'\ndepth = '{long}'\n"),
                4,
            ),
        ] {
            let error = parse(&text).unwrap_err();
            assert_eq!(error.line, Some(line), "{error}");
            assert!(error.what.contains("a path of 4097 bytes"), "{error}");
            assert!(parse(&text.replace(&long, &long[1..])).is_ok());
        }
    }

    #[test]
    fn a_root_stands_before_no_more_paths_than_are_read() {
        let root = "r".repeat(MAX_PATH_BYTES - 1);
        let frames = |count: usize| "[[frames]]\nimage = 'a'\n".repeat(count);
        let text = |count| format!("version = 1\nimage_root = '{root}'\n{}", frames(count));
        let most = MAX_PATHS_BYTES / MAX_PATH_BYTES;
        assert!(parse(&text(most)).is_ok());
        let error = parse(&text(most + 1)).unwrap_err();
        assert_eq!(error.line, Some(2));
        assert!(error.what.contains("65537 paths have"), "{error}");
    }

    #[test]
    fn an_unknown_key_is_named_with_its_line() {
        let error = parse("version = 1\norigin = \"x\"\ncolour = true\n").unwrap_err();
        assert_eq!(error.line, Some(3));
        assert!(error.what.contains("colour"), "{error}");
        let error = parse("version = 1\n[[frames]]\nimage = \"a\"\nfocal = 1\n").unwrap_err();
        assert_eq!(error.line, Some(4));
        let error = parse("version = 1\n[[frames]]\nturn = 4\n").unwrap_err();
        assert_eq!(error.line, Some(3));
        assert!(error.what.contains("a turn of 4 quarters"), "{error}");
    }

    #[test]
    fn every_line_that_is_wrong_by_itself_is_told() {
        let parse_all = |text: &str| {
            let (manifest, problems) = Manifest::parse_all(&TextFile::new(Path::new("x"), text));
            let lines: Vec<_> = problems.iter().map(|problem| problem.line).collect();
            (manifest, lines)
        };
        let text = "version = 1\ncolour = 3\nname = 'desk'\n[[frames]]\nimage = 7\nimage2 = ''\n";
        let (manifest, lines) = parse_all(text);
        assert_eq!(lines, [Some(2), Some(5), Some(6)]);
        assert_eq!(
            manifest.and_then(|manifest| manifest.name).as_deref(),
            Some("desk")
        );
        // What cannot be taken apart ends the search, and so does a version that was taken out.
        assert_eq!(parse_all("version = 1\nnotes = [\n'a'\n").1.len(), 1);
        assert_eq!(parse_all("version = 'x'\ncolour = 3\n").1.len(), 2);
        let many: Vec<String> = (0..99).map(|i| format!("a{i} = 1")).collect();
        assert_eq!(parse_all(&many.join("\n")).1.len(), MAX_PROBLEMS);
    }

    #[test]
    fn another_version_and_a_dangerous_name_are_refused() {
        assert!(parse("version = 2").unwrap_err().what.contains("version 2"));
        assert!(parse(&format!("version = 1\nname = '{}'", "x".repeat(300))).is_err());
        for name in ["", "..", "a/b", "a\\b", ".hidden"] {
            assert!(parse(&format!("version = 1\nname = '{name}'")).is_err());
        }
        assert!(parse("version = 1\nname = '05-castle'").is_ok());
    }

    #[test]
    fn what_is_written_reads_back() {
        let manifest = Manifest {
            name: Some("desk".into()),
            notes: vec!["a \"quoted\" note".into()],
            image_root: Some("/data/with space".into()),
            depth: Some(DepthUnit {
                per_unit: 5000.0,
                invalid: Some(7),
            }),
            distortion: Some(Lens::Brown(Distortion {
                k1: 0.1 + 0.2,
                k2: -1e-17,
                p1: 0.0,
                p2: 5e300,
                k3: 1.0,
            })),
            frames: vec![ManifestFrame {
                image: Some(Path::new("rgb").join("1.5.png")),
                name: Some("left/1.5.png".into()),
                depth: Some(Path::new("depth").join("1.4.png")),
                camera: Some(Camera::pinhole(1.0 / 3.0, 2.0, 3.0, 4.0)),
                turn: Turn::ThreeQuarters,
            }],
            ..Manifest::default()
        };
        let text = toml::to_string(&manifest).unwrap();
        assert_eq!(parse(&text).unwrap(), manifest);
        // With the same character on every system.
        assert!(text.contains("\"rgb/1.5.png\"") && text.contains("\"depth/1.4.png\""));
        assert_eq!(
            manifest.image(Path::new("set"), 0),
            Some("/data/with space/rgb/1.5.png".into())
        );
        assert_eq!(manifest.image(Path::new("set"), 1), None);
        let depth = manifest.depth(Path::new("set"), 0).unwrap();
        assert_eq!(depth.path, Path::new("/data/with space/depth/1.4.png"));
        assert_eq!(depth.unit.per_unit, 5000.0);
    }

    proptest! {
        #[test]
        fn no_text_panics(text in "(version = 1\n)?.{0,60}") {
            let _ = parse(&text);
        }
    }
}
