//! One integration binary: one link step.

mod conformance;
mod damage;
mod util;
