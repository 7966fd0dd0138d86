//! The `chainage` program: parse, resolve, run, exit code.

mod allocator;
mod cli;
mod open_files;

use std::process::ExitCode;

fn main() -> ExitCode {
    allocator::return_large_blocks();
    open_files::raise_limit();
    cli::main()
}
