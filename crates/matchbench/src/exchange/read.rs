//! Matches of a dataset's pairs from files: recognised, checked once over all pairs, and given
//! pair by pair.
//!
//! Opening reads every pair of the dataset once and keeps none of them. So memory does not grow with the
//! number of pairs, and errors are reported before a run begins: numbers that are not finite, points
//! outside their image, ambiguities outside 0..1. If the points fill little of their images, a warning says
//! so, since points of resized images look like that.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use matchbench_vision::geometry::MatchedPoints;
use matchbench_vision::image::Size;
use nalgebra::Point2;

use super::names::{Ambiguous, NamedBy, Names};
use super::probe::Probe;
use super::recognise::format_of;
use super::{
    Contents, ExchangeError, Format, RawMatches, ReadOptions, Scores, Source, Understood, bounded,
};
use crate::counted::counted;
use crate::datasets::Sequence;
use crate::front_door::{PIXEL_CENTER, RESIZED};

/// Points that fill less of the image's width and height than this, in all pairs, are warned about.
const FILLED: f64 = 0.6;
/// How far outside its image a point may lie beside the rounding of its file, in pixels.
const SLACK: f64 = 1e-3;

/// Matches of a dataset in files.
pub struct MatchFiles {
    source: Box<dyn Source>,
    /// The index of each pair of frames in the source, and whether to swap its images.
    pairs: BTreeMap<(u32, u32), (usize, bool)>,
    /// Sizes of the images, by frame; `None` for those of no pair.
    sizes: Vec<Option<Size>>,
    understood: Understood,
    survey: Survey,
    /// What the files of each pair were when it was first read, by its index in the source.
    stamps: HashMap<usize, Stamp>,
}

/// By what a file that has changed is known, without reading it: sizes and times of change of the file of matches and
/// that of their points.
type Stamp = [(u64, Option<SystemTime>); 2];

/// What reading all pairs of the dataset has shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Survey {
    /// Pairs that the files have.
    pub found: usize,
    /// Pairs of the dataset that they lack; they count as failed.
    pub absent: Vec<(u32, u32)>,
    /// Pairs in the files that are none of the dataset.
    pub others: usize,
    /// Number of matches of all pairs.
    pub matches: u64,
    /// What looks wrong, in words.
    pub warnings: Vec<String>,
}

/// Missing pairs that are named; of more, the number is told.
const NAMED: usize = 10;

impl Survey {
    /// Which pairs are in the dataset or in the files alone, in sentences.
    pub fn remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        if !self.absent.is_empty() {
            let named = self.absent.iter().take(NAMED);
            let named: Vec<_> = named.map(|(a, b)| format!("{a} {b}")).collect();
            let more = match self.absent.len().saturating_sub(NAMED) {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            remarks.push(format!(
                "absent: {} ({}{more}); what is run of them counts as failed",
                counted(self.absent.len(), "pair"),
                named.join(", ")
            ));
        }
        if self.others > 0 {
            remarks.push(format!(
                "{} of the files not in the dataset",
                counted(self.others, "pair")
            ));
        }
        remarks
    }
}

/// Matches of a pair as our own matchers give them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FileMatches {
    /// The matches, in pixels of the original images, the first pixel's centre at (0, 0); positions
    /// are rounded to single precision, as a run keeps them.
    pub points: MatchedPoints,
    /// Numbers of keypoints of both images, where the format knows them.
    pub keypoints: Option<[usize; 2]>,
}

impl fmt::Debug for MatchFiles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("MatchFiles")
            .field("understood", &self.understood)
            .field("survey", &self.survey)
            .finish_non_exhaustive()
    }
}

