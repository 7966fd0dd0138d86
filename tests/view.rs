//! `chainage view`: what its server answers, and what it refuses.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use chainage::input::{Catalog, Fields, InputOptions, record_xyz};

use crate::util::drive::{drive, scratch, settings};
use crate::util::program::program;
use crate::util::shipped;

/// A running server. It ends when the value is dropped.
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

/// A folder with an OUT and, beside it, a file that must not be served.
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
    let beyond = server.ask("GET", "/drive.laz", "Range: bytes=256-\r\n");
    assert_eq!(beyond.status, 416);
    assert!(beyond.headers.contains("content-range: bytes */256"), "{}", beyond.headers);
    assert_eq!(server.ask("HEAD", "/drive.laz", "Range: bytes=0-1\r\n").status, 200);
}

/// A paused download keeps its connection, and others are still answered.
#[test]
fn readers_that_pause_do_not_stop_it() {
    let folder = folder();
    let out = folder.path().join("out");
    // More than the buffers of a connection hold.
    std::fs::File::create(out.join("large.laz")).and_then(|file| file.set_len(1 << 28)).expect("a file");
    let server = Server::start(&out);
    let paused: Vec<TcpStream> = (0..20)
        .map(|_| {
            let mut stream = TcpStream::connect(("127.0.0.1", server.port)).expect("connects");
            let asked = format!("GET /large.laz HTTP/1.1\r\nHost: 127.0.0.1:{}\r\n\r\n", server.port);
            stream.write_all(asked.as_bytes()).expect("sent");
            let mut begin = [0; 12];
            stream.read_exact(&mut begin).expect("an answer begins");
            stream
        })
        .collect();
    assert_eq!(server.ask("GET", "/", "").status, 200);
    drop(paused);
}

/// The resident memory of the server and its threads, as the system counts them.
fn memory_and_threads(server: &Server) -> (u64, u64) {
    let status = std::fs::read_to_string(format!("/proc/{}/status", server.child.id())).expect("it lives");
    let number = |name: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix(name)).expect("a line");
        line.trim_start_matches(':').split_whitespace().next().and_then(|word| word.parse().ok())
    };
    (number("VmPeak").expect("KiB"), number("Threads").expect("a number"))
}

/// A length or a chunk that a client promises must not be allocated, read or waited for.
#[test]
fn a_request_with_a_body_is_refused_and_ends_nothing() {
    let folder = folder();
    let server = Server::start(&folder.path().join("out"));
    let port = server.port;
    assert_eq!(server.ask("GET", "/", "").status, 200);
    let (before, _) = memory_and_threads(&server);
    let own = format!("Host: 127.0.0.1:{port}\r\n");
    for (what, request) in [
        ("foreign", "GET / HTTP/1.1\r\nHost: evil\r\nContent-Length: 999999999999\r\n\r\n".to_owned()),
        ("large", format!("GET / HTTP/1.1\r\n{own}Content-Length: 30000000000\r\n\r\n")),
        ("POST", format!("POST / HTTP/1.1\r\n{own}Content-Length: 30000000000\r\n\r\nabc")),
        ("small", format!("GET / HTTP/1.1\r\n{own}Content-Length: 5\r\n\r\nabcde")),
        ("too many digits", format!("GET / HTTP/1.1\r\n{own}Content-Length: {}\r\n\r\n", "9".repeat(40))),
        ("chunked", format!("PUT / HTTP/1.1\r\n{own}Transfer-Encoding: chunked\r\n\r\nffffffffff\r\nabc")),
        (
            "waits for 100",
            format!("PUT / HTTP/1.1\r\n{own}Expect: 100-continue\r\nContent-Length: 30000000000\r\n\r\n"),
        ),
    ] {
        let asked = Instant::now();
        let answer = server.raw(&request);
        assert_eq!(answer.status, 413, "{what}");
        assert!(answer.headers.contains("connection: close"), "{what}: {}", answer.headers);
        assert!(asked.elapsed() < Duration::from_secs(5), "{what}: {:?}", asked.elapsed());
    }
    // A client that sends its body without reading the answer first still gets the answer.
    let body = "x".repeat(100_000);
    let sent = server.raw(&format!("POST / HTTP/1.1\r\n{own}Content-Length: 100000\r\n\r\n{body}"));
    assert_eq!(sent.status, 413);
    // Without a body, waiting for "100 Continue" makes no sense, and the page is sent.
    assert_eq!(server.ask("GET", "/", "Expect: 100-continue\r\nContent-Length: 0\r\n").status, 200);
    let many = "a: b\r\n".repeat(100_000);
    let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("connects");
    // The server may have closed the connection before all of it was sent.
    let _ = stream.write_all(format!("GET / HTTP/1.1\r\n{own}{many}").as_bytes());
    assert_eq!(server.ask("GET", "/", "").status, 200);
    // Each thread reserves address space for its stack and for the heap of the allocator, 64 MiB.
    let (after, _) = memory_and_threads(&server);
    assert!(after < before + (4 << 20), "{before} to {after} KiB");
}

