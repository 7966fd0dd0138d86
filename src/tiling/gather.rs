//! Gathering: takes the points of one tile from blocks of records, in file order.

use crate::model::{Lattice, LatticeTransform, PointClass, PointId, RecordView, TileCloud, record_xyz};
use crate::spatial::Cell;
use crate::tiling::Region;

/// The points of a tile, and whether the tile owns them.
#[derive(Debug)]
pub struct Gathered {
    /// Core and halo points. Core points are in ascending order of id.
    pub cloud: TileCloud,
    /// Whether the tile owns the point.
    pub core: Vec<bool>,
    /// Class code of each point, if classes were given.
    pub classes: Vec<u8>,
    /// The withheld points that the tile owns, ascending. They are not in the cloud.
    pub withheld: Vec<PointId>,
}

/// The points that are gathered, by class.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wanted {
    /// Every point that is not withheld. Classes are not needed.
    All,
    /// All of these except noise.
    Solid,
    /// Neither ground nor noise.
    Objects,
}

impl Wanted {
    fn takes(self, code: u8) -> bool {
        match self {
            Self::All => true,
            Self::Solid => code == PointClass::Object.code() || code == PointClass::Ground.code(),
            Self::Objects => code == PointClass::Object.code(),
        }
    }
}

/// Collects the points of one region block by block.
#[derive(Debug)]
pub struct Gatherer<'a> {
    region: &'a Region,
    wanted: Wanted,
    gathered: Gathered,
    edge: u32,
    /// Extent of the region in lattice units from its lower corner, which is the origin of the cloud.
    width: [u64; 2],
    /// Largest local z.
    depth: u64,
}

/// A point whose height is outside the drive's range of heights. The survey has excluded this.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HeightOutOfRange {
    /// Index of the record in its block.
    pub record: usize,
}

impl<'a> Gatherer<'a> {
    /// A gatherer for the `wanted` points of `region`. `lowest` is the smallest lattice z of the drive.
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "extents of a region are positive and checked by the plan, edges are at most 10^5 units"
    )]
    pub fn new(region: &'a Region, lattice: Lattice, lowest: i64, wanted: Wanted) -> Self {
        let edge = region.grid.edge();
        let mut cloud = TileCloud::empty(lattice);
        let corner = |k: usize| i64::from(region.area.lo[k]) * edge;
        cloud.origin = [corner(0), corner(1), lowest];
        let points = usize::try_from(region.points).unwrap_or(0);
        for column in [&mut cloud.x, &mut cloud.y, &mut cloud.z] {
            column.reserve_exact(points);
        }
        cloud.id.reserve_exact(points);
        let cells = |k: usize| (i64::from(region.area.hi[k]) - i64::from(region.area.lo[k]) + 1).max(0);
        let core = Vec::with_capacity(points);
        Self {
            region,
            wanted,
            gathered: Gathered { cloud, core, classes: Vec::new(), withheld: Vec::new() },
            edge: edge as u32,
            width: [0, 1].map(|k| (cells(k) * edge) as u64),
            depth: i32::MAX as u64,
        }
    }

    /// Adds the points of one block inside the region. `id` maps the position of a record in the block and
    /// its bytes to the id of the record. `classes` has the class codes of the records. It is needed unless
    /// all points are wanted.
    ///
    /// # Errors
    /// When a height does not fit.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_possible_wrap,
        clippy::cast_sign_loss,
        reason = "differences to the origin are compared with the extent first; negative ones wrap beyond it"
    )]
    pub fn block(
        &mut self,
        view: &RecordView<'_>,
        transform: &LatticeTransform,
        id: impl Fn(usize, &[u8]) -> PointId,
        classes: Option<&[u8]>,
    ) -> Result<(), HeightOutOfRange> {
        let mut roles = self.region.roles.cursor();
        let origin = self.gathered.cloud.origin;
        let lo: Cell = self.region.area.lo;
        let cloud = &mut self.gathered.cloud;
        for (record, bytes) in view.bytes.chunks_exact(view.stride).enumerate() {
            let class = classes.map(|codes| codes[record]);
            if class.is_some_and(|code| !self.wanted.takes(code)) {
                continue;
            }
            let [x, y, z] = transform.apply(record_xyz(bytes));
            let dx = (x - origin[0]) as u64;
            let dy = (y - origin[1]) as u64;
            if dx >= self.width[0] || dy >= self.width[1] {
                continue;
            }
            let cell = [lo[0] + (dx as u32 / self.edge) as i32, lo[1] + (dy as u32 / self.edge) as i32];
            let role = roles.get(cell);
            if role == 0 {
                continue;
            }
            if view.is_withheld(bytes) {
                if role == Region::CORE {
                    self.gathered.withheld.push(id(record, bytes));
                }
                continue;
            }
            let dz = (z - origin[2]) as u64;
            if dz > self.depth {
                return Err(HeightOutOfRange { record });
            }
            cloud.x.push(dx as i32);
            cloud.y.push(dy as i32);
            cloud.z.push(dz as i32);
            cloud.id.push(id(record, bytes));
            self.gathered.core.push(role == Region::CORE);
            self.gathered.classes.extend(class);
        }
        Ok(())
    }

    /// Finishes and returns the points.
    #[must_use]
    pub fn finish(self) -> Gathered {
        self.gathered
    }
}
