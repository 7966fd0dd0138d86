//! Tables in text files: reads columns of numbers, and writes the same rows with one more column.
//!
//! ```
//! use std::path::Path;
//!
//! use chainage::table::{Table, write_with_column};
//!
//! let table = Table::parse(Path::new("points.csv"), "x,y\n1.50,2\n3,4\n".to_owned(), true)?;
//! let columns = table.columns(&["x".to_owned()])?;
//! assert_eq!(table.values(&columns)?, [1.5, 3.0]);
//!
//! let mut out = Vec::new();
//! write_with_column(&table, "cluster_id", &[7, 0], &mut out).unwrap();
//! assert_eq!(out, b"x,y,cluster_id\n1.50,2,7\n3,4,0\n");
//! # Ok::<(), chainage::table::TableError>(())
//! ```

mod error;
mod read;
mod split;
mod write;

pub use error::TableError;
pub use read::Table;
pub use write::write_with_column;
