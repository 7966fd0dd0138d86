//! Waits for files that another process writes. A network file system shows a new name to other hosts only
//! after seconds, unless its folder is listed.

use std::path::Path;
use std::time::{Duration, Instant};

/// Shortest and longest pause between two attempts. Chosen: short against the work of a unit, and rare enough
/// for a file server.
const PAUSES: (Duration, Duration) = (Duration::from_millis(20), Duration::from_secs(1));

/// Calls `look` until it finds something or `wait` is over. Lists `folder` between two attempts, for which a
/// network file system asks the server.
pub(super) fn waited_for<T, E>(
    folder: &Path,
    wait: Duration,
    mut look: impl FnMut() -> Result<Option<T>, E>,
) -> Result<Option<T>, E> {
    let began = Instant::now();
    let mut pause = PAUSES.0;
    loop {
        let found = look()?;
        if found.is_some() || began.elapsed() >= wait {
            return Ok(found);
        }
        std::thread::sleep(pause.min(wait));
        pause = (pause * 2).min(PAUSES.1);
        // If the folder cannot be listed, the next attempt still tries the name.
        let _ = std::fs::read_dir(folder).map(Iterator::count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_late_is_found_and_what_does_not_come_is_missed_in_time() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("late");
        let look = || Ok::<_, ()>(path.exists().then_some(()));
        let began = Instant::now();
        assert_eq!(waited_for(folder.path(), Duration::from_millis(100), look), Ok(None));
        assert!(began.elapsed() >= Duration::from_millis(100));
        std::thread::scope(|scope| {
            scope.spawn(|| {
                std::thread::sleep(Duration::from_millis(100));
                fs_err::write(&path, "here").unwrap();
            });
            assert_eq!(waited_for(folder.path(), Duration::from_secs(30), look), Ok(Some(())));
        });
        assert_eq!(waited_for(folder.path(), Duration::ZERO, look), Ok(Some(())));
    }
}
