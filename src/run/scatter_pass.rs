//! Pass `scatter`: where the order of the records is bad for tiles (shuffled, tiled by others, merged), writes the
//! geometry of every point once more, grouped by owning tile, so that a tile reads what it needs and little else.
//!
//! ```text
//! file of a unit := point*            grouped by owning tile, in file order within a tile
//! point := x y z (i32, as in the record) record (u32, from the first record of the unit)
//! ```

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::codec;
use crate::error::Result;
use crate::model::record_xyz;
use crate::run::drive::{BlockRun, Drive};
use crate::run::engine::Pass;
use crate::spatial::PackedCells;
use crate::store::{PassDir, RunDir, StoreError};

/// Bytes of a point in a scattered file.
pub(crate) const STRIDE: usize = 16;

pub(crate) struct ScatterPass<'a> {
    pub(crate) drive: &'a Drive,
    pub(crate) owners: &'a PackedCells,
    pub(crate) runs: Vec<BlockRun>,
    folder: PathBuf,
}

/// Where the points of each tile are in the file of a unit: (tile, first point), ascending, and the end.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Groups {
    first: Vec<(u32, u64)>,
    end: u64,
}

impl<'a> ScatterPass<'a> {
    pub(crate) fn new(drive: &'a Drive, owners: &'a PackedCells, run_dir: &RunDir) -> Result<Self> {
        let folder = run_dir.path("scattered");
        fs_err::create_dir_all(&folder).map_err(StoreError::io("create", &folder))?;
        Ok(Self { drive, owners, runs: drive.block_runs(), folder })
    }

    /// Takes back finished units whose points were lost or cut.
    pub(crate) fn forget_lost(&self, dir: &PassDir) -> Result<()> {
        for (unit, run) in self.runs.iter().enumerate() {
            let whole = run.points * STRIDE as u64;
            if std::fs::metadata(self.path(unit)).map_or(true, |facts| facts.len() != whole) {
                dir.invalidate(unit)?;
            }
        }
        Ok(())
    }

    fn path(&self, unit: usize) -> PathBuf {
        self.folder.join(format!("{unit:06}"))
    }

    /// Every point of a unit with its tile.
    fn points(&self, run: &BlockRun) -> Result<Vec<(u32, [u8; STRIDE])>> {
        let input = self.drive.file(run.file);
        let first = input.blocks()[run.blocks.start].first_record;
        let mut points = Vec::with_capacity(usize::try_from(run.points).unwrap_or(0));
        let mut owners = self.owners.cursor();
        let mut buffer = Vec::new();
        for block in run.blocks.clone() {
            let mut record = u32::try_from(input.blocks()[block].first_record - first).unwrap_or(u32::MAX);
            self.drive.geometry(run.file, block, &mut buffer, |view, transform| {
                for bytes in view.bytes.chunks_exact(view.stride) {
                    let [x, y, _] = transform.apply(record_xyz(bytes));
                    let owner = self.drive.grid.cell(x, y).map_or(0, |cell| owners.get(cell));
                    let mut point = [0; STRIDE];
                    point[..12].copy_from_slice(&bytes[..12]);
                    point[12..].copy_from_slice(&record.to_le_bytes());
                    points.push((owner.saturating_sub(1), point));
                    record += 1;
                }
            })?;
        }
        Ok(points)
    }

    /// The scattered points, from the finished pass.
    pub(crate) fn reduce(&self, dir: &PassDir) -> Result<Scattered> {
        let mut units = Vec::new();
        for (unit, run) in self.runs.iter().enumerate() {
            let path = self.path(unit);
            let file = File::open(&path).map_err(StoreError::io("open", &path))?;
            let first_record = self.drive.file(run.file).blocks()[run.blocks.start].first_record;
            let groups = codec::decode(&dir.payload(unit)?)?;
            units.push(ScatteredUnit {
                path,
                file,
                number: run.file,
                first_record,
                records: run.points,
                groups,
            });
        }
        Ok(Scattered { units })
    }
}

impl Pass for ScatterPass<'_> {
    fn name(&self) -> &'static str {
        "scatter"
    }

    fn units(&self) -> usize {
        self.runs.len()
    }

    fn points(&self, unit: usize) -> u64 {
        self.runs[unit].points
    }

    fn bytes(&self, unit: usize) -> u64 {
        // Points with their tile, and the bytes that are written.
        self.runs[unit].points * (20 + STRIDE as u64)
    }

    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        let run = &self.runs[unit];
        self.drive.file(run.file).check_unchanged()?;
        let mut points = self.points(run)?;
        // Stable: file order within a tile.
        points.sort_by_key(|point| point.0);
        let mut groups = Groups { first: Vec::new(), end: points.len() as u64 };
        let mut bytes = Vec::with_capacity(points.len() * STRIDE);
        for (at, (tile, point)) in points.iter().enumerate() {
            if groups.first.last().is_none_or(|last| last.0 != *tile) {
                groups.first.push((*tile, at as u64));
            }
            bytes.extend_from_slice(point);
        }
        let path = self.path(unit);
        let write = || -> std::io::Result<()> {
            let file = File::options().write(true).create(true).truncate(true).open(&path)?;
            file.write_all_at(&bytes, 0)?;
            file.sync_data()
        };
        write().map_err(StoreError::io("write", &path))?;
        codec::encode(&groups)
    }
}

/// The points of the drive grouped by tile, unit by unit.
#[derive(Debug)]
pub(crate) struct Scattered {
    units: Vec<ScatteredUnit>,
}

#[derive(Debug)]
struct ScatteredUnit {
    path: PathBuf,
    file: File,
    /// Number of the input file.
    number: usize,
    first_record: u64,
    records: u64,
    groups: Groups,
}

/// Points of some tiles out of one unit.
pub(crate) struct ScatteredGroup {
    /// Number of the input file.
    pub(crate) file: usize,
    /// Record of the unit's first point in that file.
    pub(crate) first_record: u64,
    /// Records of the unit.
    pub(crate) records: u64,
    /// The points, [`STRIDE`] bytes each.
    pub(crate) bytes: Vec<u8>,
}

impl Scattered {
    /// The points of `tiles` (ascending), unit by unit.
    pub(crate) fn groups<'a>(
        &'a self,
        tiles: &'a [u32],
    ) -> impl Iterator<Item = Result<ScatteredGroup>> + 'a {
        self.units.iter().map(|unit| unit.read(tiles))
    }
}

impl ScatteredUnit {
    fn read(&self, tiles: &[u32]) -> Result<ScatteredGroup> {
        let mut bytes = Vec::new();
        for tile in tiles {
            let Ok(at) = self.groups.first.binary_search_by_key(tile, |group| group.0) else { continue };
            let first = self.groups.first[at].1;
            let end = self.groups.first.get(at + 1).map_or(self.groups.end, |next| next.1);
            let start = bytes.len();
            bytes.resize(start + usize::try_from(end - first).unwrap_or(0) * STRIDE, 0);
            self.file
                .read_exact_at(&mut bytes[start..], first * STRIDE as u64)
                .map_err(StoreError::io("read", &self.path))?;
        }
        let (file, first_record, records) = (self.number, self.first_record, self.records);
        Ok(ScatteredGroup { file, first_record, records, bytes })
    }
}
