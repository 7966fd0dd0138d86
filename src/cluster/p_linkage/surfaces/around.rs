//! The points of a tile and around it, in ascending order of their ids, with what must be known of each.

use super::planes::Moments;
use crate::cluster::TileWindow;
use crate::error::Result;
use crate::model::PointId;

/// What a tile must know of a point. A neighbour is at most the reach R away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Zone {
    /// The tile owns it.
    Core,
    /// Within R of the cells of the tile: it may be linked to a point of the tile, so its link must be known.
    Linked,
    /// Within 2 R: a link may depend on its flatness.
    Flat,
    /// Within 3 R: a flatness may depend on its place.
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
    /// Reads the points of objects of a tile and around it, in zones that are `reach` wide: 2 of them, or 3.
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
        let mut order: Vec<usize> = (0..cloud.len()).collect();
        // Core points are in order already, which this sort makes use of.
        order.sort_by_key(|point| cloud.id[*point]);
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

    pub(super) fn is_core(&self, point: usize) -> bool {
        self.zone[point] == Zone::Core
    }

    /// Lattice coordinates of a point.
    pub(super) fn lattice_point(&self, point: usize) -> [i64; 3] {
        [0, 1, 2].map(|axis| self.origin[axis] + i64::from(self.places[point][axis]))
    }
}

/// The moments of lattice points, counted from the lowest corner of the drive.
pub(super) fn moments(points: impl Iterator<Item = [i64; 3]>, corner: [i64; 3]) -> Moments {
    let mut moments = Moments::default();
    points.for_each(|point| moments.add([0, 1, 2].map(|axis| point[axis] - corner[axis])));
    moments
}
