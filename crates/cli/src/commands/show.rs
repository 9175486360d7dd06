//! `matchbench show`: one pair as a picture. It is run as any other, in a folder of its own.

use std::io::Write;
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use matchbench::datasets::read_gray;
use matchbench::files::write_whole;
use matchbench::metrics::PairResult;
use matchbench::records::{MatchesFile, matches, store};
use matchbench::report::{Thumbnail, picture_png, picture_svg, sentence};
use matchbench::run::Settings;

use super::pictures::view;
use super::run::{Job, open};
use crate::Ending;
use crate::args::ShowArgs;
use crate::contenders::contenders;
use crate::progress::cancel_on_ctrl_c;

/// Longest side of an image in the picture, and its JPEG quality.
const DRAWN: (u32, u8) = (1600, 88);

pub(crate) fn run(args: &ShowArgs) -> Result<Ending> {
    let extension = args
        .out
        .extension()
        .and_then(|extension| extension.to_str());
    let svg = match extension {
        Some("svg") => true,
        Some("png") => false,
        _ => bail!(
            "--out {}: the name must end in .png or .svg",
            args.out.display()
        ),
    };
    let estimators: Vec<String> = args.estimator.iter().cloned().collect();
    let contenders = contenders(std::slice::from_ref(&args.matcher), &estimators, &args.set)?;
    let [contender] = &contenders[..] else {
        bail!("--matcher takes one matcher");
    };
    let mut datasets = open(&[&args.dataset])?;
    let sequence = &mut datasets[0].sequence;
    sequence
        .pairs
        .retain(|pair| (pair.a, pair.b) == (args.a, args.b));
    let pair = *sequence.pairs.first().with_context(|| {
        format!(
            "{} has no pair {} {}; its pairs.txt lists those that it has",
            args.dataset.display(),
            args.a,
            args.b
        )
    })?;
    let folder = tempfile::tempdir()?;
    let job = Job {
        datasets: &datasets,
        contenders: &contenders,
        settings: Settings {
            seed: args.seed,
            ..Settings::default()
        },
        folder: folder.path(),
        cache: None,
        threads: Some(1),
        keep_matches: true,
    };
    let cancel = cancel_on_ctrl_c("stopping; nothing is written")?;
    if !job.execute_quietly(&cancel)? {
        return Ok(Ending::Stopped);
    }

    let (sequence, id) = (&datasets[0].sequence, &contender.matcher.id);
    let estimator = &contender.estimators[0].id;
    let records = store::read(&store::path(folder.path(), &sequence.name, id, estimator))?;
    let record = records.first().context("the run left no record")?;
    let result = PairResult::from(record);
    let file = MatchesFile::open(&matches::path(folder.path(), &sequence.name, id))?;
    let selected = file.read((args.a, args.b, 0))?.unwrap_or_default();
    let gray = [args.a, args.b].map(|frame| read_gray(&sequence.frames[frame as usize].image));
    let [a, b] = gray;
    let gray = [a?, b?];
    let images = gray
        .each_ref()
        .map(|image| Arc::new(Thumbnail::new(image, DRAWN.0, DRAWN.1)));
    let mut view = view(sequence, &pair, &selected, &record.outcome, images);
    if args.keypoints {
        for (points, image) in view.keypoints.iter_mut().zip(&gray) {
            let features = contender.matcher.matcher.extract(image)?;
            *points = features
                .keypoints
                .iter()
                .map(|keypoint| keypoint.at.cast())
                .collect();
        }
    }
    let counts = record.counts;
    let caption = format!(
        "{} {} – {}, {id} + {estimator}: {}",
        sequence.name,
        args.a,
        args.b,
        sentence(&result)
    );
    let picture = if svg {
        picture_svg(&view, &caption).into_bytes()
    } else {
        picture_png(&view, &caption)?
    };
    write_whole(&args.out, &picture)?;
    writeln!(
        std::io::stdout(),
        "{caption}\n{} and {} features, {} putative and {} selected matches, {} of them agree with the estimate\n{}",
        counts.features_a,
        counts.features_b,
        counts.putative,
        counts.selected,
        view.tally.agree,
        args.out.display()
    )?;
    Ok(Ending::Done)
}
