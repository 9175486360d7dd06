//! The command line of matchbench.
fn main() {}
