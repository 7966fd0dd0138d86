//! Writes a result to a file that the user names. A regular file gets its name only when it is complete;
//! other targets are written directly.

use std::io::{self, BufWriter, Read, Write};
use std::path::Path;

use super::OutputError;
use crate::whole_file;

/// First bytes of LAS and LAZ files (LAS 1.4 R15, section 2.4).
const SIGNATURE: &[u8] = b"LASF";

/// Refuses a target that [`save`] could not write, and any scan, so that a result never replaces points.
/// Worth a call before a long computation.
///
/// # Errors
/// [`OutputError::HoldsPoints`] for a LAS or LAZ file, and [`OutputError::Write`] for a folder, or for a file
/// whose folder does not exist.
pub fn check_target(path: &Path) -> Result<(), OutputError> {
    let failed = |kind: io::ErrorKind| OutputError::Write { path: path.to_owned(), source: kind.into() };
    match fs_err::metadata(path) {
        Ok(facts) if facts.is_dir() => return Err(failed(io::ErrorKind::IsADirectory)),
        Ok(facts) if !facts.is_file() => return Ok(()),
        Ok(_) => {}
        Err(_) => {
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
            return match folder.is_none_or(Path::is_dir) {
                true => Ok(()),
                false => Err(failed(io::ErrorKind::NotFound)),
            };
        }
    }
    let mut first = Vec::new();
    // A file that cannot be read may pass: it cannot be checked for points, and `save` finds out whether it
    // can be written.
    let read =
        fs_err::File::open(path).and_then(|file| file.take(SIGNATURE.len() as u64).read_to_end(&mut first));
    if read.is_ok() && first == SIGNATURE {
        return Err(OutputError::HoldsPoints { path: path.to_owned() });
    }
    Ok(())
}

/// Lets `content` write the file `path`, which gets its name when it is complete and synced. If `path` exists
/// and is not a regular file (a pipe, `/dev/null`), it is written to and never replaced.
///
/// # Errors
/// Those of [`check_target`], and [`OutputError::Write`].
pub fn save(path: &Path, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), OutputError> {
    check_target(path)?;
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
    fn a_scan_is_never_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("street.laz");
        fs_err::write(&path, b"LASF and so on").unwrap();
        let error = save(&path, |to| to.write_all(b"{}")).unwrap_err();
        assert!(matches!(&error, OutputError::HoldsPoints { path: named } if *named == path), "{error}");
        assert_eq!(fs_err::read(&path).unwrap(), b"LASF and so on");
        fs_err::write(&path, b"LAS").unwrap();
        save(&path, |to| to.write_all(b"{}")).unwrap();
        assert!(
            check_target(folder.path()).is_err() && check_target(&folder.path().join("new.json")).is_ok()
        );
        assert!(check_target(Path::new("new.json")).is_ok() && check_target(Path::new("/dev/null")).is_ok());
    }

    #[test]
    fn a_file_that_cannot_be_written_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let error = save(&folder.path().join("no folder/x.csv"), |_| Ok(())).unwrap_err();
        assert!(error.to_string().contains("x.csv"), "{error}");
    }
}
