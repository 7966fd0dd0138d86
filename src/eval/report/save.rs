//! Writing a result under its name only when it is complete.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use crate::output::OutputError;

/// Lets `content` write the file `path`: under a temporary name in the same folder first, then renamed. What is there
/// and no regular file (a pipe, `/dev/null`) is written to and never replaced.
///
/// # Errors
/// [`OutputError::Write`].
pub fn save(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), OutputError> {
    if fs_err::metadata(path).is_ok_and(|facts| !facts.is_file()) {
        let write = || {
            let mut file = BufWriter::new(fs_err::File::options().write(true).open(path)?);
            content(&mut file)?;
            file.flush()
        };
        return write().map_err(|source| OutputError::Write { path: path.to_owned(), source });
    }
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(".part");
    let temporary = path.with_file_name(name);
    let write = || {
        let mut file = BufWriter::new(fs_err::File::create(&temporary)?);
        content(&mut file)?;
        file.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()?;
        fs_err::rename(&temporary, path)
    };
    write().map_err(|source| {
        // Half a file is of no use to anyone; a failure to remove it adds nothing to the first one.
        let _ = fs_err::remove_file(&temporary);
        OutputError::Write { path: path.to_owned(), source }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_replaced_whole_or_not_at_all() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result.json");
        save(&path, |to| to.write_all(b"one")).unwrap();
        save(&path, |to| to.write_all(b"two")).unwrap();
        save(&path, |to| to.write_all(b"half").and(Err(io::ErrorKind::StorageFull.into()))).unwrap_err();
        assert_eq!(fs_err::read_to_string(&path).unwrap(), "two");
        assert_eq!(folder.path().read_dir().unwrap().count(), 1);
        let error = save(&folder.path().join("no folder/x.csv"), |_| Ok(())).unwrap_err();
        assert!(error.to_string().contains("x.csv"), "{error}");
    }

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
}
