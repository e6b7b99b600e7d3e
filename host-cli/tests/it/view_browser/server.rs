//! Process of `photoncard view`, and a server for a page of another origin.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::support::Room;

/// Process of `photoncard view`. Dropping it ends the process.
pub(crate) struct View {
    process: Child,
    /// Address of the page, with the token.
    pub(crate) address: String,
}

impl View {
    /// Starts the command on a free port. Pages save pictures in the folder `out` of `room`.
    pub(crate) fn start(room: &Room, scene: &str, options: &[&str]) -> Self {
        std::fs::create_dir_all(room.path("out")).unwrap();
        Self::start_without_folder(room, scene, &[options, &["--out", "out"]].concat())
    }

    /// Starts the command on a free port.
    pub(crate) fn start_without_folder(room: &Room, scene: &str, options: &[&str]) -> Self {
        let mut command = room.command();
        command.args(["view", scene, "--listen", "127.0.0.1:0"]).args(options);
        let mut process = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut lines = BufReader::new(process.stdout.take().unwrap()).lines();
        let address = lines.by_ref().map_while(Result::ok).find_map(|line| {
            line.split_whitespace().find(|word| word.starts_with("http://")).map(str::to_owned)
        });
        // The thread reads all further lines, so that the command can print.
        std::thread::spawn(move || lines.for_each(drop));
        Self { process, address: address.expect("the command prints the address of its page") }
    }

    /// Resident memory of the command, bytes; `None` on systems without `/proc`.
    pub(crate) fn memory(&self) -> Option<u64> {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.process.id())).ok()?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
        Some(1024 * line.trim().strip_suffix(" kB")?.parse::<u64>().ok()?)
    }

    /// Address of the WebSocket for a page.
    pub(crate) fn socket(&self) -> String {
        self.address.replace("http://", "ws://").replace("/?", "/socket?")
    }
}

impl Drop for View {
    fn drop(&mut self) {
        // Both calls fail if the process has ended already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Runs a command line in a shell, with this program as `photoncard`.
pub(crate) fn run_shown(room: &Room, line: &str) {
    let folder = std::path::Path::new(env!("CARGO_BIN_EXE_photoncard")).parent().unwrap();
    let path = std::env::join_paths(
        std::iter::once(folder.to_owned()).chain(std::env::split_paths(&std::env::var_os("PATH").unwrap())),
    );
    let mut command = Command::new("sh");
    command.args(["-c", line]).env("PATH", path.unwrap()).current_dir(room.path(".")).stdin(Stdio::null());
    let output = command.output().unwrap();
    assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
}

/// Serves a page, without access control, on a port of its own: the page has another origin. Returns its
/// address.
pub(crate) fn serve_page(page: String) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}/", listener.local_addr().unwrap());
    std::thread::spawn(move || {
        for stream in listener.incoming().map_while(Result::ok) {
            answer(stream, &page);
        }
    });
    address
}

/// Answers one request. A browser may also connect without a request.
fn answer(mut stream: TcpStream, page: &str) {
    stream.set_read_timeout(Some(Duration::from_millis(500))).unwrap();
    if matches!(stream.read(&mut [0; 4096]), Ok(1..)) {
        let head = "HTTP/1.1 200 OK\r\nContent-Type: text/html\r\nConnection: close\r\nContent-Length:";
        let _ = write!(stream, "{head} {}\r\n\r\n{page}", page.len());
    }
}

/// Plain server of the files in a folder. Dropping it ends the answers.
pub(crate) struct FileServer {
    pub(crate) address: String,
    is_over: Arc<AtomicBool>,
}

impl FileServer {
    /// Serves a folder on a port of its own.
    pub(crate) fn start(folder: PathBuf) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("http://{}/", listener.local_addr().unwrap());
        let is_over = Arc::new(AtomicBool::new(false));
        let ends = is_over.clone();
        std::thread::spawn(move || {
            for stream in listener.incoming().map_while(Result::ok) {
                if ends.load(Ordering::Relaxed) {
                    return;
                }
                let folder = folder.clone();
                std::thread::spawn(move || send_file(stream, &folder));
            }
        });
        Self { address, is_over }
    }

    /// Ends the server: requests are no longer answered.
    pub(crate) fn end(&self) {
        self.is_over.store(true, Ordering::Relaxed);
        // The listener looks at the flag with its next connection, and is closed.
        let _ = TcpStream::connect(self.address.trim_start_matches("http://").trim_end_matches('/'));
    }
}

impl Drop for FileServer {
    fn drop(&mut self) {
        self.end();
    }
}

/// Answers one request for a file.
fn send_file(mut stream: TcpStream, folder: &Path) {
    stream.set_read_timeout(Some(Duration::from_secs(5))).unwrap();
    let mut head = [0; 8192];
    let Ok(length @ 1..) = stream.read(&mut head) else { return };
    let head = String::from_utf8_lossy(&head[..length]);
    let path = head.split_whitespace().nth(1).unwrap_or("/").split('?').next().unwrap();
    let name = if path == "/" { "index.html" } else { path.trim_start_matches('/') };
    let kind = match Path::new(name).extension().and_then(|ending| ending.to_str()) {
        Some("html") => "text/html",
        Some("js") => "text/javascript",
        Some("css") => "text/css",
        Some("wasm") => "application/wasm",
        Some("svg") => "image/svg+xml",
        _ => "application/octet-stream",
    };
    let (status, body) = match std::fs::read(folder.join(name)) {
        Ok(body) => ("200 OK", body),
        Err(_) => ("404 Not Found", Vec::new()),
    };
    let length = body.len();
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n"
    );
    let _ = stream.write_all(head.as_bytes()).and_then(|()| stream.write_all(&body));
}
