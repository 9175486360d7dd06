//! `matchbench show`: draws one pair, matched as a run would match it.

use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use matchbench::cache::FeatureCache;
use matchbench::counted::counted;
use matchbench::datasets::{Frame, Pair, Sequence};
use matchbench::files::TemporaryFolder;
use matchbench::matchers::ImageFiles;
use matchbench::metrics::PairResult;
use matchbench::protocols::of_estimator;
use matchbench::records::{Counts, Outcome};
use matchbench::report::{Thumbnail, picture_png, picture_svg, sentence, view};
use matchbench::run::{
    Contender, ContenderError, Dataset, Evaluation, ImagePair, Outside, check_truth, check_turns,
    evaluate, pair_seed,
};

use super::job::{changes, check_names};
use crate::Ending;
use crate::args::ShowArgs;
use crate::output::{is_standard_output, stdout, write_result};
use crate::stop::end_on_ctrl_c;

/// Longest side of an image in the picture, and its JPEG quality.
const DRAWN: (u32, u8) = (1600, 88);

pub(crate) fn run(args: &ShowArgs) -> Result<Ending> {
    let format = Format::of(&args.out)?;
    let (_beside, contender) = contender(args)?;
    let Dataset { sequence, .. } = Dataset::open(&args.dataset)?;
    check_turns(&sequence, &contender)?;
    let pair = pair(args, &sequence)?;
    check_truth(&sequence.name, [pair], &contender)?;
    let evaluation = evaluated(args, &sequence, pair, &contender)?;
    let (outcome, matches) = (&evaluation.outcomes[0], &evaluation.matches);
    if let Outcome::Failed { reason, .. } = outcome {
        bail!("{reason}");
    }
    let [a, b] = frames(&sequence, pair);
    let images = [a.planes()?, b.planes()?]
        .map(|planes| Arc::new(Thumbnail::new(&planes, DRAWN.0, DRAWN.1)));
    let mut view = view(&sequence, pair, matches, outcome, images)
        .context("the dataset has no truth of this pair for what the estimator estimates")?;
    if args.keypoints {
        let features = evaluation.features.iter().flatten();
        for (points, features) in view.keypoints.iter_mut().zip(features) {
            let keypoints = features.keypoints.iter();
            *points = keypoints.map(|keypoint| keypoint.at.cast()).collect();
        }
    }
    let estimator = &contender.estimators[0].name;
    let caption = format!(
        "{} {} – {}, {} + {}: {}",
        sequence.name,
        args.a,
        args.b,
        contender.source.id(),
        estimator,
        sentence(
            &PairResult::of(pair.a, pair.b, outcome),
            of_estimator(estimator)
        )
    );
    let picture = match format {
        Format::Svg => picture_svg(&view, &caption).into_bytes(),
        Format::Png => picture_png(&view, &caption)?,
    };
    write_result(&args.out, &picture)?;
    if !is_standard_output(&args.out) {
        writeln!(
            stdout(),
            "{caption}\n{}, of which {} agree with the estimate\n{}",
            in_words(&matches.counts),
            view.tally.agree,
            args.out.display()
        )?;
    }
    Ok(Ending::Done)
}

/// What the picture is written as.
enum Format {
    Png,
    Svg,
}

impl Format {
    /// By the name of the file.
    fn of(out: &Path) -> Result<Self> {
        match out.extension().and_then(|extension| extension.to_str()) {
            Some("svg") => Ok(Self::Svg),
            Some("png") => Ok(Self::Png),
            // If standard output is a terminal, nobody can read the bytes; if it is piped on, the picture is a PNG.
            None if is_standard_output(out) => Ok(Self::Png),
            _ => bail!(
                "--out {}: the name must end in .png or .svg, or be - for a PNG on standard output",
                out.display()
            ),
        }
    }
}

/// The pair that is shown.
fn pair<'a>(args: &ShowArgs, sequence: &'a Sequence) -> Result<&'a Pair> {
    let mut pairs = sequence.pairs.iter();
    (pairs.find(|pair| (pair.a, pair.b) == (args.a, args.b))).with_context(|| {
        format!(
            "{} has no pair {} {}; its pairs.txt lists those that it has",
            args.dataset.display(),
            args.a,
            args.b
        )
    })
}

fn frames<'a>(sequence: &'a Sequence, pair: &Pair) -> [&'a Frame; 2] {
    [pair.a, pair.b].map(|frame| &sequence.frames[frame as usize])
}

/// The pair, matched and estimated with the seed that it has in a run.
fn evaluated(
    args: &ShowArgs,
    sequence: &Sequence,
    pair: &Pair,
    contender: &Contender,
) -> Result<Evaluation> {
    let [a, b] = frames(sequence, pair);
    let gray = [a.pixels()?, b.pixels()?];
    let matcher = contender.source.id();
    let seed = pair_seed(args.seed, &sequence.name, matcher, (pair.a, pair.b), 0);
    let images = ImagePair {
        images: gray.each_ref(),
        cameras: [&a.camera, &b.camera],
        truth: &pair.truth,
        files: Some(ImageFiles {
            dataset: &sequence.name,
            frames: [pair.a, pair.b],
            images: [&a.image, &b.image],
        }),
    };
    Ok(evaluate(contender, &images, seed)?)
}

/// `1207 and 1190 features, 1207 putative and 340 selected matches`.
fn in_words(counts: &Counts) -> String {
    // A matcher from outside may have no features, or not state their number.
    let features = match (counts.features_a, counts.features_b) {
        (0, 0) if counts.putative > 0 => String::new(),
        (a, b) => format!("{a} and {}, ", counted(b, "feature")),
    };
    let selected = counted(counts.selected, "selected match");
    format!("{features}{} putative and {selected}", counts.putative)
}

/// The matcher with its estimator, and the folder of the files that a matcher from outside leaves behind, which
/// must exist longer than the matcher.
fn contender(args: &ShowArgs) -> Result<(TemporaryFolder, Contender)> {
    let matcher = std::slice::from_ref(&args.matcher);
    check_names(matcher)?;
    end_on_ctrl_c()?;
    let estimators: Vec<String> = args.estimator.iter().cloned().collect();
    let folder = TemporaryFolder::new()?;
    let outside = Outside {
        logs: folder.path(),
        cache: &FeatureCache::new(folder.path().join("cache")),
    };
    match Contender::all_of(matcher, &estimators, &changes(&args.set)?, Some(&outside)) {
        Ok(contenders) => match contenders.into_iter().next() {
            Some(contender) if args.matcher != "all" => Ok((folder, contender)),
            _ => bail!("--matcher takes one matcher"),
        },
        Err(error) => {
            if let ContenderError::Start(_) = error {
                // The message names the log in it.
                folder.keep();
            }
            Err(error.into())
        }
    }
}
