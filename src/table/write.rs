//! Writes the rows of a table as they were read, with one more column.

use std::io::{self, Write};

use crate::table::Table;

/// Writes the header (if there is one) and every row of `table` byte for byte, each followed by a new field:
/// `name` in the header, `values[i]` in row i.
///
/// # Errors
/// Those of the writer.
pub fn write_with_column(table: &Table, name: &str, values: &[u32], to: &mut dyn Write) -> io::Result<()> {
    let separator = table.separator.text();
    if let Some(header) = table.header() {
        writeln!(to, "{header}{separator}{name}")?;
    }
    for (row, value) in table.rows().zip(values) {
        writeln!(to, "{row}{separator}{value}")?;
    }
    Ok(())
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
    fn rows_are_repeated_byte_for_byte() {
        assert_eq!(
            written("x, \"the y\"\r\n1.50, 2\r\n03,4 \r\n", true),
            "x, \"the y\",cluster_id\n1.50, 2,7\n03,4 ,0\n"
        );
        assert_eq!(written("1\t2\n3\t4", false), "1\t2\t7\n3\t4\t0\n");
        assert_eq!(written("1  2\n3 4\n", false), "1  2 7\n3 4 0\n");
    }
}
