//! Writing a result under its name only when it is complete.

use std::io::{self, Write};
use std::path::Path;

use super::OutputError;
use crate::whole_file;

/// Lets `content` write the file `path`, which gets its name when it is complete and synced.
///
/// # Errors
/// [`OutputError::Write`].
pub fn save(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), OutputError> {
    whole_file::write(path, content).map_err(|source| OutputError::Write { path: path.to_owned(), source })
}
