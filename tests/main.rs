//! One integration binary: one link step.

mod contracts;
mod kernels;
mod util;
