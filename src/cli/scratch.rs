//! The folder for the temporary files of a command: --scratch, or the system's.

use std::path::Path;

use chainage::scratch_folder::{NoScratchFolder, ScratchFolder};

use crate::cli::exit::CliError;

/// A new folder inside `chosen`, which is made if it does not exist.
pub(crate) fn folder(chosen: Option<&Path>, command: &str) -> Result<ScratchFolder, CliError> {
    let parent = chosen.map_or_else(std::env::temp_dir, Path::to_owned);
    std::fs::create_dir_all(&parent)
        .map_err(|source| CliError::Write { target: parent.display().to_string(), source })?;
    ScratchFolder::create(&parent, command).map_err(|NoScratchFolder { path, source }| CliError::Write {
        target: path.display().to_string(),
        source,
    })
}
