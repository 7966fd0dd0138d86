//! The table of objects for the page: columns with their definitions, one array of values per column, and outlines in
//! metres.

use std::io::Write;

use serde_json::json;

use crate::model::{Column, ColumnType, Value};
use crate::output::objects::{ObjectTable, places, rounded};

/// Where the page counts coordinates from, and the metres per unit of the input.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PageFrame {
    /// In metres of the world frame.
    pub(crate) origin_m: [f64; 2],
    /// For x and y.
    pub(crate) units_m: [f64; 2],
}

/// The table as JSON. `shown` has the positions of the rows.
pub(super) fn json_of(
    table: &ObjectTable<'_>,
    shown: &[usize],
    frame: PageFrame,
) -> Result<Vec<u8>, serde_json::Error> {
    let columns: Vec<_> = table.columns.iter().map(described).collect();
    let mut values = vec![Vec::new(); table.columns.len()];
    let mut outlines = Vec::new();
    for (number, &position) in shown.iter().enumerate() {
        let row = (table.row)(position).map_err(serde_json::Error::io)?;
        for ((column, value), to) in table.columns.iter().zip(&row.values).zip(&mut values) {
            to.extend_from_slice(if number == 0 { b"[" } else { b"," });
            write_value(column, value, to)?;
        }
        let separator = if number == 0 { "" } else { "," };
        let outline: Vec<String> = row.outline.iter().flat_map(|&place| coordinates(place, frame)).collect();
        let _ = write!(outlines, "{separator}[{}]", outline.join(","));
    }
    let mut text = format!(r#"{{"columns":{},"values":["#, json!(columns)).into_bytes();
    for (number, column) in values.iter().enumerate() {
        text.extend_from_slice(if number == 0 { b"" } else { b",\n" });
        text.extend_from_slice(if shown.is_empty() { b"[" } else { column });
        text.push(b']');
    }
    text.extend_from_slice(b"],\n\"outlines\":[");
    text.extend_from_slice(&outlines);
    text.extend_from_slice(b"]}");
    Ok(text)
}

fn described(column: &Column) -> serde_json::Value {
    let kind = match column.column_type {
        ColumnType::Count => "count",
        ColumnType::Decimal { .. } => "decimal",
        ColumnType::Text => "text",
        ColumnType::Texts => "texts",
        ColumnType::Counts => "counts",
        ColumnType::Flag => "flag",
    };
    json!({
        "name": column.name,
        "type": kind,
        "unit": column.unit.label(),
        "places": places(column.column_type),
        "definition": column.definition,
    })
}

/// A value with the digits of the other formats; `null` where it is missing.
fn write_value(column: &Column, value: &Value<'_>, to: &mut Vec<u8>) -> Result<(), serde_json::Error> {
    match value {
        Value::Missing => to.extend_from_slice(b"null"),
        Value::Count(count) => to.extend_from_slice(count.to_string().as_bytes()),
        Value::Decimal(value) => {
            let places = places(column.column_type);
            let text = rounded(*value, places)
                .map_or("null".to_owned(), |value| format!("{value:.*}", places.into()));
            to.extend_from_slice(text.as_bytes());
        }
        Value::Text(text) => serde_json::to_writer(to, text)?,
        Value::Texts(texts) => serde_json::to_writer(to, texts)?,
        Value::Counts(counts) => serde_json::to_writer(to, counts)?,
        Value::Flag(flag) => serde_json::to_writer(to, flag)?,
    }
    Ok(())
}

/// A vertex of an outline in metres from the origin of the page, with centimetres.
fn coordinates(place: [f64; 2], frame: PageFrame) -> [String; 2] {
    [0, 1].map(|axis| {
        let metres = place[axis] * frame.units_m[axis] - frame.origin_m[axis];
        rounded(metres, 2).map_or("0".to_owned(), |metres| metres.to_string())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::objects::DriveShape;
    use crate::output::objects::tests::{COLUMNS, car, stray};

    #[test]
    fn rows_are_columns_with_the_digits_of_the_other_formats() {
        let row = |at: usize| Ok(if at == 0 { car() } else { stray() });
        let drive = DriveShape::default();
        let table = ObjectTable { columns: COLUMNS, drive: &drive, len: 2, row: &row };
        let frame = PageFrame { origin_m: [530_000.0, 3_380_000.0], units_m: [1.0, 1.0] };
        let text = json_of(&table, &[0, 1], frame).unwrap();
        let found: serde_json::Value = serde_json::from_slice(&text).unwrap();
        assert_eq!(found["values"][1], json!([530_000.123, null]));
        assert_eq!(found["values"][3], json!(["car, \"red\"", "none"]));
        assert_eq!(found["values"][4][0], json!(["a.las", "b, \"c\".laz"]));
        assert_eq!(found["columns"][2]["places"], 1);
        assert_eq!(found["outlines"][0], json!([0, 0, 4, 0, 4, 2]));
        let none: serde_json::Value = serde_json::from_slice(&json_of(&table, &[], frame).unwrap()).unwrap();
        assert_eq!(none["values"], json!([[], [], [], [], []]));
    }
}
