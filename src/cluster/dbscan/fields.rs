//! `dbscan` on drives in a space of standardised fields: coordinates with intensity or colours.
//!
//! The same two variants as in metres (see `dbscan`), over a kd-tree. Exact over tiles for the same reasons: points that
//! are within epsilon in this space are within epsilon times the standard deviation over the weight of x, and of y, in the
//! plane; that is the reach. A point has the same place in this space in every tile, because statistics are those of the
//! whole drive. Cost: one query of radius epsilon per point (`core`: three). Memory: about 8 bytes per field, 20 of the
//! tree and 20 more, per point.

use super::settings::{DbscanConfig, DbscanVariant};
use crate::cluster::Clusterer;
use crate::cluster::dbscan::rows as space;
use crate::model::AlgorithmError;
use crate::model::{FieldSpace, Lattice, Reach, TileCloud};
use crate::spatial::Points;

/// The method in a space of fields.
#[derive(Debug, Clone)]
pub(super) struct FieldDbscan {
    config: DbscanConfig,
    /// Radius in standard deviations.
    epsilon: f64,
    space: FieldSpace,
}

impl FieldDbscan {
    pub(super) fn new(config: &DbscanConfig, epsilon: f64, space: FieldSpace) -> Self {
        Self { config: config.clone(), epsilon, space }
    }
}

impl Clusterer for FieldDbscan {
    fn name(&self) -> &'static str {
        "dbscan"
    }

    fn reach(&self, lattice: Lattice) -> Reach {
        self.config.reach(self.space.horizontal(self.epsilon), lattice)
    }

    fn object_size(&self) -> std::ops::RangeInclusive<u64> {
        self.config.object_size()
    }

    fn cluster(&self, cloud: &TileCloud, labels: &mut [u32]) -> Result<u32, AlgorithmError> {
        self.cluster_tile(cloud, &vec![true; cloud.len()], labels)
    }

    fn cluster_tile(
        &self,
        cloud: &TileCloud,
        core: &[bool],
        labels: &mut [u32],
    ) -> Result<u32, AlgorithmError> {
        let too_many = |_| AlgorithmError::TooManyPoints { method: "dbscan", points: cloud.len() as u64 };
        let points = Points::new(self.space.axes.len(), self.space.places(cloud)).map_err(too_many)?;
        let method = space::Dbscan {
            variant: match self.config.variant {
                DbscanVariant::Size => space::DbscanVariant::Size,
                DbscanVariant::Core => space::DbscanVariant::Core,
            },
            epsilon: self.epsilon,
            min_points: self.config.min_points,
            max_points: 0,
        };
        // Ties go to the smaller id, whatever the order of the points.
        let (found, count) = method.connected_sets(&points, core, &cloud.id).map_err(too_many)?;
        labels.copy_from_slice(&found);
        Ok(count)
    }
}
