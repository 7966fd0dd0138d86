//! Printing results to standard output: tables for people, JSON for scripts.

use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use chainage::config::ConfigError;
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

    /// Whether JSON goes to standard output.
    pub(crate) fn is_printed(&self) -> bool {
        self.json.as_deref().is_some_and(is_standard_output)
    }

    /// Refuses a file in the folder `out` that the command itself writes, according to `is_owned` for its
    /// name.
    pub(crate) fn spares(&self, out: &Path, is_owned: impl Fn(&str) -> bool) -> Result<(), CliError> {
        let Some(path) = self.json.as_deref().filter(|path| !is_standard_output(path)) else { return Ok(()) };
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if is_owned(&name) && resolved(folder) == resolved(out) {
            let expected = format!("another file: {name} in {} is an output of the run", out.display());
            let error = ConfigError::value("--json", path.display(), expected);
            return Err(chainage::Error::from(error).into());
        }
        Ok(())
    }

    /// Prints the page, unless JSON is printed. Writes JSON to a file, if one was given.
    pub(crate) fn show(&self, value: &impl Serialize, page: impl FnOnce() -> String) -> Result<(), CliError> {
        if self.deliver(value)? { Ok(()) } else { text(&page()) }
    }

    /// Writes JSON to its destination. Returns whether this is standard output.
    pub(crate) fn deliver(&self, value: &impl Serialize) -> Result<bool, CliError> {
        self.deliver_by(|to| {
            serde_json::to_writer_pretty(&mut *to, value)?;
            to.write_all(b"\n")
        })
    }

    /// The same, for JSON that `content` writes.
    pub(crate) fn deliver_by(
        &self,
        content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<bool, CliError> {
        deliver(self.json.as_deref(), content)
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

/// A parser of the name of a file for a result. A file that cannot be written, or that is a scan, is refused
/// before anything is computed.
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

/// A parser of the name of a folder for results.
pub(crate) fn folder() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| {
        if is_standard_output(&path) {
            return Err("a folder cannot be standard output; write ./- for a folder of this name");
        }
        Ok(path)
    })
}

/// A path without links and detours, to compare it with others.
pub(crate) fn resolved(path: &Path) -> PathBuf {
    std::fs::canonicalize(path).or_else(|_| std::path::absolute(path)).unwrap_or_else(|_| path.to_owned())
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
