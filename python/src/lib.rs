//! matchbench for Python: numpy arrays in, numpy arrays out, no algorithm.
//!
//! The module `matchbench._native` is a thin layer over `matchbench-vision` and `matchbench`; the package
//! around it (`python/python/matchbench`) gives it the names and defaults that people know. Each file here
//! is one kind of thing that crosses the border. Three rules hold for all of them:
//!
//! - the interpreter is released while anything is computed, read or written;
//! - parameters cross as JSON, so that they are checked where the command line's are, by the same code;
//! - what does not fit is refused in words that say what was given and what is expected.

mod arrays;
mod callable;
mod camera;
mod correspondences;
mod datasets;
mod detached;
mod errors;
mod estimators;
mod features;
mod matchers;
mod params;
mod pickled;
mod progress;
mod run;
mod scores;

/// The classes and functions of `matchbench._native`.
#[pyo3::pymodule(name = "_native")]
mod native {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::camera::Camera;
    #[pymodule_export]
    use crate::correspondences::search;
    #[pymodule_export]
    use crate::datasets::{Dataset, import_dataset, read_gray, rendered_scene};
    #[pymodule_export]
    use crate::errors::{Error, NoPose};
    #[pymodule_export]
    use crate::estimators::{Estimator, HomographyEstimate, PoseEstimate};
    #[pymodule_export]
    use crate::features::Features;
    #[pymodule_export]
    use crate::matchers::{Matcher, Matches};
    #[pymodule_export]
    use crate::run::{command_line, pair_seed, run};
    #[pymodule_export]
    use crate::scores::{evaluate, report};

    /// The limits of the environment hold here as in the program, and the process is remembered.
    #[pymodule_init]
    fn init(_module: &Bound<'_, PyModule>) -> PyResult<()> {
        crate::detached::remember();
        matchbench_cli::environment()
            .map_err(|error| crate::errors::value_error(format!("{error:#}")))
    }
}
