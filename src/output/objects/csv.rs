//! CSV after RFC 4180, with lines that end in a line feed. A missing value is an empty field, a list is
//! joined by `;`, and a flag is `true` or `false`.

use std::io::{self, Write};
use std::path::Path;

use crate::model::{Column, Value};
use crate::output::objects::number::{listed, places, rounded};
use crate::output::objects::table::{ObjectFormat, ObjectTable, stream};

/// The format.
#[derive(Debug)]
pub(super) struct Csv;

impl ObjectFormat for Csv {
    fn write(&self, table: &ObjectTable<'_>, path: &Path) -> io::Result<()> {
        stream(path, |out| lines(table, out))
    }
}

fn lines(table: &ObjectTable<'_>, out: &mut dyn Write) -> io::Result<()> {
    let names: Vec<&str> = table.columns.iter().map(|column| column.name).collect();
    writeln!(out, "{}", names.join(","))?;
    // A line is built in memory, so that `out` is called once per row and not once per field.
    let mut line = Vec::new();
    for row in table.rows() {
        line.clear();
        for (index, (column, value)) in table.columns.iter().zip(&row?.values).enumerate() {
            if index > 0 {
                line.push(b',');
            }
            write_field(column, value, &mut line)?;
        }
        line.push(b'\n');
        out.write_all(&line)?;
    }
    Ok(())
}

fn write_field(column: &Column, value: &Value<'_>, line: &mut Vec<u8>) -> io::Result<()> {
    match value {
        Value::Missing => Ok(()),
        Value::Count(count) => write!(line, "{count}"),
        Value::Decimal(value) => {
            let places = places(column.column_type);
            match rounded(*value, places) {
                Some(value) => write!(line, "{value:.*}", usize::from(places)),
                None => Ok(()),
            }
        }
        Value::Text(text) => write_text(text, line),
        Value::Texts(texts) => write_text(&listed(texts), line),
        Value::Counts(counts) => write_text(&listed(counts), line),
        Value::Flag(flag) => write!(line, "{flag}"),
    }
}

/// Writes a text, in quotes if it needs them.
fn write_text(text: &str, line: &mut Vec<u8>) -> io::Result<()> {
    if text.contains(['"', ',', '\r', '\n']) {
        write!(line, "\"{}\"", text.replace('"', "\"\""))
    } else {
        line.write_all(text.as_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{ColumnType, ColumnUnit};
    use crate::output::objects::table::tests::{car, reports_errors, stray, written};

    #[test]
    fn there_is_a_header_and_a_line_per_row() {
        let text = written(&Csv, &[car(), stray()], None);
        let car = r#"7,530000.123,0.0,"car, ""red""","a.las;b, ""c"".laz""#;
        assert_eq!(text, format!("id,min_x,share,class,files\n{car}\n8,,,none,a.las\n"));
        assert_eq!(written(&Csv, &[], Some(25_832)), "id,min_x,share,class,files\n");
    }

    #[test]
    fn lists_and_flags_are_one_field() {
        let column =
            Column { name: "x", column_type: ColumnType::Counts, unit: ColumnUnit::None, definition: "" };
        let text = |value: Value<'_>| {
            let mut line = Vec::new();
            write_field(&column, &value, &mut line).unwrap();
            String::from_utf8(line).unwrap()
        };
        assert_eq!(text(Value::Counts(vec![])), "");
        assert_eq!(text(Value::Counts(vec![3, 17])), "3;17");
        assert_eq!([text(Value::Flag(true)), text(Value::Flag(false))], ["true", "false"]);
    }

    #[test]
    fn errors_are_reported() {
        assert!(reports_errors(&Csv));
    }
}
