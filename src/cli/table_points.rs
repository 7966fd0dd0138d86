//! The rows of a table as points, from some columns, standardised or not; and the estimate of epsilon over
//! them.

use std::path::Path;

use chainage::cluster::dbscan::epsilon::{self, Attempt, Estimate};
use chainage::cluster::dbscan::rows::neighbour_curve;
use chainage::config::ConfigError;
use chainage::spatial::Points;
use chainage::table::Table;

/// A table, and its rows as points.
pub(crate) struct TablePoints {
    pub(crate) table: Table,
    /// The columns that are the coordinates.
    pub(crate) columns: Vec<usize>,
    pub(crate) points: Points,
}

impl TablePoints {
    /// Reads a table. `columns` are names or numbers; if there are none, all numeric columns are used. With
    /// weights (one per column, or none for all 1) columns are standardised.
    pub(crate) fn read(
        path: &Path,
        header: bool,
        columns: &[String],
        weights: Option<&[f64]>,
    ) -> chainage::Result<Self> {
        let table = Table::read(path, header)?;
        let columns = if columns.is_empty() { table.numeric_columns()? } else { table.columns(columns)? };
        if let Some(at) = (1..columns.len()).find(|&at| columns[..at].contains(&columns[at])) {
            let expected = "named once: a column that counts twice has another weight";
            return Err(ConfigError::value("--columns", table.name(columns[at]), expected).into());
        }
        let given = weights.map_or(0, <[f64]>::len);
        if given != 0 && given != columns.len() {
            let expected = format!("one weight per column, {} in all", columns.len());
            return Err(ConfigError::value("--weights", format!("{given} weights"), expected).into());
        }
        let mut points = Points::new(columns.len(), table.values(&columns)?)?;
        if let Some(weights) = weights {
            points.standardise(weights)?;
        }
        Ok(Self { table, columns, points })
    }
}

/// Whether the name of a file is that of a table.
pub(crate) fn is_table(path: &Path) -> bool {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    matches!(extension.as_deref(), Some("csv" | "txt" | "tsv"))
}

/// Estimates epsilon with `first` neighbours, or with more if they are needed.
pub(crate) fn estimate(points: &Points, first: usize) -> chainage::Result<Estimate> {
    let mut k = first;
    loop {
        match epsilon::estimate(neighbour_curve(points, k)?, first, points.len() as u64)? {
            Attempt::Found(estimate) => return Ok(*estimate),
            Attempt::Longer(longer) => k = longer,
        }
    }
}
