//! CSV after RFC 4180, with lines that end in a line feed. A missing value is an empty field, and a list of texts is
//! joined by `;`.

use std::io::{self, Write};

use crate::model::{Column, Value};
use crate::output::objects::number::{places, rounded};
use crate::output::objects::table::{ObjectFormat, ObjectTable};

/// The format.
#[derive(Debug)]
pub(super) struct Csv;

impl ObjectFormat for Csv {
    fn write(&self, table: &ObjectTable<'_>, out: &mut dyn Write) -> io::Result<()> {
        let names: Vec<&str> = table.columns.iter().map(|column| column.name).collect();
        writeln!(out, "{}", names.join(","))?;
        // A line is put together in memory: `out` is asked once per row and not once per field.
        let mut line = Vec::new();
        for row in table.rows() {
            line.clear();
            for (index, (column, value)) in table.columns.iter().zip(&row.values).enumerate() {
                if index > 0 {
                    line.push(b',');
                }
                write_field(column, value, &mut line)?;
            }
            line.push(b'\n');
            out.write_all(&line)?;
        }
        out.flush()
    }
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
        Value::Texts(texts) => write_text(&texts.join(";"), line),
    }
}

/// A text, in quotes when it needs them.
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
    use crate::output::objects::table::tests::{car, refuses_after, stray, written};

    #[test]
    fn there_is_a_header_and_a_line_per_row() {
        let text = written(&Csv, &[car(), stray()], None);
        let car = r#"7,530000.123,0.0,"car, ""red""","a.las;b, ""c"".laz""#;
        assert_eq!(text, format!("id,min_x,share,class,files\n{car}\n8,,,none,a.las\n"));
        assert_eq!(written(&Csv, &[], Some(25_832)), "id,min_x,share,class,files\n");
    }

    #[test]
    fn a_refusing_writer_is_an_error() {
        assert!(refuses_after(&Csv, 10) && refuses_after(&Csv, 40) && !refuses_after(&Csv, 1_000));
    }
}
