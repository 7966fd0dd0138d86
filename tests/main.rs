//! One integration binary: one link step.

mod conformance;
mod contracts;
mod kernels;
mod util;
