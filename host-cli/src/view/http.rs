//! Subset of HTTP/1.1 that a page needs: heads of requests, and responses that close the connection.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use super::page_files::PageFile;

/// Maximum size of a request's head, bytes.
const MAX_HEAD: usize = 8 << 10;
const MAX_HEADERS: usize = 64;
/// Time limit for reading a request's head, and for each write of a response.
const PATIENCE: Duration = Duration::from_secs(5);

/// Head of a request.
#[derive(Debug, PartialEq)]
pub(super) struct Head {
    pub(super) method: String,
    pub(super) target: String,
    /// Header names in lower case, with their values.
    headers: Vec<(String, String)>,
}

/// Response to a request that is refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Refusal {
    pub(super) status: u16,
    reason: &'static str,
    text: &'static str,
}

impl Refusal {
    pub(super) const fn new(status: u16, reason: &'static str, text: &'static str) -> Self {
        Self { status, reason, text }
    }

    pub(super) const fn forbidden(text: &'static str) -> Self {
        Self::new(403, "Forbidden", text)
    }

    pub(super) fn send(&self, stream: &mut TcpStream) -> std::io::Result<()> {
        let Self { status, reason, text } = self;
        respond(stream, &format!("{status} {reason}"), "text/plain; charset=utf-8", "", text.as_bytes())
    }
}

const BAD_REQUEST: Refusal = Refusal::new(400, "Bad Request", "this is no request");
const TOO_LARGE: Refusal = Refusal::new(431, "Request Header Fields Too Large", "the request is too large");
const TOO_SLOW: Refusal = Refusal::new(408, "Request Timeout", "the request did not arrive in time");

impl Head {
    /// Reads a request's head from a connection, in at most [`PATIENCE`] and about [`MAX_HEAD`] bytes.
    pub(super) fn read(stream: &mut TcpStream) -> Result<Self, Refusal> {
        let start = Instant::now();
        let mut bytes = Vec::new();
        loop {
            let left = PATIENCE.saturating_sub(start.elapsed());
            if left.is_zero() || stream.set_read_timeout(Some(left)).is_err() {
                return Err(TOO_SLOW);
            }
            let mut buffer = [0; 1024];
            match stream.read(&mut buffer) {
                Ok(0) => return Err(BAD_REQUEST),
                Ok(count) => bytes.extend(&buffer[..count]),
                Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {}
                Err(_) => return Err(TOO_SLOW),
            }
            if let Some(head) = Self::parse(&bytes)? {
                return Ok(head);
            }
            if bytes.len() > MAX_HEAD {
                return Err(TOO_LARGE);
            }
        }
    }

    /// Parses a head; `None` if it is incomplete.
    pub(super) fn parse(bytes: &[u8]) -> Result<Option<Self>, Refusal> {
        let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
        let mut request = httparse::Request::new(&mut headers);
        match request.parse(bytes) {
            Ok(httparse::Status::Partial) => return Ok(None),
            Ok(httparse::Status::Complete(_)) => {}
            Err(httparse::Error::TooManyHeaders) => return Err(TOO_LARGE),
            Err(_) => return Err(BAD_REQUEST),
        }
        let (Some(method), Some(target)) = (request.method, request.path) else { return Err(BAD_REQUEST) };
        if !target.is_ascii() {
            return Err(BAD_REQUEST);
        }
        let text = |header: &httparse::Header| {
            let value = std::str::from_utf8(header.value).ok()?;
            Some((header.name.to_ascii_lowercase(), value.trim().to_owned()))
        };
        let headers: Option<Vec<_>> = request.headers.iter().map(text).collect();
        let headers = headers.ok_or(BAD_REQUEST)?;
        Ok(Some(Self { method: method.to_owned(), target: target.to_owned(), headers }))
    }

    /// Values of all headers with this name.
    pub(super) fn all(&self, name: &str) -> Vec<&str> {
        self.headers.iter().filter(|(known, _)| known == name).map(|(_, value)| value.as_str()).collect()
    }

    /// Value of the only header with this name; `None` if there is none or several.
    pub(super) fn one(&self, name: &str) -> Option<&str> {
        if let [value] = self.all(name)[..] { Some(value) } else { None }
    }

