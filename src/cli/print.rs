//! Printing results to standard output: tables for people, JSON for scripts.

use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use chainage::output::{check_target, save};
use chainage::run::SectionFacts;
pub(crate) use chainage::words::{counted, separated as count};
use clap::builder::{PathBufValueParser, TypedValueParser};
use serde::Serialize;

use crate::cli::exit::CliError;

fn to_standard_output(content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), CliError> {
    let mut out = BufWriter::new(io::stdout().lock());
    content(&mut out).and_then(|()| out.flush()).map_err(CliError::stdout)
}

/// A section of a drive, for a person.
pub(crate) fn section(section: &SectionFacts) -> String {
    format!("chainage {:.0} to {:.0} m of {:.0} m", section.from_m, section.to_m, section.length_m)
}

/// Prints text as it is.
pub(crate) fn text(text: &str) -> Result<(), CliError> {
    to_standard_output(|out| out.write_all(text.as_bytes()))
}

/// Where a result goes as JSON, in commands that print a page.
#[derive(Debug, clap::Args)]
pub(crate) struct JsonOutput {
    /// Print JSON instead of text; with =FILE, print text and write JSON to the file
    #[arg(
        long,
        value_name = "FILE",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "-",
        value_parser = target()
    )]
    json: Option<PathBuf>,
}

impl JsonOutput {
    /// Whether JSON goes anywhere.
    pub(crate) fn is_asked_for(&self) -> bool {
        self.json.is_some()
    }

    /// Prints the page, unless JSON is printed; writes JSON to a file.
    pub(crate) fn show(&self, value: &impl Serialize, page: impl FnOnce() -> String) -> Result<(), CliError> {
        let printed = deliver(self.json.as_deref(), |to| {
            serde_json::to_writer_pretty(&mut *to, value)?;
            to.write_all(b"\n")
        })?;
        if printed { Ok(()) } else { text(&page()) }
    }
}

/// Writes a result to its destination. Returns whether this is standard output.
pub(crate) fn deliver(
    to: Option<&Path>,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<bool, CliError> {
    let Some(path) = to else { return Ok(false) };
    if !is_standard_output(path) {
        return Ok(save(path, content).map(|()| false).map_err(chainage::Error::from)?);
    }
    match to_standard_output(content) {
        // If a reader closes the pipe early, the other results are still written.
        Err(error) if !error.is_broken_pipe() => Err(error),
        _ => Ok(true),
    }
}

/// Reads the name of a file for a result. A name that cannot be written, or that is the name of a scan, is
/// refused before anything is computed.
pub(crate) fn target() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| {
        if is_standard_output(&path) {
            return Ok(path);
        }
        check_target(&path).map(|()| path).map_err(|error| match std::error::Error::source(&error) {
            Some(cause) => format!("{error}: {cause}"),
            None => error.to_string(),
        })
    })
}

/// Whether a result is to go to standard output.
pub(crate) fn is_standard_output(path: &Path) -> bool {
    path == Path::new("-")
}

/// A table with a header; the first column is flush left, the others flush right.
pub(crate) fn table(header: &[&str], rows: &[Vec<String>]) -> String {
    let width = |column: usize| {
        rows.iter()
            .map(|row| row[column].chars().count())
            .chain([header[column].chars().count()])
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..header.len()).map(width).collect();
    let line = |cells: &[String]| {
        let mut text = String::new();
        for (column, (cell, &width)) in cells.iter().zip(&widths).enumerate() {
            if column == 0 {
                text.push_str(&format!("  {cell:<width$}"));
            } else {
                text.push_str(&format!("  {cell:>width$}"));
            }
        }
        format!("{}\n", text.trim_end())
    };
    let names: Vec<String> = header.iter().map(ToString::to_string).collect();
    let mut text = line(&names);
    rows.iter().for_each(|row| text.push_str(&line(row)));
    text
}

/// Bytes as MiB or GiB.
pub(crate) fn bytes(number: u64) -> String {
    let mib = number as f64 / f64::from(1 << 20);
    if mib < 1024.0 { format!("{mib:.1} MiB") } else { format!("{:.2} GiB", mib / 1024.0) }
}

/// Prints a line on standard error. If standard error is closed, nobody reads it, so the failure is ignored.
pub(crate) fn note(text: &str) {
    let _ = io::stderr().write_all(format!("{text}\n").as_bytes());
}

/// Warnings as lines.
pub(crate) fn warnings(list: &[String]) -> String {
    list.iter().map(|text| format!("  warning: {text}\n")).collect()
}
