//! Arguments of the commands that match: matchers and estimators on datasets, or on one pair.

use std::num::{NonZeroU32, NonZeroUsize};
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use matchbench::records::KeepMatches;

use super::{from_one, one_of, run_folder, trimmed};
use crate::threads::Threads;

#[derive(Debug, Args)]
pub(crate) struct DemoArgs {
    /// Matchers, separated by commas, or `all`, which takes several minutes; a path names the manifest of a
    /// matcher from outside
    #[arg(
        long,
        value_name = "IDS",
        value_delimiter = ',',
        value_parser = trimmed,
        default_value = "sift,orb,brisk,kaze,akaze"
    )]
    pub matchers: Vec<String>,
    /// Folder for the run and its report; running again resumes
    #[arg(long, value_name = "DIR", default_value = "matchbench-demo")]
    pub out: PathBuf,
    #[command(flatten)]
    pub threads: Threads,
}

#[derive(Debug, Args)]
#[command(after_help = "\
A run file says the same in TOML. It also says which matchers are run on which dataset, and from
what datasets are imported. Options on the command line replace what it says: --matches what has
the same name. --tuned is added to it, and --set comes last. docs/formats.md lists its keys:

  out = \"runs/study\"                   # paths start from the folder of the file
  matchers = [\"sift\", \"orb\"]
  estimators = [\"ransac-e\", \"best\"]
  [set]
  sift.ratio = 0.7
  [[dataset]]
  path = \"castle\"                     # imported if it is not there
  import = { kind = \"strecha\", source = \"castle-P30\", pairs = \"all\" }
  matchers = [\"sift\"]                 # instead of those above

Examples:
  matchbench run office --matchers sift,orb --estimator ransac-e,best --out runs/first
  matchbench run office castle --matchers all --sample 50 --out runs/all
  matchbench run office --matchers sift --protocol superglue --out runs/superglue
  matchbench run study.toml
  matchbench run study.toml --sample 50 --out runs/quick")]
pub(crate) struct RunArgs {
    /// Dataset folders (made by `matchbench import`, or in the format of the paper's authors), or one
    /// run file, whose name ends in .toml
    #[arg(value_name = "DATASET", required = true)]
    pub datasets: Vec<PathBuf>,
    /// Matchers, separated by commas, or `all` (see `matchbench list matchers`); a path is that of the manifest
    /// of a matcher from outside (see `matchbench check`)
    #[arg(long, value_name = "IDS", value_delimiter = ',', value_parser = trimmed)]
    pub matchers: Vec<String>,
    /// Folder of the run. If it exists, the run is resumed; datasets, matchers, estimators, pairs and
    /// repetitions may be added
    #[arg(long, value_name = "RUN")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub threads: Threads,
    #[command(flatten)]
    pub choices: ChoiceArgs,
    /// Only N pairs of each dataset, evenly spread (over the first ones if --limit is given). The run can go on
    /// later with a multiple of N, or with all pairs
    #[arg(long, value_name = "N", value_parser = from_one::<NonZeroUsize>)]
    pub sample: Option<NonZeroUsize>,
    /// Folder of the feature cache [default: RUN/cache]
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
    /// Try all failed pairs again. Without this option, only failures that may go away are tried again: a file
    /// that could not be read, or a matcher from outside that gave up
    #[arg(long)]
    pub retry_failed: bool,
    /// Write RUN/report when done
    #[arg(long)]
    pub report: bool,
    // The last: what follows stands under its heading.
    #[command(flatten)]
    pub files: MatchesArgs,
}

/// Options that the records of a run depend on, besides its datasets and matchers.
#[derive(Debug, Args)]
pub(crate) struct ChoiceArgs {
    /// Estimators of poses or homographies, separated by commas. Datasets that have only homographies need a run
    /// of their own [default: the one that belongs to each matcher; best for matches from files; best-h if no
    /// dataset has true poses]
    #[arg(long, value_name = "IDS", value_delimiter = ',', value_parser = trimmed)]
    pub estimator: Vec<String>,
    /// Evaluation protocols, separated by commas, or `all` (see `matchbench list protocols`). A protocol sets
    /// the size of images of native matchers, the estimator, the unit of its threshold and the repetitions. A
    /// program is given its size by hand, if it has a parameter for it (--set ID.max_size=N). Several protocols
    /// share one set of matches, found in images of the original size [default: matchbench]
    #[arg(long, value_name = "IDS", value_delimiter = ',', value_parser = trimmed)]
    pub protocol: Vec<String>,
    /// Only the first N pairs of each dataset
    #[arg(long, value_name = "N", value_parser = from_one::<NonZeroUsize>)]
    pub limit: Option<NonZeroUsize>,
    /// Seed of all random choices [default: 0]
    #[arg(long, value_name = "S")]
    pub seed: Option<u64>,
    /// Run every pair N times, each time with other random choices; scores are means [default: 1, or as often
    /// as the protocol requires]
    #[arg(long, value_name = "N", value_parser = from_one::<NonZeroU32>)]
    pub repeat: Option<NonZeroU32>,
    /// Change a parameter, for example --set sift.ratio=0.7 (repeatable; see `matchbench list`)
    #[arg(long, value_name = "ID.NAME=VALUE")]
    pub set: Vec<String>,
    /// Let an estimator draw samples for at most MS milliseconds per pair, to compare estimators at equal time
    /// (raise max_iterations with --set). Results then differ from run to run
    #[arg(long, value_name = "MS", value_parser = from_one::<NonZeroU32>)]
    pub time_budget: Option<NonZeroU32>,
    /// Use the parameters that `matchbench tune` chose; the scenes that they were tuned on are refused
    /// (repeatable)
    #[arg(long, value_name = "FILE")]
    pub tuned: Vec<PathBuf>,
    /// Which matches are kept in RUN, at 20 to 28 bytes each [default: all]
    #[arg(long, value_enum, value_name = "WHICH")]
    pub keep_matches: Option<KeepArg>,
    /// The same as --keep-matches none
    #[arg(long, hide = true, conflicts_with = "keep_matches")]
    pub no_matches: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "\
A plan is cut into shards, which any number of machines compute in any order. Merged, they are the
run that one machine would have written, bit for bit except for the times.

PLAN/plan.json says what is run (with a hash that every shard names) and which pairs belong to
which shard. All shards have equally many pairs, chosen such that few images are extracted by more
than one shard.

A run file is planned as `run` would run it. Its `out`, `cache` and `report` are for `run` alone:
--out, and --cache of `work`, take their place. All its datasets must have the same matchers.

Examples:
  matchbench plan castle office --matchers sift,orb --estimator best --shards 16 --out plans/both
  matchbench work plans/both --shard 1       # on any machine; and 2 to 16
  matchbench merge plans/both --out runs/both
  matchbench plan castle --matches mine=mine/matches --shards 16 --out plans/mine
  matchbench plan study.toml --shards 16 --out plans/study")]
pub(crate) struct PlanArgs {
    /// Dataset folders, or one run file, whose name ends in .toml
    #[arg(value_name = "DATASET", required = true)]
    pub datasets: Vec<PathBuf>,
    /// Matchers, separated by commas, or `all` (see `matchbench list matchers`); a path is that of the manifest
    /// of a matcher from outside, which every machine must have at the same path
    #[arg(
        long,
        value_name = "IDS",
        value_delimiter = ',',
        value_parser = trimmed
    )]
    pub matchers: Vec<String>,
    #[command(flatten)]
    pub choices: ChoiceArgs,
    /// How many shards; several per machine balance machines of different speed
    #[arg(long, value_name = "N", value_parser = from_one::<NonZeroU32>)]
    pub shards: NonZeroU32,
    /// Folder of the plan. The shards are written into it too, unless another place is given
    #[arg(long, value_name = "PLAN")]
    pub out: PathBuf,
    // The last: what follows stands under its heading.
    #[command(flatten)]
    pub files: MatchesArgs,
}

#[derive(Debug, Args)]
#[command(after_help = "\
A shard that was stopped or killed is resumed by the same command; one that is done is left as it
is. A folder of another plan is refused, and so are other datasets, matchers or versions than
those planned.

Machines with a shared folder need nothing else. Without one, copy PLAN to each machine, and the
folders PLAN/shards/K back to one place, or name the copies to `matchbench merge`.

Examples:
  matchbench work plans/both --shard 3
  matchbench work plans/both --shard 3 --data /local/castle --data /local/office")]
pub(crate) struct WorkArgs {
    /// The folder of a plan, or its plan.json
    #[arg(value_name = "PLAN")]
    pub plan: PathBuf,
    /// Number of the shard, from 1
    #[arg(long, value_name = "K")]
    pub shard: u32,
    /// Folder of the shard [default: PLAN/shards/K]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// A dataset folder on this machine, if datasets are not where the plan has them; then give all of them
    /// (repeatable)
    #[arg(long, value_name = "DATASET")]
    pub data: Vec<PathBuf>,
    /// Where the files of planned matches are on this machine, if not where the plan has them (repeatable)
    #[arg(long, value_name = "NAME=PATH[,PATH]")]
    pub matches: Vec<String>,
    /// Folder of the feature cache, which shards may share [default: PLAN/cache]
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
    #[command(flatten)]
    pub threads: Threads,
    /// Try all failed pairs again, see `matchbench run`
    #[arg(long)]
    pub retry_failed: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "\
If shards are missing or not finished, they are named and nothing is written. If there are two
copies of a shard, they must agree.

Examples:
  matchbench merge plans/both --out runs/both
  matchbench merge plans/both node1/both node2/both --out runs/both")]
pub(crate) struct MergeArgs {
    /// The folder of a plan, or its plan.json
    #[arg(value_name = "PLAN")]
    pub plan: PathBuf,
    /// Copies of that folder, or folders of shards, from other machines
    #[arg(value_name = "COPY")]
    pub copies: Vec<PathBuf>,
    /// Folder of the run
    #[arg(long, value_name = "RUN")]
    pub out: PathBuf,
}

#[derive(Debug, Args)]
#[command(after_help = "\
The runs may differ in matchers, estimators and datasets. They must agree in the version of
matchbench, the seed, the pairs and the repetitions, and in the parameters of every matcher and
estimator that several of them have. If several have records of the same dataset, matcher and
estimator, those of the run that has the most are taken. The result is a run like any other, which
has each matcher with all of its estimators on all of its datasets: `run` goes on with it and
computes those that no run had, `eval` and `report` compare all its matchers. A run that is still
being written is refused.

Examples:
  matchbench join gpu/runs/learned runs/native --out runs/all
  matchbench report runs/all")]
pub(crate) struct JoinArgs {
    /// Folders of runs
    #[arg(value_name = "RUN", num_args = 2.., required = true, value_parser = run_folder())]
    pub runs: Vec<PathBuf>,
    /// Folder of the joined run, which must not hold a run yet
    #[arg(long, value_name = "RUN")]
    pub out: PathBuf,
}

/// The values of `--keep-matches`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum KeepArg {
    /// All selected matches: another estimator can use them, and the report draws them
    All,
    /// Those that agree with the estimated pose, of pairs that are done with this option; another estimator has to start
    /// from the features again
    Inliers,
    /// None; the report draws none, and another estimator has to start from the features again
    None,
}

impl ChoiceArgs {
    /// Which matches are kept on disk, if the option is given.
    pub(crate) fn kept(&self) -> Option<KeepMatches> {
        if self.no_matches {
            return Some(KeepMatches::None);
        }
        self.keep_matches.map(KeepMatches::from)
    }
}

impl From<KeepArg> for KeepMatches {
    fn from(keep: KeepArg) -> Self {
        match keep {
            KeepArg::All => Self::All,
            KeepArg::Inliers => Self::Inliers,
            KeepArg::None => Self::None,
        }
    }
}

#[derive(Debug, Args)]
#[command(after_help = "\
DATA holds the downloaded data, under their published names; --where lists them. What is there is
imported; what is missing is named and left out. OUT/index.html shows Tables 1 to 3 and Figures 1
to 3 with the published numbers beside ours; tables/ and figures/ have each as a file, report/ the
complete report, run/ the run, and paper.tex all of it for LaTeX. The same command resumes a run
that was stopped.

--quick takes 60 pairs of each sequence, evenly spread, without GAIM, CODE and RepMatch, and times
10 pairs, into OUT/quick. It shares datasets and features with the whole run.

For a study of your own, copy and change its run file: crates/matchbench/src/paper/paper.toml.

Examples:
  matchbench paper --where
  matchbench paper downloads --out paper --quick
  matchbench paper downloads --out paper --sequences 05,06")]
pub(crate) struct PaperArgs {
    /// Folder of the downloaded data
    #[arg(value_name = "DATA", required_unless_present = "where_to_find")]
    pub data: Option<PathBuf>,
    /// Folder for all results
    #[arg(long, value_name = "DIR", required_unless_present = "where_to_find")]
    pub out: Option<PathBuf>,
    /// Only these sequences, 01 to 08 [default: all]
    #[arg(long, value_name = "NN", value_delimiter = ',', value_parser = trimmed)]
    pub sequences: Vec<String>,
    /// A quick look: some pairs of each sequence, without the slow matchers
    #[arg(long)]
    pub quick: bool,
    /// Change a parameter (repeatable)
    #[arg(long, value_name = "ID.NAME=VALUE")]
    pub set: Vec<String>,
    /// Say what to download, how large it is, and where to put it
    #[arg(long = "where", exclusive = true)]
    pub where_to_find: bool,
    #[command(flatten)]
    pub threads: Threads,
}

/// Matches from the files of another tool.
#[derive(Debug, Args)]
#[command(next_help_heading = "Matches from files")]
pub(crate) struct MatchesArgs {
    /// Matches of another tool, under the name that they get in tables: files, a folder of files, or a folder
    /// with one folder for each dataset (repeatable; see `matchbench list formats`)
    #[arg(long, value_name = "NAME=PATH[,PATH]")]
    pub matches: Vec<String>,
    /// The format [default: recognised by the content of the files]
    #[arg(long, value_name = "FORMAT", requires = "matches")]
    pub matches_format: Option<String>,
    /// Where the centre of the first pixel is in these files, 0 or 0.5 [default: what the format says]
    #[arg(long, value_name = "0|0.5", requires = "matches")]
    pub pixel_center: Option<f64>,
    /// The points are in pixels of images that were resized to this size
    #[arg(long, value_name = "WxH", requires = "matches", value_parser = size)]
    pub resized: Option<[u32; 2]>,
    /// Read the matches that the tool verified (COLMAP's two-view geometries)
    #[arg(long, requires = "matches")]
    pub verified: bool,
    /// A note about the matches, which is kept in plan and report (repeatable)
    #[arg(long, value_name = "KEY=VALUE", requires = "matches")]
    pub note: Vec<String>,
}

impl MatchesArgs {
    /// Whether it is said how to read files.
    pub(crate) fn has_options(&self) -> bool {
        self.matches_format.is_some()
            || self.pixel_center.is_some()
            || self.resized.is_some()
            || self.verified
            || !self.note.is_empty()
    }
}

// As clap would write it, in lines of the usual width.
#[derive(Debug, Args)]
#[command(override_usage = "\
matchbench tune [OPTIONS] --parameter <ESTIMATOR.NAME> --values <VALUES> --out <DIR>
                       <--matchers <IDS>|--matches <NAME=PATH[,PATH]>> <DATASET>...")]
#[command(after_help = "\
Values are tried under the protocol `matchbench` alone, in images as they are. Under another
protocol, which may have images of another size, another value may be best.

Example:
  matchbench tune kitchen --matchers sift,orb --parameter ransac-e.threshold_px \\
                  --values 0.5,0.75,1,1.5,2 --out tuning
  matchbench run castle --matchers sift --tuned tuning/tuned.json --out runs/castle
  matchbench tune kitchen --matches loma=loma --parameter best.threshold_px --values 1,2 --out t")]
#[command(group(one_of("matched_by", ["matchers", "matches"])))]
pub(crate) struct TuneArgs {
    /// Dataset folders; do not report on any of them later
    #[arg(value_name = "DATASET", required = true)]
    pub datasets: Vec<PathBuf>,
    /// Matchers whose matches are used, separated by commas; a path is that of the manifest of a matcher from
    /// outside
    #[arg(long, value_name = "IDS", value_delimiter = ',', value_parser = trimmed)]
    pub matchers: Vec<String>,
    /// The parameter (see `matchbench list estimators`)
    #[arg(long, value_name = "ESTIMATOR.NAME")]
    pub parameter: String,
    /// The values to try, separated by commas
    #[arg(long, value_name = "VALUES", value_delimiter = ',', required = true, value_parser = trimmed)]
    pub values: Vec<String>,
    /// Folder of the run that tries the values; running the command again resumes it
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    #[command(flatten)]
    pub threads: Threads,
    /// Only the first N pairs of each dataset
    #[arg(long, value_name = "N", value_parser = from_one::<NonZeroUsize>)]
    pub limit: Option<NonZeroUsize>,
    /// Seed of all random choices
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u64,
    /// Run every pair N times
    #[arg(long, value_name = "N", default_value_t = NonZeroU32::MIN, value_parser = from_one::<NonZeroU32>)]
    pub repeat: NonZeroU32,
    /// Change another parameter (repeatable)
    #[arg(long, value_name = "ID.NAME=VALUE")]
    pub set: Vec<String>,
    /// Folder of the feature cache [default: DIR/cache]
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
    // The last: what follows stands under its heading.
    #[command(flatten)]
    pub files: MatchesArgs,
}

// As clap would write it, in lines of the usual width.
#[derive(Debug, Args)]
#[command(override_usage = "\
matchbench show [OPTIONS] --out <FILE> <--matcher <ID>|--matches <NAME=PATH[,PATH]>>
                       <DATASET> <A> <B>")]
#[command(after_help = "\
Lines join the selected matches. Their colour is the Sampson distance from the true epipolar
geometry, or the distance from where the true homography takes the point: green below 1 pixel, blue
below 3, orange below 10, red beyond. Solid lines are within 1 pixel of the estimate (3 pixels of a
homography), dashed ones are not: red and solid is what misled the estimator. Drawn in image b are a
few epipolar lines, or with an estimator of homographies the frame of image a: the true ones white,
the estimated ones yellow.

Examples:
  matchbench show office 0 7 --matcher sift --out pair.png
  matchbench show office 0 7 --matcher orb --estimator best --keypoints --out pair.svg
  matchbench show boat 0 3 --matcher sift --estimator best-h --out pair.png
  matchbench show office 0 7 --matches lightglue=hloc --out pair.png")]
#[command(group(one_of("matched_by", ["matcher", "matches"])))]
pub(crate) struct ShowArgs {
    /// The dataset folder
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
    /// First image of the pair: its number, counted from 0, or its name
    #[arg(value_name = "A")]
    pub a: String,
    /// Second image of the pair
    #[arg(value_name = "B")]
    pub b: String,
    /// The matcher (see `matchbench list matchers`); a path is that of the manifest of a matcher from outside
    #[arg(long, value_name = "ID", conflicts_with = "matches")]
    pub matcher: Option<String>,
    /// The estimator of poses or homographies [default: the one that belongs to the matcher; best for matches from
    /// files]
    #[arg(long, value_name = "ID")]
    pub estimator: Option<String>,
    /// The picture to write, .png or .svg
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Seed of all random choices
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u64,
    /// Change a parameter (repeatable)
    #[arg(long, value_name = "ID.NAME=VALUE")]
    pub set: Vec<String>,
    /// Draw all keypoints too
    #[arg(long)]
    pub keypoints: bool,
    // The last: what follows stands under its heading.
    #[command(flatten)]
    pub files: MatchesArgs,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Detection and description are timed for an image; search, selection and pose for a pair, with the
estimator of the matcher (or best-h if the dataset has only homographies); with one thread and
without a cache, after a few pairs to warm up. Medians, with quartiles in brackets.
The first pairs are measured again at the end: where they then take another time, or single times
lie far from all others, a warning says that the machine was not quiet.

Examples:
  matchbench time office --matchers sift,orb
  matchbench time office --matchers all --pairs 20
  matchbench time office --matchers sift --set sift.ratio=0.7")]
pub(crate) struct TimeArgs {
    /// The dataset folder
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
    /// Matchers of `matchbench list matchers`, separated by commas, or `all`
    #[arg(long, value_name = "IDS", value_delimiter = ',', required = true, value_parser = trimmed)]
    pub matchers: Vec<String>,
    /// The first N pairs, or all if there are fewer
    #[arg(long, value_name = "N", default_value = "200", value_parser = from_one::<NonZeroUsize>)]
    pub pairs: NonZeroUsize,
    /// Change a parameter (repeatable)
    #[arg(long, value_name = "ID.NAME=VALUE")]
    pub set: Vec<String>,
    /// Also write means, medians and quartiles, as comma-separated values
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Also write the paper's Table 3: means, with medians in brackets
    #[arg(long, value_name = "FILE")]
    pub latex: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Starts the matcher and matches two pairs, one of them twice, and a pair of tiny images. Where the
truth of the pairs is known, as in the built-in scene, it says whether the points can be right, or
which usual mistake explains them.

Exit codes: 0 nothing is WRONG (what is doubtful works, but not as most would like); 1 the matcher
could not be tried, for example since its manifest cannot be read; 2 something is WRONG.

Example:
  matchbench check adapters/opencv/sift.toml
  matchbench check ./mine.toml office --set mine.max_size=640")]
pub(crate) struct CheckArgs {
    /// The manifest of the matcher (`adapters/README.md` shows how to write one)
    #[arg(value_name = "MANIFEST")]
    pub manifest: PathBuf,
    /// A dataset folder whose images are matched [default: a built-in scene]
    #[arg(value_name = "DATASET")]
    pub dataset: Option<PathBuf>,
    /// Change a parameter (repeatable)
    #[arg(long, value_name = "NAME.KEY=VALUE")]
    pub set: Vec<String>,
}

/// `640x480`: width and height.
fn size(text: &str) -> Result<[u32; 2], String> {
    let sides = text
        .split_once('x')
        .and_then(|(width, height)| Some([width.parse().ok()?, height.parse().ok()?]));
    sides.ok_or_else(|| "give a width and a height, for example 640x480".to_owned())
}