    /// `Sec-WebSocket-Key` of a WebSocket request of version 13; `None` for any other request.
    pub(super) fn socket_key(&self) -> Option<String> {
        let has = |name: &str, word: &str| {
            self.all(name)
                .iter()
                .flat_map(|value| value.split(','))
                .any(|part| part.trim().eq_ignore_ascii_case(word))
        };
        let is_upgrade = has("connection", "upgrade") && has("upgrade", "websocket");
        let is_known = is_upgrade && self.one("sec-websocket-version") == Some("13");
        self.one("sec-websocket-key").filter(|key| is_known && key.len() == 24).map(str::to_owned)
    }
}

/// Sends a file of the page. The response allows the page to open a WebSocket to `host`, the request's
/// `Host`, and to run WebAssembly if it `has_module`.
pub(super) fn send_file(
    stream: &mut TcpStream,
    file: &PageFile,
    host: &str,
    has_module: bool,
) -> std::io::Result<()> {
    let scripts = if has_module { "script-src 'self' 'wasm-unsafe-eval'; " } else { "" };
    // Not all browsers let `'self'` stand for the server's WebSocket.
    let policy = format!(
        "Content-Security-Policy: default-src 'self'; {scripts}connect-src 'self' ws://{host}; \
         img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n"
    );
    respond(stream, "200 OK", file.kind, &policy, file.text.as_bytes())
}

/// Sends the WebAssembly module.
pub(super) fn send_module(stream: &mut TcpStream, module: &[u8]) -> std::io::Result<()> {
    respond(stream, "200 OK", "application/wasm", "", module)
}

/// Accepts a WebSocket request.
pub(super) fn accept_socket(stream: &mut TcpStream, key: &str) -> std::io::Result<()> {
    let accept = tungstenite::handshake::derive_accept_key(key.as_bytes());
    let head = format!(
        "HTTP/1.1 101 Switching Protocols\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Accept: {accept}\r\n\r\n"
    );
    stream.write_all(head.as_bytes())
}

fn respond(stream: &mut TcpStream, status: &str, kind: &str, more: &str, body: &[u8]) -> std::io::Result<()> {
    let length = body.len();
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\nCache-Control: no-store\r\n\
         Referrer-Policy: no-referrer\r\nX-Content-Type-Options: nosniff\r\nCross-Origin-Resource-Policy: same-origin\r\n\
         Cross-Origin-Opener-Policy: same-origin\r\n{more}\r\n"
    );
    stream.set_write_timeout(Some(PATIENCE))?;
    stream.write_all(head.as_bytes())?;
    stream.write_all(body)?;
    stream.flush()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_head_is_answered() {
        let many = "A: b\r\n".repeat(MAX_HEADERS + 1);
        for (text, status) in [
            ("GET / HTTP/1.1\r\nHost: a\r\n", None),
            ("", None),
            ("\u{16}\u{3}\u{1}\u{2}", Some(400)),
            ("GET /\r\n\r\n", Some(400)),
            ("GET / HTTP/1.1\r\nno header\r\n\r\n", Some(400)),
            (&format!("GET / HTTP/1.1\r\n{many}\r\n"), Some(431)),
        ] {
            let found = Head::parse(text.as_bytes());
            match status {
                None => assert_eq!(found, Ok(None), "{text}"),
                Some(status) => assert_eq!(found.unwrap_err().status, status, "{text}"),
            }
        }
        assert_eq!(Head::parse(b"GET / HTTP/1.1\r\nA: \xff\r\n\r\n"), Err(BAD_REQUEST));
    }

    #[test]
    fn a_slow_or_endless_request_is_ended() {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let mut client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let mut server = listener.accept().unwrap().0;
        let writer = std::thread::spawn(move || {
            let line = format!("A: {}\r\n", "b".repeat(1000));
            let _ = client.write_all(b"GET / HTTP/1.1\r\n");
            for _ in 0..20 {
                let _ = client.write_all(line.as_bytes());
            }
            client
        });
        assert_eq!(Head::read(&mut server), Err(TOO_LARGE));
        drop(writer.join().unwrap());
    }
}
