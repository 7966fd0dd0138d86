//! The `chainage` program: parse, resolve, run, exit code.

mod allocator;
mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    allocator::return_large_blocks();
    cli::main()
}
