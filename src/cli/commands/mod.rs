//! The commands: one file each, named as the command is typed.

pub(crate) mod bench;
pub(crate) mod cluster;
pub(crate) mod config;
pub(crate) mod demo;
pub(crate) mod estimate_epsilon;
pub(crate) mod eval;
pub(crate) mod info;
pub(crate) mod next;
pub(crate) mod pages;
pub(crate) mod plan;
pub(crate) mod reduce;
pub(crate) mod run;
pub(crate) mod slurm;
pub(crate) mod status;
pub(crate) mod synth;
pub(crate) mod train;
pub(crate) mod view;
pub(crate) mod work;
