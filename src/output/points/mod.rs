//! Files of points: labelled copies of the input, edited byte by byte, and new files.

pub(crate) mod copc;
pub(crate) mod descriptor;
mod edit;
mod labelled;
pub(crate) mod laz_chunk;
pub(crate) mod new_file;
mod options;
mod record;
mod tail;

pub use labelled::{LabelledFile, check_names};
pub use options::LabelOptions;
pub(crate) use record::{RESERVED, is_field_of_records};
