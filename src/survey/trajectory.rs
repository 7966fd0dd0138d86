//! Reading a trajectory: CSV with the columns `gps_time,x,y,z` (more are ignored), in the coordinates of the drive.

use std::path::{Path, PathBuf};

/// A trajectory file that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrajectoryError {
    /// The file cannot be read.
    #[error("cannot read the trajectory {path}", path = path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The first line does not name the columns.
    #[error("the trajectory {path} has no column {column} in its first line ({found})", path = path.display())]
    Column {
        /// The file.
        path: PathBuf,
        /// The column that is missing.
        column: &'static str,
        /// The first line as it stands.
        found: String,
    },
    /// A line that does not hold finite numbers in these columns.
    #[error("line {line} of the trajectory {path} has no number in column {column}: {found}", path = path.display())]
    Number {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// The column.
        column: &'static str,
        /// The line as it stands.
        found: String,
    },
    /// Fewer than two positions.
    #[error("the trajectory {path} has {positions} positions, at least 2 are needed", path = path.display())]
    TooShort {
        /// The file.
        path: PathBuf,
        /// Positions in it.
        positions: usize,
    },
}

const COLUMNS: [&str; 3] = ["gps_time", "x", "y"];

/// The positions (x, y) of a trajectory in order of time, in the units of the file.
///
/// # Errors
/// When the file cannot be read, a column is missing, or a value is not a finite number.
pub fn read_trajectory(path: &Path) -> Result<Vec<[f64; 2]>, TrajectoryError> {
    let text = fs_err::read_to_string(path)
        .map_err(|source| TrajectoryError::Read { path: path.to_owned(), source })?;
    let mut lines = text.lines().enumerate();
    let header = lines.next().map_or("", |line| line.1);
    let names: Vec<String> = header.split(',').map(|name| name.trim().to_ascii_lowercase()).collect();
    let mut places = [0; 3];
    for (place, column) in places.iter_mut().zip(COLUMNS) {
        *place = names.iter().position(|name| name == column).ok_or_else(|| TrajectoryError::Column {
            path: path.to_owned(),
            column,
            found: header.chars().take(120).collect(),
        })?;
    }
    let mut rows = Vec::new();
    for (index, line) in lines.filter(|line| !line.1.trim().is_empty()) {
        let fields: Vec<&str> = line.split(',').collect();
        let mut values = [0.0; 3];
        for ((value, place), column) in values.iter_mut().zip(places).zip(COLUMNS) {
            *value = fields
                .get(place)
                .and_then(|field| field.trim().parse::<f64>().ok())
                .filter(|number| number.is_finite())
                .ok_or_else(|| TrajectoryError::Number {
                    path: path.to_owned(),
                    line: index + 1,
                    column,
                    found: line.chars().take(120).collect(),
                })?;
        }
        rows.push(values);
    }
    if rows.len() < 2 {
        return Err(TrajectoryError::TooShort { path: path.to_owned(), positions: rows.len() });
    }
    // Stable: positions of one instant stay in file order.
    rows.sort_by(|a, b| a[0].total_cmp(&b[0]));
    Ok(rows.into_iter().map(|row| [row[1], row[2]]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<[f64; 2]>, TrajectoryError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trajectory.csv");
        fs_err::write(&path, text).unwrap();
        read_trajectory(&path)
    }

    #[test]
    fn columns_are_found_by_name_and_rows_sorted_by_time() {
        let rows = read("heading,gps_time,x,y,z\n0,2,20,200,0\n0,1,10,100,0\n\n").unwrap();
        assert_eq!(rows, [[10.0, 100.0], [20.0, 200.0]]);
    }

    #[test]
    fn errors_name_line_and_column() {
        assert!(matches!(read("time,x,y\n"), Err(TrajectoryError::Column { column: "gps_time", .. })));
        let error = read("gps_time,x,y\n1,2,3\n2,nan,4\n").unwrap_err();
        assert!(matches!(error, TrajectoryError::Number { line: 3, column: "x", .. }), "{error}");
        assert!(matches!(read("gps_time,x,y\n1,2,3\n"), Err(TrajectoryError::TooShort { positions: 1, .. })));
    }
}
