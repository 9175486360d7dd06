//! Arguments of the commands about results: scores, reports, comparisons, other formats.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{from_one, one_of, run_folder, trimmed};
use crate::threads::Threads;

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  matchbench eval runs/first
  matchbench eval Results --datasets Dataset
  matchbench eval Results --preset paper --format latex
  matchbench eval --errors zeb/root_sift --format csv
  matchbench eval runs/first --protocol superglue,roma
  matchbench eval --errors zeb/root_sift --protocol zeb")]
#[command(group(one_of("scored", ["results", "errors"])))]
pub(crate) struct EvalArgs {
    /// A run folder, or a folder with the authors' <sequence>/<matcher>.txt files
    #[arg(value_name = "RESULTS", value_parser = run_folder())]
    pub results: Option<PathBuf>,
    #[command(flatten)]
    pub scored: ScoredArgs,
    /// Score published pose errors instead: a folder with one table per dataset, whose header names its columns
    /// (CSV, or the tables of ZEB). Columns `a` and `b` name the images of a pair, so that intervals know which pairs
    /// share one. CSV output then ends with a row `mean`
    #[arg(long, value_name = "DIR", conflicts_with_all = ["results", "datasets", "pairs", "preset"])]
    pub errors: Option<PathBuf>,
    /// Score by the protocol of another benchmark, and say where the run departed from it: protocols of
    /// `matchbench list protocols`, separated by commas, or `all`. If the run was made under protocols of other
    /// benchmarks, `all` are those that it was made under
    #[arg(long, value_name = "IDS", value_delimiter = ',', value_parser = trimmed)]
    pub protocol: Vec<String>,
    /// How to write the scores
    #[arg(long, value_enum, default_value_t = FormatArg::Table)]
    pub format: FormatArg,
    /// Write the 95 % interval behind each AUC of the formats latex and markdown, or with --protocol behind each score,
    /// also of the format table
    #[arg(long)]
    pub intervals: bool,
    /// Write to a file instead of standard output
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub threads: Threads,
}

/// Which pairs of results are scored.
#[derive(Debug, Args)]
pub(crate) struct ScoredArgs {
    /// Folder that holds <sequence>/pairs.txt, for results in the authors' format without a groundtruth.txt
    /// beside them
    #[arg(long, value_name = "DIR")]
    pub datasets: Option<PathBuf>,
    /// Score only the pairs that this rule chooses among the listed ones: all, fragments:N, window:N or
    /// list:FILE. Images are numbered as in the results, after any stride; a list may name them, if the dataset is
    /// in DIR of --datasets, or where its run had it
    #[arg(long, value_name = "RULE")]
    pub pairs: Option<String>,
    /// Score the pairs that a publication scores: `paper` takes every image with the next 9 in sequences 06 to
    /// 08, and the listed pairs in all others
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
    /// Aligned text, for reading
    Table,
    /// One row per dataset, matcher and estimator, full precision
    Csv,
    /// Everything, full precision
    Json,
    /// Markdown, for GitHub or a wiki
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
  figures/    every figure as SVG, PNG, PDF and Vega-Lite specification
  tables/     scores.csv .json .md, auc.tex (the paper's Table 2), pairs.csv .parquet
  cite/       how a paper would say what was run, the BibTeX of all papers that took part, and the
              commands that compute all of it again

Pictures need the dataset at the path that it had, and the matches of the run. A run with
--keep-matches none has no pictures of matches; with `inliers` they show only the inliers.

Examples:
  matchbench report runs/first
  matchbench report runs/first --pictures all --out first-report
  matchbench report runs/first --bundle first.html
  matchbench report Results --datasets Dataset --preset paper --out paper-report")]
pub(crate) struct ReportArgs {
    /// A run folder, or a folder with the authors' <sequence>/<matcher>.txt files
    #[arg(value_name = "RUN", value_parser = run_folder())]
    pub run: PathBuf,
    /// Folder of the report [default: RUN/report]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Write the report as one page of at most 5 MB instead, which can be mailed: tables, figures, the list of
    /// pairs, as many pictures as fit, and the tables as files that can be saved; `-` is standard output
    #[arg(long, value_name = "FILE.html", conflicts_with = "out")]
    pub bundle: Option<PathBuf>,
    /// Of a run: how many pairs of each dataset have pictures, in the page as many as fit, and in the folder pairs
    /// beside it; `all` for every pair [default: 16]
    #[arg(long, value_name = "N|all", value_parser = number_or_all)]
    pub pictures: Option<usize>,
    /// Of a run: folder of the feature cache, from which keypoints are taken for pictures [default: RUN/cache]
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
    #[command(flatten)]
    pub threads: Threads,
    // The last: what follows stands under this heading.
    #[command(
        flatten,
        next_help_heading = "Only of the authors' files (a run's report scores all pairs of its own datasets)"
    )]
    pub scored: ScoredArgs,
}

