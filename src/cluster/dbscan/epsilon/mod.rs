//! Estimation of epsilon, the radius of `dbscan`, from how far away neighbours are: the curve, its fit and the point
//! where its slope is that of its chord. `curve_step` measures the curve over the tiles of a
//! drive; the rest knows distances only.
//!
//! Source: "DBSCAN with automatic estimation of epsilon", section 3.2.3, equations
//! 5 and 11 to 14. Ours: the point itself is the neighbour k = 1 (so that D_1 = 0 is not part of the curve), the
//! polynomial is fitted in k scaled to [-1, 1], the smallest root is taken, and K grows to [`LARGEST_K`] at most.

mod chart;
mod curve;
mod curve_step;
mod error;
mod fit;
mod found;
mod polynomial;
mod settings;

pub use chart::svg;
pub use curve::{Curve, CurveSums};
pub(crate) use curve_step::{CurveStep, STEP};
pub use error::EpsilonError;
pub use fit::{Attempt, Estimate, estimate};
pub(crate) use found::HALO_M;
pub use found::{Cost, DriveEpsilon};
pub use polynomial::Polynomial;
pub use settings::EpsilonConfig;

/// Neighbours to start with (paper, section 4.2.2), the point itself included.
pub const FIRST_K: usize = 40;
/// Fewest neighbours to start with: a polynomial of degree 5 through k = 2 to 8 leaves one degree of freedom.
pub const SMALLEST_K: usize = 8;
/// Most neighbours that are tried before the estimation gives up (chosen: five times where the paper starts).
pub const LARGEST_K: usize = 200;
