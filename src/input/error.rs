//! Errors of input files.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use crate::error::{ErrorKind, Failure};

/// An input file that is missing, damaged or not acceptable. The text names the file and both numbers.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InputError {
    /// The file cannot be opened or read.
    #[error("cannot read {path}", path = path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A model cannot be read.
    #[error("cannot read the model {path}", path = path.display())]
    Model {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A folder or pattern without any LAS or LAZ file, or no argument at all.
    #[error("no LAS or LAZ file in {argument:?}")]
    NothingFound {
        /// Folder or pattern as given.
        argument: String,
    },
    /// An argument that is a malformed file pattern.
    #[error("{argument:?} is neither a file nor a valid pattern")]
    Pattern {
        /// The argument as given.
        argument: String,
        /// Why.
        source: glob::PatternError,
    },
    /// A file that is given twice. Its points would count twice.
    #[error("{path} is given twice", path = path.display())]
    Duplicate {
        /// The file.
        path: PathBuf,
    },
    /// A file whose name, or the name of a folder above it, is not UTF-8.
    #[error("the path {path:?} is not UTF-8")]
    NotUtf8 {
        /// The file.
        path: PathBuf,
    },
    /// The file does not start with the LAS signature.
    #[error("{path} is not a LAS or LAZ file: it starts with {found:?} instead of \"LASF\"", path = path.display())]
    NotLas {
        /// The file.
        path: PathBuf,
        /// Its first bytes as text.
        found: String,
    },
    /// The file ends inside a structure that is mandatory for its version.
    #[error("{path} ends at byte {size}, inside its {what}, which takes {needed} bytes", path = path.display())]
    TooShort {
        /// The file.
        path: PathBuf,
        /// The structure.
        what: &'static str,
        /// Bytes from the start of the file to the end of the structure.
        needed: u64,
        /// Bytes in the file.
        size: u64,
    },
    /// A LAS version that this program does not know.
    #[error("{path} has LAS version {major}.{minor}; the versions 1.0 to 1.4 can be read", path = path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// Major version in the header.
        major: u8,
        /// Minor version in the header.
        minor: u8,
    },
    /// A header field that contradicts another one or the file size.
    #[error("{path}: the header's {field} is {value}, but must be {expected}", path = path.display())]
    HeaderField {
        /// The file.
        path: PathBuf,
        /// The field, in words of the LAS specification.
        field: &'static str,
        /// The value as written.
        value: String,
        /// The accepted values.
        expected: String,
    },
    /// Fewer bytes than the promised points need.
    #[error(
        "{path} is truncated: its header promises {promised} points, but the file has {present}",
        path = path.display()
    )]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Points in the header.
        promised: u64,
        /// Whole points in the file.
        present: u64,
    },
    /// Compressed points without a usable description of the compression.
    #[error("{path} is compressed, but its laszip record {problem}", path = path.display())]
    LaszipRecord {
        /// The file.
        path: PathBuf,
        /// The problem, as the end of the sentence.
        problem: String,
    },
    /// The table of the compressed chunks contradicts the file.
    #[error("{path}: the table of compressed chunks {problem}", path = path.display())]
    ChunkTable {
        /// The file.
        path: PathBuf,
        /// The problem.
        problem: ChunkTableProblem,
    },
    /// One chunk (or block) of points cannot be decoded.
    #[error(
        "{path}: chunk {chunk} (points {first} to {last}) cannot be decoded: {problem}",
        path = path.display()
    )]
    Chunk {
        /// The file.
        path: PathBuf,
        /// Index of the chunk.
        chunk: usize,
        /// Its first record.
        first: u64,
        /// Its last record.
        last: u64,
        /// The problem.
        problem: ChunkProblem,
    },
    /// A file that is no cloud-optimised point cloud, or a damaged one.
    #[error("{path} cannot be shown in parts: {problem}", path = path.display())]
    Copc {
        /// The file.
        path: PathBuf,
        /// The problem.
        problem: CopcProblem,
    },
    /// Coordinates in degrees. Distances would not be metres.
    #[error("{path} has geographic coordinates (degrees): {description}", path = path.display())]
    Geographic {
        /// The file.
        path: PathBuf,
        /// Name of its coordinate reference system.
        description: String,
    },
    /// Earth-centred coordinates. z would not be up.
    #[error("{path} has geocentric coordinates (z is not up): {description}", path = path.display())]
    Geocentric {
        /// The file.
        path: PathBuf,
        /// Name of its coordinate reference system.
        description: String,
    },
    /// Two files of one drive in different coordinate reference systems.
    #[error(
        "{other} is in {other_crs}, but {path} is in {crs}",
        path = path.display(), other = other.display()
    )]
    CrsDiffers {
        /// A file.
        path: PathBuf,
        /// Its coordinate reference system.
        crs: String,
        /// A later file.
        other: PathBuf,
        /// The system of the later file.
        other_crs: String,
    },
    /// The records lack a field that a method needs.
    #[error("{path} has no {field}: its point format is {point_format}", path = path.display())]
    NoField {
        /// The file.
        path: PathBuf,
        /// Its point format.
        point_format: u8,
        /// The field.
        field: &'static str,
    },
    /// A file without the classes that are to be learned.
    #[error("{path} has no dimension {name} of unsigned bytes, so there is nothing to learn from it", path = path.display())]
    NoLabels {
        /// The file.
        path: PathBuf,
        /// The dimension.
        name: &'static str,
    },
    /// The file changed during the run.
    #[error("{path} changed during the run: {before} before, {now} now", path = path.display())]
    Changed {
        /// The file.
        path: PathBuf,
        /// Size and time when it was opened.
        before: String,
        /// Size and time now.
        now: String,
    },
}

