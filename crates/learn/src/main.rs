//! `matchbench-learn`: makes patches, learns the tables of trained descriptors on them, and measures their
//! FPR95.

mod binary_tests;
mod boost;
mod evaluate;
mod lbgm;
mod metric;
mod pairs;
mod patches;
mod resume;

use std::fs;
use std::num::{ParseFloatError, ParseIntError};
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use clap::{Args, Parser, Subcommand};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use matchbench::files::write_whole;
use matchbench_vision::features::binboost::BinBoostTable;
use matchbench_vision::features::dlco::DlcoTable;
use matchbench_vision::seed::Seed;

use binary_tests::Kind;
use boost::BoostParams;
use evaluate::{Described, report};
use lbgm::LbgmTable;
use metric::MetricParams;
use patches::{PatchSet, Recipe};
use resume::Checkpoint;

/// A number of things that there must be.
fn count(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(0) => Err("must be 1 at least".to_owned()),
        count => count.map_err(|error: ParseIntError| error.to_string()),
    }
}

/// A number of pairs of patches: one of the same point and one of different points, at least.
fn count_of_pairs(text: &str) -> Result<usize, String> {
    match count(text)? {
        1 => Err("must be 2 at least".to_owned()),
        count => Ok(count),
    }
}

/// A number above 0.
fn positive(text: &str) -> Result<f64, String> {
    number(text, |number| number > 0.0, "must be above 0")
}

/// A number from 0 on.
fn not_negative(text: &str) -> Result<f64, String> {
    number(text, |number| number >= 0.0, "must be 0 at least")
}

fn number(text: &str, is_allowed: fn(f64) -> bool, rule: &str) -> Result<f64, String> {
    let number: f64 = (text.parse()).map_err(|error: ParseFloatError| error.to_string())?;
    if number.is_finite() && is_allowed(number) {
        Ok(number)
    } else {
        Err(rule.to_owned())
    }
}

/// Learns the tables of matchbench's trained descriptors from images with known cameras.
#[derive(Debug, Parser)]
#[command(name = "matchbench-learn", version, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Make a set of patches from datasets and rendered scenes
    Patches(PatchesArgs),
    /// FPR95 of SIFT and of tables on one part of a set
    Evaluate(EvaluateArgs),
    /// Learn BGM: each bit is one weak learner; the table has the form of BinBoost's
    Bgm(BgmArgs),
    /// Learn LBGM: a projection of BGM's answers to real values
    Lbgm(LbgmArgs),
    /// Learn BinBoost: each bit is a boosted combination of weak learners
    Binboost(BinboostArgs),
    /// Learn DLCO: pooling regions, then the projection
    Dlco(DlcoArgs),
    /// Choose the tests of ORB, FREAK or LATCH again, and compare them with the library's
    Tests(TestsArgs),
}

#[derive(Debug, Args)]
struct PatchesArgs {
    /// Scenes to learn from: folders of datasets, or rendered:NAME
    #[arg(long, value_name = "SCENE", num_args = 1.., required = true)]
    train: Vec<String>,
    /// Scenes to choose parameters on
    #[arg(long, value_name = "SCENE", num_args = 1..)]
    validation: Vec<String>,
    /// Scenes to report on
    #[arg(long, value_name = "SCENE", num_args = 1..)]
    test: Vec<String>,
    /// Most triplets of one pair of images
    #[arg(long, value_name = "N", default_value_t = 60)]
    per_pair: usize,
    /// Number of warped views of each photograph
    #[arg(long, value_name = "N", default_value_t = 2)]
    warps: usize,
    /// Blur many of the warped views, and warp rendered images as well
    #[arg(long)]
    blurred: bool,
    /// Seed of every random choice
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder of the set
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Debug, Args)]
struct EvaluateArgs {
    /// The set
    set: PathBuf,
    /// Which part of it: train, validation or test
    #[arg(long, default_value = "test")]
    part: String,
    /// A table of BinBoost or BGM
    #[arg(long, value_name = "FILE", num_args = 1..)]
    binboost: Vec<PathBuf>,
    /// A table of DLCO
    #[arg(long, value_name = "FILE", num_args = 1..)]
    dlco: Vec<PathBuf>,
    /// A table of LBGM
    #[arg(long, value_name = "FILE", num_args = 1..)]
    lbgm: Vec<PathBuf>,
    /// Values of DLCO's descriptor
    #[arg(long, value_name = "N", num_args = 1.., default_values_t = [120], value_parser = count)]
    dimensions: Vec<usize>,
}

