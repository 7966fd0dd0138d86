//! The report as JSON.

use std::io::{self, Write};

use crate::eval::report::values::Report;

impl Report<'_> {
    /// Writes the whole report as JSON, keys in a fixed order.
    ///
    /// # Errors
    /// What `to` answers.
    pub fn write_json(&self, to: &mut dyn Write) -> io::Result<()> {
        serde_json::to_writer_pretty(&mut *to, self)?;
        to.write_all(b"\n")
    }
}
