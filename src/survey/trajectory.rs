//! Reads a trajectory: a table with the columns `gps_time,x,y,z` (others are ignored), in the coordinates of
//! the drive.

use std::path::Path;

use crate::survey::SurveyError;
use crate::survey::recordings::{GAP_S, recordings};
use crate::table::{Table, TableError};

const COLUMNS: [&str; 3] = ["gps_time", "x", "y"];
/// A trajectory with few positions has a gap only where the time is this many times as long as usual (chosen:
/// positions that were thinned by distance are far apart in time at a crossing).
const GAP_INTERVALS: f64 = 10.0;

/// The positions (x, y) of a trajectory in order of time, in metres: a run for each recording without a gap
/// in time. `unit_m` is the unit of the coordinates of the drive in metres. Those of the file have it, too.
///
/// # Errors
/// When the file cannot be read, a column is missing, or a value is not a finite number.
pub fn read_trajectory(path: &Path, unit_m: f64) -> Result<Vec<Vec<[f64; 2]>>, SurveyError> {
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
    let runs = recordings(rows, |row| row[0], |intervals| (GAP_INTERVALS * median(intervals)).max(GAP_S));
    let metres = |row: &&[f64]| [row[1] * unit_m, row[2] * unit_m];
    Ok(runs.iter().map(|run| run.iter().map(metres).collect()).collect())
}

/// The middle of these values, the larger one of two.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
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

    fn read(text: &str) -> Result<Vec<Vec<[f64; 2]>>, SurveyError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trajectory.csv");
        fs_err::write(&path, text).unwrap();
        read_trajectory(&path, 1.0)
    }

    #[test]
    fn columns_are_found_by_name_and_rows_sorted_by_time() {
        let rows = read("heading,gps_time,x,y,z\n0,2,20,200,0\n0,1,10,100,0\n\n").unwrap();
        assert_eq!(rows, [[[10.0, 100.0], [20.0, 200.0]]]);
    }

    #[test]
    fn a_gap_in_time_ends_a_run_and_the_end_of_the_week_does_not() {
        let track = |times: &[f64]| {
            let rows = times.iter().enumerate().map(|(x, time)| format!("{time},{x},0\n"));
            read(&format!("gps_time,x,y\n{}", rows.collect::<String>())).unwrap()
        };
        let lengths = |times: &[f64]| track(times).iter().map(Vec::len).collect::<Vec<_>>();
        assert_eq!(lengths(&[0.0, 1.0, 2.0, 6.0, 7.0]), [5]);
        assert_eq!(lengths(&[0.0, 1.0, 2.0, 12.5, 13.5]), [3, 2]);
        assert_eq!(lengths(&[0.0, 5.0, 10.0, 40.0, 45.0]), [5], "positions every 5 s");
        let wrapped = track(&[604_799.0, 604_800.0, 1.0, 2.0]);
        assert_eq!(wrapped, [[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]]]);
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
            assert_eq!(read(text).unwrap(), [[[10.0, 100.0], [20.0, 200.0]]], "{text}");
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
