//! `chainage` turns the files of one mobile laser scanning drive into the same files with two more facts per point
//! (is it ground, which object is it part of) and a table of the objects, out of core, resumable, and with a result
//! in which nobody can tell where the tiles were.
//!
//! The modules stand in the order in which data flows through them.

pub mod error;
pub mod model;
pub mod spatial;

mod codec;
mod whole_file;

pub mod config;

pub mod input;

pub mod survey;

pub mod tiling;

pub mod ground;

pub mod cluster;

pub mod stitch;

pub mod inventory;

pub mod output;

pub mod eval;

pub mod table;

pub mod store;

pub mod run;

pub mod synth;

pub use error::{Error, ErrorKind, Failure, Result};
