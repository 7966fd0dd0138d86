//! The memory that tiles need, for the plan: the need of the pass over tiles that needs most.

use crate::cluster::BytesPer;
use crate::run::chain::Chain;
use crate::run::passes::ground;
use crate::run::plan::budget::TileNeed;
use crate::tiling::{Plan, Tile};

/// Share of points of objects that the plan assumes, in percent. Drives along streets have 27 to 64. The true
/// share is known after the ground pass. If it is larger, as in a forest, fewer tiles are in flight at once.
const OBJECT_SHARE_PERCENT: u64 = 55;

/// Bytes per point of the steps of the method.
fn of_method(chain: &Chain) -> u64 {
    let bytes = |bytes| match bytes {
        BytesPer::Point(bytes) => bytes,
        BytesPer::ObjectPoint(bytes) => bytes * OBJECT_SHARE_PERCENT / 100,
    };
    chain.method.steps().iter().map(|step| bytes(step.bytes)).max().unwrap_or(0)
}

/// Bytes per point in flight in the pass that needs most.
pub(crate) fn bytes_per_point(chain: &Chain) -> u64 {
    ground::BYTES_PER_POINT.max(of_method(chain))
}

/// Bytes of a tile in the pass that needs most, halo included.
pub(crate) fn tile_bytes(chain: &Chain, plan: &Plan, tile: usize) -> u64 {
    let ground = plan.region_points(tile, chain.ground_reach) * ground::BYTES_PER_POINT;
    let cluster = plan.region_points(tile, chain.cluster_reach) * of_method(chain);
    ground.max(cluster)
}

/// The memory of the tiles of a plan.
pub(crate) fn of_plan(chain: &Chain, plan: &Plan) -> Vec<TileNeed> {
    let core = |tile: &Tile| tile.points * bytes_per_point(chain);
    (0..)
        .zip(&plan.tiles)
        .map(|(number, tile)| TileNeed { core: core(tile), all: tile_bytes(chain, plan, number) })
        .collect()
}

/// Bytes of the largest tile of a plan.
pub(crate) fn largest(chain: &Chain, plan: &Plan) -> u64 {
    TileNeed::largest(&of_plan(chain, plan))
}
