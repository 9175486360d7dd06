//! `matchbench show`: draws one pair, matched as a run would match it.

use std::io::Write;
use std::path::Path;

use anyhow::{Result, bail, ensure};
use matchbench::files::TemporaryFolder;
use matchbench::show::Shown;
use matchbench::study::{Prepared, Study, StudyDataset, StudyError};

use super::job::{changes, tell_news};
use super::matches;
use crate::Ending;
use crate::args::ShowArgs;
use crate::output::{is_standard_output, stdout, write_result};
use crate::stop::end_on_ctrl_c;

pub(crate) fn run(args: &ShowArgs) -> Result<Ending> {
    let format = Format::of(&args.out)?;
    // Where the required argument contradicts one that is there, clap asks for none.
    ensure!(
        args.matcher.is_none() || !args.files.has_options(),
        "--matches-format, --pixel-center, --resized, --verified and --note say how to read --matches, and this is --matcher"
    );
    // What a matcher from outside leaves behind lies in it, and it must exist longer than the matcher.
    let folder = TemporaryFolder::new()?;
    end_on_ctrl_c()?;
    let prepared = match study(args, folder.path())?.prepare(&tell_news) {
        Err(error @ StudyError::NotStarted(_)) => {
            // The message names the log in it.
            folder.keep();
            return Err(error.into());
        }
        prepared => prepared?,
    };
    let Prepared {
        datasets,
        contenders,
        ..
    } = &prepared;
    let [contender] = &contenders[..] else {
        bail!("show draws the matches of one matcher");
    };
    let sequence = &datasets[0].sequence;
    let pair = [
        sequence.frame_called(&args.a)?,
        sequence.frame_called(&args.b)?,
    ];
    let shown = Shown::new(&datasets[0], pair, contender, args.seed, args.keypoints)?;
    let picture = match format {
        Format::Svg => shown.svg().into_bytes(),
        Format::Png => shown.png()?,
    };
    write_result(&args.out, &picture)?;
    if !is_standard_output(&args.out) {
        let (caption, out) = (&shown.caption, args.out.display());
        writeln!(stdout(), "{caption}\n{}\n{out}", shown.in_words())?;
    }
    Ok(Ending::Done)
}

/// What is asked for, as a run whose folder is temporary.
fn study(args: &ShowArgs, folder: &Path) -> Result<Study> {
    Ok(Study {
        out: Some(folder.to_owned()),
        datasets: vec![StudyDataset::at(&args.dataset)],
        matchers: args.matcher.iter().cloned().collect(),
        matches: matches::asked(&args.files)?,
        estimators: args.estimator.iter().cloned().collect(),
        set: changes(&args.set)?,
        ..Study::default()
    })
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