impl MatchFiles {
    /// The matches for the pairs of `sequence` in the files at `paths`: files, a folder of files,
    /// or a folder that has a folder of files for each dataset.
    ///
    /// # Errors
    /// If a file cannot be read or is of no known format; the convention or the size must be said
    /// and is not; an option does not concern the format; no pair is one of the dataset; or a
    /// match is wrong. The message names file, pair and match.
    pub fn open(
        paths: &[PathBuf],
        sequence: &Sequence,
        options: &ReadOptions,
    ) -> Result<Self, ExchangeError> {
        Self::open_as(paths, sequence, options, None)
    }

    /// The same for a `part` of a dataset, all of which was `known` before: scores are read as they were
    /// understood then, and files that have none of these pairs may be right.
    ///
    /// # Errors
    /// As [`MatchFiles::open`].
    pub fn open_part(
        paths: &[PathBuf],
        part: &Sequence,
        options: &ReadOptions,
        known: &Understood,
    ) -> Result<Self, ExchangeError> {
        Self::open_as(paths, part, options, Some(known))
    }

    fn open_as(
        paths: &[PathBuf],
        sequence: &Sequence,
        options: &ReadOptions,
        known: Option<&Understood>,
    ) -> Result<Self, ExchangeError> {
        let probe = Probe::new(paths, &sequence.name)?;
        let (files, passed_over) = (probe.files.clone(), probe.passed_over);
        let format = format_of(&probe, options.format)?;
        let pixel_center = options.center_in(&files[0], format)?;
        let contents = (format.open)(probe, options)?;

        let names = Names::of(sequence);
        let (named_by, doubtful) = names.kind(&contents.pairs);
        let (found, ambiguous) = pairs_by_frames(&contents, &names, named_by)?;
        let mut this = Self {
            source: contents.source,
            pairs: BTreeMap::new(),
            sizes: vec![None; sequence.frames.len()],
            understood: Understood {
                format: format.id.into(),
                pixel_center,
                resized: options.resized,
                verified: options.verified,
                named_by,
                scores: Scores::None,
                files: Vec::new(),
                passed_over,
                notes: options.notes.clone(),
            },
            survey: Survey::default(),
            stamps: HashMap::new(),
        };
        this.assign(&found, contents.pairs.len(), sequence)?;
        let of_several = of_several_images(&ambiguous, sequence);
        if this.pairs.is_empty() && !sequence.pairs.is_empty() && known.is_none() {
            let why = of_several.map_or_else(String::new, |why| format!(": {why}"));
            let name = &sequence.name;
            let what = format!("none of its pairs is one of the dataset `{name}`{why}");
            let remedy = "name images as the dataset does, or frames by number";
            return Err(ExchangeError::new(&files[0], what, remedy));
        }
        let doubt = doubtful.then(|| doubt_of_names(named_by).to_owned());
        this.survey
            .warnings
            .extend(of_several.into_iter().chain(doubt));
        this.survey
            .warnings
            .extend(doubt_of_center(format, pixel_center));
        this.read_all(known.map(|known| known.scores))?;
        // Afterwards: what changes from here on is no more what was stamped.
        this.understood.files = Understood::hashed(&files)?;
        Ok(this)
    }

    /// How the files were understood.
    pub fn understood(&self) -> &Understood {
        &self.understood
    }

    /// What reading all pairs has shown.
    pub fn survey(&self) -> &Survey {
        &self.survey
    }

    /// The matches of frames `a` and `b`, in the order of the file; `None` if it has none. May be
    /// called from many threads.
    ///
    /// # Errors
    /// If they cannot be read or are wrong, or their file has changed since all was read and hashed.
    pub fn matches(&self, a: u32, b: u32) -> Result<Option<FileMatches>, ExchangeError> {
        let Some(&(index, swapped)) = self.pairs.get(&(a, b)) else {
            return Ok(None);
        };
        let raw = self.raw(index, swapped, (a, b))?;
        self.refuse_changed(index)?;
        let wrong = |what: String| self.wrong(index, (a, b), what);
        let [points_a, points_b] = [(&raw.a, a), (&raw.b, b)].map(|(points, frame)| {
            let to_original = self.to_original(frame);
            let narrow = |point: &[f64; 2]| {
                let [x, y] = to_original(*point);
                Point2::new(f64::from(x as f32), f64::from(y as f32))
            };
            points.iter().map(narrow).collect()
        });
        let ambiguity = raw.rating.ambiguities(raw.a.len(), self.understood.scores);
        Ok(Some(FileMatches {
            points: MatchedPoints::new(points_a, points_b, ambiguity.map_err(wrong)?)
                .with_turns(raw.turns)
                .with_growths(raw.growths),
            keypoints: raw.keypoints,
        }))
    }

