//! Client of a view's WebSocket, in place of the page in a browser.

use std::collections::HashMap;
use std::io::{BufRead, BufReader, Read};
use std::net::TcpStream;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tungstenite::handshake::client::generate_key;
use tungstenite::http::Request;
use tungstenite::{Message, WebSocket};

use crate::support::Room;

/// Time limit of each wait, long enough for a busy machine.
const PATIENCE: Duration = Duration::from_secs(200);

/// Process of `photoncard view`. Dropping it ends the process.
pub(crate) struct View {
    pub(crate) process: Child,
    /// Address and port of the view.
    pub(crate) host: String,
    pub(crate) token: String,
}

impl View {
    pub(crate) fn start(room: &Room, scene: &str, options: &[&str]) -> Self {
        let mut command = room.command();
        command.args(["view", scene, "--listen", "127.0.0.1:0"]).args(options);
        let mut process = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
        let Some((host, token)) =
            line.trim().strip_prefix("http://").and_then(|url| url.split_once("/?token="))
        else {
            let mut said = String::new();
            process.stderr.take().unwrap().read_to_string(&mut said).unwrap();
            panic!("{line:?}: {said}");
        };
        Self { host: host.to_owned(), token: token.to_owned(), process }
    }

    /// Requests the WebSocket at `target`, with these headers `Host` and `Origin`.
    ///
    /// # Errors
    /// Returns the HTTP status of the refusal.
    pub(crate) fn try_connect(&self, target: &str, host: &str, origin: Option<&str>) -> Result<Page, u16> {
        let stream = TcpStream::connect(&self.host).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let mut request = Request::builder()
            .uri(format!("ws://{}{target}", self.host))
            .header("Host", host)
            .header("Connection", "Upgrade")
            .header("Upgrade", "websocket")
            .header("Sec-WebSocket-Version", "13")
            .header("Sec-WebSocket-Key", generate_key());
        if let Some(origin) = origin {
            request = request.header("Origin", origin);
        }
        match tungstenite::client(request.body(()).unwrap(), stream) {
            Ok((socket, _)) => Ok(Page::new(socket)),
            Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(response))) => {
                Err(response.status().as_u16())
            }
            Err(error) => panic!("{error}"),
        }
    }

    /// Connects to the WebSocket with token and valid headers.
    pub(crate) fn connect(&self) -> Page {
        let target = format!("/socket?token={}", self.token);
        self.try_connect(&target, &self.host, Some(&format!("http://{}", self.host))).unwrap()
    }

    /// Requests a file. Returns status and text of the response.
    pub(crate) fn get(&self, target: &str, host: &str) -> (u16, String) {
        use std::io::Write;
        let mut stream = TcpStream::connect(&self.host).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        write!(stream, "GET {target} HTTP/1.1\r\nHost: {host}\r\n\r\n").unwrap();
        let mut text = String::new();
        stream.read_to_string(&mut text).unwrap();
        (text.split(' ').nth(1).unwrap().parse().unwrap(), text)
    }
}

