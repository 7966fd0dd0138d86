//! Shared by several integration tests: the optional data folder, small drives and how to run them,
//! references.

pub(crate) mod contest_oracle;
pub(crate) mod cut_oracle;
pub(crate) mod drive;
pub(crate) mod imports;
pub(crate) mod las;
pub(crate) mod memory_drive;
pub(crate) mod method_run;
pub(crate) mod numbers;
pub(crate) mod oracle;
pub(crate) mod peaks_oracle;
pub(crate) mod program;
pub(crate) mod street;
pub(crate) mod surface_oracle;

use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The folder of shared test data, or `None` (with a message) if it is missing.
///
/// It is not part of the project. `CHAINAGE_SHARED_DATA` names it; the default is a folder beside the
/// project.
pub(crate) fn shared_data() -> Option<PathBuf> {
    let folder = std::env::var_os("CHAINAGE_SHARED_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    skipped(&format!("no shared test data in {} (set CHAINAGE_SHARED_DATA)", folder.display()));
    None
}

/// Says that a test leaves `what` out. A test that passes shows no text, so the file in `CHAINAGE_SKIPPED`
/// gets a line as well, which `scripts/check.sh` repeats at its end.
pub(crate) fn skipped(what: &str) {
    println!("skipped: {what}");
    if let Some(path) = std::env::var_os("CHAINAGE_SKIPPED") {
        let mut file = OpenOptions::new().append(true).create(true).open(path).expect("the list of skips");
        file.write_all(format!("{}\n", what.replace('\n', " ")).as_bytes()).expect("written");
    }
}

/// A file that ships with the project, by its path from the root.
pub(crate) fn shipped(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// Every LAS and LAZ file below a folder, sorted.
pub(crate) fn las_files(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).expect("a readable folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files.extend(las_files(&path));
        } else if path.extension().is_some_and(|extension| extension == "las" || extension == "laz") {
            files.push(path);
        }
    }
    files.sort();
    files
}
