//! The points that `chainage view` streams: the part of `drive.copc.laz` that a request names, and the open
//! file.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

use chainage::input::InputError;
use chainage::output::PointStream;

use crate::cli::served::Refusal;

/// Name of the file with all points.
const CLOUD: &str = "drive.copc.laz";

/// The part of the file that a request names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    /// The table of its nodes.
    Tree,
    /// The points of a node: level and position.
    Node([u32; 4]),
}

/// The part that the target of a request names; its path names `file`. `None` for the file itself.
pub(crate) fn part_of(target: &str, file: &Path) -> Result<Option<Part>, Refusal> {
    let query = target.split('#').next().and_then(|target| target.split_once('?')).map(|(_, query)| query);
    match query.filter(|_| file.file_name().is_some_and(|name| name == CLOUD)) {
        Some("tree") => Ok(Some(Part::Tree)),
        Some(query) => match query.strip_prefix("node=") {
            Some(key) => key_of(key).map(|key| Some(Part::Node(key))).ok_or(Refusal::BadRequest),
            None => Ok(None),
        },
        None => Ok(None),
    }
}

/// Level and position, with hyphens between them.
fn key_of(text: &str) -> Option<[u32; 4]> {
    let digits = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit());
    let numbers: Option<Vec<u32>> =
        text.split('-').map(|part| part.parse().ok().filter(|_| digits(part))).collect();
    numbers?.try_into().ok()
}

/// The file, opened at the first request, and again after it has changed.
#[derive(Debug, Default)]
pub(crate) struct Cloud(Mutex<Option<Opened>>);

#[derive(Debug)]
struct Opened {
    bytes: u64,
    changed: SystemTime,
    stream: Arc<PointStream>,
}

impl Cloud {
    /// The part as media type and bytes; `None` if there is no such node.
    pub(crate) fn read(
        &self,
        path: &Path,
        part: Part,
    ) -> Result<Option<(&'static str, Vec<u8>)>, InputError> {
        let stream = self.open(path)?;
        match part {
            Part::Tree => Ok(Some(("application/json", stream.tree().into_bytes()))),
            Part::Node(key) => Ok(stream.node(key)?.map(|bytes| ("application/vnd.chainage.points", bytes))),
        }
    }

    fn open(&self, path: &Path) -> Result<Arc<PointStream>, InputError> {
        let failed = |source| InputError::Read { path: path.to_owned(), source };
        let metadata = fs_err::metadata(path).map_err(failed)?;
        let (bytes, changed) = (metadata.len(), metadata.modified().map_err(failed)?);
        // The value behind the lock is replaced as a whole, so it stays valid if another thread panics.
        let mut opened = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match opened.as_ref().filter(|opened| (opened.bytes, opened.changed) == (bytes, changed)) {
            Some(opened) => Ok(Arc::clone(&opened.stream)),
            None => {
                let stream = Arc::new(PointStream::open(path)?);
                *opened = Some(Opened { bytes, changed, stream: Arc::clone(&stream) });
                Ok(stream)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_asked_for_by_the_query() {
        let of = |target| part_of(target, Path::new("out/drive.copc.laz"));
        assert_eq!(of("/drive.copc.laz?tree"), Ok(Some(Part::Tree)));
        assert_eq!(of("/drive.copc.laz?node=7-64-3-0"), Ok(Some(Part::Node([7, 64, 3, 0]))));
        for whole in ["/drive.copc.laz", "/drive.copc.laz?", "/drive.copc.laz?x=1", "/drive.copc.laz#?tree"] {
            assert_eq!(of(whole), Ok(None), "{whole}");
        }
        for key in
            ["", "1-2-3", "1-2-3-4-5", "1--2-3", "+1-2-3-4", "1-2-3-4294967296", "1-2-3-4%20", "a-b-c-d"]
        {
            let asked = format!("/drive.copc.laz?node={key}");
            let is_refused =
                matches!(part_of(&asked, Path::new("out/drive.copc.laz")), Err(Refusal::BadRequest));
            assert!(is_refused, "{key}");
        }
        assert_eq!(part_of("/drive.laz?tree", Path::new("out/drive.laz")), Ok(None));
    }
}
