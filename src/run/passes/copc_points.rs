//! Pass `copc points`: makes the records of the cloud-optimised file, and writes them grouped by the column
//! of its octree that owns them, so that the columns can be completed one at a time.
//!
//! ```text
//! payload := found points            sections
//! points := point*                   grouped by column, in file order within a column
//! point := record number from the first of the unit (u32), record of the cloud-optimised file
//! ```

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::codec;
use crate::error::Result;
use crate::input::Fields;
use crate::model::{Kind, PointId, in_u32, record_xyz};
use crate::output::LabelledFile;
use crate::output::points::copc::{
    CopcFormat, Cube, LEAF_POINTS, Spot, Squares, Totals, leaf_levels, rank, undecided_levels,
};
use crate::run::drive::{BlockRun, Drive, Groups};
use crate::run::engine::{Outline, Pass, Payloads, Sections};
use crate::run::passes::copies::{Labels, Shown};
use crate::run::passes::relabel::PointColumns;
use crate::spatial::{Cell, PackedCells};
use crate::store::Inputs;

const NUMBER: u32 = 8;
const NAME: &str = "copc points";

/// Sections of the payload of a unit.
const FOUND: usize = 0;
const POINTS: usize = 1;
/// Bytes of the number before a record.
const NUMBER_BYTES: usize = 4;
/// The group of points that are not shown.
const NOWHERE: u32 = u32::MAX;

/// What the bytes of a unit mean. 2: columns follow from the written coordinates. 3: overlap points of point
/// formats 0 to 5 have the flag.
const EPOCH: u32 = 3;

/// The points depend on the values of all points and on the settings of the output, as the labelled copies
/// do. Their columns follow from the tiles, on which these values depend.
pub(crate) fn outline(export: &Outline) -> Outline {
    let depends = Inputs::new().with("pass export", export.depends.fingerprint());
    Outline::new(NUMBER, NAME, depends.with("copc epoch", EPOCH))
}

/// The columns of the octree that are completed one at a time, and where the octree ends.
#[derive(Debug)]
pub(crate) struct Columns {
    pub(crate) cube: Cube,
    /// The columns.
    pub(crate) list: Squares,
    /// The squares below which the tree ends. They follow from the points of the cells alone.
    leaves: Squares,
}

impl Columns {
    /// Divides a cube into columns until they have at most `most` points, or are single cells. No column is
    /// below a leaf of the octree, whatever `most` is.
    pub(crate) fn of(cube: Cube, cells: &PackedCells, edge: i64, most: u64) -> Self {
        let level = cube.raster_level(edge);
        let from = [0, 1].map(|axis| cube.origin[axis].div_euclid(edge));
        let digits =
            |cell: Cell| [0, 1].map(|axis| (i64::from(cell[axis]) - from[axis]).max(0).cast_unsigned());
        let mut counts: Vec<(u64, u64)> =
            cells.iter().map(|(cell, points)| (Squares::code(level, digits(cell)), points.into())).collect();
        counts.sort_unstable();
        let leaf = LEAF_POINTS as u64;
        let divide = |most: u64| Squares::divide(&counts, level, most);
        Self { cube, list: divide(most.max(leaf)), leaves: divide(leaf) }
    }

    /// The column of a place.
    fn of_place(&self, spot: Spot) -> usize {
        self.list.of(spot.square(self.list.cells()))
    }

    /// The level at which the tree ends, for each point of a column.
    pub(super) fn leaf_levels(&self, points: &[(Spot, u64)]) -> Vec<u32> {
        let cells = self.leaves.cells();
        leaf_levels(points, cells, |spot| self.leaves.level(self.leaves.of(spot.square(cells))))
    }

    /// Levels at which some column cannot decide alone.
    fn undecided(&self) -> u32 {
        undecided_levels(self.list.deepest())
    }
}

/// The point with the smallest rank in each cell of the levels that columns cannot decide: its rank and its
/// number.
pub(super) type Winners = BTreeMap<(u32, u128), (u64, u64)>;

fn improve(winners: &mut Winners, cell: (u32, u128), found: (u64, u64)) {
    winners.entry(cell).and_modify(|best| *best = (*best).min(found)).or_insert(found);
}

/// The result of a unit.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Found {
    /// Where the points of each column are.
    groups: Groups<u32>,
    totals: Totals,
    winners: Vec<((u32, u128), (u64, u64))>,
}

/// The points of the drive grouped by column.
pub(crate) struct GroupedPoints {
    units: Vec<GroupedUnit>,
    points: Sections,
    pub(super) totals: Totals,
    pub(super) winners: Winners,
}

struct GroupedUnit {
    first_id: PointId,
    groups: Groups<u32>,
}

impl GroupedPoints {
    /// The columns with points, ascending, and the number of their points.
    pub(crate) fn columns(&self) -> Vec<(usize, u64)> {
        let mut points = BTreeMap::new();
        for (column, count) in self.units.iter().flat_map(|unit| unit.groups.counts()) {
            if column != NOWHERE {
                *points.entry(column as usize).or_insert(0) += count;
            }
        }
        points.into_iter().collect()
    }

    /// The points of a column: their numbers, and their records one after the other.
    pub(super) fn of_column(&self, column: usize, record_len: usize) -> Result<(Vec<PointId>, Vec<u8>)> {
        let (mut ids, mut records) = (Vec::new(), Vec::new());
        let column = in_u32(column, "columns of the octree");
        let stride = NUMBER_BYTES + record_len;
        for (number, unit) in self.units.iter().enumerate() {
            let range = unit.groups.bytes(column, stride);
            if range.is_empty() {
                continue;
            }
            for point in self.points.get(number)?.read(range)?.chunks_exact(stride) {
                let number = u32::from_le_bytes([point[0], point[1], point[2], point[3]]);
                ids.push(unit.first_id + u64::from(number));
                records.extend_from_slice(&point[NUMBER_BYTES..]);
            }
        }
        Ok((ids, records))
    }
}

