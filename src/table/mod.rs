//! Tables in text files: reading columns of numbers, and writing the same rows with one more column. Knows nothing of
//! what the numbers mean.

mod error;
mod read;
mod split;
mod write;

pub use error::TableError;
pub use read::Table;
pub use write::write_with_column;