impl Drop for View {
    fn drop(&mut self) {
        // Both calls fail if the process has ended already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Connected page.
pub(crate) struct Page {
    socket: WebSocket<TcpStream>,
    received: usize,
    /// Last text message of each type.
    pub(crate) last: HashMap<String, Value>,
    /// Values of each pixel as shown: radiance or a layer.
    pub(crate) pixels: HashMap<(u32, u32), [f32; 3]>,
    /// Request number of each received tile, and side of the square that one rendered pixel covers, pixels.
    pub(crate) steps: Vec<(u32, u32)>,
    /// Numbers of gathers, irradiance records and DRAM lines for each tile of the newest picture at full
    /// resolution, by the tile's corner.
    pub(crate) work: HashMap<(u32, u32), [u32; 3]>,
    /// Name and contents of the last downloaded picture.
    file: Option<(String, Vec<u8>)>,
}

impl Page {
    fn new(socket: WebSocket<TcpStream>) -> Self {
        Self {
            socket,
            received: 0,
            last: HashMap::new(),
            pixels: HashMap::new(),
            steps: Vec::new(),
            work: HashMap::new(),
            file: None,
        }
    }

    pub(crate) fn send(&mut self, message: &Value) {
        self.socket.send(Message::text(message.to_string())).unwrap();
    }

    pub(crate) fn send_raw(&mut self, message: Message) {
        // The view may have closed the connection already.
        let _ = self.socket.send(message);
    }

    /// Reads messages until one of type `kind` satisfies `is_right`, and returns it.
    pub(crate) fn wait(&mut self, kind: &str, is_right: impl Fn(&Value) -> bool) -> Value {
        let begin = Instant::now();
        while begin.elapsed() < PATIENCE {
            match self.socket.read().unwrap() {
                Message::Text(text) => {
                    let message: Value = serde_json::from_str(&text).unwrap();
                    let found = message["type"].as_str().unwrap().to_owned();
                    let is_it = found == kind && is_right(&message);
                    self.last.insert(found, message.clone());
                    if is_it {
                        return message;
                    }
                }
                Message::Binary(bytes) => self.receive(&bytes),
                _ => {}
            }
        }
        panic!("no {kind} after {:?}; last: {:?}", begin.elapsed(), self.last);
    }

    pub(crate) fn wait_for(&mut self, kind: &str) -> Value {
        self.wait(kind, |_| true)
    }

    /// Waits for a final picture, and returns its state. If the last state is `settled` already, waits for
    /// the final picture of a newer request.
    pub(crate) fn settle(&mut self) -> Value {
        let before = self
            .last
            .get("state")
            .filter(|state| state["settled"] == true)
            .map(|state| state["version"].clone());
        self.wait("state", |state| state["settled"] == true && Some(&state["version"]) != before.as_ref())
    }

    /// Downloads the picture, and returns name and contents of its file.
    pub(crate) fn download(&mut self, name: &str) -> (String, Vec<u8>) {
        self.send(&json!({"type": "save", "name": name, "download": true}));
        let begin = Instant::now();
        while begin.elapsed() < PATIENCE {
            if let Some(file) = self.file.take() {
                return file;
            }
            match self.socket.read().unwrap() {
                Message::Binary(bytes) => self.receive(&bytes),
                Message::Text(text) => assert!(!text.contains("\"type\":\"error\""), "{text}"),
                _ => {}
            }
        }
        panic!("no {name} after {:?}", begin.elapsed());
    }

    /// Sends an environment map.
    pub(crate) fn drop_map(&mut self, name: &str, bytes: &[u8]) {
        self.send(&json!({"type": "drop", "name": name, "bytes": bytes.len()}));
        self.wait_for("announced");
        for part in bytes.chunks(10_000) {
            self.send_raw(Message::binary(part.to_vec()));
        }
    }

    /// Closes the connection.
    pub(crate) fn leave(mut self) {
        self.socket.close(None).unwrap();
        self.wait_for_end();
    }

    /// Waits until the view closes the connection.
    pub(crate) fn wait_for_end(&mut self) {
        let begin = Instant::now();
        while begin.elapsed() < PATIENCE {
            match self.socket.read() {
                Ok(Message::Close(_)) | Err(_) => return,
                Ok(_) => {}
            }
        }
        panic!("the connection stays");
    }

    /// Takes a tile or a file.
    fn receive(&mut self, bytes: &[u8]) {
        self.received += bytes.len();
        match bytes.strip_prefix(&u32::MAX.to_le_bytes()) {
            None => self.draw(bytes),
            Some(rest) => {
                let (length, rest) = rest.split_first_chunk().unwrap();
                let (name, contents) = rest.split_at(u32::from_le_bytes(*length) as usize);
                self.file = Some((String::from_utf8(name.to_vec()).unwrap(), contents.to_vec()));
            }
        }
    }

    fn draw(&mut self, tile: &[u8]) {
        let words = tile.as_chunks::<4>().0;
        let [version, step, x, y, columns, rows, _, _, work @ ..] =
            &words[..11].iter().map(|word| u32::from_le_bytes(*word)).collect::<Vec<_>>()[..]
        else {
            panic!("no header")
        };
        let [version, step, x, y, columns, rows] = [version, step, x, y, columns, rows].map(|word| *word);
        assert_eq!(words.len(), 11 + 3 * (columns * rows) as usize);
        if step == 1 {
            self.work.insert((x, y), work.try_into().unwrap());
        } else {
            self.work.clear();
        }
        self.steps.push((version, step));
        for (index, pixel) in (0..columns * rows).zip(words[11..].as_chunks::<3>().0) {
            let [left, top] = [x + index % columns * step, y + index / columns * step];
            let pixel = pixel.map(f32::from_le_bytes);
            for offset in 0..step * step {
                self.pixels.insert((left + offset % step, top + offset / step), pixel);
            }
        }
        self.send(&json!({"type": "shown", "version": version, "bytes": self.received}));
    }

    /// Mean radiance over all pixels and channels of a picture, each of which must have been shown.
    pub(crate) fn mean(&self, [width, height]: [u32; 2]) -> f32 {
        let inside = self.pixels.iter().filter(|((x, y), _)| *x < width && *y < height);
        let sums: Vec<f32> = inside.map(|(_, pixel)| pixel.iter().sum()).collect();
        assert_eq!(sums.len(), (width * height) as usize, "pixels that were never shown");
        sums.iter().sum::<f32>() / (3 * sums.len()) as f32
    }
}

/// Message that places the camera at `(x, 0.5, 3)`.
pub(crate) fn camera(x: f64, is_moving: bool) -> Value {
    json!({"type": "camera", "position": [x, 0.5, 3], "look_at": [0, 0.3, 0], "fov": 40, "moving": is_moving})
}
