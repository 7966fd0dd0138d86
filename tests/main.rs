//! One integration binary: one link step.

#[cfg(test)]
mod architecture;
#[cfg(test)]
mod chunk_tables;
#[cfg(test)]
mod cli;
#[cfg(test)]
mod cluster_tables;
#[cfg(test)]
mod conformance;
mod contracts;
#[cfg(test)]
mod copc;
#[cfg(test)]
mod damage;
#[cfg(test)]
mod dbscan;
#[cfg(test)]
mod density_peaks;
#[cfg(test)]
mod density_peaks_run;
#[cfg(test)]
mod edge;
#[cfg(test)]
mod epsilon;
#[cfg(test)]
mod equivalence;
#[cfg(test)]
mod eval;
#[cfg(test)]
#[cfg(feature = "gpkg")]
mod geopackage;
#[cfg(test)]
mod inventory;
mod kernels;
#[cfg(test)]
mod labelled;
#[cfg(test)]
mod messages;
#[cfg(test)]
mod normalized_cut;
#[cfg(test)]
mod p_linkage;
#[cfg(test)]
mod refusals;
#[cfg(test)]
mod report;
#[cfg(test)]
mod resume;
#[cfg(test)]
mod rounds;
#[cfg(test)]
mod section;
#[cfg(test)]
mod spinning;
#[cfg(test)]
mod street_run;
#[cfg(test)]
mod switch;
#[cfg(test)]
mod synth;
#[cfg(test)]
mod train;
#[cfg(test)]
mod util;
#[cfg(test)]
mod view;
#[cfg(test)]
mod words;
#[cfg(test)]
mod workers;