/// The problem with the table of compressed chunks.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ChunkTableProblem {
    /// The position of the table is outside the file.
    #[error("should be at byte {offset}, but the file has {size} bytes")]
    Outside {
        /// Its stated position.
        offset: u64,
        /// Bytes in the file.
        size: u64,
    },
    /// An unknown version of the table.
    #[error("has version {version}; only version 0 is known")]
    Version {
        /// Version as written.
        version: u32,
    },
    /// More chunks than the compressed bytes can hold.
    #[error("lists {chunks} chunks, but {bytes} compressed bytes have room for at most {limit}")]
    TooMany {
        /// Chunks listed.
        chunks: u64,
        /// Bytes of compressed points.
        bytes: u64,
        /// Chunks of the smallest possible size in these bytes.
        limit: u64,
    },
    /// The table itself cannot be decoded.
    #[error("cannot be decoded: {cause}")]
    Damaged {
        /// Message of the decoder.
        cause: String,
    },
    /// The chunks are larger than the space for them.
    #[error("says that chunk {chunk} ends at byte {end}, but the compressed points end at byte {limit}")]
    Overrun {
        /// Index of the chunk.
        chunk: usize,
        /// End of the chunk according to the table.
        end: u64,
        /// End of the compressed points.
        limit: u64,
    },
    /// The chunks do not add up to the number of points in the header.
    #[error("has {present} points, but the header promises {promised}")]
    Points {
        /// Points according to the header.
        promised: u64,
        /// Points (or their largest possible number) according to the table.
        present: u64,
    },
    /// There is no table, and the chunks cannot be found without it.
    #[error("is missing, and the chunks cannot be found without it ({found} of {promised} points found)")]
    Missing {
        /// Points according to the header.
        promised: u64,
        /// Points found by walking over the chunks.
        found: u64,
    },
    /// A chunk that exceeds the limits of the coder or of this program.
    #[error(
        "says that chunk {chunk} has {points} points in {bytes} bytes, but at most {limit} points can be read from it"
    )]
    Dense {
        /// Index of the chunk.
        chunk: usize,
        /// Points of the chunk.
        points: u64,
        /// Compressed bytes of the chunk.
        bytes: u64,
        /// Largest number of points in that many bytes, or within the decoding limit.
        limit: u64,
    },
}

/// The problem with the tree of a cloud-optimised point cloud.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CopcProblem {
    /// The record that describes the tree is missing.
    #[error("it is not a cloud-optimised point cloud")]
    NotCopc,
    /// A point format that such a file cannot have.
    #[error("its point format is {point_format}, but a cloud-optimised point cloud has 6, 7 or 8")]
    Format {
        /// The format.
        point_format: u8,
    },
    /// There is no column with the object of a point.
    #[error("its points have no dimension of 32 bits with their object; chainage did not write it")]
    NoObjects,
    /// The cube of the tree has no size.
    #[error("its cube has half an edge of {halfsize} and a spacing of {spacing}")]
    Cube {
        /// Half of the edge.
        halfsize: f64,
        /// Distance between points of the root.
        spacing: f64,
    },
    /// A page of the table of nodes is not inside the file, or has no whole entries.
    #[error(
        "a page of its table of nodes has {bytes} bytes from byte {at}, the file has {size}, an entry has 32"
    )]
    Page {
        /// First byte.
        at: u64,
        /// Bytes.
        bytes: u64,
        /// Bytes of the file.
        size: u64,
    },
    /// A page of the table of nodes that two others refer to. It may be a circle.
    #[error("the page of its table of nodes at byte {at} is referred to twice")]
    PageTwice {
        /// First byte.
        at: u64,
    },
    /// The table of nodes is too long.
    #[error("its table of nodes has {entries} entries or more, the limit is {limit}")]
    TooMany {
        /// Entries.
        entries: u64,
        /// The limit.
        limit: u64,
    },
    /// A node whose position does not exist.
    #[error("its table has a node at {at:?} of level {level}, which does not exist")]
    Key {
        /// The level.
        level: i32,
        /// The position.
        at: [i32; 3],
    },
    /// A node whose points are not inside the file, or are too many for their bytes.
    #[error(
        "its node {key:?} has {points} points in {bytes} bytes from byte {at}; the file has {size} bytes"
    )]
    Node {
        /// Level and position.
        key: [u32; 4],
        /// Points as written.
        points: i32,
        /// First byte.
        at: u64,
        /// Bytes as written.
        bytes: i32,
        /// Bytes of the file.
        size: u64,
    },
    /// A node that is in the table twice.
    #[error("its node {key:?} is in the table twice")]
    Twice {
        /// Level and position.
        key: [u32; 4],
    },
    /// A node without the node above it. Nobody would find it.
    #[error("its node {key:?} is in the table without the node above it")]
    Orphan {
        /// Level and position.
        key: [u32; 4],
    },
    /// The nodes do not have the points that the header promises.
    #[error("its nodes have {present} points, but the header promises {promised}")]
    Points {
        /// Points of all nodes.
        present: u64,
        /// Points according to the header.
        promised: u64,
    },
    /// The points of a node cannot be decoded.
    #[error("its node {key:?} cannot be decoded: {problem}")]
    Damaged {
        /// Level and position.
        key: [u32; 4],
        /// The problem.
        problem: ChunkProblem,
    },
    /// The table of nodes could not be read.
    #[error("its table of nodes cannot be read ({cause})")]
    Unreadable {
        /// Message of the system.
        cause: String,
    },
}

