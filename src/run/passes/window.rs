//! The windows of a step of a method: the drive and its tiles, and the stored results of earlier steps and
//! rounds.

use crate::cluster::{DriveWindow, Method, TilePoints, TileWindow};
use crate::error::{Error, Result};
use crate::model::{Field, FieldSums, Lattice, PointClass, TileId};
use crate::run::drive::{Classified, Drive, StoredFields};
use crate::run::engine::{Payloads, Rounds};
use crate::run::passes::sections;
use crate::spatial::{Cell, CellGrid, CellMap, PackedCells};
use crate::store::UnitReader;
use crate::tiling::{Plan, Region, Wanted};

/// The drive that a method works on, and the method.
pub(crate) struct MethodDrive<'a> {
    pub(crate) classified: &'a Classified<'a>,
    pub(crate) method: &'a dyn Method,
    /// Further fields of the points with their sums, if the method asks for any.
    pub(crate) fields: Option<(StoredFields, Vec<(Field, FieldSums)>)>,
}

/// The complete rounds of a step: where the latest result of each tile is.
pub(crate) struct StepResults {
    pub(crate) rounds: Rounds,
    pub(crate) payloads: Vec<Payloads>,
}

impl StepResults {
    /// A reader of the payload of a tile.
    pub(crate) fn reader(&self, tile: TileId) -> Result<UnitReader> {
        let (round, unit) = self.rounds.latest(tile.index());
        let payloads = self.payloads.get(round as usize);
        payloads.ok_or_else(|| Error::bug(format!("tile {tile} was not computed")))?.reader(unit)
    }
}

/// A method in progress: its complete steps, and the complete rounds of the current step.
pub(crate) struct Progress<'a> {
    pub(crate) over: &'a MethodDrive<'a>,
    /// Complete steps with their globals.
    pub(crate) done: Vec<(StepResults, Vec<u8>)>,
    pub(crate) current: StepResults,
    /// The bytes that the last reduction of this step returned, if it asked for another round.
    pub(crate) again: Vec<u8>,
}

impl Progress<'_> {
    fn drive(&self) -> &Drive {
        self.over.classified.tiled.drive
    }

    pub(crate) fn plan(&self) -> &Plan {
        self.over.classified.tiled.plan
    }

    fn results(&self, step: usize) -> Result<&StepResults> {
        match self.done.get(step) {
            Some((results, _)) => Ok(results),
            None if step == self.done.len() => Ok(&self.current),
            None => Err(Error::bug(format!("step {step} has not been run"))),
        }
    }
}

impl DriveWindow for Progress<'_> {
    fn lattice(&self) -> Lattice {
        self.drive().lattice()
    }

    fn tiles(&self) -> usize {
        self.plan().tiles.len()
    }

    fn objects(&self) -> u64 {
        self.over.classified.objects.iter().sum()
    }

    fn extent(&self) -> ([i64; 3], [i64; 3]) {
        self.over.classified.tiled.surveyed.extent()
    }

    fn longest_tile_m(&self) -> f64 {
        let edge_m = self.lattice().metres(self.drive().grid.edge());
        self.plan().tiles.iter().map(|tile| tile.to_m - tile.from_m + edge_m).fold(0.0, f64::max)
    }

    fn field_sums(&self) -> &[(Field, FieldSums)] {
        self.over.fields.as_ref().map_or(&[], |(_, sums)| sums)
    }

    fn payload(&self, step: usize, tile: TileId) -> Result<Vec<u8>> {
        self.results(step)?.reader(tile)?.read_section(sections::PAYLOAD)
    }

    fn global(&self, step: usize) -> &[u8] {
        self.done.get(step).map_or(&[], |(_, global)| global)
    }

    fn again(&self) -> &[u8] {
        &self.again
    }
}

/// The drive as a step sees it from one tile.
pub(crate) struct Around<'a> {
    pub(crate) progress: &'a Progress<'a>,
    pub(crate) tile: TileId,
}

