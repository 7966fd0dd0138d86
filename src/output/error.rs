//! Errors while results are written.

use std::borrow::Cow;
use std::path::PathBuf;

use crate::error::{ErrorKind, Failure};
use crate::output::points::descriptor::{OBJECT_CLASS, ORIGINAL_CLASS};

/// A result that could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum OutputError {
    /// The file system refused.
    #[error("cannot write {path}", path = path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A result would replace points.
    #[error("{path} contains points (LAS or LAZ) and is not replaced", path = path.display())]
    HoldsPoints {
        /// The file.
        path: PathBuf,
    },
    /// The output folder is not empty.
    #[error("{path} is not empty", path = path.display())]
    NotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// The LAZ encoder refused.
    #[error("cannot compress points")]
    Compress {
        /// Why.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The input of a labelled copy can no longer be read.
    #[error("cannot read {path} again", path = path.display())]
    Source {
        /// The input file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A name that no extra-bytes dimension can have.
    #[error("a dimension cannot be named {name:?}: 1 to 31 bytes are needed")]
    DimensionName {
        /// The name.
        name: String,
    },
    /// The input has a dimension with this name, but of another type.
    #[error(
        "{path} has a dimension {name} of data type {data_type}{scaled}; type {expected} without a scale is needed",
        path = path.display()
    )]
    DimensionType {
        /// The input file.
        path: PathBuf,
        /// Name of the dimension.
        name: String,
        /// Its data type (LAS 1.4 R15, table 25).
        data_type: u8,
        /// Words about its scale, or nothing.
        scaled: &'static str,
        /// The data type that is needed.
        expected: u8,
    },
    /// The input has a dimension with the name of the dimension for the class before, but chainage did not
    /// write it.
    #[error(
        "{path} has a dimension {name} of another program, described as {description:?}: the class cannot be kept in it",
        path = path.display()
    )]
    DimensionOfOthers {
        /// The input file.
        path: PathBuf,
        /// Name of the dimension.
        name: &'static str,
        /// Its description.
        description: String,
    },
    /// A LAS class that the point format of a file cannot store.
    #[error(
        "{path} has point format {point_format} and LAS classes up to {limit}: {class} cannot be {code}",
        path = path.display()
    )]
    ClassCode {
        /// The input file.
        path: PathBuf,
        /// Word of the class of objects.
        class: &'static str,
        /// Its LAS code.
        code: u8,
        /// Point format of the file.
        point_format: u8,
        /// Largest code.
        limit: u8,
    },
    /// The new records would be longer than the format allows.
    #[error("the labelled records of {path} would have {length} bytes; at most {limit} are possible", path = path.display())]
    RecordLength {
        /// The input file.
        path: PathBuf,
        /// Bytes of a new record.
        length: usize,
        /// Bytes it may have.
        limit: usize,
    },
    /// Header and records before the points would be longer than the format allows.
    #[error("{path} has {length} bytes before the points; at most 4294967295 are possible", path = path.display())]
    Header {
        /// The input file.
        path: PathBuf,
        /// Bytes before the points.
        length: usize,
    },
    /// More dimensions than one extra-bytes record can describe.
    #[error("{path} has {count} extra dimensions; at most {limit} can be described", path = path.display())]
    Descriptors {
        /// The input file.
        path: PathBuf,
        /// Dimensions of the labelled copy.
        count: usize,
        /// Dimensions that can be described.
        limit: usize,
    },
    /// Two labelled copies would have the same name.
    #[error("two labelled copies would be named {name}")]
    NameClash {
        /// The name.
        name: String,
    },
    /// A labelled copy would have the name of another output.
    #[error(
        "the labelled copy of {path} would have the name of another output of the run, {name}",
        path = path.display()
    )]
    NameOfOutput {
        /// The input file.
        path: PathBuf,
        /// The name.
        name: String,
    },
    /// The chunks of a compressed copy differ from the plan.
    #[error(
        "{name}: {promised} points were planned and {written} were written, or the chunks differ from the plan"
    )]
    Incomplete {
        /// Name of the copy.
        name: String,
        /// Points planned.
        promised: u64,
        /// Points written.
        written: u64,
    },
    /// Chunks were requested from a copy that is not compressed.
    #[error("{name} is not compressed and has no chunks")]
    NotCompressed {
        /// Name of the copy.
        name: String,
    },
    /// The points of the drive cannot be one cloud-optimised file.
    #[error("no cloud-optimised file of this drive can be written: {reason}")]
    Copc {
        /// Why.
        reason: String,
    },
    /// Bytes that are not a whole number of point records.
    #[error("{bytes} bytes of points are not a whole number of records of {record_bytes} bytes")]
    PartialRecord {
        /// Bytes that were to be written.
        bytes: usize,
        /// Bytes of one record.
        record_bytes: u64,
    },
}

impl Failure for OutputError {
    fn kind(&self) -> ErrorKind {
        match self {
            // The fix is a changed setting, and nothing was written.
            Self::ClassCode { .. }
            | Self::DimensionName { .. }
            | Self::DimensionType { .. }
            | Self::DimensionOfOthers { .. } => ErrorKind::Config,
            // The fix is another name of an input file, and nothing was written.
            Self::NameClash { .. } | Self::NameOfOutput { .. } => ErrorKind::Input,
            _ => ErrorKind::Output,
        }
    }

    fn hint(&self) -> Option<Cow<'static, str>> {
        match self {
            Self::Write { source, .. } if source.kind() == std::io::ErrorKind::StorageFull => {
                Some("free some space and type the same command again".into())
            }
            Self::HoldsPoints { .. } => Some("choose another file for the result".into()),
            Self::NotEmpty { .. } => Some("choose another folder, or empty this one first".into()),
            // Only the dimension of the objects can have another name.
            Self::DimensionType { name, .. } if name == ORIGINAL_CLASS => {
                Some("leave out --keep-original, or rename the dimension in the file first".into())
            }
            Self::DimensionOfOthers { .. } => {
                Some("leave out --keep-original, or rename the dimension in the file first".into())
            }
            Self::DimensionType { name, .. } if name == OBJECT_CLASS => Some(
                "rename the dimension in the file first, or choose a method that does not classify (--method euclidean)".into(),
            ),
            Self::DimensionName { .. } | Self::DimensionType { .. } => {
                Some("choose another name with output.dimension".into())
            }
            Self::ClassCode { limit, .. } => Some(
                format!(
                    "choose codes up to {limit} in output.classification, or convert the files to a point format from 6 \
                     to 10"
                )
                .into(),
            ),
            Self::NameClash { .. } => {
                Some("rename one of the input files, or process them as separate drives".into())
            }
            Self::NameOfOutput { .. } => {
                Some("rename the input file, or leave points out of --outputs".into())
            }
            Self::RecordLength { .. } | Self::Descriptors { .. } => {
                Some("write uncompressed copies, or drop extra dimensions of the input first".into())
            }
            Self::Copc { .. } => Some("leave it out: without --copc, and without copc in --outputs".into()),
            Self::Write { .. }
            | Self::Compress { .. }
            | Self::PartialRecord { .. }
            | Self::Source { .. }
            | Self::Header { .. }
            | Self::Incomplete { .. }
            | Self::NotCompressed { .. } => None,
        }
    }

    /// Whether no further writing can succeed.
    fn stops_all(&self) -> bool {
        true
    }
}
