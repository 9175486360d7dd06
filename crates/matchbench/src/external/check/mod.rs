//! Trying a manifest out: what is wrong, in words.
//!
//! Two pairs are matched, the first of them twice, and one of tiny images. Their true poses or homographies, which the
//! child never sees, show what the protocol alone cannot show: whether points are what they should
//! be. If matches do not lie near their true epipolar lines, the usual mistakes are undone one by one (x
//! and y exchanged, the images exchanged, pixels of a resized image), and the mistake that explains the
//! matches is named.

mod points;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::Instant;

use matchbench_vision::geometry::Camera;
use matchbench_vision::image::{GrayImage, Size};
use matchbench_vision::seed::Seed;

use points::{EXPLAINS, Known, NEAR_PX, SOUND, mistake, share_near};

use crate::counted::counted;
use crate::datasets::rendered::{self, World, scenes};
use crate::datasets::{DatasetError, Sequence, Truth, read_size};
use crate::files::TemporaryFolder;

use super::answer::{Matched, Times};
use super::log::Log;
use super::manifest::{Kind, Manifest};
use super::pool::{Breakdown, External, Image};

/// Matches below which a share says nothing.
const FEW: usize = 20;
/// The scene that is rendered where no dataset is given.
const BUILT_IN: &str = "office-wide";
/// Size of the tiny images.
const TINY: Size = Size::new(12, 9);

/// A pair of images with the truth about them.
#[derive(Clone, Debug)]
struct CheckPair {
    /// Numbers of the frames.
    pair: [u32; 2],
    /// The files of the images.
    paths: [PathBuf; 2],
    /// Their sizes.
    sizes: [Size; 2],
    /// Their cameras.
    cameras: [Camera; 2],
    /// What is known about them.
    truth: Truth,
}

/// How something that was tried came out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// As it should be.
    Good,
    /// It works, but not as most would like.
    Doubtful,
    /// It does not work.
    Wrong,
}

/// Something that was tried, and how it came out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// How it came out.
    pub verdict: Verdict,
    /// What it was, in words.
    pub text: String,
}

/// Tries out the matcher of a `manifest` on two pairs of `dataset`, or of a built-in scene, and calls
/// `tell` with each finding as it comes. What the matcher prints goes to `log`.
///
/// # Errors
/// If the dataset turns an image, an image of it cannot be read, or a temporary file cannot be written.
pub fn check(
    manifest: Manifest,
    log: Log,
    dataset: Option<&Sequence>,
    tell: &mut dyn FnMut(Finding),
) -> Result<(), DatasetError> {
    if let Some(frame) = dataset.and_then(Sequence::turned) {
        return Err(DatasetError::new(
            &frame.image,
            "the dataset turns the image, and a program from outside sees it as it is stored",
            "store the images turned and import them again",
        ));
    }
    let folder =
        TemporaryFolder::new().map_err(|error| unwritable(&std::env::temp_dir(), &error))?;
    let start = Instant::now();
    let kind = manifest.kind;
    let external = match External::start(manifest, log) {
        Ok(external) => external,
        Err(error) => {
            tell(wrong(error.to_string()));
            return Ok(());
        }
    };
    let identity = external.identity();
    tell(good(format!(
        "ready after {:.1} s: {}, version {}, centre of the first pixel at {}",
        start.elapsed().as_secs_f64(),
        identity.name,
        identity.version,
        identity.pixel_center
    )));
    let pairs = match dataset {
        Some(dataset) => pairs_of(dataset)?,
        None => pairs_of(&built_in(folder.path())?)?,
    };
    let mut first = None;
    for pair in &pairs {
        let matched = ask(&external, kind, pair.pair, pair.images());
        match &matched {
            Ok(matched) => inspect(pair, matched, tell),
            Err(breakdown) => tell(wrong(format!("{}: {breakdown}", names(pair.pair)))),
        }
        first.get_or_insert(matched);
    }
    if let (Some(pair), Some(Ok(first))) = (pairs.first(), first) {
        tell(compare_repeat(
            &first,
            ask(&external, kind, pair.pair, pair.images()),
        ));
    }
    tell(tiny(&external, kind, folder.path())?);
    Ok(())
}

impl CheckPair {
    fn images(&self) -> [Image<'_>; 2] {
        [0, 1].map(|side| Image {
            path: &self.paths[side],
            size: self.sizes[side],
        })
    }
}

