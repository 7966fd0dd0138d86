//! Writing a result under its name only when it is complete.

use std::io::Write;
use std::path::Path;

use crate::output::OutputError;

/// Writes `text` to `path`: under a temporary name in the same folder first, then renamed.
///
/// # Errors
/// [`OutputError::Write`].
pub fn save(path: &Path, text: &str) -> Result<(), OutputError> {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(".part");
    let temporary = path.with_file_name(name);
    let write = || {
        let mut file = fs_err::File::create(&temporary)?;
        file.write_all(text.as_bytes())?;
        file.sync_all()?;
        drop(file);
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
        save(&path, "one").unwrap();
        save(&path, "two").unwrap();
        assert_eq!(fs_err::read_to_string(&path).unwrap(), "two");
        assert_eq!(folder.path().read_dir().unwrap().count(), 1);
        let error = save(&folder.path().join("no folder/x.csv"), "x").unwrap_err();
        assert!(error.to_string().contains("x.csv"), "{error}");
    }
}
