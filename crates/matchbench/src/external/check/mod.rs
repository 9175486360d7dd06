//! Trying a manifest out: what is wrong, in words.
//!
//! Two pairs are matched, the first of them twice, and one of tiny images. Their true poses or homographies, which the
//! child never sees, show what the protocol alone cannot show: whether points are what they should
//! be. The usual mistakes are undone one by one (x and y exchanged, the images exchanged, pixels of a resized
//! image). A mistake that explains the matches of all pairs better is named.

mod points;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::Instant;

use matchbench_vision::geometry::Camera;
use matchbench_vision::image::{GrayImage, Size};
use matchbench_vision::seed::Seed;

use points::{Judged, Mistake, NEAR_PX, SOUND, mistake};

use crate::counted::counted;
use crate::datasets::rendered::{self, World, scenes};
use crate::datasets::{DatasetError, Sequence, Truth, read_size};
use crate::files::{TemporaryFolder, temporary_files};
use crate::matchers::mostly_copies;

use super::answer::Matched;
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
    let folder = TemporaryFolder::new().map_err(|error| unwritable(&temporary_files(), &error))?;
    let start = Instant::now();
    let kind = manifest.kind;
    let external = match External::start(manifest, log) {
        Ok(external) => external,
        Err(error) => {
            tell(wrong(error.without_log()));
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
    let mut answers = Vec::new();
    for pair in &pairs {
        let answer = ask(&external, kind, pair.pair, pair.images());
        match &answer {
            Ok(matched) => describe(pair, matched, tell),
            Err(breakdown) => tell(wrong(format!("{}: {breakdown}", names(pair.pair)))),
        }
        answers.push(answer);
    }
    let answered = pairs.iter().zip(&answers);
    judge(
        answered.filter_map(|(pair, answer)| Some((pair, answer.as_ref().ok()?))),
        tell,
    );
    if let (Some(pair), Some(Ok(first))) = (pairs.first(), answers.first()) {
        let again = ask(&external, kind, pair.pair, pair.images());
        tell(compare_repeat(first, again));
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
    let points = matching.matches(&a.features, &b.features).0;
    let ends = points.a.iter().zip(&points.b).zip(&points.ambiguity);
    let rows = ends.map(|((a, b), &ambiguity)| {
        let [a, b] = [a, b].map(|at| at.cast::<f32>());
        [a.x, a.y, b.x, b.y, ambiguity]
    });
    Ok(Matched {
        rows: rows.collect(),
        features: Some([a.features.len() as u32, b.features.len() as u32]),
        times: a.times.and(b.times),
    })
}

/// Says how many matches there are and how long they took.
fn describe(pair: &CheckPair, matched: &Matched, tell: &mut dyn FnMut(Finding)) {
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
}

/// Says whether the matches of the pairs can be right, and which mistake explains them if they are not.
fn judge<'a>(
    answered: impl Iterator<Item = (&'a CheckPair, &'a Matched)>,
    tell: &mut dyn FnMut(Finding),
) {
    let mut judged = Vec::new();
    for (pair, matched) in answered {
        tell_copies(pair, &matched.rows, tell);
        match can_be_judged(pair, &matched.rows) {
            Ok(matches) => judged.push(matches),
            Err(doubt) => tell(doubtful(format!("{}: {doubt}", names(pair.pair)))),
        }
    }
    let explanation = mistake(&judged);
    for matches in &judged {
        tell(judgement(matches, explanation.as_ref()));
    }
}

/// Says whether most matches of a pair are copies of others.
fn tell_copies(pair: &CheckPair, rows: &[[f32; 5]], tell: &mut dyn FnMut(Finding)) {
    let places = rows.iter().map(|&[xa, ya, xb, yb, _]| [xa, ya, xb, yb]);
    if let Some(different) = mostly_copies(places) {
        tell(doubtful(format!(
            "{}: of {} only {different} are different, and the rest are copies, each of which counts in the scores; answer each \
             match once",
            names(pair.pair),
            counted(rows.len(), "match")
        )));
    }
}

/// The matches of a pair, if the truth can judge them.
///
/// # Errors
/// Why it cannot, in words.
fn can_be_judged<'a>(pair: &'a CheckPair, rows: &'a [[f32; 5]]) -> Result<Judged<'a>, String> {
    if rows.len() < FEW {
        return Err(format!(
            "with fewer than {FEW} matches no pose is estimated"
        ));
    }
    let points = different_points(rows);
    if points < FEW {
        let points = counted(points, "different point");
        return Err(format!(
            "all matches are of {points} of an image, which no pose is known from"
        ));
    }
    Judged::of(pair, rows).ok_or_else(|| {
        "neither a pose with a baseline nor a homography is known of it, so nothing says whether the points are right"
            .to_owned()
    })
}

/// How near the matches of a pair lie to where they should, beside how near without the mistake.
fn judgement(matches: &Judged<'_>, explanation: Option<&Mistake>) -> Finding {
    let distances = matches.distances();
    let share = distances.share_near();
    let where_they_lie = format!(
        "{}: {:.0} % of the matches lie within {NEAR_PX} pixels of their true {}",
        names(matches.pair().pair),
        100.0 * share,
        matches.noun()
    );
    if let Some(mistake) = explanation {
        let without = matches.distances_without(mistake);
        return wrong(format!(
            "{where_they_lie}, half of them within {:.1}; {:.0} % would, and half of them within {:.1}, if {}",
            distances.median(),
            100.0 * without.share_near(),
            without.median(),
            mistake.words
        ));
    }
    if share >= SOUND {
        return good(where_they_lie);
    }
    doubtful(format!(
        "{where_they_lie}: are they points of the original images, in pixels, x before y, a before b?"
    ))
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
        Err(breakdown) => {
            let none = match kind {
                Kind::Features(_) => "features",
                Kind::Matches => "matches",
            };
            wrong(format!(
                "images of {TINY} pixels: {breakdown}; answer no {none}, or `failed`"
            ))
        }
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
mod tests;
