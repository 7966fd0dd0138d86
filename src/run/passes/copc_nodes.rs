//! Pass `copc nodes`: completes the columns of the octree of the cloud-optimised file, one at a time: which
//! node shows which point, and the chunk of each node. Nodes above the columns are joined from points of
//! several columns. Its reduction writes the file with the nodes in the order of their keys, so the columns
//! leave no trace in it.
//!
//! ```text
//! payload := sections: table of parts, the parts one after the other
//! part    := the chunk of a node, or points of a node above the column: number (u64) and record
//! ```

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::codec;
use crate::error::{Error, Result};
use crate::model::{PointId, in_u32, record_xyz};
use crate::output::OutputError;
use crate::output::points::copc::{
    Compression, CopcFormat, CopcSchema, NodeKey, Spot, Totals, WorldCube, levels, rank,
};
use crate::run::drive::Drive;
use crate::run::engine::{Outline, Pass, Payloads};
use crate::run::passes::copc_points::{Columns, GroupedPoints};
use crate::store::{Inputs, UnitReader};
use crate::whole_file;

const NUMBER: u32 = 9;
const NAME: &str = "copc nodes";

/// Bytes per point of a column beside three copies of its record: number (8), place and rank (24), order (4),
/// leaves (16), levels and nodes (36).
const BYTES_PER_POINT: u64 = 88;

/// The nodes depend on the points alone.
pub(crate) fn outline(points: &Outline) -> Outline {
    let depends = Inputs::new().with("pass copc points", points.depends.fingerprint());
    Outline::new(NUMBER, NAME, depends)
}

/// A part of a payload.
#[derive(Debug, Serialize, Deserialize)]
struct Part {
    key: NodeKey,
    points: u32,
    bytes: u64,
}

pub(crate) struct CopcNodesPass<'a> {
    pub(crate) drive: &'a Drive,
    pub(crate) columns: &'a Columns,
    pub(crate) grouped: &'a GroupedPoints,
    /// The columns with points, and the number of their points. A unit completes one of them.
    pub(crate) with_points: Vec<(usize, u64)>,
    pub(crate) format: &'a CopcFormat<'a>,
    /// Where the file is written.
    pub(crate) path: &'a Path,
    pub(crate) outline: Outline,
}

/// Where the parts of nodes are: unit, range in its second section, and number of points.
type Places = BTreeMap<NodeKey, Vec<(usize, Range<u64>, u32)>>;

impl CopcNodesPass<'_> {
    /// The place of each record of a column in the octree.
    fn spots(&self, ids: &[PointId], records: &[u8]) -> Vec<(Spot, u64)> {
        let to_tree = self.format.to_tree(self.drive.lattice());
        let spot = |record: &[u8]| self.columns.cube.place(to_tree.parts(record_xyz(record)));
        let records = records.chunks_exact(self.format.record_len());
        records.zip(ids).map(|(record, id)| (spot(record), rank(*id))).collect()
    }

    /// The level of the column that a unit completes.
    fn level(&self, unit: usize) -> u32 {
        self.columns.list.level(self.with_points[unit].0)
    }

    /// The points of every node that has some of a column, in the order of the keys.
    fn nodes(&self, column: u32, ids: &[PointId], spots: &[(Spot, u64)]) -> Vec<(NodeKey, u32)> {
        let wins = |point: usize, level: u32| {
            let best = self.grouped.winners.get(&(level, spots[point].0.cell(level)));
            best.is_some_and(|(_, id)| *id == ids[point].number())
        };
        let found = levels(column, spots, &self.columns.leaf_levels(spots), wins);
        let mut nodes: Vec<(NodeKey, u32)> =
            found.iter().zip(spots).map(|(level, (spot, _))| spot.node(*level)).zip(0..).collect();
        // Points of a column are in the order of their numbers.
        nodes.sort_unstable();
        nodes
    }

    fn places(&self, payloads: &Payloads) -> Result<Places> {
        let mut places = Places::new();
        for unit in 0..self.units() {
            let parts: Vec<Part> = codec::decode(&payloads.reader(unit)?.read_section(0)?)?;
            let mut start = 0;
            for Part { key, points, bytes } in parts {
                places.entry(key).or_default().push((unit, start..start + bytes, points));
                start += bytes;
            }
        }
        Ok(places)
    }

    /// The chunk of a node. A node that is not above the columns is complete in one of them; of others, the
    /// columns pass on their points.
    fn chunk(
        &self,
        compression: &Compression,
        key: NodeKey,
        parts: &[(usize, Range<u64>, u32)],
        readers: &mut Readers<'_>,
    ) -> Result<(u32, Vec<u8>)> {
        if parts.iter().any(|(unit, ..)| self.level(*unit) <= key.level) {
            let [(unit, range, points)] = parts else {
                return Err(Error::bug(format!(
                    "{} columns have the node {key:?}, which one owns",
                    parts.len()
                )));
            };
            return Ok((*points, readers.read(*unit, range)?));
        }
        let stride = size_of::<u64>() + self.format.record_len();
        let mut points: Vec<(u64, Vec<u8>)> = Vec::new();
        for (unit, range, _) in parts {
            for point in readers.read(*unit, range)?.chunks_exact(stride) {
                let (id, record) = point.split_first_chunk::<8>().ok_or_else(|| Error::bug("a cut point"))?;
                points.push((u64::from_le_bytes(*id), record.to_vec()));
            }
        }
        points.sort_unstable();
        let records: Vec<u8> = points.iter().flat_map(|(_, record)| record.iter().copied()).collect();
        Ok((in_u32(points.len(), "points of a node"), compression.chunk(&records)?))
    }

    fn schema<'b>(&'b self, totals: &'b Totals) -> CopcSchema<'b> {
        let crs = self.drive.catalog.crs();
        let lattice = self.drive.lattice();
        let [unit_m, ..] = self.drive.catalog.units_m();
        let cube = self.columns.cube;
        let halfsize = lattice.metres(cube.side) / unit_m / 2.0;
        let centre = cube.origin.map(|value| lattice.metres(value) / unit_m + halfsize);
        CopcSchema { format: self.format, crs, cube: WorldCube { centre, halfsize }, totals }
    }
}

