//! Pass `ground`: tells ground and isolated noise from objects, one class per point, tile by tile.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::codec;
use crate::error::Result;
use crate::ground::{GroundFilter, IsolatedNoise};
use crate::model::PointClass;
use crate::run::drive::sync_columns;
use crate::run::engine::Pass;
use crate::run::tiles::Tiles;
use crate::spatial::{Cell, TileView};
use crate::store::PassDir;
use crate::tiling::Wanted;

/// Bytes per point that a tile of this pass needs at its peak (columns, voxels, sorting): `scripts/tile_memory.py` measured 37
/// to 44 on streets, and 44 to 51 in forests, where few points share a voxel.
pub(crate) const BYTES_PER_POINT: u64 = 52;

pub(crate) struct GroundPass<'a> {
    pub(crate) tiles: &'a Tiles<'a>,
    pub(crate) noise: Option<&'a IsolatedNoise>,
    pub(crate) filter: &'a dyn GroundFilter,
    /// Horizontal reach of noise and filter together, in lattice units.
    pub(crate) reach: i64,
}

/// What a tile leaves behind beside the classes of its points.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(crate) struct GroundPayload {
    /// Points by class code.
    pub(crate) counts: [u64; 4],
    /// Ground points and the sum of their lattice z, by cell.
    pub(crate) heights: Vec<(Cell, u32, i64)>,
}

/// Sums of heights by cell; neighbouring points mostly share a cell, so the last one is kept at hand.
#[derive(Debug, Default)]
struct HeightSums {
    sums: BTreeMap<Cell, (u32, i64)>,
    last: Cell,
    open: (u32, i64),
}

impl HeightSums {
    fn add(&mut self, cell: Cell, z: i64) {
        if cell != self.last {
            self.flush();
            self.last = cell;
        }
        self.open.0 += 1;
        self.open.1 += z;
    }

    fn flush(&mut self) {
        if self.open.0 > 0 {
            let sum = self.sums.entry(self.last).or_default();
            sum.0 += self.open.0;
            sum.1 += self.open.1;
            self.open = (0, 0);
        }
    }

    fn finish(mut self) -> Vec<(Cell, u32, i64)> {
        self.flush();
        self.sums.into_iter().map(|(cell, (count, sum))| (cell, count, sum)).collect()
    }
}

impl Pass for GroundPass<'_> {
    fn name(&self) -> &'static str {
        "ground"
    }

    fn units(&self) -> usize {
        self.tiles.plan.tiles.len()
    }

    fn points(&self, unit: usize) -> u64 {
        self.tiles.plan.tiles[unit].points
    }

    fn bytes(&self, unit: usize) -> u64 {
        self.tiles.plan.region_points(unit, self.reach) * BYTES_PER_POINT
    }

    fn prefetch(&self, unit: usize) {
        self.tiles.prefetch(unit, self.reach);
    }

    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        let gathered = self.tiles.gather(unit, self.reach, Wanted::All)?;
        let cloud = &gathered.cloud;
        let mut classes = vec![PointClass::Object; cloud.len()];
        {
            // The voxels are given back before the columns to be written are made, which take as much.
            let mut view = TileView::new(cloud);
            if let Some(noise) = self.noise {
                noise.mark(&mut view, &mut classes)?;
            }
            self.filter.classify(&mut view, &mut classes)?;
        }

        let mut payload = GroundPayload::default();
        let (mut ids, mut codes) = (Vec::new(), Vec::new());
        let mut heights = HeightSums::default();
        let grid = self.tiles.drive.grid;
        for (point, class) in classes.iter().enumerate().filter(|(point, _)| gathered.core[*point]) {
            ids.push(cloud.id[point]);
            codes.push(class.code());
            payload.counts[usize::from(class.code())] += 1;
            if *class == PointClass::Ground {
                let [x, y, z] = cloud.lattice_point(point);
                if let Some(cell) = grid.cell(x, y) {
                    heights.add(cell, z);
                }
            }
        }
        payload.heights = heights.finish();
        self.tiles.drive.write_column(&self.tiles.drive.classes, &ids, &codes)?;
        codec::encode(&payload)
    }

    fn sync(&self) -> Result<()> {
        sync_columns(&self.tiles.drive.classes)
    }
}

impl GroundPass<'_> {
    /// Points of objects in the core of each tile, from the finished pass.
    pub(crate) fn reduce(&self, dir: &PassDir) -> Result<Vec<u64>> {
        let objects = |unit| {
            let payload: GroundPayload = codec::decode(&dir.payload(unit)?)?;
            Ok(payload.counts[usize::from(PointClass::Object.code())])
        };
        (0..self.units()).map(objects).collect()
    }
}
