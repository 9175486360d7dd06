//! The program `matchbench`. All of it is in the library, which the Python package calls too.

use std::process::ExitCode;

use matchbench::memory::HugePages;

#[global_allocator]
static ALLOCATOR: HugePages = HugePages;

fn main() -> ExitCode {
    ExitCode::from(matchbench_cli::run(std::env::args_os()))
}
