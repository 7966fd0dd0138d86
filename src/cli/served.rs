//! The rules of the server of `chainage view`: which requests it refuses, which file a path names, and which
//! bytes of the file are sent. No files are read here, except to resolve links.

use std::ops::Range;
use std::path::{Path, PathBuf};

/// Name of the page, which `/` shows.
pub(crate) const PAGE: &str = "report.html";

/// Why a request is refused, as a status of HTTP (RFC 9110, section 15.5).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// The path is malformed.
    BadRequest = 400,
    /// The request names another host.
    Forbidden = 403,
    /// There is no such file, or it is not one of the outputs.
    NotFound = 404,
    /// Neither GET nor HEAD.
    MethodNotAllowed = 405,
    /// The bytes are beyond the end of the file.
    RangeNotSatisfiable = 416,
}

/// Checks the values of all Host headers. A page of another site can make a browser send requests here under
/// a name of that site (DNS rebinding), so only requests under our own names are answered.
pub(crate) fn check_host<'a>(hosts: impl IntoIterator<Item = &'a str>, port: u16) -> Result<(), Refusal> {
    let mut hosts = hosts.into_iter();
    let ours = hosts.next().is_some_and(|host| {
        ["127.0.0.1", "localhost"].iter().any(|name| {
            // The standard port is left out (RFC 9110, section 4.2.1).
            host.eq_ignore_ascii_case(&format!("{name}:{port}"))
                || (port == 80 && host.eq_ignore_ascii_case(name))
        })
    });
    if ours && hosts.next().is_none() { Ok(()) } else { Err(Refusal::Forbidden) }
}

/// The file of `root` that the target of a request names. `root` is resolved. Names that begin with a dot are
/// never served, because they belong to the state.
pub(crate) fn file_of(root: &Path, target: &str) -> Result<PathBuf, Refusal> {
    let path = target.split(['?', '#']).next().unwrap_or_default();
    let path = path.strip_prefix('/').ok_or(Refusal::BadRequest)?;
    let path = if path.is_empty() { PAGE } else { path };
    let mut file = root.to_owned();
    for part in path.split('/') {
        let name = decoded(part).ok_or(Refusal::BadRequest)?;
        // Checked after decoding, so that an encoded form is treated the same.
        if name.is_empty() || name.contains(['/', '\\', ':']) || name.contains(|c: char| c.is_control()) {
            return Err(Refusal::BadRequest);
        }
        if name.starts_with('.') {
            return Err(Refusal::NotFound);
        }
        file.push(name);
    }
    // Links are followed, but must end inside `root`.
    let found = fs_err::canonicalize(&file).map_err(|_| Refusal::NotFound)?;
    let inside = found.strip_prefix(root).map_err(|_| Refusal::NotFound)?;
    let hidden = inside.iter().any(|part| part.to_string_lossy().starts_with('.'));
    if hidden || !found.is_file() { Err(Refusal::NotFound) } else { Ok(found) }
}

/// A part of a path without percent signs (RFC 3986, section 2.1); `None` if it is broken or not UTF-8.
fn decoded(part: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(part.len());
    let mut rest = part.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        rest = after;
        if first != b'%' {
            bytes.push(first);
            continue;
        }
        let (digits, after) = rest.split_at_checked(2)?;
        let digit = |byte: u8| char::from(byte).to_digit(16);
        let value = digit(digits[0])? * 16 + digit(digits[1])?;
        bytes.push(u8::try_from(value).ok()?);
        rest = after;
    }
    String::from_utf8(bytes).ok()
}

/// The bytes of a file of `length` bytes that a Range header requests. `None` for the whole file: without a
/// header, with several ranges, and with a range that is not understood (RFC 9110, section 14.2).
pub(crate) fn range_of(header: Option<&str>, length: u64) -> Result<Option<Range<u64>>, Refusal> {
    let Some((first, last)) = header.and_then(|text| text.strip_prefix("bytes=")?.split_once('-')) else {
        return Ok(None);
    };
    let number = |text: &str| {
        let digits = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
        // A number with more digits than u64 is beyond the end of any file.
        digits.then(|| text.parse().unwrap_or(u64::MAX))
    };
    let range = match (number(first.trim()), number(last.trim()), first.trim(), last.trim()) {
        (Some(from), Some(to), ..) if from <= to => from..to.saturating_add(1).min(length),
        (Some(from), None, _, "") => from..length,
        (None, Some(count), "", _) => length.saturating_sub(count)..length,
        _ => return Ok(None),
    };
    if range.start >= range.end { Err(Refusal::RangeNotSatisfiable) } else { Ok(Some(range)) }
}

