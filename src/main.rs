//! The `chainage` program.

fn main() {}
