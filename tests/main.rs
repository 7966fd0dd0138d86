//! One integration binary: one link step.

#[cfg(test)]
mod synth;