    /// Keeps the pairs of the dataset, among all that the files `count`, and the sizes of their images.
    fn assign(
        &mut self,
        found: &BTreeMap<(u32, u32), usize>,
        count: usize,
        sequence: &Sequence,
    ) -> Result<(), ExchangeError> {
        for pair in &sequence.pairs {
            let (a, b) = (pair.a, pair.b);
            let straight = found.get(&(a, b)).map(|&index| (index, false));
            let place = straight.or_else(|| found.get(&(b, a)).map(|&index| (index, true)));
            let Some(place) = place else {
                self.survey.absent.push((a, b));
                continue;
            };
            self.pairs.insert((a, b), place);
            for frame in [a, b] {
                let size = &mut self.sizes[frame as usize];
                if size.is_none() {
                    *size = Some(sequence.frames[frame as usize].size()?);
                }
            }
        }
        self.survey.found = self.pairs.len();
        let used: BTreeSet<usize> = self.pairs.values().map(|(index, _)| *index).collect();
        self.survey.others = count - used.len();
        Ok(())
    }

    /// Reads every pair once: checks it, and learns what scores look like, unless that is `known`, and how far
    /// points reach.
    fn read_all(&mut self, known: Option<Scores>) -> Result<(), ExchangeError> {
        let mut scores = known.unwrap_or(Scores::None);
        let mut filled: f64 = 0.0;
        let mut stamps = HashMap::with_capacity(self.pairs.len());
        for (&(a, b), &(index, swapped)) in &self.pairs {
            stamps.insert(index, self.stamp(index)?);
            let raw = self.raw(index, swapped, (a, b))?;
            self.survey.matches += raw.a.len() as u64;
            scores = known.unwrap_or_else(|| raw.rating.seen_after(scores));
            (raw.rating.ambiguities(raw.a.len(), scores))
                .map_err(|what| self.wrong(index, (a, b), what))?;
            for (points, frame) in [(&raw.a, a), (&raw.b, b)] {
                filled = filled.max(fill(points, self.stored_size(frame)));
            }
        }
        self.stamps = stamps;
        self.understood.scores = scores;
        if self.survey.matches > 0 && filled < FILLED {
            let doubt = match self.understood.resized {
                None => format!(
                    "are they those of resized images? Then say {}",
                    RESIZED.with("WxH")
                ),
                Some([width, height]) => format!("were the images resized to {width}x{height}?"),
            };
            self.survey.warnings.push(format!(
                "in every pair the points fill less than {:.0} % of the images' width and height \
                 (at most {:.0} %): {doubt}",
                100.0 * FILLED,
                100.0 * filled
            ));
        }
        Ok(())
    }

    /// What the files of the pair with this index are now.
    fn stamp(&self, index: usize) -> Result<Stamp, ExchangeError> {
        let of = |file: &Path| {
            let file_now =
                fs::metadata(file).map_err(|error| ExchangeError::unreadable(file, error))?;
            Ok::<_, ExchangeError>((file_now.len(), file_now.modified().ok()))
        };
        Ok([
            of(self.source.file(index))?,
            of(self.source.points_file(index))?,
        ])
    }

