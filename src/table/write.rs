//! Writes a table as it was read, with one more column.

use std::io::{self, Write};

use crate::table::Table;

/// Writes `table` byte for byte, with its byte order mark, line ends and empty lines, and adds a field to the
/// header (if there is one) and to every row: `name` in the header, `values[i]` in row i. A last row without
/// a line end gets one.
///
/// # Errors
/// Those of the writer.
pub fn write_with_column(table: &Table, name: &str, values: &[u32], to: &mut dyn Write) -> io::Result<()> {
    let separator = table.separator.text();
    let (text, row_ends) = table.text_and_row_ends();
    let mut at = 0;
    if let Some(header) = &table.header {
        write!(to, "{}{separator}{name}", &text[..header.end])?;
        at = header.end;
    }
    for (end, value) in row_ends.zip(values) {
        write!(to, "{}{separator}{value}", &text[at..end])?;
        at = end;
    }
    to.write_all(&text.as_bytes()[at..])?;
    if text[at..].is_empty() { to.write_all(line_end(text).as_bytes()) } else { Ok(()) }
}

/// The line end of a text: that of its first line.
fn line_end(text: &str) -> &'static str {
    match text.split_once('\n') {
        Some((line, _)) if line.ends_with('\r') => "\r\n",
        _ => "\n",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn written(text: &str, has_header: bool) -> String {
        let table = Table::parse(Path::new("t.csv"), text.to_owned(), has_header).unwrap();
        let mut out = Vec::new();
        write_with_column(&table, "cluster_id", &[7, 0], &mut out).unwrap();
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn the_table_is_repeated_byte_for_byte() {
        assert_eq!(
            written("x, \"the y\"\r\n1.50, 2\r\n03,4 \r\n", true),
            "x, \"the y\",cluster_id\r\n1.50, 2,7\r\n03,4 ,0\r\n"
        );
        assert_eq!(
            written("\u{feff}\nx;y\n\n1;2\r\n \n3;4\n\n", true),
            "\u{feff}\nx;y;cluster_id\n\n1;2;7\r\n \n3;4;0\n\n"
        );
        assert_eq!(written("1;2\r\n3;4", false), "1;2;7\r\n3;4;0\r\n");
        assert_eq!(written("1\t2\n3\t4", false), "1\t2\t7\n3\t4\t0\n");
        assert_eq!(written("1  2\n3 4\n", false), "1  2 7\n3 4 0\n");
    }
}
