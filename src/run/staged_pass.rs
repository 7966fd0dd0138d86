//! Passes of a method with stages: each stage over the tiles, its reduction, and the last one, which gives objects.

use std::collections::BTreeMap;

use crate::cluster::{DriveSource, Mapped, StagedClusterer, TilePoints, TileSource};
use crate::codec;
use crate::error::{Error, Result};
use crate::model::{Lattice, ObjectPart, PointClass};
use crate::run::clustered::Objects;
use crate::run::drive::sync_columns;
use crate::run::engine::Pass;
use crate::run::tiles::Tiles;
use crate::stitch::{LocalObject, Stitcher};
use crate::store::PassDir;
use crate::tiling::Wanted;

/// Bytes per point that a tile of a stage needs at its peak. `scripts/tile_memory.py` measured 17 to 48 on streets, where
/// half of the points or more are ground, and 61 to 66 in forests, where nearly all are of objects and few to a voxel; the
/// stage `borders` of density-peaks is the hungriest.
pub(crate) const BYTES_PER_POINT: u64 = 68;

/// What the engine keeps of a tile after a stage: its payload, and behind it, encoded, the object of label 1, 2, ... over
/// the points of the tile (none but for the last stage). The length of the payload, a little-endian u64, comes last, so
/// that the payload is taken out by cutting.
fn keep(mut payload: Vec<u8>, parts: &[ObjectPart]) -> Result<Vec<u8>> {
    let length = payload.len() as u64;
    payload.extend(codec::encode(&parts)?);
    payload.extend(length.to_le_bytes());
    Ok(payload)
}

/// Where the payload ends in what is kept.
fn payload_end(kept: &[u8]) -> Result<usize> {
    let length = kept.last_chunk().map(|length| u64::from_le_bytes(*length));
    length
        .and_then(|length| usize::try_from(length).ok())
        .filter(|length| *length <= kept.len() - size_of::<u64>())
        .ok_or_else(|| Error::bug(format!("{} bytes are not what a stage keeps", kept.len())))
}

/// The stages that are done: where their payloads are, and their globals.
pub(crate) struct Done<'a> {
    pub(crate) tiles: &'a Tiles<'a>,
    pub(crate) dirs: Vec<PassDir>,
    globals: Vec<Vec<u8>>,
}

impl<'a> Done<'a> {
    /// None yet.
    pub(crate) fn new(tiles: &'a Tiles<'a>) -> Self {
        Self { tiles, dirs: Vec::new(), globals: Vec::new() }
    }

    /// Adds the global of the stage in the last of `dirs`: as stored behind the tiles of its pass, else reduced and
    /// stored there.
    pub(crate) fn reduce(&mut self, method: &dyn StagedClusterer) -> Result<()> {
        let stage = self.globals.len();
        let behind = self.tiles.plan.tiles.len();
        let dir = &self.dirs[stage];
        let global = match dir.load(behind)? {
            Ok(global) => global,
            Err(_) => {
                let global = method.reduce(stage, self)?;
                dir.commit(behind, &global)?;
                global
            }
        };
        self.globals.push(global);
        Ok(())
    }

    fn kept(&self, stage: usize, tile: u32) -> Result<Vec<u8>> {
        let dir =
            self.dirs.get(stage).ok_or_else(|| Error::bug(format!("stage {stage} has not been run")))?;
        Ok(dir.payload(tile as usize)?)
    }

    fn parts(&self, tile: u32) -> Result<Vec<ObjectPart>> {
        let kept = self.kept(self.dirs.len() - 1, tile)?;
        codec::decode(&kept[payload_end(&kept)?..kept.len() - size_of::<u64>()])
    }

    /// Whole objects and their ids, from the finished stages, and what the method has to say about them.
    pub(crate) fn objects(&self, method: &dyn StagedClusterer) -> Result<Objects> {
        let grouped = method.group(self)?;
        let mut stitcher = Stitcher::default();
        for (tile, groups) in (0_u32..).zip(&grouped.groups) {
            let mut parts = self.parts(tile)?;
            if parts.len() != groups.len() {
                return Err(Error::bug(format!(
                    "tile {tile} has {} labels and {} groups",
                    parts.len(),
                    groups.len()
                )));
            }
            for (part, _) in parts.iter_mut().zip(groups).filter(|(_, group)| **group == 0) {
                *part = ObjectPart::empty();
            }
            stitcher.tile(parts.into_iter().map(|part| LocalObject { open: true, part }).collect());
        }
        let mut first = BTreeMap::<u32, (u32, u32)>::new();
        for (tile, groups) in (0_u32..).zip(&grouped.groups) {
            for (label, &group) in (1_u32..).zip(groups).filter(|(_, group)| **group != 0) {
                let one = *first.entry(group).or_insert((tile, label));
                if one != (tile, label) && !stitcher.link(one, (tile, label)) {
                    return Err(Error::bug(format!("label {label} of tile {tile} does not exist")));
                }
            }
        }
        let stitched = stitcher.finish(&method.object_size());
        Ok(Objects { stitched, figures: Some(grouped.figures), charts: grouped.charts })
    }
}

