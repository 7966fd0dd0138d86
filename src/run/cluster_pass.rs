//! Pass `cluster`: joins the points that are neither ground nor noise, tile by tile; and its reduction, the stitching.

use crate::cluster::Clusterer;
use crate::codec;
use crate::error::{Error, Result};
use crate::run::drive::sync_columns;
use crate::run::engine::Pass;
use crate::run::fields_pass::StoredFields;
use crate::run::tiles::Tiles;
use crate::stitch::{LocalLabels, Stitched, Stitcher};
use crate::store::{PassDir, StoreError};
use crate::tiling::Wanted;

/// Bytes per point of objects that a tile of this pass needs at its peak: `scripts/tile_memory.py` measured 47 to 83 on streets
/// and 76 to 84 in forests. In a space of so many fields (0: none beside coordinates) the places of the points and a tree come on
/// top, estimated from their sizes.
pub(crate) fn bytes_per_point(fields: usize) -> u64 {
    88 + 32 * fields as u64
}

pub(crate) struct ClusterPass<'a> {
    pub(crate) tiles: &'a Tiles<'a>,
    pub(crate) method: &'a dyn Clusterer,
    /// Horizontal reach of the method in lattice units.
    pub(crate) reach: i64,
}

impl Pass for ClusterPass<'_> {
    fn name(&self) -> &'static str {
        "cluster"
    }

    fn units(&self) -> usize {
        self.tiles.plan.tiles.len()
    }

    fn points(&self, unit: usize) -> u64 {
        self.tiles.plan.tiles[unit].points
    }

    fn bytes(&self, unit: usize) -> u64 {
        let per_point = bytes_per_point(self.tiles.fields.map_or(0, StoredFields::dimensions));
        self.tiles.object_points(unit, self.reach) * per_point
    }

    fn prefetch(&self, unit: usize) {
        self.tiles.prefetch(unit, self.reach);
    }

    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        let gathered = self.tiles.gather(unit, self.reach, Wanted::Objects)?;
        let (cloud, core) = (&gathered.cloud, &gathered.core);
        let mut labels = vec![0; cloud.len()];
        let count = self.method.cluster_tile(cloud, core, &mut labels)?;
        let (drive, owners) = (self.tiles.drive, self.tiles.plan.owners());
        let owner = |point: usize| {
            let [x, y, _] = cloud.lattice_point(point);
            // Gathered points lie in occupied cells, and those have an owner.
            drive.grid.cell(x, y).map_or(0, |cell| owners.get(cell)).saturating_sub(1)
        };
        let file = |id: u64| u32::try_from(drive.locate(id).0).unwrap_or(u32::MAX);
        let size = self.method.object_size();
        let local = LocalLabels::collect(cloud, core, &mut labels, count, &size, owner, file);
        let (ids, values): (Vec<u64>, Vec<u32>) = (0..cloud.len())
            .filter(|&point| core[point])
            .map(|point| (cloud.id[point], labels[point]))
            .unzip();
        drive.write_column(&drive.labels, &ids, &values)?;
        codec::encode(&local)
    }

    fn sync(&self) -> Result<()> {
        sync_columns(&self.tiles.drive.labels)
    }
}

impl ClusterPass<'_> {
    /// Whole objects and their ids, from the finished pass.
    pub(crate) fn reduce(&self, dir: &PassDir) -> Result<Stitched> {
        let mut stitcher = Stitcher::default();
        for unit in 0..self.units() {
            let local: LocalLabels = codec::decode(&dir.payload(unit)?)?;
            stitcher.tile(local.objects);
        }
        for unit in 0..self.units() {
            let local: LocalLabels = codec::decode(&dir.payload(unit)?)?;
            self.link(&mut stitcher, unit, &local)?;
        }
        Ok(stitcher.finish(&self.method.object_size()))
    }

    /// Unites the labels of tile `unit` with those that the owners gave to the points of its halo.
    fn link(&self, stitcher: &mut Stitcher, unit: usize, local: &LocalLabels) -> Result<()> {
        let here = u32::try_from(unit).unwrap_or(u32::MAX);
        let mut reader = LabelReader { tiles: self.tiles, file: usize::MAX, first: 0, values: Vec::new() };
        let mut last = None;
        for seam in &local.seams {
            let there = reader.label(seam.id)?;
            let link = ((here, seam.label), (seam.owner, there));
            if last == Some(link) {
                continue;
            }
            last = Some(link);
            if !stitcher.link(link.0, link.1) {
                let text = format!(
                    "point {} has label {} in tile {here} and {there} in tile {}",
                    seam.id, seam.label, seam.owner
                );
                return Err(Error::bug(text));
            }
        }
        Ok(())
    }
}

/// Reads labels by ascending point id, a page at a time.
struct LabelReader<'a> {
    tiles: &'a Tiles<'a>,
    file: usize,
    first: u64,
    values: Vec<u32>,
}

impl LabelReader<'_> {
    const PAGE: u64 = 16_384;

    fn label(&mut self, id: u64) -> Result<u32> {
        let drive = self.tiles.drive;
        let (file, record) = drive.locate(id);
        if file != self.file || record < self.first || record >= self.first + self.values.len() as u64 {
            self.file = file;
            self.first = record / Self::PAGE * Self::PAGE;
            let count = Self::PAGE.min(drive.file(file).point_count() - self.first);
            self.values.resize(usize::try_from(count).unwrap_or(0), 0);
            let column = &drive.labels[file];
            column.read(self.first, &mut self.values).map_err(StoreError::io("read", column.path()))?;
        }
        Ok(self.values[usize::try_from(record - self.first).unwrap_or(0)])
    }
}
