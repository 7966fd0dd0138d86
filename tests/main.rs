//! One integration binary: one link step.

#[cfg(test)]
mod chunk_tables;
#[cfg(test)]
mod cluster_tables;
#[cfg(test)]
mod conformance;
mod contracts;
mod kernels;
#[cfg(test)]
mod damage;
#[cfg(test)]
mod dbscan;
#[cfg(test)]
mod eval;
#[cfg(test)]
mod labelled;
#[cfg(test)]
mod refusals;
#[cfg(test)]
mod util;
