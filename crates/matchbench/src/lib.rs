//! Which feature matcher should I use? Datasets in, a report out.
//!
//! A dataset has images with known cameras, and pairs with the true relative pose. Matchers are run on every pair,
//! estimators compute a pose from the matches, and its angular error is recorded. Scores are functions of the records,
//! as in the paper *MatchBench: An Evaluation of Feature Matchers* (Bian et al.): the share of pairs with an error
//! below 1 to 15 degrees (SP curves), the mean of these shares (AUC), and the mean number of correspondences of right
//! pairs (AP).
//!
//! Two matchers on a rendered scene, and their table:
//!
//! ```
//! use matchbench::datasets::rendered;
//! use matchbench::metrics::{Summary, load};
//! use matchbench::report::{Format, render};
//! use matchbench::run::{Cancel, Contender, Dataset, Run, Silent};
//!
//! # let temporary = tempfile::tempdir()?;
//! # let folder = temporary.path();
//! // Four frames of a cabinet with little texture.
//! let mut scene = rendered::scenes()[2].clone();
//! scene.frames = 4;
//! let paths = rendered::ensure_scenes(&folder.join("scenes"), &[scene], &|_| {})?;
//! let datasets = [Dataset::open(&paths[0])?];
//!
//! let contenders = Contender::all_of(&["sift".into(), "orb".into()], &["best".into()], &Default::default(), None)?;
//! let out = folder.join("run");
//! let summary = Run::new(&datasets, &contenders, &out).execute(&Silent, &Cancel::default())?;
//! assert!(summary.is_complete());
//!
//! let results = load(&out, None)?;
//! let scores: Vec<Summary> = results.iter().map(|set| Summary::new(set)).collect();
//! println!("{}", render(Format::Table, &scores));
//! # assert!(render(Format::Table, &scores).contains("orb"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`run::evaluate`] does the same for one pair in memory, without a disk; [`report::of_run`] makes the page, the
//! tables and the figures of a run. `examples/own_matcher.rs` runs a matcher of one's own beside two built-in ones,
//! `examples/own_dataset.rs` makes a dataset from images and poses that a program holds.
//!
//! The modules in the order of the data:
//!
//! | module | what is in it |
//! | --- | --- |
//! | [`datasets`] | images, cameras and true poses: importers, pair rules, validation, rendered scenes |
//! | [`matchers`], [`estimators`] | the lists of what can be asked for by name, with parameters |
//! | [`external`], [`exchange`] | matchers as processes, and matches in the files of other tools |
//! | [`run`] | matchers and estimators over pairs, resumable; [`cache`] keeps features by content |
//! | [`records`] | the folder of a run: its plan, one line per task, the selected matches |
//! | [`protocols`] | evaluation protocols of other benchmarks, chosen by name |
//! | [`metrics`] | success, AUC, average matches, with intervals: pure functions of records |
//! | [`report`] | tables, figures, the page |
//! | [`show`] | one pair as a picture |
//! | [`tune`], [`time`](mod@time) | the best value of a parameter; how long stages take |
//!
//! Records are equal bit for bit for any number of threads, apart from the times. Work is done by the rayon pool that
//! the caller is in. The program `matchbench` also uses [`memory::HugePages`] and [`memory::keep_freed`], which save up to a
//! sixth of the time of an extraction; another program can do the same.

mod arrays;
pub mod cache;
pub mod config;
pub mod counted;
pub mod datasets;
pub mod estimators;
pub mod exchange;
pub mod external;
pub mod files;
pub mod front_door;
pub mod matchers;
pub mod memory;
pub mod metrics;
mod panics;
pub mod paper;
pub mod protocols;
pub mod records;
pub mod report;
pub mod run;
pub mod show;
pub mod study;
pub mod time;
pub mod tune;

pub use matchbench_vision::InstructionSet;