/// Options that BGM, LBGM and BinBoost share.
#[derive(Debug, Args)]
struct LearnersArgs {
    /// The set
    set: PathBuf,
    /// Number of boxes that weak learners choose from
    #[arg(long, value_name = "N", default_value_t = 384, value_parser = count)]
    boxes: usize,
    /// Number of pairs of patches
    #[arg(long, value_name = "N", default_value_t = 24_000, value_parser = count_of_pairs)]
    pairs: usize,
    /// Weight of a bit in the margin of a pair
    #[arg(long, default_value_t = 0.1, value_parser = positive)]
    step: f64,
    /// Seed of every random choice
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The table to write; a stopped run continues from OUT.part beside it
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

#[derive(Debug, Args)]
struct BgmArgs {
    #[command(flatten)]
    common: LearnersArgs,
    /// Number of bits
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = count)]
    bits: usize,
    /// Number of features tried for each weak learner
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = count)]
    tries: usize,
}

#[derive(Debug, Args)]
struct LbgmArgs {
    #[command(flatten)]
    bgm: BgmArgs,
    /// Number of values of the descriptor
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = count)]
    dimensions: usize,
}

#[derive(Debug, Args)]
struct BinboostArgs {
    #[command(flatten)]
    common: LearnersArgs,
    /// Number of bits
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = count)]
    bits: usize,
    /// Number of weak learners per bit
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = count)]
    learners: usize,
    /// Number of features tried for each weak learner
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = count)]
    tries: usize,
}

#[derive(Debug, Args)]
struct DlcoArgs {
    /// The set
    set: PathBuf,
    /// Number of values of the descriptor
    #[arg(long, value_name = "N", default_value_t = 120, value_parser = count)]
    dimensions: usize,
    /// Most pooled values
    #[arg(long, value_name = "N", default_value_t = 640, value_parser = count)]
    values: usize,
    /// Number of triplets for the selection of rings
    #[arg(long, value_name = "N", default_value_t = 8_000, value_parser = count)]
    ring_triplets: usize,
    /// Number of triplets for the projection
    #[arg(long, value_name = "N", default_value_t = 30_000, value_parser = count)]
    triplets: usize,
    /// Number of principal directions that the projection works in
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = count)]
    principal: usize,
    /// Number of triplets in a step
    #[arg(long, value_name = "N", default_value_t = 2_000, value_parser = count)]
    batch: usize,
    /// Number of steps of the optimisation
    #[arg(long, value_name = "N", default_value_t = 150, value_parser = count)]
    steps: usize,
    /// Weight of the nuclear norm
    #[arg(long, default_value_t = 1e-5, value_parser = not_negative)]
    mu: f64,
    /// Inverse step size
    #[arg(long, default_value_t = 1e-3, value_parser = positive)]
    gamma: f64,
    /// Seed of every random choice
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The table to write; a stopped run continues from OUT.part beside it
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

