//! The Python module of matchbench: numpy arrays in and out, no algorithm.
//!
//! The module `matchbench._native` is a thin layer over `matchbench-vision` and `matchbench`. The Python
//! package around it (`python/python/matchbench`) adds familiar names and defaults. Each file here handles one
//! kind of values that are passed between Python and Rust. Three rules hold for all of them:
//!
//! - The interpreter is released while features, matches, poses and scores are computed and files are read or
//!   written. It is held while arrays are copied from and to Python, which includes the conversion of colours to grey.
//! - Parameters are passed as JSON, so the same code checks them as for the command line.
//! - A refusal says in words what was given and what is expected.

mod arrays;
mod callable;
mod camera;
mod correspondences;
mod datasets;
mod detached;
mod errors;
mod estimators;
mod features;
mod integers;
mod matchers;
mod params;
mod pickled;
mod progress;
mod queue;
mod run;
mod scores;
mod show;
mod study;
mod text;

/// For the arrays of Rust; those of numpy have huge pages already.
#[global_allocator]
static ALLOCATOR: matchbench::memory::HugePages = matchbench::memory::HugePages;

/// The classes and functions of `matchbench._native`.
#[pyo3::pymodule(name = "_native")]
mod native {
    use matchbench::front_door::FrontDoor;
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::camera::Camera;
    #[pymodule_export]
    use crate::correspondences::search;
    #[pymodule_export]
    use crate::datasets::{Dataset, import_dataset, read_gray, rendered_scene, write_dataset};
    #[pymodule_export]
    use crate::errors::{Error, NoModel};
    #[pymodule_export]
    use crate::estimators::{Estimator, HomographyEstimate, PoseEstimate};
    #[pymodule_export]
    use crate::features::Features;
    #[pymodule_export]
    use crate::matchers::{Matcher, Matches};
    #[pymodule_export]
    use crate::run::{command_line, join, pair_seed, run};
    #[pymodule_export]
    use crate::scores::{evaluate, evaluate_under, pairs, report};
    #[pymodule_export]
    use crate::show::show;

    /// Applies the limits from the environment as the program does, remembers the process, and makes messages call
    /// options as Python does.
    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        crate::detached::remember();
        FrontDoor::Python.open();
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        matchbench_cli::environment()
            .map_err(|error| crate::errors::value_error(format!("{error:#}")))
    }
}
