//! Estimation of epsilon, the radius of `dbscan`, from the mean distances to the k-th nearest neighbours. A
//! polynomial is fitted to this curve. Epsilon is its value at the point where its slope equals the slope of
//! its chord. `curve_step` measures the curve over the tiles of a drive. The other files see only distances.
//!
//! Source: Wang, Ji, Wang, Wen, Li, Sun, "An Improved DBSCAN Method for LiDAR Data Segmentation with
//! Automatic Eps Estimation", Sensors 19(1), 172 (2019), doi:10.3390/s19010172, section 3.2.3, equations 5
//! and 11 to 14. Ours: the point itself is the neighbour k = 1 (so D_1 = 0 is not part of the curve), the
//! polynomial is fitted in k scaled to [-1, 1], the smallest root is used, and K grows to [`LARGEST_K`] at
//! most. "The paper" in this folder is Wang et al. 2019.

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
pub(crate) use curve_step::{CurveStep, EPOCH, STEP};
pub use error::EpsilonError;
pub use fit::{Attempt, Estimate, estimate};
pub(crate) use found::HALO_M;
pub use found::{Cost, DriveEpsilon};
pub use polynomial::Polynomial;
pub use settings::EpsilonConfig;

/// Number of neighbours at the start, the point itself included (paper, section 4.2.2).
pub const FIRST_K: usize = 40;
/// Smallest number of neighbours at the start. A polynomial of degree 5 through k = 2 to 8 leaves one degree
/// of freedom.
pub const SMALLEST_K: usize = 8;
/// Largest number of neighbours before the estimation gives up (chosen: five times the number at the start in
/// the paper).
pub const LARGEST_K: usize = 200;
