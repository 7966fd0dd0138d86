//! The points that `chainage view` streams: the part of `drive.copc.laz` that a request names, and the open
//! file.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

use chainage::ground::NoGround;
use chainage::input::InputError;
use chainage::output::{Found, PointStream};
use serde_json::Value;

use crate::cli::served::Refusal;

/// Name of the file with all points.
const CLOUD: &str = "drive.copc.laz";
/// Name of the report beside it, which says what its LAS classes mean.
const REPORT: &str = "report.json";

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
    /// Size and time of the file and of the report.
    versions: [(u64, SystemTime); 2],
    stream: Arc<PointStream>,
}

impl Cloud {
    /// The part as media type and bytes; `None` if there is no such node, or if the report does not say what
    /// the LAS classes mean. The page then shows its sample.
    pub(crate) fn read(
        &self,
        path: &Path,
        part: Part,
    ) -> Result<Option<(&'static str, Vec<u8>)>, InputError> {
        let Some(stream) = self.open(path)? else { return Ok(None) };
        match part {
            Part::Tree => Ok(Some(("application/json", stream.tree().into_bytes()))),
            Part::Node(key) => Ok(stream.node(key)?.map(|bytes| ("application/vnd.chainage.points", bytes))),
        }
    }

    fn open(&self, path: &Path) -> Result<Option<Arc<PointStream>>, InputError> {
        let report = path.with_file_name(REPORT);
        let of_file = version(path).map_err(|source| InputError::Read { path: path.to_owned(), source })?;
        let Ok(of_report) = version(&report) else { return Ok(None) };
        let versions = [of_file, of_report];
        // The value behind the lock is replaced as a whole, so it stays valid if another thread panics.
        let mut opened = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(opened) = opened.as_ref().filter(|opened| opened.versions == versions) {
            return Ok(Some(Arc::clone(&opened.stream)));
        }
        let content = fs_err::read(&report).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok());
        let Some(found) = content.as_ref().and_then(found_of) else { return Ok(None) };
        let stream = Arc::new(PointStream::open(path, found)?);
        *opened = Some(Opened { versions, stream: Arc::clone(&stream) });
        Ok(Some(stream))
    }
}

/// Size and time of a file: whether it has changed.
fn version(path: &Path) -> std::io::Result<(u64, SystemTime)> {
    let metadata = fs_err::metadata(path)?;
    Ok((metadata.len(), metadata.modified()?))
}

/// What the run of a report has found. `None` if the report does not say it, or if the run has kept all LAS
/// classes: then they do not say which points are ground and noise.
fn found_of(report: &Value) -> Option<Found> {
    let setting = |path: &str| report.pointer(&format!("/configuration/{path}"));
    let is_kept = setting("output/classification")?.as_str()?.trim() == "keep";
    let ground = setting("ground/method")? != NoGround::NAME;
    let noise = setting("noise/enabled")?.as_bool()?;
    (!is_kept).then_some(Found { ground, noise })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_settings_say_what_a_run_has_found() {
        let of = |classification: &str, method: &str, enabled: bool| {
            let settings = json!({
                "output": { "classification": classification },
                "ground": { "method": method },
                "noise": { "enabled": enabled },
            });
            found_of(&json!({ "configuration": settings }))
        };
        let found = |ground, noise| Some(Found { ground, noise });
        assert_eq!(of("set", "opening", true), found(true, true));
        assert_eq!(of("pole=64", "opening", false), found(true, false));
        assert_eq!(of("set", "none", true), found(false, true));
        assert_eq!(of("keep", "opening", true), None);
        assert_eq!(found_of(&json!({})), None);
    }

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
