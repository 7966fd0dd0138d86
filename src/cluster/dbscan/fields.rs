//! `dbscan` on drives in a space of standardised fields: coordinates with intensity or colours.
//!
//! The variants are the same as in metres (see `dbscan`), and neighbours are found with a kd-tree. Results
//! are exact over tiles for the same reasons. In this space the distance of two points is at most epsilon
//! only if their x, and likewise their y, differ by at most epsilon times the standard deviation over the
//! weight. This gives the reach in the plane. A point has the same coordinates in this space in every tile,
//! because the statistics are those of the whole drive. Cost: one query of radius epsilon per point (`core`:
//! three). Memory per point: about 8 bytes per field, 20 of the tree and 20 more.

use super::settings::{DbscanConfig, NAME};
use crate::cluster::dbscan::rows;
use crate::model::{AlgorithmError, FieldSpace, TileCloud};
use crate::spatial::Points;

/// Labels the points of a tile. The tile owns the points where `core` is true. `epsilon` is in standard
/// deviations.
pub(super) fn label(
    config: &DbscanConfig,
    epsilon: f64,
    space: &FieldSpace,
    cloud: &TileCloud,
    core: &[bool],
    labels: &mut [u32],
) -> Result<u32, AlgorithmError> {
    let too_many = |_| AlgorithmError::TooManyPoints { method: NAME, points: cloud.len() as u64 };
    let points = Points::new(space.axes.len(), space.places(cloud)).map_err(too_many)?;
    let method =
        rows::Dbscan { variant: config.variant, epsilon, min_points: config.min_points, max_points: 0 };
    // Of equal distances, the smaller values count. The order of the points does not matter.
    let (found, count) = method.connected_sets(&points, core, &cloud.id).map_err(too_many)?;
    labels.copy_from_slice(&found);
    Ok(count)
}
