//! Errors while a prediction is compared with a reference.

use std::borrow::Cow;
use std::fmt;
use std::path::PathBuf;

use crate::error::{ErrorKind, Failure};

/// Which side of the comparison something is on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The files that are scored.
    Prediction,
    /// The files with the labels that are taken as true.
    Reference,
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Prediction => "prediction",
            Self::Reference => "reference",
        })
    }
}

/// A point of one side, for messages.
#[derive(Debug, Clone, PartialEq)]
pub struct PointSite {
    /// Its file.
    pub path: PathBuf,
    /// Its record, from 0.
    pub record: u64,
    /// Its position in metres.
    pub at_m: [f64; 3],
    /// Its GPS time in seconds, where both sides have one and it is compared.
    pub gps_time: Option<f64>,
}

impl fmt::Display for PointSite {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.at_m;
        write!(f, "record {} of {} at ({x:.4}, {y:.4}, {z:.4})", self.record, self.path.display())?;
        self.gps_time.map_or(Ok(()), |time| write!(f, ", time {time:.6}"))
    }
}

fn site(site: &Option<Box<PointSite>>) -> String {
    site.as_ref().map_or_else(|| "the end".to_owned(), ToString::to_string)
}

/// The labels cannot be compared. The text names the file, the dimension or the point, and both numbers.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvalError {
    /// A file has no such dimension.
    #[error("the {side} {path} has no dimension {name}", path = path.display())]
    NoDimension {
        /// Which side the file is on.
        side: Side,
        /// The file.
        path: PathBuf,
        /// The dimension that was asked for.
        name: String,
        /// The dimensions that it has.
        known: Vec<String>,
    },
    /// A dimension of a type that contains no ids.
    #[error("dimension {name} of {path} is of type {data_type}, which does not contain single numbers", path = path.display())]
    DimensionType {
        /// The file.
        path: PathBuf,
        /// The dimension.
        name: String,
        /// Its type, as the LAS specification numbers them.
        data_type: u8,
    },
    /// A label that is not a whole number in range.
    #[error("{name} = {value} in record {record} of {path} is not {expected}", path = path.display())]
    Label {
        /// The file.
        path: PathBuf,
        /// The record, from 0.
        record: u64,
        /// The dimension.
        name: String,
        /// Its value.
        value: String,
        /// What would be valid.
        expected: &'static str,
    },
    /// The two sides do not have the same number of points.
    #[error(
        "the prediction has {} points and the reference {}; in record order they first differ at {} of the prediction \
         and {} of the reference",
        counts[0], counts[1], site(prediction), site(reference)
    )]
    PointCounts {
        /// Points of the prediction and of the reference.
        counts: [u64; 2],
        /// The first point of the prediction that differs; `None` if the prediction ends there.
        prediction: Option<Box<PointSite>>,
        /// The first point of the reference that differs; `None` if the reference ends there.
        reference: Option<Box<PointSite>>,
    },
    /// Points without a counterpart on the other side.
    #[error(
        "{unmatched} of {points} points have no counterpart, the first: {prediction} of the prediction and {reference} \
         of the reference"
    )]
    Unmatched {
        /// Number of points of the prediction without a counterpart. The reference has the same number.
        unmatched: u64,
        /// Points of each side.
        points: u64,
        /// The first such point of the prediction.
        prediction: Box<PointSite>,
        /// The first such point of the reference.
        reference: Box<PointSite>,
        /// The coarsest scale of the coordinates of each side, in the units of the files.
        scales: [f64; 2],
    },
    /// The scratch files of a comparison in different orders cannot be written or read back.
    #[error("cannot use the scratch file {path}", path = path.display())]
    Scratch {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
}

impl Failure for EvalError {
    fn kind(&self) -> ErrorKind {
        match self {
            Self::NoDimension { .. } | Self::DimensionType { .. } | Self::Label { .. } => ErrorKind::Input,
            Self::PointCounts { .. } | Self::Unmatched { .. } => ErrorKind::Difference,
            Self::Scratch { .. } => ErrorKind::Output,
        }
    }

    fn hint(&self) -> Option<Cow<'static, str>> {
        match self {
            Self::NoDimension { side, known, .. } => {
                let option = match side {
                    Side::Prediction => "--prediction-dim and --object-class-dim",
                    Side::Reference => "--reference-dim and --class-dim",
                };
                Some(format!("name it with {option}; the file has {}", known.join(", ")).into())
            }
            Self::PointCounts { .. } => {
                Some("give all files of both sides, PRED... --reference REF...".into())
            }
            Self::Unmatched { scales: [one, other], .. } if (one / other - 1.0).abs() > 1e-9 => Some(
                format!(
                    "coordinates in steps of {one} and {other} are matched only in the order of records: write the \
                     coarser side again with the points and scale of the other"
                )
                .into(),
            ),
            Self::Unmatched { prediction, .. } if prediction.gps_time.is_some() => {
                Some("if only the GPS times differ, add --ignore-time".into())
            }
            Self::Scratch { source, .. } if source.kind() == std::io::ErrorKind::StorageFull => {
                Some("name a folder with more space with --scratch".into())
            }
            Self::DimensionType { .. }
            | Self::Label { .. }
            | Self::Unmatched { .. }
            | Self::Scratch { .. } => None,
        }
    }
}
