//! Reads a trajectory: CSV with the columns `gps_time,x,y,z` (others are ignored), in the coordinates of the
//! drive.

use std::path::Path;

use crate::survey::SurveyError;

const COLUMNS: [&str; 3] = ["gps_time", "x", "y"];

/// The positions (x, y) of a trajectory in order of time, in the units of the file.
///
/// # Errors
/// When the file cannot be read, a column is missing, or a value is not a finite number.
pub fn read_trajectory(path: &Path) -> Result<Vec<[f64; 2]>, SurveyError> {
    let text =
        fs_err::read_to_string(path).map_err(|source| SurveyError::Read { path: path.to_owned(), source })?;
    let mut lines = text.lines().enumerate();
    let header = lines.next().map_or("", |line| line.1);
    let names: Vec<String> = header.split(',').map(|name| name.trim().to_ascii_lowercase()).collect();
    let mut places = [0; 3];
    for (place, column) in places.iter_mut().zip(COLUMNS) {
        *place = names.iter().position(|name| name == column).ok_or_else(|| SurveyError::Column {
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
                .ok_or_else(|| SurveyError::Number {
                    path: path.to_owned(),
                    line: index + 1,
                    column,
                    found: line.chars().take(120).collect(),
                })?;
        }
        rows.push(values);
    }
    if rows.len() < 2 {
        return Err(SurveyError::TooShort { path: path.to_owned(), positions: rows.len() });
    }
    // A stable sort: positions with equal times stay in file order.
    rows.sort_by(|a, b| a[0].total_cmp(&b[0]));
    Ok(rows.into_iter().map(|row| [row[1], row[2]]).collect())
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

    #[test]
    fn errors_name_line_and_column() {
        assert!(matches!(read("time,x,y\n"), Err(SurveyError::Column { column: "gps_time", .. })));
        let error = read("gps_time,x,y\n1,2,3\n2,nan,4\n").unwrap_err();
        assert!(matches!(error, SurveyError::Number { line: 3, column: "x", .. }), "{error}");
        assert!(matches!(read("gps_time,x,y\n1,2,3\n"), Err(SurveyError::TooShort { positions: 1, .. })));
    }
}