/// Why a chunk cannot be decoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ChunkProblem {
    /// Its layers are larger than the chunk.
    #[error("its layers need {promised} bytes, but the chunk has {present}")]
    Layers {
        /// Bytes of the layers, by their own sizes.
        promised: u64,
        /// Bytes in the chunk.
        present: u64,
    },
    /// Its own number of points differs from that in the header and the table.
    #[error("it says that it has {present} points, but the header and the table promise {promised}")]
    Points {
        /// Points by header and table of chunks.
        promised: u32,
        /// Points by the chunk's own count.
        present: u32,
    },
    /// The bytes are not valid code, or they end too early.
    #[error("damaged data ({cause})")]
    Damaged {
        /// Message of the decoder.
        cause: String,
    },
    /// The bytes could not be read.
    #[error("reading failed ({cause})")]
    Unreadable {
        /// Message of the system.
        cause: String,
    },
}

/// Whether a path may name scans: LAS, LAZ, a folder or a pattern. Tables are read, too.
fn is_scan(path: &Path) -> bool {
    path.extension().is_none_or(|ending| ["las", "laz"].iter().any(|scan| ending.eq_ignore_ascii_case(scan)))
}

impl Failure for InputError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Input
    }

    fn concerns_input(&self) -> bool {
        true
    }

    fn hint(&self) -> Option<Cow<'static, str>> {
        Some(Cow::Borrowed(match self {
            Self::Read { path, source } if source.kind() == std::io::ErrorKind::NotFound && is_scan(path) => {
                "give files, folders with *.las or *.laz, or patterns in quotes"
            }
            Self::Read { .. } => return None,
            Self::Model { .. } => "chainage train writes a model; leave it out to use the built-in one",
            Self::NothingFound { .. } | Self::Pattern { .. } => {
                "give files, folders with *.las or *.laz (folders below them are not searched), or patterns in quotes"
            }
            Self::Duplicate { .. } => "name every file once; a folder already names the files in it",
            Self::NotUtf8 { .. } => {
                "rename the file or the folder; `convmv -f latin1 -t utf8 FILE` shows the probable name"
            }
            Self::NotLas { .. } => "leave the file out, or convert it to LAS or LAZ first",
            Self::TooShort { .. } | Self::Truncated { .. } => {
                "copy the file again from its source; if it is all there is, \
                 `pdal translate --nostream` or LAStools `las2las -safe` can save the whole points"
            }
            Self::Version { .. } | Self::HeaderField { .. } => {
                "the file is damaged or was written wrongly; copy it again, or rewrite it with `pdal translate`"
            }
            Self::LaszipRecord { .. } | Self::ChunkTable { .. } | Self::Chunk { .. } => {
                "copy the file again from its source, or rewrite it with LASzip or `pdal translate`"
            }
            Self::Copc { .. } => "write it again: chainage run with --copc",
            Self::Geographic { .. } | Self::Geocentric { .. } => {
                "reproject to a projected system in metres, e.g. `pdal translate IN OUT reprojection \
                 --filters.reprojection.out_srs=EPSG:25832`; if only the record is wrong, state the unit \
                 with input.unit"
            }
            Self::CrsDiffers { .. } => {
                "reproject the files to one system, or process them as separate drives"
            }
            Self::NoLabels { .. } => "give labelled drives, for example those of chainage synth",
            Self::NoField { .. } => {
                "leave the field out of dbscan.fields (--fields), or the file out of the drive"
            }
            Self::Changed { .. } => {
                "do not change inputs during a run; start again when the files are complete"
            }
        }))
    }

    fn stops_all(&self) -> bool {
        matches!(self, Self::Changed { .. })
    }
}
