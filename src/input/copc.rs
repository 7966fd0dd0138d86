//! A cloud-optimised point cloud (COPC 1.0, <https://copc.io>) as a tree: its cube, its table of nodes, and
//! the records of one node. The file is not trusted: every number is checked against the size of the file
//! before it is used or memory is allocated.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::Fields;
use super::decode::{Coding, MAX_CHUNK_BYTES, MAX_POINTS_PER_BYTE};
use super::error::{CopcProblem, InputError};
use super::header::{Header, Scaling};
use super::layout::RecordLayout;
use super::mapped::ByteSource;

/// User id and record id of the record that describes the tree.
const INFO: (&str, u16) = ("copc", 1);
/// Bytes of that record.
const INFO_BYTES: u64 = 160;
/// Bytes of an entry of the table of nodes.
const ENTRY_BYTES: u64 = 32;
/// Entries that are read at once.
const ENTRIES_AT_ONCE: u64 = 4_096;
/// Largest number of entries in the table of nodes. Chosen: a drive of 16 km has 0.3 million, and 4 million
/// take 300 MB of memory.
const MOST_ENTRIES: u64 = 1 << 22;
/// Deepest level whose positions the file can express.
const DEEPEST: u32 = 30;

/// Level and position along the axes, which is 0 to 2^level - 1.
pub(crate) type Key = [u32; 4];

/// A node of the tree.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Node {
    /// Number of its points; 0 if only nodes below it have points.
    pub(crate) points: u32,
    /// Bytes of the file with the compressed points.
    bytes: Range<u64>,
}

/// The cube of the root, in the units of the file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cube {
    /// Its corner with the smallest coordinates.
    pub(crate) origin: [f64; 3],
    /// Its edge.
    pub(crate) side: f64,
    /// Distance between the points that the root shows.
    pub(crate) spacing: f64,
}

/// A cloud-optimised file, open for reading from any thread.
#[derive(Debug)]
pub(crate) struct CopcFile {
    path: PathBuf,
    source: ByteSource,
    coding: Coding,
    layout: RecordLayout,
    scaling: Scaling,
    cube: Cube,
    nodes: BTreeMap<Key, Node>,
}

impl CopcFile {
    /// Opens a file, and reads and checks its table of nodes.
    ///
    /// # Errors
    /// [`InputError::Copc`] if it is not a cloud-optimised file or its table is damaged, and the errors of
    /// any LAZ file.
    pub(crate) fn open(path: &Path) -> Result<Self, InputError> {
        let read_error = |source| InputError::Read { path: path.to_owned(), source };
        // Not mapped: a run may replace the file while it is shown.
        let source = ByteSource::open(path, false).map_err(read_error)?;
        let header = Header::read(path, &source)?;
        let problem = |problem| InputError::Copc { path: path.to_owned(), problem };
        let info = header.vlrs.records.first().filter(|record| record.is(INFO.0, INFO.1));
        let info = info.and_then(|record| record.read(&source, u64::from(u16::MAX)));
        let info = info.filter(|bytes| bytes.len() as u64 >= INFO_BYTES && header.compressed);
        let Some(info) = info else { return Err(problem(CopcProblem::NotCopc)) };
        if !(6..=8).contains(&header.point_format) {
            return Err(problem(CopcProblem::Format { point_format: header.point_format }));
        }
        let coding = Coding::read(path, &header, &source)?;
        let layout = RecordLayout::read(&header, &source, &mut Vec::new());
        let cube = cube_of(&info).map_err(problem)?;
        let table = Table { source: &source, header: &header, nodes: BTreeMap::new(), entries: 0 };
        let nodes = table.read(word(&info, 40), word(&info, 48)).map_err(problem)?;
        let present = nodes.values().map(|node| u64::from(node.points)).sum();
        if !header.counts.contains(&present) {
            return Err(problem(CopcProblem::Points { present, promised: header.counts[0] }));
        }
        Ok(Self { path: path.to_owned(), source, coding, layout, scaling: header.scaling, cube, nodes })
    }

    /// The positions of the fields in a record.
    pub(crate) fn layout(&self) -> &RecordLayout {
        &self.layout
    }

    /// Scale and offset of the coordinates of records.
    pub(crate) fn scaling(&self) -> &Scaling {
        &self.scaling
    }

    /// The cube of the root.
    pub(crate) fn cube(&self) -> Cube {
        self.cube
    }

    /// The nodes by ascending key. The parent of each node is among them.
    pub(crate) fn nodes(&self) -> &BTreeMap<Key, Node> {
        &self.nodes
    }

    /// Decodes the records of a node into `records`, which is overwritten.
    ///
    /// # Errors
    /// [`InputError::Copc`] when the points are damaged or cannot be read.
    pub(crate) fn records(&self, key: Key, node: &Node, records: &mut Vec<u8>) -> Result<(), InputError> {
        let mut buffer = Vec::new();
        records.clear();
        if node.points == 0 {
            return Ok(());
        }
        let bytes = self
            .source
            .slice(node.bytes.clone(), &mut buffer)
            .map_err(|source| InputError::Read { path: self.path.clone(), source })?;
        self.coding.decode(bytes, node.points, Fields::All, records).map_err(|problem| InputError::Copc {
            path: self.path.clone(),
            problem: CopcProblem::Damaged { key, problem },
        })
    }
}