#[derive(Debug, Args)]
struct TestsArgs {
    /// The set
    set: PathBuf,
    /// The descriptor whose tests are chosen
    #[arg(long)]
    of: Kind,
    /// Part of the set to compare on
    #[arg(long, default_value = "test")]
    part: String,
    /// Number of triplets used to choose
    #[arg(long, value_name = "N", default_value_t = 2_000, value_parser = count)]
    triplets: usize,
    /// Number of random tests to choose from; FREAK chooses from all
    #[arg(long, value_name = "N", default_value_t = 10_000, value_parser = count)]
    candidates: usize,
    /// Seed of every random choice
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The table to write, in the form that the library has
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

fn main() -> Result<()> {
    match Cli::parse().command {
        Command::Patches(args) => make_patches(args),
        Command::Evaluate(args) => evaluate(&args),
        Command::Bgm(args) => {
            let (_, table, checkpoint) = learn_bgm(&args)?;
            finish(&args.common.out, &table.to_bytes(), &checkpoint)
        }
        Command::Lbgm(args) => learn_lbgm(&args),
        Command::Binboost(args) => learn_binboost(&args),
        Command::Dlco(args) => learn_dlco(&args),
        Command::Tests(args) => choose_tests(&args),
    }
}

fn make_patches(args: PatchesArgs) -> Result<()> {
    let recipe = Recipe {
        scenes: [args.train, args.validation, args.test],
        per_pair: args.per_pair,
        warps: args.warps,
        blurred: args.blurred,
        seed: args.seed,
    };
    let manifest = patches::make(&recipe, &args.out, &bar("pairs of images"))?;
    for part in manifest.parts {
        println!("{}: {} patches", part.name, part.patches);
        for (source, count) in part.sources {
            println!("  {source}: {count} triplets");
        }
    }
    Ok(())
}

fn evaluate(args: &EvaluateArgs) -> Result<()> {
    let set = read_part(&args.set, &args.part)?;
    let name = |path: &Path| {
        path.file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned()
    };
    let mut described = vec![("sift".to_owned(), Described::sift(&set))];
    for path in &args.binboost {
        let table =
            BinBoostTable::from_bytes(&read(path)?).with_context(|| path.display().to_string())?;
        described.push((name(path), Described::binboost(&set, &table)?));
    }
    for path in &args.dlco {
        let table =
            DlcoTable::from_bytes(&read(path)?).with_context(|| path.display().to_string())?;
        for &dimensions in &args.dimensions {
            let name = format!("{} {dimensions}", name(path));
            described.push((name, Described::dlco(&set, &table, dimensions)?));
        }
    }
    for path in &args.lbgm {
        let table =
            LbgmTable::from_bytes(&read(path)?).with_context(|| path.display().to_string())?;
        described.push((name(path), Described::lbgm(&set, &table)?));
    }
    println!("{}", report(&set, &described));
    Ok(())
}

/// The set, the table, and the checkpoint, which is not needed any more after the table is written.
fn learn_bits(
    stage: &str,
    common: &LearnersArgs,
    bits: usize,
    learners_per_bit: usize,
    tries: usize,
) -> Result<(PatchSet, BinBoostTable, Checkpoint)> {
    let set = read_part(&common.set, "train")?;
    let params = BoostParams {
        bits,
        learners_per_bit,
        boxes: common.boxes,
        tries,
        pairs: common.pairs,
        step: common.step,
        seed: common.seed,
    };
    let checkpoint = Checkpoint::new(&common.out, &set, &(stage, &params))?;
    let table = boost::learn(&set, &params, &checkpoint, &bar("bits"))?;
    Ok((set, table, checkpoint))
}

fn learn_bgm(args: &BgmArgs) -> Result<(PatchSet, BinBoostTable, Checkpoint)> {
    learn_bits("bgm", &args.common, args.bits, 1, args.tries)
}

fn learn_lbgm(args: &LbgmArgs) -> Result<()> {
    let (set, bgm, checkpoint) = learn_bgm(&args.bgm)?;
    let LearnersArgs {
        pairs, seed, out, ..
    } = &args.bgm.common;
    // The second stage takes seconds, so it is run again after a stop.
    checkpoint.save(&bgm.to_bytes())?;
    let seed = Seed(*seed).child("lbgm");
    let table = LbgmTable::learn(&set, bgm, args.dimensions, *pairs, seed, &bar("steps"))?;
    finish(out, &table.to_bytes(), &checkpoint)
}

fn learn_binboost(args: &BinboostArgs) -> Result<()> {
    let (_, table, checkpoint) = learn_bits(
        "binboost",
        &args.common,
        args.bits,
        args.learners,
        args.tries,
    )?;
    finish(&args.common.out, &table.to_bytes(), &checkpoint)
}

/// Chooses tests, and compares them with those of the library on patches that were not used to choose.
fn choose_tests(args: &TestsArgs) -> Result<()> {
    let set = read_part(&args.set, "train")?;
    let (kind, seed) = (args.of, Seed(args.seed).child("tests"));
    let bar = bar("tests");
    let chosen = binary_tests::choose(kind, &set, args.triplets, args.candidates, seed, &bar)?;
    bar.finish_and_clear();
    let held_out = read_part(&args.set, &args.part)?;
    let in_tree = kind.in_tree();
    println!(
        "{} of {} tests are in the library's table too; chosen with correlations below {:.2}",
        binary_tests::shared(kind, &chosen.tests, &in_tree),
        in_tree.len(),
        chosen.limit
    );
    let mut described = vec![("sift".to_owned(), Described::sift(&held_out))];
    for (name, tests) in [("library", &in_tree), ("chosen", &chosen.tests)] {
        let rows = binary_tests::describe(kind, tests, &held_out);
        let (share, correlation) = binary_tests::spread(&rows, tests.len());
        println!(
            "{name}: |share of yes - 1/2| {share:.3}, |correlation| {correlation:.3} in the mean"
        );
        described.push((name.to_owned(), Described::Binary(rows)));
    }
    println!("{}", report(&held_out, &described));
    write_whole(&args.out, &chosen.tests.concat())?;
    Ok(())
}

fn learn_dlco(args: &DlcoArgs) -> Result<()> {
    let set = read_part(&args.set, "train")?;
    let params = MetricParams {
        dimensions: args.dimensions,
        values: args.values,
        ring_triplets: args.ring_triplets,
        triplets: args.triplets,
        principal: args.principal,
        batch: args.batch,
        steps: args.steps,
        mu: args.mu,
        gamma: args.gamma,
        seed: args.seed,
    };
    let checkpoint = Checkpoint::new(&args.out, &set, &("dlco", &params))?;
    let table = metric::learn(&set, &params, &checkpoint, &bar("steps"))?;
    println!(
        "{} rings, {} values pooled",
        table.rings.len(),
        table.pooled()
    );
    finish(&args.out, &table.to_bytes(), &checkpoint)
}

/// Writes a finished table, and removes the state from which a stopped run would have continued.
fn finish(out: &Path, bytes: &[u8], checkpoint: &Checkpoint) -> Result<()> {
    write_whole(out, bytes)?;
    checkpoint.remove();
    println!("{}: {} bytes", out.display(), bytes.len());
    Ok(())
}

/// One part of a set, which must not be empty.
fn read_part(folder: &Path, part: &str) -> Result<PatchSet> {
    let set = PatchSet::read(folder, part)?;
    ensure!(
        !set.triplets.is_empty(),
        "{}: its part `{part}` is empty; name scenes for it when the patches are made, or another --part",
        folder.display()
    );
    Ok(set)
}

fn read(path: &Path) -> Result<Vec<u8>> {
    fs::read(path).with_context(|| format!("{}: cannot be read", path.display()))
}

/// A progress bar on standard error if that is a terminal; otherwise nothing is drawn.
fn bar(unit: &str) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(0), ProgressDrawTarget::stderr_with_hz(5));
    let template = format!("{{bar:30}} {{pos}}/{{len}} {unit}  {{eta}} left  {{msg}}");
    bar.set_style(ProgressStyle::with_template(&template).expect("the template is a constant"));
    bar.enable_steady_tick(Duration::from_millis(500));
    bar
}
