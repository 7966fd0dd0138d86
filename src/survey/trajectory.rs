//! Reads a trajectory: a table with the columns `gps_time,x,y,z` (others are ignored), in the coordinates of
//! the drive.

use std::path::Path;

use crate::survey::SurveyError;
use crate::table::{Table, TableError};

const COLUMNS: [&str; 3] = ["gps_time", "x", "y"];

/// The positions (x, y) of a trajectory in order of time, in the units of the file.
///
/// # Errors
/// When the file cannot be read, a column is missing, or a value is not a finite number.
pub fn read_trajectory(path: &Path) -> Result<Vec<[f64; 2]>, SurveyError> {
    let table = match Table::read(path, true) {
        // A first line of numbers names no column.
        Err(TableError::NoHeader { path, found }) => {
            return Err(SurveyError::Column { path, column: COLUMNS[0], found });
        }
        Err(TableError::Empty { path, names }) => {
            places(&path, &names)?;
            return Err(SurveyError::TooShort { path, positions: 0 });
        }
        table => table?,
    };
    let values = table.values(&places(path, table.names())?)?;
    let mut rows: Vec<&[f64]> = values.chunks_exact(COLUMNS.len()).collect();
    if rows.len() < 2 {
        return Err(SurveyError::TooShort { path: path.to_owned(), positions: rows.len() });
    }
    // A stable sort: positions with equal times stay in file order.
    rows.sort_by(|a, b| a[0].total_cmp(&b[0]));
    Ok(rows.into_iter().map(|row| [row[1], row[2]]).collect())
}

/// Where the columns of a trajectory are among those of a table.
fn places(path: &Path, names: &[String]) -> Result<Vec<usize>, SurveyError> {
    let place = |column: &'static str| {
        let found = names.iter().position(|name| name.eq_ignore_ascii_case(column));
        found.ok_or_else(|| SurveyError::Column {
            path: path.to_owned(),
            column,
            found: names.join(",").chars().take(120).collect(),
        })
    };
    COLUMNS.into_iter().map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<[f64; 2]>, SurveyError> {
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

    /// A spreadsheet writes a byte order mark and quotes, and in some languages semicolons.
    #[test]
    fn a_trajectory_of_a_spreadsheet_is_read() {
        for text in [
            "\u{feff}gps_time,x,y,z\r\n1,10,100,0\r\n2,20,200,0\r\n",
            "\"gps_time\",\"X\",\"Y\"\n\"1\",\"10\",\"100\"\n2,20,200\n",
            "GPS_Time;x;y\n1;10;100\n2;20;200\n",
            "gps_time x y\n1 10 100\n2 20 200\n",
        ] {
            assert_eq!(read(text).unwrap(), [[10.0, 100.0], [20.0, 200.0]], "{text}");
        }
    }

    #[test]
    fn errors_name_line_and_column() {
        assert!(matches!(read("time,x,y\n"), Err(SurveyError::Column { column: "gps_time", .. })));
        assert!(matches!(read("1,2,3\n4,5,6\n"), Err(SurveyError::Column { column: "gps_time", .. })));
        let error = read("gps_time,x,y\n1,2,3\n2,nan,4\n").unwrap_err();
        let SurveyError::Table(TableError::Number { line, column, .. }) = &error else { panic!("{error}") };
        assert_eq!((*line, column.as_str()), (3, "x"));
        let error = read("gps_time,x,y\n1,2,3\n2,4\n").unwrap_err();
        assert!(error.to_string().contains("line 3"), "{error}");
        assert!(matches!(read("gps_time,x,y\n"), Err(SurveyError::TooShort { positions: 0, .. })));
        assert!(matches!(read("gps_time,x,y\n1,2,3\n"), Err(SurveyError::TooShort { positions: 1, .. })));
    }
}