/// The cube that the info record of the file describes.
fn cube_of(info: &[u8]) -> Result<Cube, CopcProblem> {
    let number = |at: usize| f64::from_bits(word(info, at));
    let (centre, halfsize, spacing) = ([0, 8, 16].map(number), number(24), number(32));
    let numbers = centre.into_iter().chain([halfsize, spacing]);
    if halfsize <= 0.0 || spacing <= 0.0 || numbers.into_iter().any(|value| !value.is_finite()) {
        return Err(CopcProblem::Cube { halfsize, spacing });
    }
    Ok(Cube { origin: centre.map(|middle| middle - halfsize), side: 2.0 * halfsize, spacing })
}

/// The table of nodes while it is read: pages, which may refer to further pages.
struct Table<'a> {
    source: &'a ByteSource,
    header: &'a Header,
    nodes: BTreeMap<Key, Node>,
    entries: u64,
}

impl Table<'_> {
    fn read(mut self, at: u64, bytes: u64) -> Result<BTreeMap<Key, Node>, CopcProblem> {
        let mut pages = vec![(at, bytes)];
        let mut seen = BTreeSet::new();
        while let Some((at, bytes)) = pages.pop() {
            if !seen.insert(at) {
                return Err(CopcProblem::PageTwice { at });
            }
            self.page(at, bytes, &mut pages)?;
        }
        if let Some(key) = self.nodes.keys().find(|key| !self.has_parent(**key)) {
            return Err(CopcProblem::Orphan { key: *key });
        }
        Ok(self.nodes)
    }

    fn has_parent(&self, [level, x, y, z]: Key) -> bool {
        level == 0 || self.nodes.contains_key(&[level - 1, x >> 1, y >> 1, z >> 1])
    }

    fn page(&mut self, at: u64, bytes: u64, pages: &mut Vec<(u64, u64)>) -> Result<(), CopcProblem> {
        let size = self.source.len();
        let end = at.checked_add(bytes).filter(|end| *end <= size);
        let Some(end) = end.filter(|_| bytes > 0 && bytes.is_multiple_of(ENTRY_BYTES)) else {
            return Err(CopcProblem::Page { at, bytes, size });
        };
        self.entries += bytes / ENTRY_BYTES;
        if self.entries > MOST_ENTRIES {
            return Err(CopcProblem::TooMany { entries: self.entries, limit: MOST_ENTRIES });
        }
        let mut buffer = Vec::new();
        let mut start = at;
        while start < end {
            let part = start..end.min(start + ENTRIES_AT_ONCE * ENTRY_BYTES);
            start = part.end;
            let entries = self
                .source
                .slice(part, &mut buffer)
                .map_err(|error| CopcProblem::Unreadable { cause: error.to_string() })?;
            for entry in entries.chunks_exact(32) {
                if let Some(page) = entry_of(entry, self.header, size, &mut self.nodes)? {
                    pages.push(page);
                }
            }
        }
        Ok(())
    }
}

/// Reads an entry into `nodes`. Returns the place of a further page, if the entry refers to one.
fn entry_of(
    entry: &[u8],
    header: &Header,
    size: u64,
    nodes: &mut BTreeMap<Key, Node>,
) -> Result<Option<(u64, u64)>, CopcProblem> {
    let [level, x, y, z] = [0, 4, 8, 12].map(|at| int(entry, at));
    let (at, bytes, points) = (word(entry, 16), int(entry, 24), int(entry, 28));
    let key = [level, x, y, z].map(i32::cast_unsigned);
    if key[0] > DEEPEST || key[1..].iter().any(|along| *along >> key[0] > 0) {
        return Err(CopcProblem::Key { level, at: [x, y, z] });
    }
    let node = |bytes| CopcProblem::Node { key, points, at, bytes, size };
    let length = u64::try_from(bytes).map_err(|_| node(bytes))?;
    if points == -1 {
        return Ok(Some((at, length)));
    }
    let points = u32::try_from(points).map_err(|_| node(bytes))?;
    let range = if points == 0 { 0..0 } else { at..at.saturating_add(length) };
    let fits =
        (MAX_CHUNK_BYTES / u64::from(header.record_len)).min(length.saturating_mul(MAX_POINTS_PER_BYTE));
    if points > 0 && (range.start < header.points_start || range.end > size || u64::from(points) > fits) {
        return Err(node(bytes));
    }
    match nodes.insert(key, Node { points, bytes: range }) {
        Some(_) => Err(CopcProblem::Twice { key }),
        None => Ok(None),
    }
}

fn word(bytes: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(std::array::from_fn(|byte| bytes[at + byte]))
}

fn int(bytes: &[u8], at: usize) -> i32 {
    i32::from_le_bytes(std::array::from_fn(|byte| bytes[at + byte]))
}
