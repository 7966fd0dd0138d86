//! Writes a result that the user names. A regular file gets its name only when it is complete; other targets
//! are written directly.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::OutputError;
use crate::whole_file;

/// Lets `content` write the file `path`, which gets its name when it is complete and synced. If `path` exists
/// and is not a regular file (a pipe, `/dev/null`), it is written to and never replaced.
///
/// # Errors
/// [`OutputError::Write`].
pub fn save(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), OutputError> {
    let written = if fs_err::metadata(path).is_ok_and(|facts| !facts.is_file()) {
        write_into(path, content)
    } else {
        whole_file::write(path, content)
    };
    written.map_err(|source| OutputError::Write { path: path.to_owned(), source })
}

fn write_into(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut file = BufWriter::new(fs_err::File::options().write(true).open(path)?);
    content(&mut file)?;
    file.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pipe_is_written_to_and_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        let reader = std::thread::spawn({
            let path = path.clone();
            move || fs_err::read_to_string(path).unwrap()
        });
        save(&path, |to| to.write_all(b"one")).unwrap();
        assert_eq!(reader.join().unwrap(), "one");
        assert!(!fs_err::metadata(&path).unwrap().is_file());
    }

    #[test]
    fn a_file_that_cannot_be_written_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let error = save(&folder.path().join("no folder/x.csv"), |_| Ok(())).unwrap_err();
        assert!(error.to_string().contains("x.csv"), "{error}");
    }
}
