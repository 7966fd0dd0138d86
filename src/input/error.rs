//! Errors of input files.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use crate::error::{ErrorKind, Failure};

pub use super::problem::{ChunkProblem, ChunkTableProblem, CopcProblem};

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
    /// A file that is given by two names, for example by a link.
    #[error("{path} and {other} are the same file", path = path.display(), other = other.display())]
    SameFile {
        /// The file.
        path: PathBuf,
        /// Its other name, which was given before.
        other: PathBuf,
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
    /// Points in a file whose header promises none.
    #[error("{path}: the header promises no points, but the file has {found}", path = path.display())]
    NotCounted {
        /// The file.
        path: PathBuf,
        /// What was found, with its number.
        found: String,
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
    /// A file that is not a cloud-optimised point cloud, or is damaged.
    #[error("{path} cannot be streamed: {problem}", path = path.display())]
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
    /// The records do not have a field that a method needs.
    #[error("{path} has no {field}: its point format is {point_format}", path = path.display())]
    NoField {
        /// The file.
        path: PathBuf,
        /// Its point format.
        point_format: u8,
        /// The field.
        field: &'static str,
    },
    /// A file without the classes to learn from.
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

/// Whether a path may name scans: LAS, LAZ, a folder or a pattern. Other paths name tables.
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
                "give files, folders with *.las or *.laz (some commands also search below them: --recursive), or patterns in quotes"
            }
            Self::Duplicate { .. } => "name every file once; a folder already names the files in it",
            Self::SameFile { .. } => "give only one of the two names: its points would count twice",
            Self::NotUtf8 { .. } => {
                "rename the file or the folder; `convmv -f latin1 -t utf8 FILE` shows the probable name"
            }
            Self::NotLas { .. } => "leave the file out, or convert it to LAS or LAZ first",
            Self::TooShort { .. } | Self::Truncated { .. } => {
                "copy the file again from its source; if it is all there is, \
                 `pdal translate --nostream` or LAStools `las2las -safe` can save the whole points"
            }
            Self::NotCounted { .. } => {
                "its recorder probably did not close the file: export it again, or write the number into its header \
                 (LAStools: `lasinfo -i FILE -set_number_of_point_records N`); leave the file out if it is empty on \
                 purpose"
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
