//! `chainage view`.

use std::io::{self, Read, Seek, SeekFrom};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use chainage::input::InputError;
use chainage::run::CancelToken;
use tiny_http::{Header, Method, Request, Response, Server, StatusCode};

use crate::cli::exit::{CliError, Outcome};
use crate::cli::numbers::whole;
use crate::cli::served::{PAGE, Refusal, check_host, file_of, media_type, range_of};
use crate::cli::streamed::{Cloud, part_of};
use crate::cli::{exit, interrupt, print};

/// How often the server looks whether it is to stop.
const PATIENCE: Duration = Duration::from_millis(200);
/// Requests that are answered at the same time, one thread each. A download that its reader pauses keeps its
/// thread, so there are many more than the six connections that a browser opens.
const REQUESTS: usize = 128;

#[derive(Debug, clap::Args)]
pub(crate) struct ViewArgs {
    /// Output directory of a run
    out: PathBuf,
    /// Port on 127.0.0.1 [default: a free one]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true, value_parser = whole::<u16>(0..=65_535, 8_080))]
    port: u16,
    /// Only print the address; do not open a browser
    #[arg(long)]
    no_open: bool,
}

impl ViewArgs {
    pub(crate) fn run(&self) -> Outcome {
        let root = fs_err::canonicalize(&self.out).unwrap_or_else(|_| self.out.clone());
        if !root.join(PAGE).is_file() {
            return Err(CliError::NoPage { path: self.out.clone() });
        }
        let failed = |source: Box<dyn std::error::Error + Send + Sync>| CliError::Serve {
            port: self.port,
            source: io::Error::other(source),
        };
        let server = Server::http(("127.0.0.1", self.port)).map_err(failed)?;
        let Some(port) = server.server_addr().to_ip().map(|address| address.port()) else {
            return Err(failed("the address has no port".into()));
        };
        let cancel = Arc::new(CancelToken::default());
        interrupt::listen(&cancel)?;
        let url = format!("http://127.0.0.1:{port}/");
        print::text(&format!("{url}\n"))?;
        if !self.no_open && !open_browser(&url) {
            print::note("no browser could be opened: open the address yourself");
        }
        print::note("Ctrl-C ends the server");
        serve(&server, &Arc::new(Shown { root, port, cloud: Cloud::default() }), &cancel);
        Ok(exit::DONE)
    }
}

/// What is served.
struct Shown {
    root: PathBuf,
    port: u16,
    cloud: Cloud,
}

/// Answers requests until Ctrl-C. Answers that are still being sent end with the process.
fn serve(server: &Server, shown: &Arc<Shown>, cancel: &CancelToken) {
    let answering = Arc::new(());
    while !cancel.is_cancelled() {
        let Ok(Some(request)) = server.recv_timeout(PATIENCE) else { continue };
        if Arc::strong_count(&answering) > REQUESTS {
            let text = format!("{REQUESTS} requests are being answered\n");
            let _ = send_text(request, StatusCode(503), text, None);
            continue;
        }
        let (shown, mine) = (Arc::clone(shown), Arc::clone(&answering));
        std::thread::spawn(move || {
            // A client that goes away is no failure of the server.
            let _ = answer(request, &shown);
            drop(mine);
        });
    }
}

/// Why a request is not answered with what it asks for.
enum Failed {
    Refused(Refusal),
    /// The range is beyond a file of this length.
    Beyond(Refusal, u64),
    /// The file with all points cannot be read.
    Cloud(InputError),
}

impl From<Refusal> for Failed {
    fn from(refusal: Refusal) -> Self {
        Self::Refused(refusal)
    }
}

fn answer(request: Request, shown: &Shown) -> io::Result<()> {
    match found(&request, shown) {
        Ok(Reply::File(found)) => found.send(request),
        Ok(Reply::Part(media, bytes)) => {
            let mut response = Response::from_data(bytes).with_chunked_threshold(usize::MAX);
            guards().chain(header("Content-Type", media)).for_each(|header| response.add_header(header));
            request.respond(response)
        }
        Err(Failed::Refused(refusal)) => {
            let allowed = (refusal == Refusal::MethodNotAllowed).then(|| header("Allow", "GET, HEAD"));
            refuse(request, refusal, allowed.flatten())
        }
        Err(Failed::Beyond(refusal, length)) => {
            refuse(request, refusal, header("Content-Range", &format!("bytes */{length}")))
        }
        Err(Failed::Cloud(error)) => {
            let mut text = error.to_string();
            let mut cause = std::error::Error::source(&error);
            while let Some(source) = cause {
                text.push_str(&format!(": {source}"));
                cause = source.source();
            }
            send_text(request, StatusCode(500), format!("{text}\n"), None)
        }
    }
}

