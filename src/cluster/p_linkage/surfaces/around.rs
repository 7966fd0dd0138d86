//! The points of a tile and around it, each with its zone. They are sorted by place, and by id only if
//! several are in one place. So the order of records in files decides nothing: ids follow this order, but
//! places do not.

use super::planes::Moments;
use crate::cluster::TileWindow;
use crate::error::Result;
use crate::model::{PointId, TileCloud};

/// Zone of a point: what the tile must know about it. A neighbour is at most the reach R away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Zone {
    /// The tile owns it.
    Core,
    /// Within R of the cells of the tile. The point may be linked to a point of the tile, so its link must be
    /// known.
    Linked,
    /// Within 2 R. A link may depend on its flatness.
    Flat,
    /// Within 3 R. A flatness may depend on its place.
    Place,
}

/// The points. A point is identified by its position.
#[derive(Debug)]
pub(super) struct Around {
    /// Lattice coordinates of local (0, 0, 0).
    pub(super) origin: [i64; 3],
    /// Local coordinates, which are not negative.
    pub(super) places: Vec<[i32; 3]>,
    pub(super) id: Vec<PointId>,
    pub(super) zone: Vec<Zone>,
}

impl Around {
    /// Reads the points of objects of a tile and around it, in 2 or 3 `zones` that are `reach` wide.
    pub(super) fn load(tile: &dyn TileWindow, reach: i64, zones: i64) -> Result<Self> {
        let points = tile.points(zones * reach, true)?;
        let cloud = &points.cloud;
        let grid = tile.grid();
        let near = [Zone::Linked, Zone::Flat].map(|zone| (zone, tile.cells((zone as i64) * reach)));
        let mut cursors = [near[0].1.cursor(), near[1].1.cursor()];
        let mut zone_of = |point: usize| {
            if points.core[point] {
                return Zone::Core;
            }
            let [x, y, _] = cloud.lattice_point(point);
            let Some(cell) = grid.cell(x, y) else { return Zone::Place };
            let within = cursors.iter_mut().position(|cells| cells.get(cell) != 0);
            within.map_or(Zone::Place, |at| near[at].0)
        };
        let order = in_order(cloud);
        Ok(Self {
            origin: cloud.origin,
            places: order.iter().map(|&at| [cloud.x[at], cloud.y[at], cloud.z[at]]).collect(),
            id: order.iter().map(|&at| cloud.id[at]).collect(),
            zone: order.iter().map(|&at| zone_of(at)).collect(),
        })
    }

    pub(super) fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether a point is in the same place as the one before it.
    pub(super) fn repeats(&self, point: usize) -> bool {
        point > 0 && self.places[point] == self.places[point - 1]
    }

    pub(super) fn is_core(&self, point: usize) -> bool {
        self.zone[point] == Zone::Core
    }

    /// Lattice coordinates of a point.
    pub(super) fn lattice_point(&self, point: usize) -> [i64; 3] {
        [0, 1, 2].map(|axis| self.origin[axis] + i64::from(self.places[point][axis]))
    }
}

/// The points of a cloud in ascending order of their places: x, then y, then z, then the id.
pub(super) fn in_order(cloud: &TileCloud) -> Vec<usize> {
    // Local coordinates are not negative, so they fit one number per point. Sorting numbers is faster than
    // sorting points by keys.
    let column = |value: i32| u128::from(value.unsigned_abs());
    let place = |at: usize| column(cloud.x[at]) << 96 | column(cloud.y[at]) << 64 | column(cloud.z[at]) << 32;
    let mut keys: Vec<u128> = (0..cloud.len()).map(|at| place(at) | at as u128).collect();
    keys.sort_unstable();
    #[expect(clippy::cast_possible_truncation, reason = "the lower half of a key is a position")]
    let mut order: Vec<usize> = keys.into_iter().map(|key| key as u32 as usize).collect();
    let at = |point: usize| (cloud.x[point], cloud.y[point], cloud.z[point]);
    for in_one_place in order.chunk_by_mut(|a, b| at(*a) == at(*b)).filter(|points| points.len() > 1) {
        in_one_place.sort_unstable_by_key(|point| cloud.id[*point]);
    }
    order
}

/// The moments of lattice points, relative to the lowest corner of the drive.
pub(super) fn moments(points: impl Iterator<Item = [i64; 3]>, corner: [i64; 3]) -> Moments {
    let mut moments = Moments::default();
    points.for_each(|point| moments.add([0, 1, 2].map(|axis| point[axis] - corner[axis])));
    moments
}