    /// Refuses files that are no more what was read and hashed at first, when the pair with this index was just read.
    fn refuse_changed(&self, index: usize) -> Result<(), ExchangeError> {
        let (before, now) = (self.stamps[&index], self.stamp(index)?);
        let files = [self.source.file(index), self.source.points_file(index)];
        let changed = (0..2).find(|&which| before[which] != now[which]);
        changed.map_or(Ok(()), |which| {
            Err(ExchangeError::new(
                files[which],
                "it has changed since it was opened, and what stands in it now is not what its hash is of",
                "put back what it was; for the new matches begin again, with another folder",
            ))
        })
    }

    /// The matches of a pair as the file has them, once they were checked.
    fn raw(
        &self,
        index: usize,
        swapped: bool,
        (a, b): (u32, u32),
    ) -> Result<RawMatches, ExchangeError> {
        let mut raw = (self.source.read(index)).map_err(|error| error.at(pair_in_words(a, b)))?;
        bounded(raw.a.len()).map_err(|what| self.wrong(index, (a, b), what))?;
        if swapped {
            std::mem::swap(&mut raw.a, &mut raw.b);
            for change in raw.turns.iter_mut().chain(&mut raw.growths).flatten() {
                *change = -*change;
            }
            if let Some(keypoints) = &mut raw.keypoints {
                keypoints.reverse();
            }
        }
        let wrong = |what| {
            ExchangeError::damaged(self.source.points_file(index), what).at(pair_in_words(a, b))
        };
        for (points, frame, image) in [(&raw.a, a, "a"), (&raw.b, b, "b")] {
            let finite = |point: &[f64; 2]| point.iter().all(|at| at.is_finite());
            if let Some(number) = points.iter().position(|point| !finite(point)) {
                let [x, y] = points[number];
                let what = format!(
                    "match {number}: the point ({x}, {y}) of image {image} is not of finite numbers"
                );
                return Err(wrong(what));
            }
            let inside = self.bounds(frame, &raw);
            if let Some(number) = points.iter().position(|point| !inside(*point)) {
                let [x, y] = points[number];
                let [width, height] = self.stored_size(frame);
                let what = format!(
                    "match {number}: the point ({x}, {y}) of image {image} is outside the image \
                     of {width} x {height} pixels"
                );
                let mut error = wrong(what);
                let size = match self.understood.resized {
                    None => format!(
                        "if the matcher saw resized images say {}",
                        RESIZED.with("WxH")
                    ),
                    Some([width, height]) => {
                        format!(
                            "if the images were not resized to {width}x{height} correct {RESIZED}"
                        )
                    }
                };
                error.remedy =
                    format!("{size}; if the first pixel's centre is elsewhere say {PIXEL_CENTER}");
                return Err(error);
            }
        }
        Ok(raw)
    }

    /// Whether a finite point is in the image, but for rounding.
    fn bounds(&self, frame: u32, raw: &RawMatches) -> impl Fn([f64; 2]) -> bool + use<> {
        let [width, height] = self.stored_size(frame);
        let first = self.understood.pixel_center - 0.5;
        let slack = SLACK + raw.element.rounding(width.max(height));
        move |[x, y]| {
            let within = |at: f64, side: f64| at >= first - slack && at <= first + side + slack;
            within(x, width) && within(y, height)
        }
    }

    /// Width and height of the image that the points of a frame belong to.
    fn stored_size(&self, frame: u32) -> [f64; 2] {
        self.understood
            .resized
            .map_or_else(|| self.original_size(frame), |size| size.map(f64::from))
    }

    fn original_size(&self, frame: u32) -> [f64; 2] {
        let size = self.sizes[frame as usize].expect("the sizes of all pairs were read");
        [size.width as f64, size.height as f64]
    }

    /// From a point in the file to the original image. Nothing is computed where nothing changes,
    /// so that numbers stay what they are.
    fn to_original(&self, frame: u32) -> impl Fn([f64; 2]) -> [f64; 2] + use<> {
        let center = self.understood.pixel_center;
        let original = self.original_size(frame);
        let resized = self.understood.resized.map(|size| size.map(f64::from));
        move |point| {
            let axis = |axis: usize| match resized {
                None => point[axis] - center,
                Some(resized) => {
                    (point[axis] - center + 0.5) * original[axis] / resized[axis] - 0.5
                }
            };
            [axis(0), axis(1)]
        }
    }