fn refuse(request: Request, refusal: Refusal, more: Option<Header>) -> io::Result<()> {
    let status = StatusCode(refusal as u16);
    send_text(request, status, format!("{} {}\n", status.0, status.default_reason_phrase()), more)
}

fn send_text(
    request: Request,
    status: StatusCode,
    text: String,
    more: impl IntoIterator<Item = Header>,
) -> io::Result<()> {
    let mut response = Response::from_string(text).with_status_code(status);
    for header in more.into_iter().chain(guards()) {
        response.add_header(header);
    }
    request.respond(response)
}

/// What a request asks for.
enum Reply {
    File(Found),
    /// Media type and bytes of a part of the file with all points.
    Part(&'static str, Vec<u8>),
}

/// A file and the part of it that was asked for.
struct Found {
    path: PathBuf,
    file: fs_err::File,
    length: u64,
    range: Option<std::ops::Range<u64>>,
}

fn found(request: &Request, shown: &Shown) -> Result<Reply, Failed> {
    let values = |name: &'static str| {
        let fields = request.headers().iter().filter(move |header| header.field.equiv(name));
        fields.map(|header| header.value.as_str())
    };
    check_host(values("Host"), shown.port)?;
    if !matches!(request.method(), Method::Get | Method::Head) {
        return Err(Refusal::MethodNotAllowed.into());
    }
    let path = file_of(&shown.root, request.url())?;
    if let Some(part) = part_of(request.url(), &path)? {
        let (media, bytes) =
            shown.cloud.read(&path, part).map_err(Failed::Cloud)?.ok_or(Refusal::NotFound)?;
        return Ok(Reply::Part(media, bytes));
    }
    let file = fs_err::File::open(&path).map_err(|_| Refusal::NotFound)?;
    let length = file.metadata().map_err(|_| Refusal::NotFound)?.len();
    // Range is defined for GET only (RFC 9110, section 14.2).
    let asked = values("Range").next().filter(|_| *request.method() == Method::Get);
    let range = range_of(asked, length).map_err(|refusal| Failed::Beyond(refusal, length))?;
    Ok(Reply::File(Found { path, file, length, range }))
}

impl Found {
    fn send(mut self, request: Request) -> io::Result<()> {
        let part = self.range.clone().unwrap_or(0..self.length);
        self.file.seek(SeekFrom::Start(part.start))?;
        let count = usize::try_from(part.end - part.start).map_err(io::Error::other)?;
        let mut headers: Vec<Header> = guards().collect();
        headers.extend(header("Content-Type", media_type(&self.path)));
        headers.extend(header("Accept-Ranges", "bytes"));
        if self.range.is_some() {
            let range = format!("bytes {}-{}/{}", part.start, part.end - 1, self.length);
            headers.extend(header("Content-Range", &range));
        }
        let status = StatusCode(if self.range.is_some() { 206 } else { 200 });
        let body = self.file.take(part.end - part.start);
        // With its length and not in chunks, so that a browser shows how much is left.
        request.respond(
            Response::new(status, headers, body, Some(count), None).with_chunked_threshold(usize::MAX),
        )
    }
}

/// Headers of every answer: nothing is guessed, kept, framed, or read by pages of other sites.
fn guards() -> impl Iterator<Item = Header> {
    [
        ("X-Content-Type-Options", "nosniff"),
        ("Cache-Control", "no-store"),
        ("Content-Security-Policy", "frame-ancestors 'none'"),
        ("Cross-Origin-Resource-Policy", "same-origin"),
        ("Referrer-Policy", "no-referrer"),
    ]
    .into_iter()
    .filter_map(|(name, value)| header(name, value))
}

/// A header; `None` for characters that no header may have.
fn header(name: &str, value: &str) -> Option<Header> {
    Header::from_bytes(name, value).ok()
}

/// Opens the address in the browser of the user. Returns whether one was started.
fn open_browser(url: &str) -> bool {
    let opener = if cfg!(target_os = "macos") { "open" } else { "xdg-open" };
    let started = Command::new(opener)
        .arg(url)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    started.is_ok()
}
