//! The points of one tile as a structure of arrays, and the voxel grid over them.

use crate::model::{Field, Lattice, PointId};

/// The points of one tile (or of a whole small cloud), in local lattice units.
///
/// A local coordinate is the lattice coordinate minus `origin`. It is never negative. The order of the points
/// is not defined. Every tie is broken by `id`.
#[derive(Debug, Clone)]
pub struct TileCloud {
    /// The lattice of the run.
    pub lattice: Lattice,
    /// Lattice coordinates of local (0, 0, 0); not above any point of the cloud on any axis.
    pub origin: [i64; 3],
    /// Local x of every point, in lattice units, >= 0.
    pub x: Vec<i32>,
    /// Local y of every point, in lattice units, >= 0.
    pub y: Vec<i32>,
    /// Local z of every point, in lattice units, >= 0.
    pub z: Vec<i32>,
    /// Number of every point in the drive; unique.
    pub id: Vec<PointId>,
    /// Further fields of every point, where a method asked for them.
    pub fields: Vec<(Field, Vec<u16>)>,
}

impl TileCloud {
    /// A cloud without points.
    #[must_use]
    pub fn empty(lattice: Lattice) -> Self {
        let x = Vec::new();
        let y = Vec::new();
        let z = Vec::new();
        let id = Vec::new();
        let fields = Vec::new();
        Self { lattice, origin: [0; 3], x, y, z, id, fields }
    }

    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Whether there are no points.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.x.is_empty()
    }

    /// A further field of every point, if it is there.
    #[must_use]
    pub fn field(&self, field: Field) -> Option<&[u16]> {
        self.fields.iter().find(|(name, _)| *name == field).map(|(_, values)| &values[..])
    }

    /// Lattice coordinates of point `index`.
    #[must_use]
    pub fn lattice_point(&self, index: usize) -> [i64; 3] {
        [
            self.origin[0] + i64::from(self.x[index]),
            self.origin[1] + i64::from(self.y[index]),
            self.origin[2] + i64::from(self.z[index]),
        ]
    }

    /// The cloud of lattice points, with ids 0, 1, 2...: for tests, tables and small clouds.
    ///
    /// # Panics
    /// When the extent of the points exceeds 2^31 lattice units on an axis.
    #[must_use]
    #[expect(clippy::expect_used, reason = "a documented precondition of a helper for small clouds")]
    pub fn from_lattice_points(lattice: Lattice, points: &[[i64; 3]]) -> Self {
        let mut cloud = Self::empty(lattice);
        if points.is_empty() {
            return cloud;
        }
        for axis in 0..3 {
            cloud.origin[axis] = points.iter().map(|point| point[axis]).min().unwrap_or(0);
        }
        for (index, point) in points.iter().enumerate() {
            let local = |axis: usize| {
                let local = i128::from(point[axis]) - i128::from(cloud.origin[axis]);
                i32::try_from(local).expect("the extent fits 31 bits")
            };
            let x = local(0);
            let y = local(1);
            let z = local(2);
            cloud.x.push(x);
            cloud.y.push(y);
            cloud.z.push(z);
            cloud.id.push(PointId::at(index));
        }
        cloud
    }
}

/// Voxels of one edge length over a tile. Maps local coordinates to voxels, which are the same in every tile.
///
/// An index is `floor(lattice coordinate / edge)` minus `base`, the index of the voxel that contains the
/// tile's origin. Indices are therefore small and never negative, and adding `base` gives the global index.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct VoxelGrid {
    /// Edge of a voxel in lattice units.
    pub edge: u32,
    /// Global index of local voxel (0, 0, 0).
    pub base: [i64; 3],
    /// Position of the tile's origin inside that voxel, in lattice units.
    remainder: [u32; 3],
}

impl VoxelGrid {
    /// The grid with voxels of `edge` lattice units (> 0) over a tile with this `origin`.
    #[must_use]
    #[expect(clippy::cast_possible_truncation, reason = "a remainder modulo a u32 is a u32")]
    pub fn new(origin: [i64; 3], edge: u32) -> Self {
        let edge_units = i64::from(edge.max(1));
        Self {
            edge: edge.max(1),
            base: origin.map(|value| value.div_euclid(edge_units)),
            remainder: origin.map(|value| value.rem_euclid(edge_units) as u32),
        }
    }

    /// Local voxel index along `axis` of a local coordinate (>= 0).
    #[inline]
    #[must_use]
    pub fn index(&self, axis: usize, local: i32) -> u32 {
        self.position(axis, local) / self.edge
    }

    /// Lattice units along `axis` from the beginning of voxel 0 to a local coordinate (>= 0).
    #[inline]
    pub(crate) fn position(&self, axis: usize, local: i32) -> u32 {
        local.unsigned_abs() + self.remainder[axis]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_voxel_is_the_same_voxel_whatever_the_origin() {
        for origin in [-1_000_i64, -301, -300, -1, 0, 1, 299, 300, 12_345] {
            let grid = VoxelGrid::new([origin; 3], 300);
            for local in [0_i32, 1, 299, 300, 301, 5_000] {
                let global = grid.base[0] + i64::from(grid.index(0, local));
                assert_eq!(global, (origin + i64::from(local)).div_euclid(300), "{origin} {local}");
            }
        }
    }
}
