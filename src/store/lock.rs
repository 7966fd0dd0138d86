//! The lock of a run directory. The process that drives a run holds it; workers do not.

use std::fs::{File, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::host;
use crate::store::StoreError;

/// The holder of the lock, according to the lock file.
#[derive(Debug, Serialize, Deserialize)]
struct Holder {
    host: String,
    process: u32,
}

impl Holder {
    /// This process.
    fn here() -> Self {
        Self { host: host::name().to_owned(), process: std::process::id() }
    }

    /// A description of the holder, and whether it still runs, as far as this host can tell.
    fn described(&self) -> String {
        let Self { host, process } = self;
        if host != host::name() {
            return format!("process {process} on {host} (whether it runs can be seen only there)");
        }
        let state = if host::is_alive(*process) {
            "it runs"
        } else {
            "it has ended, but its child may hold the lock"
        };
        format!("process {process} on this host, {host} ({state})")
    }
}

/// Takes the lock. The system releases it when the process ends, for any reason.
pub(super) fn lock(out: &Path, path: &Path) -> Result<File, StoreError> {
    let io = |action| StoreError::io(action, path);
    let mut file =
        File::options().read(true).write(true).create(true).truncate(false).open(path).map_err(io("open"))?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => {
            let mut text = String::new();
            let holder = file.read_to_string(&mut text).ok().and_then(|_| serde_json::from_str(&text).ok());
            let holder =
                holder.map_or_else(|| "another process".to_owned(), |holder: Holder| holder.described());
            return Err(StoreError::Locked { path: out.to_owned(), holder });
        }
        Err(TryLockError::Error(source)) => return Err(io("lock")(source)),
    }
    let text = serde_json::to_string(&Holder::here()).unwrap_or_default();
    file.set_len(0)
        .and_then(|()| file.rewind())
        .and_then(|()| file.write_all(text.as_bytes()))
        .map_err(io("write"))?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_says_who_holds_it_and_whether_it_runs() {
        let here = Holder::here();
        let text = here.described();
        assert!(text.contains(host::name()) && text.contains("it runs"), "{text}");
        let mut child = std::process::Command::new("true").spawn().unwrap();
        child.wait().unwrap();
        let ended = Holder { process: child.id(), ..here }.described();
        assert!(ended.contains("it has ended"), "{ended}");
        let elsewhere = Holder { host: "node7".to_owned(), process: 12 }.described();
        assert_eq!(elsewhere, "process 12 on node7 (whether it runs can be seen only there)");
    }
}
