//! Tables in text files: reads columns of numbers, and writes the same rows with one more column.

mod error;
mod read;
mod split;
mod write;

pub use error::TableError;
pub use read::Table;
pub use write::write_with_column;
