//! Pass `scatter`: if the order of the records is unfavourable for tiles (shuffled, tiled by other software,
//! merged), writes the geometry of every point again, grouped by owning tile. Then a tile reads little more
//! than it needs.
//!
//! ```text
//! payload := groups points       sections
//! points := point*               grouped by owning tile, in file order within a tile
//! point := x y z (i32, as in the record) record (u32, from the first record of the unit; with the highest
//!          bit if it is withheld)
//! ```

use crate::codec;
use crate::error::Result;
use crate::model::{TileId, in_u32, record_xyz};
use crate::run::drive::ScatteredUnit;
use crate::run::drive::{BlockRun, Drive, Groups, RECORD_BITS, STRIDE, Scattered, Surveyed};
use crate::run::engine::{Outline, Pass, Payloads, Sections};
use crate::store::Inputs;
use crate::tiling::Plan;

const NUMBER: u32 = 1;
const NAME: &str = "scatter";

/// Sections of the payload of a unit.
const GROUPS: usize = 0;
const POINTS: usize = 1;
/// The tile of points outside a section, which no tile reads.
const NOBODY: TileId = TileId::new(u32::MAX);

pub(crate) struct ScatterPass<'a> {
    drive: &'a Drive,
    plan: &'a Plan,
    runs: Vec<BlockRun>,
    outline: Outline,
}

/// Raised when the points of a unit are stored otherwise.
const EPOCH: u32 = 1;

/// Scattering depends on the content of the input and on the tiles.
pub(crate) fn outline(surveyed: &Surveyed, plan: &Plan) -> Outline {
    let depends = Inputs::new()
        .with("scatter epoch", EPOCH)
        .with("input content", format!("{:016x}", surveyed.content_digest()))
        .with("tiles", format!("{} tiles, geometry {:016x}", plan.tiles.len(), plan.digest()));
    Outline::new(NUMBER, NAME, depends)
}

impl<'a> ScatterPass<'a> {
    pub(crate) fn of(drive: &'a Drive, plan: &'a Plan, outline: Outline) -> Self {
        Self { drive, plan, runs: drive.block_runs(), outline }
    }

    /// Every point of a unit with its tile.
    fn grouped(&self, run: &BlockRun) -> Result<Vec<(TileId, [u8; STRIDE])>> {
        let input = self.drive.file(run.file);
        let first = input.blocks()[run.blocks.start].first_record;
        let mut points = Vec::with_capacity(usize::try_from(run.points).unwrap_or(0));
        let mut owners = self.plan.owners().cursor();
        let mut buffer = Vec::new();
        for block in run.blocks.clone() {
            let mut record = in_u32(input.blocks()[block].first_record - first, "records of a unit");
            self.drive.geometry(run.file, block, &mut buffer, |view, transform| {
                for bytes in view.bytes.chunks_exact(view.stride) {
                    let [x, y, _] = transform.apply(record_xyz(bytes));
                    let owner = self.drive.grid.cell(x, y).map_or(0, |cell| owners.get(cell));
                    let mut point = [0; STRIDE];
                    point[..12].copy_from_slice(&bytes[..12]);
                    let withheld = if view.is_withheld(bytes) { !RECORD_BITS } else { 0 };
                    point[12..].copy_from_slice(&(record | withheld).to_le_bytes());
                    points.push((owner.checked_sub(1).map_or(NOBODY, TileId::new), point));
                    record += 1;
                }
            })?;
        }
        // The sort is stable: within a tile, the points stay in file order.
        points.sort_by_key(|point| point.0);
        Ok(points)
    }
}

impl Pass for ScatterPass<'_> {
    type Global = Scattered;

    fn outline(&self) -> &Outline {
        &self.outline
    }

    fn units(&self) -> usize {
        self.runs.len()
    }

    fn points(&self, unit: usize) -> u64 {
        self.runs[unit].points
    }

    fn bytes(&self, unit: usize) -> u64 {
        // Points with their tile, and twice the bytes to be stored.
        self.runs[unit].points * (20 + 2 * STRIDE as u64)
    }

    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        let run = &self.runs[unit];
        self.drive.file(run.file).check_unchanged()?;
        let points = self.grouped(run)?;
        let groups = Groups::of(points.iter().map(|(tile, _)| *tile));
        let bytes: Vec<[u8; STRIDE]> = points.into_iter().map(|(_, point)| point).collect();
        let bytes = bytes.into_flattened();
        Ok(codec::pack(&[codec::encode(&groups)?, bytes]))
    }

    /// The scattered points.
    fn reduce(&self, payloads: &Payloads) -> Result<Scattered> {
        let mut units = Vec::new();
        for (unit, run) in self.runs.iter().enumerate() {
            let first_record = self.drive.file(run.file).blocks()[run.blocks.start].first_record;
            let groups = codec::decode(&payloads.section(unit, GROUPS)?)?;
            units.push(ScatteredUnit { number: run.file, first_record, groups });
        }
        Ok(Scattered { units, points: Sections::of(payloads.clone(), POINTS) })
    }
}