/// The first pair of a dataset and one from its middle.
fn pairs_of(dataset: &Sequence) -> Result<Vec<CheckPair>, DatasetError> {
    let count = dataset.pairs.len();
    let chosen = [0, count / 2].into_iter().take(count);
    chosen
        .map(|index| {
            let pair = dataset.pairs[index];
            let frames = [pair.a, pair.b].map(|frame| &dataset.frames[frame as usize]);
            let [a, b] = frames.map(|frame| {
                let path = std::path::absolute(&frame.image);
                let path = path.unwrap_or_else(|_| frame.image.clone());
                read_size(&path).map(|size| (path, size))
            });
            let (a, b) = (a?, b?);
            Ok(CheckPair {
                pair: [pair.a, pair.b],
                paths: [a.0, b.0],
                sizes: [a.1, b.1],
                cameras: frames.map(|frame| frame.camera),
                truth: pair.truth,
            })
        })
        .collect()
}

/// Three frames of a built-in scene, rendered into `folder`, and two pairs of them.
fn built_in(folder: &Path) -> Result<Sequence, DatasetError> {
    let scene = scenes().iter().find(|scene| scene.name == BUILT_IN);
    let scene = scene.expect("a built-in scene");
    let mut sequence = rendered::sequence(scene);
    sequence.pairs.retain(|pair| pair.a == 0);
    sequence.pairs.truncate(2);
    let world = World::build(scene.place);
    for pair in &sequence.pairs {
        for frame in [pair.a, pair.b] {
            let image = folder.join(format!("{frame:04}.png"));
            write_png(&image, &world.render(scene, frame))?;
            sequence.frames[frame as usize].image = image;
        }
    }
    Ok(sequence)
}

fn write_png(path: &Path, pixels: &GrayImage) -> Result<(), DatasetError> {
    let (width, height) = (pixels.width() as u32, pixels.height() as u32);
    image::GrayImage::from_raw(width, height, pixels.data().to_vec())
        .expect("as many pixels as its size says")
        .save(path)
        .map_err(|error| unwritable(path, &error))
}

fn unwritable(path: &Path, error: &dyn std::fmt::Display) -> DatasetError {
    DatasetError::new(path, error.to_string(), "set TMPDIR to a folder with room")
}

