//! The HTTP server of `chainage view`: it reads requests and sends answers. The content of the answers is
//! made elsewhere.
//!
//! A request may come from any program on this machine, and from any page in its browsers. So the head of a
//! request has a limit of bytes and of time, bodies are refused, and there is a limit of connections.

use std::io::{self, BufWriter, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

/// Largest number of simultaneous connections, one thread each. A paused download keeps its thread, so there
/// are many more than the six connections that a browser opens.
const CONNECTIONS: usize = 128;
/// Largest number of bytes of the head of a request.
const HEAD_BYTES: usize = 16 << 10;
/// Largest number of headers of a request.
const HEADERS: usize = 64;
/// Time for the whole head of a request, and for the next request on a connection.
const HEAD_TIME: Duration = Duration::from_secs(5);
/// Time after which a stalled download is ended. A browser continues it with a range.
const STILL: Duration = Duration::from_secs(600);
/// Time and number of bytes for which the server still reads after a refusal.
const LINGER_TIME: Duration = Duration::from_secs(1);
const LINGER_BYTES: usize = 256 << 10;
/// Pause after a connection could not be accepted, for example because no file descriptor was free.
const REST: Duration = Duration::from_millis(100);

/// The head of a request. It has no body.
#[derive(Debug)]
pub(crate) struct Request {
    pub(crate) method: String,
    /// The path and the query, as they were sent.
    pub(crate) target: String,
    headers: Vec<(String, String)>,
    /// Whether the connection ends with the answer.
    closes: bool,
}

impl Request {
    /// The values of all headers of this name.
    pub(crate) fn values(&self, name: &'static str) -> impl Iterator<Item = &str> {
        let fields = self.headers.iter().filter(move |(field, _)| field.eq_ignore_ascii_case(name));
        fields.map(|(_, value)| value.as_str())
    }
}

/// An answer.
pub(crate) struct Answer {
    pub(crate) status: u16,
    /// The headers, except those of the connection, the length and the date.
    pub(crate) headers: Vec<(&'static str, String)>,
    /// Bytes of the body.
    pub(crate) length: u64,
    pub(crate) body: Box<dyn Read>,
}

impl Answer {
    /// An answer whose body is in memory.
    pub(crate) fn of(status: u16, media: &str, bytes: Vec<u8>) -> Self {
        let headers = vec![("Content-Type", media.to_owned())];
        Self { status, headers, length: bytes.len() as u64, body: Box::new(io::Cursor::new(bytes)) }
    }

    /// The status in words.
    pub(crate) fn in_words(status: u16) -> Self {
        Self::of(status, "text/plain; charset=utf-8", format!("{status} {}\n", reason(status)).into_bytes())
    }
}

/// Answers requests as long as the process lives. An answer that is being sent ends with the process.
pub(crate) fn serve(
    listener: &TcpListener,
    answer: &Arc<impl Fn(&Request) -> Answer + Send + Sync + 'static>,
) {
    let open = Arc::new(());
    loop {
        let Ok((stream, _)) = listener.accept() else {
            std::thread::sleep(REST);
            continue;
        };
        if Arc::strong_count(&open) > CONNECTIONS {
            // The answer fits into the empty buffer of the connection, so this does not wait.
            let _ = stream.set_nonblocking(true);
            let _ = send(&stream, Answer::in_words(503), false, true);
            continue;
        }
        let (answer, mine) = (Arc::clone(answer), Arc::clone(&open));
        // Without a thread, the connection is dropped. The client may try again.
        let _ = std::thread::Builder::new().spawn(move || {
            // A client that disconnects is not a failure of the server.
            let _ = converse(&stream, answer.as_ref());
            drop(mine);
        });
    }
}

/// Answers the requests of a connection, one after the other.
fn converse(stream: &TcpStream, answer: &impl Fn(&Request) -> Answer) -> io::Result<()> {
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(STILL))?;
    let mut bytes = Vec::new();
    loop {
        match next_request(stream, &mut bytes)? {
            Next::Request(request) => {
                send(stream, answer(&request), request.method == "HEAD", request.closes)?;
                if request.closes {
                    return linger(stream);
                }
            }
            Next::Refused(status) => {
                send(stream, Answer::in_words(status), false, true)?;
                return linger(stream);
            }
            Next::End => return Ok(()),
        }
    }
}

/// The next event on a connection.
#[derive(Debug)]
enum Next {
    Request(Request),
    /// The status of the refusal. The following bytes on the connection cannot be understood.
    Refused(u16),
    /// The client has closed the connection, or sends nothing more.
    End,
}

/// Reads the head of a request. `bytes` are the received bytes that are not parsed yet.
fn next_request(mut stream: &TcpStream, bytes: &mut Vec<u8>) -> io::Result<Next> {
    let deadline = Instant::now() + HEAD_TIME;
    let mut block = [0; 4 << 10];
    loop {
        match parsed(bytes) {
            Parsed::Whole(request, length) => {
                bytes.drain(..length);
                return Ok(Next::Request(request));
            }
            Parsed::Refused(status) => return Ok(Next::Refused(status)),
            Parsed::Partial => {}
        }
        // One deadline for the whole head: bytes that trickle in do not extend it.
        let left = deadline.saturating_duration_since(Instant::now());
        let late = if bytes.is_empty() { Next::End } else { Next::Refused(408) };
        if left.is_zero() {
            return Ok(late);
        }
        stream.set_read_timeout(Some(left))?;
        match stream.read(&mut block) {
            Ok(0) => return Ok(Next::End),
            Ok(count) => bytes.extend_from_slice(&block[..count]),
            Err(error) if is_late(&error) => return Ok(late),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
}

fn is_late(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut)
}

/// The result of parsing the bytes of a connection.
#[derive(Debug)]
enum Parsed {
    /// A request, and the number of its bytes.
    Whole(Request, usize),
    /// The beginning of a request.
    Partial,
    /// The status of the refusal.
    Refused(u16),
}

fn parsed(bytes: &[u8]) -> Parsed {
    let mut fields = [httparse::EMPTY_HEADER; HEADERS];
    let mut head = httparse::Request::new(&mut fields);
    let length = match head.parse(bytes) {
        Ok(httparse::Status::Complete(length)) if length <= HEAD_BYTES => length,
        Ok(httparse::Status::Partial) if bytes.len() < HEAD_BYTES => return Parsed::Partial,
        Ok(_) | Err(httparse::Error::TooManyHeaders) => return Parsed::Refused(431),
        Err(httparse::Error::Version) => return Parsed::Refused(505),
        Err(_) => return Parsed::Refused(400),
    };
    let headers: Option<Vec<(String, String)>> = head
        .headers
        .iter()
        .map(|field| Some((field.name.to_owned(), std::str::from_utf8(field.value).ok()?.to_owned())))
        .collect();
    let (Some(method), Some(target), Some(headers)) = (head.method, head.path, headers) else {
        return Parsed::Refused(400);
    };
    let mut request = Request {
        method: method.to_owned(),
        target: target.to_owned(),
        headers,
        closes: head.version == Some(0),
    };
    // No request needs a body, so none is read, whatever its stated length. A client that waits for "100
    // Continue" gets the refusal instead (RFC 9110, section 10.1.1).
    let has_body = request.values("Transfer-Encoding").next().is_some()
        || request.values("Content-Length").any(|length| length.trim() != "0");
    if has_body {
        return Parsed::Refused(413);
    }
    let closes = request
        .values("Connection")
        .flat_map(|value| value.split(','))
        .any(|option| option.trim().eq_ignore_ascii_case("close"));
    request.closes |= closes;
    Parsed::Whole(request, length)
}

/// Headers of every answer: browsers do not guess types, keep copies, or let pages of other sites frame or
/// read it.
const GUARDS: [(&str, &str); 5] = [
    ("X-Content-Type-Options", "nosniff"),
    ("Cache-Control", "no-store"),
    ("Content-Security-Policy", "frame-ancestors 'none'"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
    ("Referrer-Policy", "no-referrer"),
];

fn send(stream: &TcpStream, answer: Answer, is_head: bool, closes: bool) -> io::Result<()> {
    let Answer { status, headers, length, body } = answer;
    let mut to = BufWriter::with_capacity(64 << 10, stream);
    write!(to, "HTTP/1.1 {status} {}\r\n", reason(status))?;
    write!(to, "Date: {}\r\n", httpdate::fmt_http_date(SystemTime::now()))?;
    write!(to, "Connection: {}\r\n", if closes { "close" } else { "keep-alive" })?;
    for (name, value) in GUARDS.into_iter().chain(headers.iter().map(|(name, value)| (*name, value.as_str())))
    {
        write!(to, "{name}: {value}\r\n")?;
    }
    // The answer has its length and is not sent in chunks, so that a browser shows the remaining part.
    write!(to, "Content-Length: {length}\r\n\r\n")?;
    if !is_head && io::copy(&mut body.take(length), &mut to)? < length {
        // The file became shorter. After the length was sent, only the end of the connection can tell the
        // client.
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    to.flush()
}

/// Closes a connection so that the client can read the answer: if it still sends when the socket is closed,
/// the system resets the connection and the client may lose what it has not read yet.
fn linger(mut stream: &TcpStream) -> io::Result<()> {
    stream.shutdown(Shutdown::Write)?;
    let deadline = Instant::now() + LINGER_TIME;
    let (mut block, mut total) = ([0; 4 << 10], 0);
    while total < LINGER_BYTES {
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() {
            break;
        }
        stream.set_read_timeout(Some(left))?;
        match stream.read(&mut block)? {
            0 => break,
            count => total += count,
        }
    }
    Ok(())
}

/// The name of a status (RFC 9110, section 15; RFC 6585).
fn reason(status: u16) -> &'static str {
    match status {
        200 => "OK",
        206 => "Partial Content",
        400 => "Bad Request",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        408 => "Request Timeout",
        413 => "Content Too Large",
        416 => "Range Not Satisfiable",
        431 => "Request Header Fields Too Large",
        500 => "Internal Server Error",
        503 => "Service Unavailable",
        505 => "HTTP Version Not Supported",
        _ => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_read_with_limits() {
        let whole = b"GET /a?b HTTP/1.1\r\nHost: x\r\nRange: bytes=0-1\r\nhost: y\r\n\r\nGET";
        let Parsed::Whole(request, length) = parsed(whole) else { panic!("a request") };
        assert_eq!(
            (request.method.as_str(), request.target.as_str(), request.closes),
            ("GET", "/a?b", false)
        );
        assert_eq!((length, request.values("HOST").collect::<Vec<_>>()), (whole.len() - 3, vec!["x", "y"]));
        for text in ["", "G", "GET / HTTP/1.1\r\n", "GET / HTTP/1.1\r\nHost: x\r\n"] {
            assert!(matches!(parsed(text.as_bytes()), Parsed::Partial), "{text:?}");
        }
        let closes = |text: &str| match parsed(text.as_bytes()) {
            Parsed::Whole(request, _) => request.closes,
            other => panic!("{text:?}: {other:?}"),
        };
        assert!(closes("GET / HTTP/1.1\r\nConnection: x, Close\r\n\r\n") && closes("GET / HTTP/1.0\r\n\r\n"));
        assert!(!closes("GET / HTTP/1.1\r\nContent-Length: 0\r\nExpect: 100-continue\r\n\r\n"));
        let long = format!("GET /{} HTTP/1.1\r\n", "x".repeat(HEAD_BYTES));
        let many = format!("GET / HTTP/1.1\r\n{}\r\n", "a: b\r\n".repeat(HEADERS + 1));
        for (text, status) in [
            ("POST / HTTP/1.1\r\nContent-Length: 999999999999\r\n\r\n", 413),
            ("POST / HTTP/1.1\r\nContent-Length: 99999999999999999999999\r\n\r\n", 413),
            ("POST / HTTP/1.1\r\nContent-Length: 0\r\nContent-Length: 5\r\n\r\n", 413),
            ("GET / HTTP/1.1\r\nContent-Length: -1\r\n\r\n", 413),
            ("GET / HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n", 413),
            ("GET / HTTP/2.0\r\n\r\n", 505),
            ("GET\r\n\r\n", 400),
            ("\x16\x03\x01", 400),
            (&long, 431),
            (&many, 431),
        ] {
            assert!(matches!(parsed(text.as_bytes()), Parsed::Refused(found) if found == status), "{text:?}");
        }
    }
}
