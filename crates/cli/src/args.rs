//! What can be typed. Parsing only; each subcommand's work is in `commands/`.

use std::num::{NonZeroU32, NonZeroUsize};
use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

/// Which feature matcher should I use?
///
/// matchbench runs feature matchers on pairs of images with known cameras, estimates the relative
/// pose from the matches, compares it with the truth, and shows which matcher leads to how many
/// right poses, with how many matches, in what time.
#[derive(Debug, Parser)]
#[command(name = "matchbench", version, arg_required_else_help = true, after_help = FIRST_STEPS)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

const FIRST_STEPS: &str = "\
First steps:
  matchbench demo                                        a first report, on built-in data
  matchbench import tum rgbd_dataset_freiburg3_... office --pairs window:9,stride:15
  matchbench validate office                             are the data sound?
  matchbench run office --matchers sift --out runs/first
  matchbench eval runs/first                             the scores

Exit codes: 0 done; 1 bad input; 2 finished, but some tasks failed; 130 stopped by Ctrl-C.";

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run five matchers on built-in scenes and write a report: the quickest way to see what this is
    Demo(DemoArgs),
    /// Turn the field's data sets and pair lists, a COLMAP model or your own data into a dataset
    Import(ImportArgs),
    /// Write a dataset in the layout of another tool
    Convert(ConvertArgs),
    /// Run matchers on datasets; can be stopped and resumed at any time
    Run(RunArgs),
    /// Choose a parameter of an estimator, on scenes other than those that will be reported
    Tune(TuneArgs),
    /// Score a run, or results in the format of the paper's authors
    Eval(EvalArgs),
    /// Write the report of a run: a page to look at, figures and tables
    Report(ReportArgs),
    /// Draw one pair: both images, the matches by their true error, epipolar lines
    Show(ShowArgs),
    /// Measure how long matchers take, by the paper's protocol
    Time(TimeArgs),
    /// Say what changed between two runs, with intervals
    Compare(CompareArgs),
    /// Write a run's poses in the format of the paper's authors, or its matches for other tools
    Export(ExportArgs),
    /// Show what is available, with every parameter
    List(ListArgs),
    /// Check a dataset; name every problem by file and line, and say how to mend it
    Validate(ValidateArgs),
    /// Try out a matcher from outside; say in words what is wrong with it
    Check(CheckArgs),
    /// Print what a shell needs to complete commands and options
    Completions(CompletionsArgs),
    /// Print the manual page, or write those of all commands
    Man(ManArgs),
}

/// More threads than any machine of today makes use of.
const MOST_THREADS: usize = 1024;

/// How many threads a command has for all that it does.
#[derive(Clone, Copy, Debug, Default, Args)]
pub(crate) struct Threads {
    /// Threads; results do not depend on it [default: all cores]
    #[arg(long = "threads", value_name = "N", value_parser = threads)]
    pub number: Option<NonZeroUsize>,
}

impl Command {
    /// What `--threads` says, where the command has that option.
    pub(crate) fn threads(&self) -> Option<NonZeroUsize> {
        let threads = match self {
            Self::Demo(args) => args.threads,
            Self::Run(args) => args.threads,
            Self::Tune(args) => args.threads,
            Self::Eval(args) => args.threads,
            Self::Report(args) => args.threads,
            Self::Compare(args) => args.threads,
            Self::Validate(args) => args.threads,
            // One pair, one thread, or nothing to share out.
            Self::Import(_)
            | Self::Convert(_)
            | Self::Show(_)
            | Self::Time(_)
            | Self::Export(_)
            | Self::Check(_)
            | Self::List(_)
            | Self::Completions(_)
            | Self::Man(_) => Threads::default(),
        };
        threads.number
    }
}