#[derive(Debug, Args)]
#[command(after_help = "\
ENTRIES may hold, at any depth, folders of runs and folders with the authors'
<sequence>/<matcher>.txt files, of anybody. Every score is computed from the records and files; no
table is believed. An entry that is damaged, not finished or not what it says is listed with the
reason and left out, and the exit code is 2. Links are not followed.

Results are ranked together if they have the same dataset (name and fingerprint), pairs and
protocol. Tables have 95 % intervals and letters: methods that share a letter do not differ
significantly. If the dataset of a run is found, the errors in its records are computed again from
the poses.

SITE opens from disk without a network, and any web server can show it:
  index.html        a table and figures of each group, the hash of what each row was computed
                    from, and the commands that compute it again
  leaderboard.csv   the same with all scores at full precision
  leaderboard.json

Examples:
  matchbench leaderboard entries --out site
  matchbench leaderboard entries --datasets data --out site")]
pub(crate) struct LeaderboardArgs {
    /// The folder that contains runs and results
    #[arg(value_name = "ENTRIES")]
    pub entries: PathBuf,
    /// Folder of the page
    #[arg(long, value_name = "SITE")]
    pub out: PathBuf,
    /// Folder that holds the datasets, by their names. It is needed for results without a groundtruth.txt, and
    /// to compute the errors of records again [default: where the runs had them]
    #[arg(long, value_name = "DIR")]
    pub datasets: Option<PathBuf>,
    #[command(flatten)]
    pub threads: Threads,
}

#[derive(Debug, Args)]
#[command(after_help = "\
For each matcher with each estimator on each dataset that both runs have, on the pairs that both
have: the AUC before and after, the change with its paired 95 % interval (both runs see the same
pairs, so the interval is that of the change) and the p-value of its paired t test, the pairs gained
and lost at 5 degrees, and a verdict in words: better, worse, not certain, or the same. Each
comparison is tested alone; p-values of several need a correction, for example Holm's.

With --matchers FIRST,SECOND two methods are compared instead: both of one run or, if AFTER is
given, FIRST of BEFORE with SECOND of AFTER. A name is MATCHER+ESTIMATOR, or a matcher, which is
compared with each estimator that both have.

--out writes a page of the pairs where they differ most: both side by side, with errors and
matches, and pairs.csv with all pairs and repetitions.

Examples:
  matchbench run office --matchers sift --set sift.ratio=0.7 --out runs/strict
  matchbench compare runs/first runs/strict
  matchbench compare runs/first runs/strict --out strict
  matchbench compare runs/first --matchers sift,orb --out sift-orb
  matchbench compare runs/first --matchers sift+ransac-e,sift+best")]
pub(crate) struct CompareArgs {
    /// The first run, before a change
    #[arg(value_name = "BEFORE", value_parser = run_folder())]
    pub before: PathBuf,
    /// The second run, after the change
    #[arg(value_name = "AFTER", value_parser = run_folder())]
    pub after: Option<PathBuf>,
    /// Two methods to compare with each other, separated by a comma
    #[arg(long, value_name = "FIRST,SECOND", value_delimiter = ',', num_args = 1, value_parser = trimmed)]
    pub matchers: Vec<String>,
    /// Folder of a page that shows the pairs where they differ most
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// How many pairs of each dataset the page shows on which the first method wins, and as many on which the
    /// second wins
    #[arg(long, value_name = "N", default_value = "6", requires = "out", value_parser = from_one::<NonZeroUsize>)]
    pub pairs: NonZeroUsize,
    #[command(flatten)]
    pub threads: Threads,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Matches are written to OUT/<matcher>/<dataset>, inliers to OUT/<matcher>+<estimator>/<dataset>, each
readable again: matchbench run DATASET --matches NAME=OUT/<matcher> --out RUN. If the format is
npz, this also needs --pixel-center 0.

Examples:
  matchbench export runs/first poses
  matchbench export runs/first colmap --format colmap
  matchbench export runs/first hloc --format hloc --inliers best")]
pub(crate) struct ExportArgs {
    /// A run folder
    #[arg(value_name = "RUN", value_parser = run_folder())]
    pub run: PathBuf,
    /// Folder to write into
    #[arg(value_name = "OUT")]
    pub out: PathBuf,
    /// authors (poses, as <dataset>/<matcher>.txt), or matches as colmap, hloc, glue-factory, npz or
    /// packed
    #[arg(long, value_name = "FORMAT", default_value = "authors")]
    pub format: String,
    /// Only the inliers of this estimator, instead of all selected matches. If it estimates fundamental
    /// matrices: as many matches as it had inliers, those nearest to the pose
    #[arg(long, value_name = "ESTIMATOR")]
    pub inliers: Option<String>,
    /// Where datasets are now, if they were moved, separated by commas (repeatable); a comma in the name of a folder that
    /// exists separates nothing
    #[arg(long, value_name = "DATASET")]
    pub datasets: Vec<PathBuf>,
}

/// `all` means as many as there are.
fn number_or_all(text: &str) -> Result<usize, String> {
    match text {
        "all" => Ok(usize::MAX),
        number => (number.parse()).map_err(|_| "give a number, or `all`".to_owned()),
    }
}