/// Reads parts of payloads. The units of neighbouring nodes are mostly the same.
struct Readers<'a> {
    payloads: &'a Payloads,
    open: Option<(usize, UnitReader, u64)>,
}

impl Readers<'_> {
    fn read(&mut self, unit: usize, range: &Range<u64>) -> Result<Vec<u8>> {
        if self.open.as_ref().is_none_or(|open| open.0 != unit) {
            let reader = self.payloads.reader(unit)?;
            let start = reader.section(1)?.start;
            self.open = Some((unit, reader, start));
        }
        let Some((_, reader, start)) = &self.open else { return Err(Error::bug("no payload is open")) };
        Ok(reader.read(start + range.start..start + range.end)?)
    }
}

impl Pass for CopcNodesPass<'_> {
    type Global = ();

    fn outline(&self) -> &Outline {
        &self.outline
    }

    fn units(&self) -> usize {
        self.with_points.len()
    }

    fn points(&self, unit: usize) -> u64 {
        self.with_points[unit].1
    }

    fn bytes(&self, unit: usize) -> u64 {
        self.points(unit) * (BYTES_PER_POINT + 3 * self.format.record_len() as u64)
    }

    fn run(&self, unit: usize) -> Result<Vec<u8>> {
        let column = self.level(unit);
        let record_len = self.format.record_len();
        let (ids, records) = self.grouped.of_column(self.with_points[unit].0, record_len)?;
        let spots = self.spots(&ids, &records);
        let nodes = self.nodes(column, &ids, &spots);
        drop(spots);
        let compression = Compression::of(self.format)?;
        let (mut parts, mut bytes) = (Vec::new(), Vec::new());
        let mut of_node = Vec::new();
        for node in nodes.chunk_by(|a, b| a.0 == b.0) {
            let key = node[0].0;
            let start = bytes.len();
            of_node.clear();
            for &(_, point) in node {
                let record = &records[point as usize * record_len..][..record_len];
                if key.level < column {
                    bytes.extend(ids[point as usize].number().to_le_bytes());
                    bytes.extend_from_slice(record);
                } else {
                    of_node.extend_from_slice(record);
                }
            }
            if key.level >= column {
                bytes.extend(compression.chunk(&of_node)?);
            }
            let points = in_u32(node.len(), "points of a node");
            parts.push(Part { key, points, bytes: (bytes.len() - start) as u64 });
        }
        Ok(codec::pack(&[codec::encode(&parts)?, bytes]))
    }

    /// Writes the file. It gets its name when it is complete.
    fn reduce(&self, payloads: &Payloads) -> Result<()> {
        let places = self.places(payloads)?;
        let compression = Compression::of(self.format)?;
        let mut readers = Readers { payloads, open: None };
        let mut written = 0;
        let chunks = places.iter().map(|(key, parts)| -> Result<_> {
            let (points, bytes) = self.chunk(&compression, *key, parts, &mut readers)?;
            written += u64::from(points);
            Ok((*key, points, bytes))
        });
        let failed = |source| OutputError::Write { path: self.path.to_owned(), source };
        let mut file = whole_file::WholeFile::create(self.path).map_err(failed)?;
        let totals = &self.grouped.totals;
        self.schema(totals).write(chunks, &mut file, failed)?;
        if written != totals.records {
            let path = self.path.display();
            let text = format!("the nodes of {path} have {written} points, its header {}", totals.records);
            return Err(Error::bug(text));
        }
        Ok(file.finish().map_err(failed)?)
    }
}