/// The media type of a file by its name.
pub(crate) fn media_type(path: &Path) -> &'static str {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("html") => "text/html; charset=utf-8",
        Some("csv") => "text/csv; charset=utf-8",
        Some("json") => "application/json",
        Some("geojson") => "application/geo+json",
        Some("gpkg") => "application/geopackage+sqlite3",
        Some("svg") => "image/svg+xml",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_our_own_names_with_the_port_are_hosts() {
        for hosts in [["127.0.0.1:8080"], ["localhost:8080"], ["LocalHost:8080"]] {
            assert_eq!(check_host(hosts, 8080), Ok(()));
        }
        assert_eq!(check_host(["localhost"], 80), Ok(()));
        let refused: [&[&str]; 8] = [
            &[],
            &["localhost"],
            &["127.0.0.1:8081"],
            &["evil.example:8080"],
            &["localhost.evil.example:8080"],
            &["localhost:8080", "evil.example"],
            &["0.0.0.0:8080"],
            &["[::1]:8080"],
        ];
        for hosts in refused {
            assert_eq!(check_host(hosts.iter().copied(), 8080), Err(Refusal::Forbidden), "{hosts:?}");
        }
    }

    #[test]
    fn paths_stay_inside() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().canonicalize().unwrap().join("out");
        let state = root.join(".chainage");
        std::fs::create_dir_all(root.join("below")).unwrap();
        std::fs::create_dir_all(&state).unwrap();
        for (file, text) in [
            (PAGE, "page"),
            ("a b%.csv", "table"),
            ("below/x.las", "points"),
            ("../secret", "no"),
            (".chainage/lock", "no"),
        ] {
            std::fs::write(root.join(file), text).unwrap();
        }
        std::os::unix::fs::symlink("../secret", root.join("link")).unwrap();
        std::os::unix::fs::symlink("..", root.join("up")).unwrap();
        std::os::unix::fs::symlink(".chainage/lock", root.join("state")).unwrap();
        std::os::unix::fs::symlink("below/x.las", root.join("inner")).unwrap();
        let text = |target: &str| file_of(&root, target).map(|path| std::fs::read_to_string(path).unwrap());
        for (target, expected) in [
            ("/", "page"),
            ("/?x=/../y", "page"),
            ("/report.html", "page"),
            ("/a%20b%25.csv", "table"),
            ("/below/x.las", "points"),
            ("/inner", "points"),
        ] {
            assert_eq!(text(target).as_deref(), Ok(expected), "{target}");
        }
        for target in [
            "/../secret",
            "/%2e%2e/secret",
            "/.%2E/secret",
            "/below/../../secret",
            "/link",
            "/up/secret",
            "/state",
            "/.chainage/lock",
            "/%2echainage/lock",
            "/below",
            "/nothing",
        ] {
            assert_eq!(text(target), Err(Refusal::NotFound), "{target}");
        }
        for target in [
            "",
            "report.html",
            "http://evil.example/",
            "//etc/passwd",
            "/..%2fsecret",
            "/%2fetc%2fpasswd",
            "/..%5csecret",
            "/below//x.las",
            "/a%00b",
            "/%",
            "/%zz",
            "/%ff",
            "/c:secret",
        ] {
            assert_eq!(text(target), Err(Refusal::BadRequest), "{target}");
        }
    }

    #[test]
    fn ranges_are_those_of_the_standard() {
        let of = |header| range_of(Some(header), 1_000);
        for (header, expected) in [
            ("bytes=0-0", 0..1),
            ("bytes=10-19", 10..20),
            ("bytes=990-5000", 990..1_000),
            ("bytes=990-", 990..1_000),
            ("bytes=-10", 990..1_000),
            ("bytes=-5000", 0..1_000),
        ] {
            assert_eq!(of(header), Ok(Some(expected)), "{header}");
        }
        for header in ["bytes=1000-", "bytes=1000-1001", "bytes=-0", "bytes=99999999999999999999-"] {
            assert_eq!(of(header), Err(Refusal::RangeNotSatisfiable), "{header}");
        }
        for header in ["bytes=5-2", "bytes=a-b", "lines=0-1", "bytes=0-1,5-6", "bytes=-", "bytes"] {
            assert_eq!(of(header), Ok(None), "{header}");
        }
        assert_eq!(range_of(None, 1_000), Ok(None));
    }
}
