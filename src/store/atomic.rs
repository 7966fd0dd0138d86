//! Files that appear under their name only when they are complete, and survive a power cut once they do.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Writes `bytes` to `path`: temporary name in the same folder, sync, rename, sync of the folder.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let temporary = temporary_name(path);
    let mut file = fs_err::File::create(&temporary)?;
    let written = file.write_all(bytes).and_then(|()| file.sync_all());
    if let Err(error) = written {
        drop(file);
        // The half-written file must not use up the space that is missing; its own failure adds nothing.
        let _ = fs_err::remove_file(&temporary);
        return Err(error);
    }
    publish(&temporary, path)
}

/// Gives a complete and synced file its final name.
pub(crate) fn publish(temporary: &Path, path: &Path) -> io::Result<()> {
    fs_err::rename(temporary, path)?;
    sync_folder(path)
}

/// Makes the directory entry of `path` durable.
pub(crate) fn sync_folder(path: &Path) -> io::Result<()> {
    match path.parent() {
        // Only Unix lets a folder be opened and synced; elsewhere the rename itself has to do.
        Some(folder) if cfg!(unix) => File::open(folder)?.sync_all(),
        _ => Ok(()),
    }
}

fn temporary_name(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(".part");
    path.with_file_name(name)
}