#[derive(Debug, Args)]
pub(crate) struct DemoArgs {
    /// Matchers, separated by commas, or `all`, which takes several minutes
    #[arg(
        long,
        value_name = "IDS",
        value_delimiter = ',',
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
Examples:
  matchbench import tum rgbd_dataset_freiburg3_long_office_household 06-office-wide --pairs window:9,stride:15
  matchbench import kitti dataset 04-kitti --sequence 00 --pairs fragments:5
  matchbench import strecha castle-P30 05-castle --pairs all
  matchbench import folder photos mine --poses photos/poses.txt --camera photos/K.txt
  matchbench import superglue scannet_test_pairs_with_gt.txt scannet-1500 --image-root ScanNet
  matchbench import scannet test.npz scannet-1500 --intrinsics intrinsics.npz --image-root ScanNet
  matchbench import megadepth 0015_0.1_0.3.npz st-peters --image-root MegaDepth
  matchbench import colmap sparse/0 church --image-root images --pairs covisible:0.1..0.7
  matchbench import oxford boat oxford-boat

Which options a KIND has: matchbench list datasets. Where images are not there, the dataset names
where they belong, and `matchbench validate` says which are missing.

The pairs of the paper, and more:
  fragments:15        consecutive fragments of 15 frames, the first of each against its others
  all                 every image against every later one
  window:9            every image against the next 9
  window:9,stride:15  the same on every 15th image; the others are left out
  list:FILE           pairs `a b` of image numbers, one pair a line
  covisible:0.1..0.7  pairs that share such a part of their points (COLMAP models)")]
pub(crate) struct ImportArgs {
    /// What SRC is: tum, kitti, strecha, 7scenes, folder, superglue, scannet, megadepth, colmap,
    /// imc, euroc, zeb, hpatches, oxford or evd
    #[arg(value_name = "KIND")]
    pub kind: String,
    /// The data as their authors publish them: a folder, a list, a model
    #[arg(value_name = "SRC")]
    pub source: PathBuf,
    /// The dataset to be made; the folder's name becomes the dataset's name
    #[arg(value_name = "OUT")]
    pub out: PathBuf,
    /// Which images are matched with which [default: what the paper does with this kind, or those
    /// that SRC lists]
    #[arg(long, value_name = "RULE")]
    pub pairs: Option<String>,
    /// Which sequence, where SRC holds several (KITTI: 00 to 10; HPatches: i, v or a folder)
    #[arg(long, value_name = "NN")]
    pub sequence: Option<String>,
    /// What happens to the images: they stay where they are, are linked to, or are copied
    #[arg(long, value_enum, default_value_t = Images::Reference)]
    pub images: Images,
    /// 3x3 calibration matrix (and distortion `k1 k2 p1 p2 [k3]`), where SRC has none or another is wanted
    #[arg(long, value_name = "FILE")]
    pub camera: Option<PathBuf>,
    /// The poses (KIND folder), in TUM or KITTI format
    #[arg(long, value_name = "FILE")]
    pub poses: Option<PathBuf>,
    /// Largest difference in time between an image and its pose, in seconds [default: 0.02]
    #[arg(long, value_name = "SECONDS")]
    pub tolerance: Option<f64>,
    /// Interpolate between the poses before and after an image instead of taking the nearest
    #[arg(long)]
    pub interpolate: bool,
    /// Folder that the image names in SRC start from [default: beside SRC]
    #[arg(long, value_name = "DIR")]
    pub image_root: Option<PathBuf>,
    /// The calibration matrices (ScanNet's intrinsics.npz) [default: beside SRC]
    #[arg(long, value_name = "FILE")]
    pub intrinsics: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Layouts:
  colmap     a folder with a COLMAP model as text (cameras, images, no points) and pairs.txt
  superglue  a file with SuperGlue's 38 columns per pair: names, turns, K, K, T_0to1

Both can be imported again, as kinds of the same names. The images are not copied.

Examples:
  matchbench convert castle castle-model --format colmap
  matchbench convert castle castle-pairs.txt --format superglue")]
pub(crate) struct ConvertArgs {
    /// The dataset folder
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
    /// What is to be written; it must not exist
    #[arg(value_name = "OUT")]
    pub out: PathBuf,
    /// The layout: colmap or superglue
    #[arg(long, value_name = "LAYOUT")]
    pub format: String,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Images {
    /// The dataset names the files where they are
    Reference,
    /// Symbolic links in the dataset's folder
    Link,
    /// Copies in the dataset's folder: it can be moved and mailed
    Copy,
}

#[derive(Debug, Args)]
pub(crate) struct RunArgs {
    /// Dataset folders (made by `matchbench import`, or in the format of the paper's authors)
    #[arg(value_name = "DATASET", required = true)]
    pub datasets: Vec<PathBuf>,
    /// Matchers, separated by commas, or `all` (see `matchbench list matchers`); a path is the manifest of
    /// a matcher from outside (see `matchbench check`)
    #[arg(
        long,
        value_name = "IDS",
        value_delimiter = ',',
        required_unless_present = "matches"
    )]
    pub matchers: Vec<String>,
    #[command(flatten)]
    pub files: MatchesArgs,
    /// Pose estimators, separated by commas [default: the one that belongs to each matcher; best
    /// for matches from files]
    #[arg(long, value_name = "IDS", value_delimiter = ',')]
    pub estimator: Vec<String>,
    /// Folder of the run; one that is there already is resumed, and may grow by datasets, matchers
    /// and estimators
    #[arg(long, value_name = "RUN")]
    pub out: PathBuf,
    #[command(flatten)]
    pub threads: Threads,
    /// Only the first N pairs of each dataset
    #[arg(long, value_name = "N")]
    pub limit: Option<usize>,
    /// Root of all random choices
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u64,
    /// Do every pair N times, each time with other random choices; scores are means
    #[arg(long, value_name = "N", default_value_t = NonZeroU32::MIN)]
    pub repeat: NonZeroU32,
    /// Change a parameter, for example --set sift.ratio=0.7 (repeatable; see `matchbench list`)
    #[arg(long, value_name = "ID.NAME=VALUE")]
    pub set: Vec<String>,
    /// Let an estimator draw samples for at most so many milliseconds a pair, to compare estimators
    /// at equal time (raise max_iterations with --set). Results then differ from run to run
    #[arg(long, value_name = "MS")]
    pub time_budget: Option<NonZeroU32>,
    /// Take over what `matchbench tune` chose; refused on the scenes that it was tuned on
    /// (repeatable)
    #[arg(long, value_name = "FILE")]
    pub tuned: Vec<PathBuf>,
    /// Folder of the feature cache [default: RUN/cache]
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
    /// Do not write the selected matches to RUN/matches (20 bytes each). Without them another
    /// estimator starts from the features again, and the report shows no matches
    #[arg(long)]
    pub no_matches: bool,
    /// Write RUN/report when done
    #[arg(long)]
    pub report: bool,
}

/// Matches from the files of another tool.
#[derive(Debug, Args)]
#[command(next_help_heading = "Matches from files")]
pub(crate) struct MatchesArgs {
    /// Matches of another tool under the name that they have in tables: files, a folder of files, or
    /// a folder with one for each dataset (repeatable; see `matchbench list formats`)
    #[arg(long, value_name = "NAME=PATH[,PATH]")]
    pub matches: Vec<String>,
    /// The format, if it is not to be recognised
    #[arg(long, value_name = "FORMAT", requires = "matches")]
    pub matches_format: Option<String>,
    /// Where the centre of the first pixel is in these files, 0 or 0.5 [default: what the format says]
    #[arg(long, value_name = "0|0.5", requires = "matches")]
    pub pixel_center: Option<f64>,
    /// The points are those of images resized to this size
    #[arg(long, value_name = "WxH", requires = "matches", value_parser = size)]
    pub resized: Option<[u32; 2]>,
    /// Read the matches that the tool verified (COLMAP's two-view geometries)
    #[arg(long, requires = "matches")]
    pub verified: bool,
    /// What is to be remembered with the matches, in plan and report (repeatable)
    #[arg(long, value_name = "KEY=VALUE", requires = "matches")]
    pub note: Vec<String>,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  matchbench tune kitchen --matchers sift,orb --parameter ransac-e.threshold_px \\
                  --values 0.5,0.75,1,1.5,2 --out tuning
  matchbench run castle --matchers sift --tuned tuning/tuned.json --out runs/castle")]
pub(crate) struct TuneArgs {
    /// Dataset folders; none of them may be reported on later
    #[arg(value_name = "DATASET", required = true)]
    pub datasets: Vec<PathBuf>,
    /// Matchers whose matches are used, separated by commas
    #[arg(long, value_name = "IDS", value_delimiter = ',', required = true)]
    pub matchers: Vec<String>,
    /// The parameter (see `matchbench list estimators`)
    #[arg(long, value_name = "ESTIMATOR.NAME")]
    pub parameter: String,
    /// The values to try, separated by commas
    #[arg(long, value_name = "VALUES", value_delimiter = ',', required = true)]
    pub values: Vec<String>,
    /// Folder of the run behind it; running again resumes
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    #[command(flatten)]
    pub threads: Threads,
    /// Only the first N pairs of each dataset
    #[arg(long, value_name = "N")]
    pub limit: Option<usize>,
    /// Root of all random choices
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u64,
    /// Do every pair N times
    #[arg(long, value_name = "N", default_value_t = NonZeroU32::MIN)]
    pub repeat: NonZeroU32,
    /// Change another parameter (repeatable)
    #[arg(long, value_name = "ID.NAME=VALUE")]
    pub set: Vec<String>,
    /// Folder of the feature cache [default: DIR/cache]
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  matchbench eval runs/first
  matchbench eval Results --datasets Dataset
  matchbench eval Results --preset paper --format latex
  matchbench eval --errors zeb/root_sift --format csv")]
pub(crate) struct EvalArgs {
    /// A run folder, or a folder with the authors' <sequence>/<matcher>.txt files
    #[arg(value_name = "RESULTS", required_unless_present = "errors")]
    pub results: Option<PathBuf>,
    #[command(flatten)]
    pub scored: ScoredArgs,
    /// Score published pose errors instead: a folder with one table a dataset, whose header names
    /// its columns (CSV, or the tables of ZEB). CSV then ends with a row `mean`
    #[arg(long, value_name = "DIR", conflicts_with_all = ["results", "datasets", "pairs", "preset"])]
    pub errors: Option<PathBuf>,
    /// How to write the scores
    #[arg(long, value_enum, default_value_t = FormatArg::Table)]
    pub format: FormatArg,
    /// Write to a file instead of standard output
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub threads: Threads,
}

/// Which pairs of results are scored.
#[derive(Debug, Args)]
pub(crate) struct ScoredArgs {
    /// Folder that holds <sequence>/pairs.txt, for the authors' format where no groundtruth.txt
    /// stands beside the results
    #[arg(long, value_name = "DIR")]
    pub datasets: Option<PathBuf>,
    /// Score only the pairs that this rule chooses among the listed ones: fragments:N, window:N or
    /// list:FILE. Images are numbered as in the results, after any stride
    #[arg(long, value_name = "RULE")]
    pub pairs: Option<String>,
    /// Score what a publication scores: `paper` takes every image with the next 9 of its sequences
    /// 06 to 08, and the listed pairs of all others
    #[arg(long, value_enum, conflicts_with = "pairs")]
    pub preset: Option<PresetArg>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum PresetArg {
    /// The pairs of the paper
    Paper,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum FormatArg {
    /// Aligned text, for people
    Table,
    /// One row per dataset, matcher and estimator, full precision
    Csv,
    /// Everything, full precision
    Json,
    /// For a forge or a wiki
    Markdown,
    /// Like the paper's Table 2
    Latex,
}

#[derive(Debug, Args)]
#[command(after_help = "\
The folder opens from disk without a network and can be mailed:
  index.html  AUC, SP curves, AP bars, times, AUC over baseline, angle and overlap, every pair in a
              list that sorts, and some of them as pictures
  pairs/      a page for each pair with pictures, all matchers on it
  figures/    every figure as SVG, PNG and Vega-Lite specification
  tables/     scores.csv .json .md, auc.tex (the paper's Table 2), pairs.csv .parquet
  cite/       how a paper would say what was run, and the BibTeX of all papers that took part

Pictures need the dataset where it was, and the matches of the run (not run with --no-matches).

Examples:
  matchbench report runs/first
  matchbench report runs/first --pictures all --out first-report
  matchbench report runs/first --bundle first.html
  matchbench report Results --datasets Dataset --preset paper --out paper-report")]
pub(crate) struct ReportArgs {
    /// A run folder, or a folder with the authors' <sequence>/<matcher>.txt files
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    #[command(flatten)]
    pub scored: ScoredArgs,
    /// Folder of the report [default: RUN/report]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write the report as one page of at most 5 MB instead, to be mailed: tables, figures, the list
    /// of pairs, as many pictures as there is room for, and the tables as files to be saved
    #[arg(long, value_name = "FILE.html", conflicts_with = "out")]
    pub bundle: Option<PathBuf>,
    /// Pairs of each dataset that have pictures, in the page as far as it has room and in the folder
    /// pairs beside it; `all` for every pair
    #[arg(long, value_name = "N|all", default_value = "16", value_parser = number_or_all)]
    pub pictures: usize,
    /// Folder of the feature cache, from which keypoints are drawn [default: RUN/cache]
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
    #[command(flatten)]
    pub threads: Threads,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Lines join the selected matches. Their colour is the distance to the true epipolar line: green below
1 pixel, blue below 3, orange below 10, red beyond. Solid lines agree with the estimated pose,
dashed ones do not: red and solid is what misled the estimator. A few epipolar lines are drawn,
the true ones white, the estimated ones yellow.

Examples:
  matchbench show office 0 7 --matcher sift --out pair.png
  matchbench show office 0 7 --matcher orb --estimator best --keypoints --out pair.svg")]
pub(crate) struct ShowArgs {
    /// The dataset folder
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
    /// First image of the pair, counted from 0
    #[arg(value_name = "A")]
    pub a: u32,
    /// Second image of the pair
    #[arg(value_name = "B")]
    pub b: u32,
    /// The matcher (see `matchbench list matchers`)
    #[arg(long, value_name = "ID")]
    pub matcher: String,
    /// The pose estimator [default: the one that belongs to the matcher]
    #[arg(long, value_name = "ID")]
    pub estimator: Option<String>,
    /// The picture to be written, .png or .svg
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Root of all random choices
    #[arg(long, value_name = "S", default_value_t = 0)]
    pub seed: u64,
    /// Change a parameter (repeatable)
    #[arg(long, value_name = "ID.NAME=VALUE")]
    pub set: Vec<String>,
    /// Draw all keypoints too
    #[arg(long)]
    pub keypoints: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Detection and description are timed for an image; search, selection and pose for a pair; with one
thread and without a cache, after a few pairs to warm up. Medians, with quartiles in brackets.
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
    /// Matchers, separated by commas, or `all`
    #[arg(long, value_name = "IDS", value_delimiter = ',', required = true)]
    pub matchers: Vec<String>,
    /// The first N pairs, or all where there are fewer
    #[arg(long, value_name = "N", default_value_t = 200)]
    pub pairs: usize,
    /// Change a parameter (repeatable)
    #[arg(long, value_name = "ID.NAME=VALUE")]
    pub set: Vec<String>,
    /// Write means, medians and quartiles too, as comma-separated values
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Write the paper's Table 3 too: means, medians in brackets
    #[arg(long, value_name = "FILE")]
    pub latex: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(after_help = "\
For each matcher with each estimator on each dataset that both runs have, on the pairs that both have:
the AUC before and after, the change with its paired 95 % interval (both runs see the same resampled
images, so the interval is that of the change), the pairs gained and lost at 5 degrees, and a
verdict in words: better, worse, not certain, or the same.

Example:
  matchbench run office --matchers sift --set sift.ratio=0.7 --out runs/strict
  matchbench compare runs/first runs/strict")]
pub(crate) struct CompareArgs {
    /// The run before
    #[arg(value_name = "BEFORE")]
    pub before: PathBuf,
    /// The run after
    #[arg(value_name = "AFTER")]
    pub after: PathBuf,
    #[command(flatten)]
    pub threads: Threads,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Matches are written to OUT/<matcher>/<dataset>, inliers to OUT/<matcher>+<estimator>/<dataset>, each
readable again: matchbench run DATASET --matches NAME=OUT/<matcher> --out RUN.

Examples:
  matchbench export runs/first poses
  matchbench export runs/first colmap --format colmap
  matchbench export runs/first hloc --format hloc --inliers best")]
pub(crate) struct ExportArgs {
    /// A run folder
    #[arg(value_name = "RUN")]
    pub run: PathBuf,
    /// Folder to write into
    #[arg(value_name = "OUT")]
    pub out: PathBuf,
    /// authors (poses, as <dataset>/<matcher>.txt), or matches as colmap, hloc, glue-factory, npz or
    /// packed
    #[arg(long, value_name = "FORMAT", default_value = "authors")]
    pub format: String,
    /// Only the matches that agree with the poses of this estimator, within its threshold, instead of
    /// all that were selected
    #[arg(long, value_name = "ESTIMATOR")]
    pub inliers: Option<String>,
    /// Datasets that are no longer where they were
    #[arg(long, value_name = "DATASET", value_delimiter = ',')]
    pub datasets: Vec<PathBuf>,
}

#[derive(Debug, Args)]
pub(crate) struct ListArgs {
    /// What to list [default: everything]
    #[arg(value_enum)]
    pub what: Option<Listed>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Listed {
    /// Matchers, their papers and parameters
    Matchers,
    /// Pose estimators, their papers and parameters
    Estimators,
    /// Built-in datasets, and the kinds that can be imported
    Datasets,
    /// Formats of matches from files
    Formats,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Starts the matcher, matches two pairs with known poses and one of tiny images, one of them twice, and
says what each came to: whether its points can be right, or by which mistake they would be.

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

#[derive(Debug, Args)]
pub(crate) struct ValidateArgs {
    /// The dataset folder
    #[arg(value_name = "DATASET")]
    pub dataset: PathBuf,
    #[command(flatten)]
    pub threads: Threads,
}

fn threads(text: &str) -> Result<NonZeroUsize, String> {
    let number = (text.parse().ok()).filter(|number: &NonZeroUsize| number.get() <= MOST_THREADS);
    number.ok_or_else(|| format!("give a number from 1 to {MOST_THREADS}"))
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  matchbench completions bash > ~/.local/share/bash-completion/completions/matchbench
  matchbench completions zsh > ~/.zfunc/_matchbench")]
pub(crate) struct CompletionsArgs {
    /// The shell
    #[arg(value_enum, value_name = "SHELL")]
    pub shell: clap_complete::Shell,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  matchbench man | man -l -
  matchbench man --out ~/.local/share/man/man1")]
pub(crate) struct ManArgs {
    /// Folder for matchbench.1 and a page for each command [default: matchbench.1 to standard output]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// `640x480`: width and height.
fn size(text: &str) -> Result<[u32; 2], String> {
    let sides = text
        .split_once('x')
        .and_then(|(width, height)| Some([width.parse().ok()?, height.parse().ok()?]));
    sides.ok_or_else(|| "give a width and a height, for example 640x480".to_owned())
}

/// `all` is as many as there are.
fn number_or_all(text: &str) -> Result<usize, String> {
    match text {
        "all" => Ok(usize::MAX),
        number => (number.parse()).map_err(|_| "give a number, or `all`".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn arguments_are_consistent() {
        Cli::command().debug_assert();
    }

    /// Every line of `text` that begins with the program's name must be understood.
    fn assert_understood(text: &str, place: &str) -> usize {
        let commands = text
            .lines()
            .map(str::trim)
            .filter(|line| line.starts_with("matchbench "));
        commands
            .map(|line| {
                let words = line
                    .split_whitespace()
                    .take_while(|word| !word.starts_with(['#', '>', '|']));
                if let Err(error) = Cli::try_parse_from(words) {
                    assert!(!error.use_stderr(), "{place}: {line}\n{error}");
                }
            })
            .count()
    }

    #[test]
    fn commands_in_the_readme_and_in_the_book_are_understood() {
        let repository = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        for (page, least) in [
            ("README.md", 2),
            ("crates/cli/README.md", 2),
            ("docs/tutorial.md", 8),
            ("docs/estimators.md", 2),
        ] {
            let text = std::fs::read_to_string(format!("{repository}/{page}"));
            let text = text.expect("it is part of the repository");
            let blocks = text.split("```").skip(1).step_by(2);
            let shell = blocks.filter_map(|block| block.strip_prefix("sh\n"));
            let count: usize = shell.map(|block| assert_understood(block, page)).sum();
            assert!(count >= least, "{page}: {count} commands");
        }
    }

    #[test]
    fn examples_in_the_help_are_understood() {
        let mut count = 0;
        for command in Cli::command().get_subcommands() {
            let mut command = command.clone().term_width(0);
            let help = command.render_long_help().to_string();
            let examples = help
                .split_once("Examples:")
                .map_or("", |(_, examples)| examples);
            count += assert_understood(examples, command.get_name());
        }
        assert!(count >= 10, "{count} examples");
    }
}