/// The matches of a pair, by the child or from the features that it describes.
fn ask(
    external: &External,
    kind: Kind,
    pair: [u32; 2],
    [a, b]: [Image<'_>; 2],
) -> Result<Matched, Breakdown> {
    let Kind::Features(matching) = kind else {
        return external.match_pair(pair, a, b);
    };
    let (a, b) = (external.describe(a)?, external.describe(b)?);
    Ok(Matched {
        rows: matching.matches(&a.features, &b.features).0,
        features: Some([a.features.len() as u32, b.features.len() as u32]),
        times: Times {
            wall: a.times.wall + b.times.wall,
            ..a.times
        },
    })
}

/// Says how many matches there are, how long they took and whether they can be right.
fn inspect(pair: &CheckPair, matched: &Matched, tell: &mut dyn FnMut(Finding)) {
    let (name, count) = (names(pair.pair), matched.rows.len());
    let features = matched.features.map_or_else(String::new, |[a, b]| {
        format!(" of {a} and {}", counted(b, "feature"))
    });
    let own: Vec<String> = (matched.times.own.iter())
        .map(|(stage, seconds)| format!("{stage} {seconds:.3} s"))
        .collect();
    let own = match (own.is_empty(), &matched.times.device) {
        (true, _) => "it tells no times of its own".to_owned(),
        (false, None) => format!(
            "by its own clock {}, on a device that it does not name",
            own.join(", ")
        ),
        (false, Some(device)) => format!("by its own clock {} on {device}", own.join(", ")),
    };
    let wall = matched.times.wall;
    tell(good(format!(
        "{name}: {}{features} in {wall:.3} s; {own}",
        counted(count, "match")
    )));
    if count < FEW {
        let text = format!("{name}: with fewer than {FEW} matches no pose is estimated");
        return tell(doubtful(text));
    }
    let points = different_points(&matched.rows);
    if points < FEW {
        let points = counted(points, "different point");
        let text =
            format!("{name}: all matches are of {points} of an image, which no pose is known from");
        return tell(doubtful(text));
    }
    let Some(known) = Known::of(pair) else {
        return tell(doubtful(format!(
            "{name}: neither a pose with a baseline nor a homography is known of it, so nothing says whether the points \
             are right"
        )));
    };
    let near = share_near(pair, &known, &matched.rows);
    let percent = 100.0 * near;
    let where_they_lie = format!(
        "{name}: {percent:.0} % of the matches lie within {NEAR_PX} pixels of their true {}",
        known.noun()
    );
    if near < EXPLAINS
        && let Some((mistake, share)) = mistake(pair, &known, &matched.rows)
    {
        return tell(wrong(format!(
            "{where_they_lie}; {:.0} % would if {mistake}",
            100.0 * share
        )));
    }
    if near >= SOUND {
        return tell(good(where_they_lie));
    }
    tell(doubtful(format!(
        "{where_they_lie}: are they points of the original images, in pixels, x before y, a before b?"
    )));
}

/// How many pixels the points of matches lie in, in the image where they are fewer.
fn different_points(rows: &[[f32; 5]]) -> usize {
    let pixels = |x: usize| {
        let pixels = rows
            .iter()
            .map(|row| [row[x], row[x + 1]].map(|v| v.round() as i64));
        pixels.collect::<BTreeSet<_>>().len()
    };
    pixels(0).min(pixels(2))
}

/// Whether the same question has the same answer.
fn compare_repeat(first: &Matched, second: Result<Matched, Breakdown>) -> Finding {
    match second {
        Err(breakdown) => wrong(format!("the same pair again: {breakdown}")),
        Ok(second) if second.rows == first.rows => {
            good("the same pair again: the same matches, bit for bit".into())
        }
        Ok(second) => doubtful(format!(
            "the same pair again: {}, {} before, and not the same; runs of it will differ",
            counted(second.rows.len(), "match"),
            first.rows.len()
        )),
    }
}

/// What becomes of images with next to nothing in them.
fn tiny(external: &External, kind: Kind, folder: &Path) -> Result<Finding, DatasetError> {
    let path = folder.join("tiny.png");
    let mut noise = Seed(1).rng();
    write_png(
        &path,
        &GrayImage::from_fn(TINY, |_, _| noise.below(256) as u8),
    )?;
    let image = Image {
        path: &path,
        size: TINY,
    };
    Ok(match ask(external, kind, [0, 1], [image, image]) {
        Ok(matched) => good(format!(
            "images of {TINY} pixels: {}",
            counted(matched.rows.len(), "match")
        )),
        Err(Breakdown::Said(reason)) => good(format!(
            "images of {TINY} pixels: it says that it cannot ({reason})"
        )),
        Err(breakdown) => wrong(format!(
            "images of {TINY} pixels: {breakdown}; answer no matches, or `failed`"
        )),
    })
}

fn names([a, b]: [u32; 2]) -> String {
    format!("pair {a} {b}")
}

fn good(text: String) -> Finding {
    let verdict = Verdict::Good;
    Finding { verdict, text }
}

fn doubtful(text: String) -> Finding {
    let verdict = Verdict::Doubtful;
    Finding { verdict, text }
}

fn wrong(text: String) -> Finding {
    let verdict = Verdict::Wrong;
    Finding { verdict, text }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Matrix3, Point2, Point3, Translation3, UnitQuaternion};

    use super::super::manifest::BuiltIn;
    use super::*;
    use crate::datasets::Turn;

    /// Matches of points in space that two cameras see, without error.
    fn rows(pair: &CheckPair) -> Vec<[f32; 5]> {
        let mut rng = Seed(2).rng();
        let mut number = |from: f64, to: f64| from + (to - from) * rng.below(1000) as f64 / 1000.0;
        (0..100)
            .map(|_| {
                let point = Point3::new(number(-2.0, 2.0), number(-1.5, 1.5), number(5.0, 9.0));
                let project = |camera: &Camera, point: Point3<f64>| {
                    camera.project(Point2::new(point.x / point.z, point.y / point.z))
                };
                let a = project(&pair.cameras[0], point);
                let b = project(&pair.cameras[1], pair.truth.pose().unwrap() * point);
                [a.x as f32, a.y as f32, b.x as f32, b.y as f32, 0.0]
            })
            .collect()
    }

    /// What is said last of these matches.
    fn told(pair: &CheckPair, rows: Vec<[f32; 5]>) -> (Verdict, String) {
        let matched = Matched {
            rows,
            features: None,
            times: Times::default(),
        };
        let mut told = Vec::new();
        inspect(pair, &matched, &mut |finding| told.push(finding));
        let last = told.pop().unwrap();
        (last.verdict, last.text)
    }

    #[test]
    fn without_a_pose_the_homography_judges_and_without_either_nothing_is_certified() {
        let twice = Matrix3::new(2.0, 0.0, 1.0, 0.0, 2.0, 3.0, 0.0, 0.0, 1.0);
        let mut pair = CheckPair {
            pair: [0, 1],
            paths: ["/a.png", "/b.png"].map(PathBuf::from),
            sizes: [Size::new(1280, 960); 2],
            cameras: [Camera::pinhole(1100.0, 1100.0, 640.0, 480.0); 2],
            truth: Truth::Homography(twice),
        };
        let point = |i: u8| [f32::from(i) * 7.0, f32::from(i % 9) * 50.0];
        let right = |i: u8| point(i).map(|x| [x, 2.0 * x]);
        let right = (0..50)
            .map(right)
            .map(|[x, y]| [x[0], y[0], x[1] + 1.0, y[1] + 3.0, 0.0]);
        let right: Vec<[f32; 5]> = right.collect();
        let (verdict, text) = told(&pair, right.clone());
        assert!(
            verdict == Verdict::Good && text.contains("true places"),
            "{text}"
        );
        let exchanged = right.iter().map(|&[xa, ya, xb, yb, q]| [xb, yb, xa, ya, q]);
        let exchanged: Vec<[f32; 5]> = exchanged.collect();
        // A part of them may be near by chance.
        for rows in [exchanged.clone(), [&right[..15], &exchanged[15..]].concat()] {
            let (verdict, text) = told(&pair, rows);
            assert!(
                verdict == Verdict::Wrong && text.contains("a and b"),
                "{text}"
            );
        }
        pair.truth = Truth::Pose(Isometry3::identity());
        let (verdict, text) = told(&pair, right);
        assert!(
            verdict == Verdict::Doubtful && text.contains("nothing says"),
            "{text}"
        );
    }

    #[test]
    fn a_dataset_that_turns_images_is_refused() {
        let mut sequence = rendered::sequence(&scenes()[0]);
        sequence.frames[1].turn = Turn::Half;
        let folder = tempfile::tempdir().unwrap();
        let text = "name = 'x'\ncommand = ['no-such-program']\n";
        let path = folder.path().join("x.toml");
        let manifest = Manifest::parse(&path, text, &BuiltIn::default()).unwrap();
        let log = Log::open(&folder.path().join("x.log")).unwrap();
        let error = check(manifest, log, Some(&sequence), &mut |_| {}).unwrap_err();
        assert!(error.to_string().contains("turns the image"), "{error}");
    }

    #[test]
    fn the_usual_mistakes_are_named() {
        let pair = CheckPair {
            pair: [0, 1],
            paths: ["/a.png", "/b.png"].map(PathBuf::from),
            sizes: [Size::new(1280, 960); 2],
            cameras: [Camera::pinhole(1100.0, 1100.0, 640.0, 480.0); 2],
            truth: Truth::Pose(Isometry3::from_parts(
                Translation3::new(1.0, 0.3, 0.4),
                UnitQuaternion::from_euler_angles(0.05, 0.2, 0.3),
            )),
        };
        let right = rows(&pair);
        let told = |change: &dyn Fn([f32; 5]) -> [f32; 5]| {
            told(&pair, right.iter().map(|&row| change(row)).collect())
        };
        assert_eq!(told(&|row| row).0, Verdict::Good);
        let (verdict, text) = told(&|[xa, ya, xb, yb, q]| [ya, xa, yb, xb, q]);
        assert!(
            verdict == Verdict::Wrong && text.contains("x and y"),
            "{text}"
        );
        let (verdict, text) = told(&|[xa, ya, xb, yb, q]| [xb, yb, xa, ya, q]);
        assert!(
            verdict == Verdict::Wrong && text.contains("a and b"),
            "{text}"
        );
        let half = |x: f32| f32::midpoint(x, 0.5) - 0.5;
        let (verdict, text) =
            told(&|row| [half(row[0]), half(row[1]), half(row[2]), half(row[3]), 0.0]);
        assert!(
            verdict == Verdict::Wrong && text.contains("resized to 640"),
            "{text}"
        );
        let (verdict, text) = told(&|row| [row[0], row[1], right[0][2], right[0][3], 0.0]);
        assert!(
            verdict == Verdict::Doubtful && text.contains("1 different point"),
            "{text}"
        );
        let (verdict, text) = told(&|row| [row[0], row[1], row[1], row[0], 0.0]);
        assert!(
            verdict == Verdict::Doubtful && text.contains("original"),
            "{text}"
        );
    }
}
