//! Folders for temporary files that no other process uses, and that are removed at the end.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// A folder for scratch files. It is removed when this value is dropped.
#[derive(Debug)]
pub struct ScratchFolder {
    path: PathBuf,
}

/// A scratch folder cannot be made.
#[derive(Debug, thiserror::Error)]
#[error("cannot make the folder {path}", path = path.display())]
pub struct NoScratchFolder {
    /// The folder.
    pub path: PathBuf,
    /// Why.
    pub source: io::Error,
}

impl ScratchFolder {
    /// Makes a new, empty folder in `parent`. Its name contains the name of the `command`.
    ///
    /// # Errors
    /// [`NoScratchFolder`], also if there is no `parent`.
    pub fn create(parent: &Path, command: &str) -> Result<Self, NoScratchFolder> {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        loop {
            let number = NUMBER.fetch_add(1, Ordering::Relaxed);
            let path = parent.join(format!("chainage-{command}-{}-{number}", std::process::id()));
            match std::fs::create_dir(&path) {
                Ok(()) => return Ok(Self { path }),
                // A killed process with the same number left this folder behind. The next name is tried.
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(source) => return Err(NoScratchFolder { path, source }),
            }
        }
    }

    /// The folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The path of the file of this name.
    #[must_use]
    pub fn join(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }
}

impl Drop for ScratchFolder {
    fn drop(&mut self) {
        // Nothing depends on the result, and nobody could receive the error.
        let _ = std::fs::remove_dir_all(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_killed_process_left_is_not_taken() {
        let parent = tempfile::tempdir().unwrap();
        let first = ScratchFolder::create(parent.path(), "test").unwrap();
        let number = first.path().to_str().unwrap().rsplit_once('-').unwrap().1.parse::<u32>().unwrap();
        // Other tests of this process may use some of the next numbers.
        for next in 1..100 {
            let left = format!("chainage-test-{}-{}", std::process::id(), number + next);
            std::fs::create_dir(parent.path().join(&left)).unwrap();
            std::fs::write(parent.path().join(left).join("state"), "of another").unwrap();
        }
        let second = ScratchFolder::create(parent.path(), "test").unwrap();
        assert_eq!(second.path().read_dir().unwrap().count(), 0);
        let path = second.path().to_owned();
        drop(second);
        assert!(!path.exists());
    }

    #[test]
    fn a_folder_that_is_not_there_is_an_error() {
        let error = ScratchFolder::create(Path::new("there/is/no/such/folder"), "test").unwrap_err();
        assert!(error.to_string().contains("chainage-test-"), "{error}");
    }
}
