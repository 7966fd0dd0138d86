//! One integration binary: one link step.

#[cfg(test)]
mod chunk_tables;
#[cfg(test)]
mod conformance;
mod contracts;
#[cfg(test)]
mod damage;
#[cfg(test)]
mod density_peaks;
#[cfg(test)]
mod density_peaks_run;
#[cfg(test)]
mod eval;
mod kernels;
#[cfg(test)]
mod labelled;
#[cfg(test)]
mod refusals;
#[cfg(test)]
mod util;