impl DriveSource for Done<'_> {
    fn lattice(&self) -> Lattice {
        self.tiles.drive.lattice()
    }

    fn tiles(&self) -> u32 {
        u32::try_from(self.tiles.plan.tiles.len()).unwrap_or(u32::MAX)
    }

    fn payload(&self, stage: usize, tile: u32) -> Result<Vec<u8>> {
        let mut kept = self.kept(stage, tile)?;
        kept.truncate(payload_end(&kept)?);
        Ok(kept)
    }

    fn global(&self, stage: usize) -> &[u8] {
        self.globals.get(stage).map_or(&[], |global| global)
    }
}

/// One stage over the tiles.
pub(crate) struct StagedPass<'a> {
    pub(crate) done: &'a Done<'a>,
    pub(crate) method: &'a dyn StagedClusterer,
    pub(crate) stage: usize,
    /// Horizontal reach of the method in lattice units.
    pub(crate) reach: i64,
}

impl Pass for StagedPass<'_> {
    fn name(&self) -> &'static str {
        self.method.stages()[self.stage].name
    }

    fn units(&self) -> usize {
        self.done.tiles.plan.tiles.len()
    }

    fn points(&self, unit: usize) -> u64 {
        self.done.tiles.plan.tiles[unit].points
    }

    fn bytes(&self, unit: usize) -> u64 {
        self.done.tiles.plan.region_points(unit, self.reach) * BYTES_PER_POINT
    }

    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        let source = Around { done: self.done, tile: unit };
        let Mapped { payload, labelled } = self.method.map(self.stage, &source)?;
        let drive = self.done.tiles.drive;
        let mut parts = Vec::new();
        if let Some(labelled) = labelled {
            let TilePoints { cloud, core, .. } = &labelled.points;
            let labels = &labelled.labels;
            let file = |id: u64| u32::try_from(drive.locate(id).0).unwrap_or(u32::MAX);
            parts = ObjectPart::collect(cloud, labels, labelled.count, |point| core[point], file);
            let (ids, values): (Vec<u64>, Vec<u32>) = (0..cloud.len())
                .filter(|&point| core[point])
                .map(|point| (cloud.id[point], labels[point]))
                .unzip();
            drive.write_column(&drive.labels, &ids, &values)?;
        }
        keep(payload, &parts)
    }

    fn sync(&self) -> Result<()> {
        sync_columns(&self.done.tiles.drive.labels)
    }
}

/// The drive as a stage sees it from one tile.
struct Around<'a> {
    done: &'a Done<'a>,
    tile: usize,
}

impl DriveSource for Around<'_> {
    fn lattice(&self) -> Lattice {
        self.done.lattice()
    }

    fn tiles(&self) -> u32 {
        self.done.tiles()
    }

    fn payload(&self, stage: usize, tile: u32) -> Result<Vec<u8>> {
        self.done.payload(stage, tile)
    }

    fn global(&self, stage: usize) -> &[u8] {
        self.done.global(stage)
    }
}

impl TileSource for Around<'_> {
    fn tile(&self) -> u32 {
        u32::try_from(self.tile).unwrap_or(u32::MAX)
    }

    fn cell_edge(&self) -> i64 {
        self.done.tiles.drive.grid.edge()
    }

    fn points(&self, reach: i64, objects_only: bool) -> Result<TilePoints> {
        let tiles = self.done.tiles;
        let wanted = if objects_only { Wanted::Objects } else { Wanted::Solid };
        let gathered = tiles.gather(self.tile, reach, wanted)?;
        let all: u64 = tiles.plan.tiles.iter().map(|tile| tile.points).sum();
        let ground = match wanted {
            Wanted::Objects => Vec::new(),
            _ => gathered.classes.iter().map(|&code| code == PointClass::Ground.code()).collect(),
        };
        let whole = tiles.plan.region_points(self.tile, reach) == all;
        Ok(TilePoints { cloud: gathered.cloud, core: gathered.core, ground, whole })
    }

    fn near(&self, reach: i64) -> Vec<u32> {
        // A cell is read whole when its border is within reach, so a point may lie a diagonal further than that.
        let diagonal = self.done.tiles.drive.grid.edge() * 3 / 2;
        self.done.tiles.plan.region(self.tile, reach + diagonal).tiles
    }

    fn owner(&self, lo: [i64; 2], hi: [i64; 2]) -> Option<u32> {
        let (grid, owners) = (self.done.tiles.drive.grid, self.done.tiles.plan.owners());
        let (from, to) = (grid.cell(lo[0], lo[1])?, grid.cell(hi[0], hi[1])?);
        let mut cells = (from[0]..=to[0]).flat_map(|i| (from[1]..=to[1]).map(move |j| [i, j]));
        cells.find_map(|cell| owners.get(cell).checked_sub(1))
    }
}