/// Neither half a request nor a silent connection keeps its thread.
#[test]
fn slow_requests_end_and_do_not_stop_others() {
    let folder = folder();
    let server = Server::start(&folder.path().join("out"));
    // The address is printed before the thread that accepts connections has begun.
    assert_eq!(server.ask("GET", "/", "").status, 200);
    std::thread::sleep(Duration::from_secs(3));
    let (_, before) = memory_and_threads(&server);
    let slow: Vec<TcpStream> = (0..20)
        .map(|number| {
            let mut stream = TcpStream::connect(("127.0.0.1", server.port)).expect("connects");
            stream.set_read_timeout(Some(Duration::from_secs(20))).expect("a time-out");
            if number % 2 == 0 {
                stream.write_all(b"GET / HTTP/1.1\r\nHost: ").expect("sent");
            }
            stream
        })
        .collect();
    assert_eq!(server.ask("GET", "/", "").status, 200);
    // A request that trickles in has no more time than the others.
    let mut trickle = TcpStream::connect(("127.0.0.1", server.port)).expect("connects");
    trickle.write_all(b"GET / HTTP/1.1\r\nX: ").expect("sent");
    let begun = Instant::now();
    let mut ended = false;
    while !ended && begun.elapsed() < Duration::from_secs(20) {
        std::thread::sleep(Duration::from_millis(250));
        ended = trickle.write_all(b"x").is_err();
    }
    assert!(ended, "it is still read after {:?}", begun.elapsed());
    for (number, mut stream) in slow.into_iter().enumerate() {
        let mut text = String::new();
        stream.read_to_string(&mut text).expect("an end");
        let expected = if number % 2 == 0 { "HTTP/1.1 408 " } else { "" };
        assert!(text.starts_with(expected) && text.is_empty() == expected.is_empty(), "{number}: {text}");
    }
    // A thread ends at most a second after its client, but later on a busy machine.
    let closed = Instant::now();
    while memory_and_threads(&server).1 > before {
        assert!(closed.elapsed() < Duration::from_secs(20), "{before} threads became more");
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// A browser asks for many parts on one connection.
#[test]
fn a_connection_answers_one_request_after_the_other() {
    let folder = folder();
    let server = Server::start(&folder.path().join("out"));
    let head = format!("Host: 127.0.0.1:{}\r\n", server.port);
    let asked = format!(
        "GET / HTTP/1.1\r\n{head}\r\nHEAD / HTTP/1.1\r\n{head}\r\nGET /drive.laz HTTP/1.1\r\n{head}Range: \
         bytes=65-67\r\nConnection: close\r\n\r\n"
    );
    let mut stream = TcpStream::connect(("127.0.0.1", server.port)).expect("connects");
    stream.write_all(asked.as_bytes()).expect("sent");
    let mut text = String::new();
    stream.read_to_string(&mut text).expect("three answers");
    assert_eq!(text.matches("HTTP/1.1 200 OK").count(), 2, "{text}");
    assert_eq!(text.matches("<p>page").count(), 1, "{text}");
    assert!(text.contains("HTTP/1.1 206 ") && text.ends_with("\r\n\r\nABC"), "{text}");
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
    // Nor over IPv6.
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

/// An OUT with a page and the cloud-optimised file of the shipped sweep, for as long as the folder lives.
fn with_cloud() -> (tempfile::TempDir, PathBuf) {
    let folder = scratch();
    let out = folder.path().join("out");
    let inputs = [shipped("tests/data/tree_road_sweep.laz")];
    let files = "output.files=[\"copc\",\"report\",\"points\"]";
    let list = [files, "cluster.method=street", "street.min_points=10"];
    drive(&inputs, &out, &settings(&list)).expect("a run");
    (folder, out)
}

/// The planes of an answer: key, place and intensity of every point, as the page reads them.
fn points_of(bytes: &[u8]) -> Vec<(u32, [i32; 3], u16, u8)> {
    assert_eq!(bytes.len() % 19, 0);
    let count = bytes.len() / 19;
    let word = |plane: usize, at: usize| {
        u32::from_le_bytes([0, 1, 2, 3].map(|byte| bytes[(plane + byte) * count + at]))
    };
    let (mut key, mut place) = (0_u32, [0_i32; 3]);
    (0..count)
        .map(|at| {
            key += word(0, at);
            for (axis, place) in place.iter_mut().enumerate() {
                let coded = word(4 + 4 * axis, at);
                *place = place.wrapping_add((coded >> 1).cast_signed() ^ -(coded & 1).cast_signed());
            }
            let intensity = u16::from_le_bytes([bytes[16 * count + at], bytes[17 * count + at]]);
            (key, place, intensity, bytes[18 * count + at])
        })
        .collect()
}

#[test]
fn the_nodes_have_the_points_of_the_file_with_their_objects() {
    let (_folder, out) = with_cloud();
    let server = Server::start(&out);
    let tree = server.ask("GET", "/drive.copc.laz?tree", "");
    assert_eq!(tree.status, 200);
    assert!(tree.headers.contains("content-type: application/json"), "{}", tree.headers);
    assert!(tree.headers.contains("x-content-type-options: nosniff"), "{}", tree.headers);
    let tree: serde_json::Value = serde_json::from_slice(&tree.body).expect("JSON");
    let nodes: Vec<u64> = tree["nodes"]
        .as_array()
        .expect("nodes")
        .iter()
        .map(|number| number.as_u64().expect("a number"))
        .collect();
    let number = |name: &str, axis: usize| tree[name][axis].as_f64().expect("a number");
    let mut found = BTreeMap::new();
    let mut listed = 0;
    for node in nodes.chunks_exact(5) {
        let target = format!("/drive.copc.laz?node={}-{}-{}-{}", node[0], node[1], node[2], node[3]);
        let answer = server.ask("GET", &target, "");
        assert_eq!(answer.status, 200, "{target}");
        let side = tree["side"].as_f64().expect("a number") / f64::from(1_u32 << node[0]);
        let points = points_of(&answer.body);
        assert!(points.len() as u64 <= node[4] && points.is_sorted_by_key(|point| point.0), "{target}");
        listed += node[4];
        for (key, place, intensity, class) in points {
            for axis in 0..3 {
                let low = number("origin", axis) + node[axis + 1] as f64 * side;
                let world = f64::from(place[axis]) * number("scale", axis) + number("offset", axis);
                assert!(world > low - 1e-6 && world < low + side + 1e-6, "{target}: {world} from {low}");
            }
            *found.entry((key, place, intensity, class)).or_insert(0) += 1;
        }
    }
    // The labelled copy has the same points, with ground and noise in its classification.
    let copy = Catalog::open(&[out.join("tree_road_sweep.laz")], &InputOptions::default()).expect("a copy");
    let file = &copy.files()[0];
    let (layout, mut buffer) = (file.layout(), Vec::new());
    let offset = |name: &str| layout.dimension(name).expect("a dimension").offset;
    let (object, kind) = (offset("cluster_id"), offset("object_class"));
    let mut expected = BTreeMap::new();
    for block in 0..file.blocks().len() {
        let records = file.records(block, Fields::All, &mut buffer).expect("records");
        for record in records.chunks_exact(layout.record_len) {
            let id = u32::from_le_bytes(std::array::from_fn(|byte| record[object + byte]));
            let class = record[layout.classification] & layout.classification_mask;
            let key = match (id, class) {
                (0, 7 | 18) => continue,
                (0, 2) => 0,
                _ => id + 1,
            };
            let intensity = u16::from_le_bytes([record[layout.intensity], record[layout.intensity + 1]]);
            *expected.entry((key, record_xyz(record), intensity, record[kind])).or_insert(0) += 1;
        }
    }
    assert_eq!(listed, copy.point_count());
    assert!(found == expected, "{} kinds of points, expected {}", found.len(), expected.len());
    assert!(found.keys().any(|point| point.0 > 1 && point.3 > 0), "objects with a class");
}

/// The LAS classes of an input are not those of the run: its ground and noise are those that the run finds.
#[test]
fn classes_that_a_run_has_not_set_are_neither_ground_nor_noise_of_the_stream() {
    let (folder, classified) = with_cloud();
    let inputs = [classified.join("tree_road_sweep.laz")];
    let run = |name: &str, list: &[&str]| {
        let out = folder.path().join(name);
        let always = ["output.files=[\"copc\",\"report\"]", "cluster.method=euclidean"];
        let summary = drive(&inputs, &out, &settings(&[&always[..], list].concat())).expect("a run");
        (Server::start(&out), summary)
    };
    let (server, _) = run("kept", &["output.classification=keep"]);
    for part in ["tree", "node=0-0-0-0"] {
        let answer = server.ask("GET", &format!("/drive.copc.laz?{part}"), "");
        assert_eq!(answer.status, 404, "{part}: the page shows its sample");
    }
    assert_eq!(server.ask("HEAD", "/drive.copc.laz", "").status, 200);
    // The number of shown points, and of ground among them.
    let shown = |server: &Server| {
        let tree = server.ask("GET", "/drive.copc.laz?tree", "");
        let tree: serde_json::Value = serde_json::from_slice(&tree.body).expect("JSON");
        let nodes = tree["nodes"].as_array().expect("nodes");
        let (mut all, mut ground) = (0, 0);
        for node in nodes.chunks_exact(5) {
            let target = format!("/drive.copc.laz?node={}-{}-{}-{}", node[0], node[1], node[2], node[3]);
            let points = points_of(&server.ask("GET", &target, "").body);
            all += points.len() as u64;
            ground += points.iter().filter(|point| point.0 == 0).count() as u64;
        }
        (all, ground)
    };
    let (server, summary) = run("neither", &["ground.method=none", "noise.enabled=false"]);
    assert_eq!(shown(&server), (summary.points, 0));
    let (server, summary) = run("both", &[]);
    let counts = summary.counts;
    let noise = counts.low_noise + counts.high_noise;
    assert!(noise > 0 && counts.ground > 0);
    assert_eq!(shown(&server), (summary.points - noise, counts.ground));
}

#[test]
fn parts_that_do_not_exist_and_other_methods_are_refused() {
    let (_folder, out) = with_cloud();
    let server = Server::start(&out);
    for (target, status) in [
        ("/drive.copc.laz?node=9-1-2-3", 404),
        ("/drive.copc.laz?node=1-2-3", 400),
        ("/drive.copc.laz?node=../../secret", 400),
        ("/.chainage/drive.copc.laz?tree", 404),
        ("/../drive.copc.laz?tree", 404),
    ] {
        assert_eq!(server.ask("GET", target, "").status, status, "{target}");
    }
    assert_eq!(server.ask("POST", "/drive.copc.laz?tree", "").status, 405);
    let foreign = "GET /drive.copc.laz?tree HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n\r\n";
    assert_eq!(server.raw(foreign).status, 403);
    let head = server.ask("HEAD", "/drive.copc.laz?node=0-0-0-0", "");
    assert_eq!((head.status, head.body.len()), (200, 0));
    // The file itself, and ranges of it, are served as before.
    let part = server.ask("GET", "/drive.copc.laz", "Range: bytes=377-380\r\n");
    assert_eq!((part.status, part.body.as_slice()), (206, &b"copc"[..]));
}

#[test]
fn a_damaged_file_is_reported_and_the_server_goes_on() {
    let (_folder, out) = with_cloud();
    let (path, server) = (out.join("drive.copc.laz"), Server::start(&out));
    let whole = std::fs::read(&path).expect("the file");
    let word = |at: usize| {
        usize::try_from(u64::from_le_bytes(whole[at..at + 8].try_into().expect("8"))).expect("fits")
    };
    let info = 375 + 54;
    let page = word(info + 40);
    let entry = |value: &[u8], at: usize| {
        let mut bytes = whole.clone();
        bytes[at..at + value.len()].copy_from_slice(value);
        bytes
    };
    let first_chunk = word(page + 16);
    let damaged = [
        ("?tree", whole[..whole.len() / 2].to_vec(), "a page of its table", "cut off"),
        ("?tree", entry(&u64::MAX.to_le_bytes(), info + 48), "a page of its table", "length of the page"),
        ("?tree", entry(&33_u64.to_le_bytes(), info + 48), "a page of its table", "half an entry"),
        (
            "?tree",
            entry(&(u64::MAX - 5).to_le_bytes(), info + 40),
            "a page of its table",
            "place of the page",
        ),
        ("?tree", entry(&f64::NAN.to_le_bytes(), info + 24), "its cube", "cube"),
        ("?tree", entry(&[9, 0, 0, 0, 255, 255], page), "does not exist", "position"),
        ("?tree", entry(&i32::MAX.to_le_bytes(), page + 24), "points in 2147483647 bytes", "bytes of a node"),
        ("?tree", entry(&i32::MAX.to_le_bytes(), page + 28), "2147483647 points", "points of a node"),
        ("?tree", entry(&(-7_i32).to_le_bytes(), page + 28), "-7 points", "points below 0"),
        ("?tree", entry(&1_u64.to_le_bytes(), page + 16), "from byte 1;", "points in the header"),
        ("?tree", entry(&0_i32.to_le_bytes(), page + 28), "promises", "a node without points"),
        // A page that refers to itself has no end.
        (
            "?tree",
            entry(
                &[page.to_le_bytes().as_slice(), &32_i32.to_le_bytes(), &(-1_i32).to_le_bytes()].concat(),
                page + 16,
            ),
            "referred to twice",
            "a circle",
        ),
        ("?tree", b"no point cloud".to_vec(), "not a LAS", "another file"),
        ("?tree", Vec::new(), "not a LAS", "an empty file"),
        (
            "?tree",
            std::fs::read(shipped("tests/data/tree_road_sweep.laz")).expect("read"),
            "not a cloud-optimised",
            "LAZ",
        ),
        ("?node=0-0-0-0", entry(&[0xff; 40], first_chunk + 35), "cannot be decoded", "a chunk"),
    ];
    for (query, bytes, words, what) in damaged {
        std::fs::write(&path, bytes).expect("written");
        let answer = server.ask("GET", &format!("/drive.copc.laz{query}"), "");
        let text = String::from_utf8_lossy(&answer.body).into_owned();
        assert_eq!(answer.status, 500, "{what}: {text}");
        assert!(text.contains(words) && text.contains("drive.copc.laz"), "{what}: {text}");
        assert!(answer.headers.contains("content-type: text/plain"), "{}", answer.headers);
    }
    std::fs::write(&path, &whole).expect("written");
    assert_eq!(server.ask("GET", "/drive.copc.laz?tree", "").status, 200);
    std::fs::remove_file(&path).expect("removed");
    assert_eq!(server.ask("GET", "/drive.copc.laz?tree", "").status, 404);
}
