//! One integration binary: one link step.

#[cfg(test)]
mod conformance;
#[cfg(test)]
mod damage;
#[cfg(test)]
mod eval;
#[cfg(test)]
mod labelled;
#[cfg(test)]
mod util;
