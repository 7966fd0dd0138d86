//! `chainage view`.

use std::io::{self, Seek, SeekFrom};
use std::net::TcpListener;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::Duration;

use chainage::input::InputError;
use chainage::run::CancelToken;

use crate::cli::exit::{CliError, Outcome};
use crate::cli::http::{self, Answer, Request};
use crate::cli::numbers::whole;
use crate::cli::served::{PAGE, Refusal, check_host, file_of, media_type, range_of};
use crate::cli::streamed::{Cloud, part_of};
use crate::cli::{exit, interrupt, print};

/// Interval at which the command checks whether it should stop.
const PATIENCE: Duration = Duration::from_millis(200);

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
        let failed = |source| CliError::Serve { port: self.port, source };
        let listener = TcpListener::bind(("127.0.0.1", self.port)).map_err(failed)?;
        let port = listener.local_addr().map_err(failed)?.port();
        let cancel = Arc::new(CancelToken::default());
        interrupt::listen(&cancel)?;
        let url = format!("http://127.0.0.1:{port}/");
        print::text(&format!("{url}\n"))?;
        if !self.no_open && !open_browser(&url) {
            print::note("no browser could be opened: open the address yourself");
        }
        print::note("Ctrl-C ends the server");
        let shown = Shown { root, port, cloud: Cloud::default() };
        let answer = Arc::new(move |request: &Request| answer(request, &shown));
        // The server accepts connections until the process ends.
        std::thread::Builder::new().spawn(move || http::serve(&listener, &answer)).map_err(failed)?;
        while !cancel.is_cancelled() {
            std::thread::sleep(PATIENCE);
        }
        Ok(exit::DONE)
    }
}

/// The files that are served.
struct Shown {
    root: PathBuf,
    port: u16,
    cloud: Cloud,
}

/// Why a request is refused or cannot be answered.
enum Failed {
    Refused(Refusal),
    /// The range is beyond a file of this length.
    Beyond(Refusal, u64),
    /// The file cannot be read.
    File(io::Error),
    /// The file with all points cannot be read.
    Cloud(InputError),
}

impl From<Refusal> for Failed {
    fn from(refusal: Refusal) -> Self {
        Self::Refused(refusal)
    }
}

fn answer(request: &Request, shown: &Shown) -> Answer {
    let refused = |refusal: Refusal, more: Option<(&'static str, String)>| {
        let mut answer = Answer::in_words(refusal as u16);
        answer.headers.extend(more);
        answer
    };
    match found(request, shown) {
        Ok(answer) => answer,
        Err(Failed::Refused(refusal)) => {
            let allowed = (refusal == Refusal::MethodNotAllowed).then(|| ("Allow", "GET, HEAD".to_owned()));
            refused(refusal, allowed)
        }
        Err(Failed::Beyond(refusal, length)) => {
            refused(refusal, Some(("Content-Range", format!("bytes */{length}"))))
        }
        Err(Failed::File(error)) => failed(&error),
        Err(Failed::Cloud(error)) => failed(&error),
    }
}

/// The answer for an error with its causes.
fn failed(error: &dyn std::error::Error) -> Answer {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(source) = cause {
        text.push_str(&format!(": {source}"));
        cause = source.source();
    }
    Answer::of(500, "text/plain; charset=utf-8", format!("{text}\n").into_bytes())
}

/// The answer to a request.
fn found(request: &Request, shown: &Shown) -> Result<Answer, Failed> {
    check_host(request.values("Host"), shown.port)?;
    if !matches!(request.method.as_str(), "GET" | "HEAD") {
        return Err(Refusal::MethodNotAllowed.into());
    }
    let path = file_of(&shown.root, &request.target)?;
    if let Some(part) = part_of(&request.target, &path)? {
        let (media, bytes) =
            shown.cloud.read(&path, part).map_err(Failed::Cloud)?.ok_or(Refusal::NotFound)?;
        return Ok(Answer::of(200, media, bytes));
    }
    let mut file = fs_err::File::open(&path).map_err(|_| Refusal::NotFound)?;
    let length = file.metadata().map_err(|_| Refusal::NotFound)?.len();
    // Range is defined for GET only (RFC 9110, section 14.2).
    let asked = request.values("Range").next().filter(|_| request.method == "GET");
    let range = range_of(asked, length).map_err(|refusal| Failed::Beyond(refusal, length))?;
    let part = range.clone().unwrap_or(0..length);
    file.seek(SeekFrom::Start(part.start)).map_err(Failed::File)?;
    let mut headers =
        vec![("Content-Type", media_type(&path).to_owned()), ("Accept-Ranges", "bytes".to_owned())];
    if range.is_some() {
        headers.push(("Content-Range", format!("bytes {}-{}/{length}", part.start, part.end - 1)));
    }
    let status = if range.is_some() { 206 } else { 200 };
    Ok(Answer { status, headers, length: part.end - part.start, body: Box::new(file) })
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