    fn wrong(&self, index: usize, (a, b): (u32, u32), what: String) -> ExchangeError {
        ExchangeError::damaged(self.source.file(index), what).at(pair_in_words(a, b))
    }
}

/// The index of each pair of frames in the files.
type PairIndexes = BTreeMap<(u32, u32), usize>;

/// The index of each pair of frames of the dataset in the files, and the names that could be those of several images.
///
/// # Errors
/// If a pair is there twice, or a name can be split in several ways.
fn pairs_by_frames(
    contents: &Contents,
    names: &Names,
    named_by: NamedBy,
) -> Result<(PairIndexes, Vec<Ambiguous>), ExchangeError> {
    let mut found = BTreeMap::new();
    let mut ambiguous = Vec::new();
    for (index, name) in contents.pairs.iter().enumerate() {
        let file = contents.source.file(index);
        let frames = names
            .pair(name, named_by)
            .map_err(|what| ExchangeError::new(file, what, "name the images with their ending"))?;
        let Some(frames) = frames else {
            ambiguous.extend(names.ambiguous(name, named_by));
            continue;
        };
        if let Some(before) = found.insert(frames, index) {
            let (first, first_file) = (&contents.pairs[before], contents.source.file(before));
            let elsewhere = if first_file == file {
                String::new()
            } else {
                format!(" in {}", first_file.display())
            };
            let what = format!(
                "{} is there twice, as {name} and as {first}{elsewhere}",
                pair_in_words(frames.0, frames.1)
            );
            return Err(ExchangeError::new(file, what, "keep one of them"));
        }
    }
    Ok((found, ambiguous))
}

/// That the first pixel's centre was said to be elsewhere than files of this format have it. What was said may have been
/// meant for other files of the same run.
fn doubt_of_center(format: &Format, taken: f64) -> Option<String> {
    let own = format.pixel_center.filter(|own| *own != taken)?;
    Some(format!(
        "the first pixel's centre was taken to be at {taken}, as {} says, and files of {} have it at {own}; if these do \
         too, leave it out for them, since it moves their points by half a pixel",
        PIXEL_CENTER.with(&taken.to_string()),
        format.id
    ))
}

/// What names could mean beside what they were taken for.
fn doubt_of_names(taken_for: NamedBy) -> &'static str {
    match taken_for {
        NamedBy::Image | NamedBy::ImageEnd => {
            "names of images could mean other frames too, by number or by a former name; they were taken as names"
        }
        NamedBy::Former | NamedBy::FormerEnd => {
            "names that images had before they were copied or linked are numbers or new names of other frames too; they \
             were taken as the former names"
        }
        NamedBy::Frame => {
            "numbers of frames are names of other images too; they were taken as numbers"
        }
    }
}

/// That pairs are left out since their names fit several images, if there are any.
fn of_several_images(pairs: &[Ambiguous], sequence: &Sequence) -> Option<String> {
    let (name, frames) = pairs.first()?;
    let [one, other] = frames.map(|frame| sequence.frames[frame as usize].image.display());
    Some(format!(
        "{} cannot be told, since a name fits several images: `{name}` is {one} and {other}. Name them with their \
         folders and endings",
        counted(pairs.len(), "pair")
    ))
}

fn pair_in_words(a: u32, b: u32) -> String {
    format!("pair {a} {b}")
}

/// The larger of the shares of width and height that the points span.
fn fill(points: &[[f64; 2]], size: [f64; 2]) -> f64 {
    let share = |axis: usize| {
        let at = points.iter().map(|point| point[axis]);
        let (least, most) = at.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), at| {
            (least.min(at), most.max(at))
        });
        (most - least).max(0.0) / size[axis]
    };
    share(0).max(share(1))
}
