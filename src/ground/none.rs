//! No ground filter: no point is ground.

use super::filter::GroundFilter;
use crate::model::{AlgorithmError, Lattice, PointClass, Reach};
use crate::spatial::TileView;

/// No filter: no point is ground. For drives whose ground has been removed already.
#[derive(Debug, Clone, Copy)]
pub struct NoGround;

impl NoGround {
    /// The word that is given instead of the name of a filter.
    pub const NAME: &'static str = "none";
}

impl GroundFilter for NoGround {
    fn name(&self) -> &'static str {
        Self::NAME
    }

    fn reach(&self, _: Lattice) -> Reach {
        Reach::Exact { metres: 0.0 }
    }

    fn classify(&self, _: &mut TileView<'_>, _: &mut [PointClass]) -> Result<(), AlgorithmError> {
        Ok(())
    }
}