pub(crate) struct CopcPointsPass<'a> {
    pub(crate) drive: &'a Drive,
    pub(crate) point_columns: &'a PointColumns,
    pub(crate) kinds: &'a [Kind],
    pub(crate) labelled: &'a [LabelledFile],
    pub(crate) shown: Shown<'a>,
    pub(crate) columns: &'a Columns,
    pub(crate) format: &'a CopcFormat<'a>,
    /// Runs of blocks with points that are shown.
    pub(crate) runs: Vec<BlockRun>,
    pub(crate) outline: Outline,
}

impl CopcPointsPass<'_> {
    fn stride(&self) -> usize {
        NUMBER_BYTES + self.format.record_len()
    }

    /// The points of a run in file order: their column, and their bytes one after the other.
    fn points_of(&self, run: &BlockRun) -> Result<(Vec<u32>, Vec<u8>, Found)> {
        let input = self.drive.file(run.file);
        let (layout, transform) = (input.layout(), input.transform());
        let conversion = self.format.conversion(input);
        let to_tree = self.format.to_tree(self.drive.lattice());
        let labelled = &self.labelled[run.file];
        let first = input.blocks()[run.blocks.start].first_record;
        let first_id = self.drive.first_id(run.file, run.blocks.start);
        let undecided = self.columns.undecided();
        let (mut columns, mut bytes) = (Vec::new(), Vec::new());
        let (mut totals, mut winners) = (Totals::default(), Winners::new());
        let (mut buffer, mut new) = (Vec::new(), Vec::new());
        let mut labels = Labels::of(self.point_columns, self.kinds);
        for block in run.blocks.clone() {
            let block_run = &input.blocks()[block];
            let records = input.records(block, Fields::All, &mut buffer)?;
            labels.read(run.file, block_run.first_record, block_run.count as usize)?;
            new.clear();
            labelled.label(records, &labels.objects, &labels.classes, &labels.kinds, &mut new);
            let numbers = in_u32(block_run.first_record - first, "records of a unit")..;
            for (at, (number, record)) in numbers.zip(new.chunks_exact(labelled.record_len())).enumerate() {
                bytes.extend(number.to_le_bytes());
                let start = bytes.len();
                let class = record[layout.classification] & layout.classification_mask;
                let kind = labels.kinds.get(at).map_or(0, |kind| kind.class);
                conversion.append(record, class, labels.objects[at], kind, &mut bytes)?;
                // A section has the points that its tiles own, whose coordinates are those of the input.
                if !self.shown.contains(transform.apply(record_xyz(record))) {
                    columns.push(NOWHERE);
                    continue;
                }
                totals.add(&bytes[start..]);
                // Everything in the octree follows from the written coordinates: rounded to another scale and
                // offset, they can be on the other side of a border.
                let spot = self.columns.cube.place(to_tree.parts(record_xyz(&bytes[start..])));
                columns.push(in_u32(self.columns.of_place(spot), "columns of the octree"));
                if undecided > 0 {
                    let id = first_id + u64::from(number);
                    let rank = rank(id);
                    for level in 0..undecided {
                        improve(&mut winners, (level, spot.cell(level)), (rank, id.number()));
                    }
                }
            }
            input.release(block);
        }
        let winners = winners.into_iter().collect();
        Ok((columns, bytes, Found { totals, winners, ..Found::default() }))
    }
}

impl Pass for CopcPointsPass<'_> {
    type Global = GroupedPoints;

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
        // Points in file order and once more grouped, with column and order, and a block as read and as
        // labelled.
        self.runs[unit].points * (2 * self.stride() as u64 + 12)
            + self.drive.largest_block_bytes(&self.runs[unit], 64)
    }

    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        let run = &self.runs[unit];
        self.drive.file(run.file).check_unchanged()?;
        let (columns, points, mut found) = self.points_of(run)?;
        let mut order: Vec<u32> = (0_u32..).take(columns.len()).collect();
        // The sort is stable: within a column, the points stay in file order.
        order.sort_by_key(|&point| columns[point as usize]);
        found.groups = Groups::of(order.iter().map(|&point| columns[point as usize]));
        let stride = self.stride();
        let mut bytes = Vec::with_capacity(points.len());
        for &point in &order {
            bytes.extend_from_slice(&points[point as usize * stride..][..stride]);
        }
        drop(points);
        Ok(codec::pack(&[codec::encode(&found)?, bytes]))
    }

    fn reduce(&self, payloads: &Payloads) -> Result<GroupedPoints> {
        let mut units = Vec::new();
        let (mut totals, mut winners) = (Totals::default(), Winners::new());
        for (unit, run) in self.runs.iter().enumerate() {
            let found: Found = codec::decode(&payloads.section(unit, FOUND)?)?;
            totals.merge(&found.totals);
            for (cell, best) in found.winners {
                improve(&mut winners, cell, best);
            }
            let first_id = self.drive.first_id(run.file, run.blocks.start);
            units.push(GroupedUnit { first_id, groups: found.groups });
        }
        Ok(GroupedPoints { units, points: Sections::of(payloads.clone(), POINTS), totals, winners })
    }
}