impl Around<'_> {
    fn region(&self, reach: i64) -> Region {
        self.progress.plan().region(self.tile.index(), reach)
    }

    fn gather(&self, region: &Region, wanted: Wanted) -> Result<TilePoints> {
        let over = self.progress.over;
        let fields = over.fields.as_ref().map(|(stored, _)| stored);
        let gathered = over.classified.gather(region, wanted, fields)?;
        let ground = match wanted {
            Wanted::Objects => Vec::new(),
            _ => gathered.classes.iter().map(|&code| code == PointClass::Ground.code()).collect(),
        };
        Ok(TilePoints { cloud: gathered.cloud, core: gathered.core, ground })
    }
}

impl DriveWindow for Around<'_> {
    fn lattice(&self) -> Lattice {
        self.progress.lattice()
    }

    fn tiles(&self) -> usize {
        self.progress.tiles()
    }

    fn objects(&self) -> u64 {
        self.progress.objects()
    }

    fn extent(&self) -> ([i64; 3], [i64; 3]) {
        self.progress.extent()
    }

    fn longest_tile_m(&self) -> f64 {
        self.progress.longest_tile_m()
    }

    fn field_sums(&self) -> &[(Field, FieldSums)] {
        self.progress.field_sums()
    }

    fn payload(&self, step: usize, tile: TileId) -> Result<Vec<u8>> {
        self.progress.payload(step, tile)
    }

    fn global(&self, step: usize) -> &[u8] {
        self.progress.global(step)
    }

    fn again(&self) -> &[u8] {
        self.progress.again()
    }
}

impl TileWindow for Around<'_> {
    fn tile(&self) -> TileId {
        self.tile
    }

    fn grid(&self) -> CellGrid {
        self.progress.drive().grid
    }

    fn occupied(&self) -> &PackedCells {
        self.progress.plan().cells()
    }

    fn cells(&self, reach: i64) -> CellMap<u8> {
        self.region(reach).roles
    }

    fn points(&self, reach: i64, objects_only: bool) -> Result<TilePoints> {
        let wanted = if objects_only { Wanted::Objects } else { Wanted::Solid };
        self.gather(&self.region(reach), wanted)
    }

    fn points_of(&self, cells: Vec<Cell>) -> Result<TilePoints> {
        self.gather(&self.progress.plan().region_of(cells), Wanted::Objects)
    }

    fn near(&self, reach: i64) -> Vec<TileId> {
        // A cell is read whole if its border is within reach, so a point may be further away by the diagonal
        // of a cell.
        let diagonal = self.grid().edge() * 3 / 2;
        self.region(reach + diagonal).tiles
    }

    fn near_cells(&self, cells: &[Cell], reach: i64) -> Vec<TileId> {
        let plan = self.progress.plan();
        let disc = self.grid().disc(reach);
        let around = cells
            .iter()
            .flat_map(|cell| disc.iter().map(move |by| [0, 1].map(|k| cell[k].wrapping_add(by[k]))));
        let mut owners = plan.owners().cursor();
        let mut tiles: Vec<TileId> =
            around.filter_map(|cell| owners.get(cell).checked_sub(1)).map(TileId::new).collect();
        tiles.sort_unstable();
        tiles.dedup();
        tiles
    }

    fn owner(&self, lo: [i64; 2], hi: [i64; 2]) -> Option<TileId> {
        let grid = self.grid();
        let owners = self.progress.plan().owners();
        let from = grid.cell(lo[0], lo[1])?;
        let to = grid.cell(hi[0], hi[1])?;
        let mut cells = (from[0]..=to[0]).flat_map(|i| (from[1]..=to[1]).map(move |j| [i, j]));
        cells.find_map(|cell| owners.get(cell).checked_sub(1)).map(TileId::new)
    }

    fn round(&self) -> u32 {
        self.progress.current.rounds.round()
    }

    fn border(&self, tile: TileId) -> Result<Vec<u8>> {
        if self.round() == 0 {
            return Ok(Vec::new());
        }
        self.progress.current.reader(tile)?.read_section(sections::BORDER)
    }
}
