//! `chainage view`: what its server answers, and what it refuses.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::Duration;

use crate::util::drive::scratch;
use crate::util::program::program;

/// A running server. It ends with the value.
struct Server {
    child: Child,
    port: u16,
}

impl Drop for Server {
    fn drop(&mut self) {
        self.child.kill().expect("killed");
        self.child.wait().expect("ended");
    }
}

/// An answer: status, headers in lower case, body.
struct Answer {
    status: u16,
    headers: String,
    body: Vec<u8>,
}

impl Server {
    fn start(out: &Path) -> Self {
        let mut child = program()
            .args(["view", "--no-open"])
            .arg(out)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("a pipe")).read_line(&mut line).expect("an address");
        let port = line
            .strip_prefix("http://127.0.0.1:")
            .and_then(|rest| rest.trim_end().strip_suffix('/'))
            .and_then(|port| port.parse().ok());
        Self { child, port: port.unwrap_or_else(|| panic!("{line:?} is no address")) }
    }

    /// Sends these bytes and reads the answer.
    fn raw(&self, request: &str) -> Answer {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).expect("connects");
        stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a time-out");
        stream.write_all(request.as_bytes()).expect("sent");
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).expect("an answer that ends");
        let split = bytes.windows(4).position(|four| four == b"\r\n\r\n").expect("headers") + 4;
        let headers = String::from_utf8_lossy(&bytes[..split]).to_lowercase();
        let status = headers.split(' ').nth(1).and_then(|status| status.parse().ok()).expect("a status");
        Answer { status, headers, body: bytes[split..].to_vec() }
    }

    fn ask(&self, method: &str, target: &str, more: &str) -> Answer {
        let port = self.port;
        self.raw(&format!(
            "{method} {target} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nConnection: close\r\n{more}\r\n"
        ))
    }
}

/// A folder with an OUT and, beside it, something that must not be served.
fn folder() -> tempfile::TempDir {
    let folder = scratch();
    let out = folder.path().join("out");
    std::fs::create_dir_all(out.join(".chainage")).expect("a folder");
    std::fs::write(out.join("report.html"), b"<!doctype html><p>page").expect("written");
    std::fs::write(out.join("drive.laz"), (0..=255).collect::<Vec<u8>>()).expect("written");
    std::fs::write(out.join(".chainage/run.toml"), b"secret").expect("written");
    std::fs::write(folder.path().join("secret"), b"secret").expect("written");
    std::os::unix::fs::symlink("../secret", out.join("link")).expect("a link");
    std::os::unix::fs::symlink("..", out.join("up")).expect("a link");
    folder
}

#[test]
fn it_serves_the_page_files_and_ranges() {
    let folder = folder();
    let server = Server::start(&folder.path().join("out"));
    let page = server.ask("GET", "/", "");
    assert_eq!((page.status, page.body.as_slice()), (200, &b"<!doctype html><p>page"[..]));
    assert!(page.headers.contains("content-type: text/html"), "{}", page.headers);
    assert!(page.headers.contains("x-content-type-options: nosniff"), "{}", page.headers);
    let head = server.ask("HEAD", "/drive.laz", "");
    assert_eq!((head.status, head.body.len()), (200, 0));
    assert!(head.headers.contains("content-length: 256"), "{}", head.headers);
    assert!(head.headers.contains("accept-ranges: bytes"), "{}", head.headers);
    let part = server.ask("GET", "/drive.laz", "Range: bytes=10-12\r\n");
    assert_eq!((part.status, part.body.as_slice()), (206, &[10, 11, 12][..]));
    assert!(part.headers.contains("content-range: bytes 10-12/256"), "{}", part.headers);
    let end = server.ask("GET", "/drive.laz", "Range: bytes=-2\r\n");
    assert_eq!((end.status, end.body.as_slice()), (206, &[254, 255][..]));
    assert_eq!(server.ask("GET", "/drive.laz", "Range: bytes=256-\r\n").status, 416);
}

#[test]
fn it_refuses_other_methods_hosts_and_places() {
    let folder = folder();
    let server = Server::start(&folder.path().join("out"));
    for method in ["POST", "PUT", "DELETE", "OPTIONS", "TRACE", "PATCH"] {
        let answer = server.ask(method, "/", "");
        assert_eq!(answer.status, 405, "{method}");
        assert!(answer.headers.contains("allow: get, head"), "{method}: {}", answer.headers);
    }
    let port = server.port;
    for hosts in [
        "Host: evil.example\r\n".to_owned(),
        format!("Host: evil.example:{port}\r\n"),
        "Host: 127.0.0.1\r\n".to_owned(),
        format!("Host: 127.0.0.1:{port}\r\nHost: evil.example\r\n"),
        String::new(),
    ] {
        let answer = server.raw(&format!("GET / HTTP/1.1\r\n{hosts}Connection: close\r\n\r\n"));
        assert_eq!((answer.status, answer.body.ends_with(b"page")), (403, false), "{hosts:?}");
    }
    let own = server.raw(&format!("GET / HTTP/1.1\r\nHost: localhost:{port}\r\nConnection: close\r\n\r\n"));
    assert_eq!(own.status, 200);
    for target in [
        "/../secret",
        "/%2e%2e/secret",
        "/..%2fsecret",
        "/%2e%2e%2fsecret",
        "/link",
        "/up/secret",
        "/up/out/.chainage/run.toml",
        "/.chainage/run.toml",
        "/%2echainage/run.toml",
        "//secret",
        "/",
    ]
    .into_iter()
    .filter(|target| *target != "/")
    {
        let answer = server.ask("GET", target, "");
        assert!(matches!(answer.status, 400 | 404), "{target}: {}", answer.status);
        assert!(!answer.body.windows(6).any(|six| six == b"secret"), "{target}");
    }
}

#[test]
fn it_listens_on_this_machine_only() {
    let folder = folder();
    let server = Server::start(&folder.path().join("out"));
    let table = std::fs::read_to_string("/proc/net/tcp").expect("the system's list of sockets");
    let port = format!(":{:04X}", server.port);
    let listening = table.lines().filter_map(|line| {
        let mut fields = line.split_whitespace().skip(1);
        let (local, _, state) = (fields.next()?, fields.next()?, fields.next()?);
        (state == "0A" && local.ends_with(&port)).then(|| local.to_owned())
    });
    assert_eq!(listening.collect::<Vec<_>>(), [format!("0100007F{port}")]);
    // Nor under the sixth version of the protocol.
    let table = std::fs::read_to_string("/proc/net/tcp6").unwrap_or_default();
    assert!(!table.lines().any(|line| line.contains(&port) && line.contains(" 0A ")), "{table}");
}

#[test]
fn without_a_page_it_says_how_to_get_one() {
    let folder = scratch();
    let output = program().args(["view", "--no-open"]).arg(folder.path()).output().expect("starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(4), "{errors}");
    assert!(errors.contains("has no report.html") && errors.contains("hint: chainage run"), "{errors}");
}
