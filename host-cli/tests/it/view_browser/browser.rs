//! Headless Chromium, driven by the Chrome `DevTools` Protocol.

use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use data_encoding::BASE64;
use serde_json::{Value, json};
use tempfile::TempDir;
use tungstenite::{Message, WebSocket};

use crate::support::skip;

/// Time limit for the browser's start and for each of its answers.
pub(crate) const PATIENCE: Duration = Duration::from_secs(200);
/// Names of Chromium's program, in order of preference.
const PROGRAMS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

/// Process of a browser with an empty profile. Dropping it ends the process.
pub(crate) struct Browser {
    process: Child,
    address: String,
    control: Tab,
    _profile: TempDir,
}

impl Browser {
    /// Starts Chromium. Returns `None`, and prints why, if the tests are to be skipped.
    pub(crate) fn start() -> Option<Self> {
        if let Ok(reason) = std::env::var("PHOTONCARD_SKIP_BROWSER") {
            skip(&format!("the page is not tested, as PHOTONCARD_SKIP_BROWSER is set: {reason}"));
            return None;
        }
        let profile = tempfile::tempdir().unwrap();
        let mut process = PROGRAMS.iter().find_map(|program| launch(program, &profile)).expect(
            "there is no Chromium; install it (apt-get install chromium), or leave these tests out by setting \
             PHOTONCARD_SKIP_BROWSER to the reason",
        );
        let address = announced(&mut process, "DevTools listening on ");
        let control = Tab::connect(&address);
        let address = address.split("/devtools/").next().unwrap().to_owned();
        Some(Self { process, address, control, _profile: profile })
    }

    /// Opens an empty tab in a window of its own with this size: a tab behind another would not be drawn.
    pub(crate) fn tab(&mut self, size: [u32; 2]) -> Tab {
        let target =
            self.control.call("Target.createTarget", &json!({"url": "about:blank", "newWindow": true}));
        let target = target["targetId"].as_str().unwrap();
        let mut tab = Tab::connect(&format!("{}/devtools/page/{target}", self.address));
        for domain in ["Runtime.enable", "Log.enable", "Page.enable"] {
            tab.call(domain, &json!({}));
        }
        tab.resize(size);
        tab
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        // Both calls fail if the process has ended already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn launch(program: &str, profile: &TempDir) -> Option<Child> {
    let mut command = Command::new(program);
    command.args([
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-dev-shm-usage",
        "--no-first-run",
    ]);
    // WebGL2 is drawn by the processor, and colours are not adapted to a display.
    command.args(["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--force-color-profile=srgb"]);
    command.args(["--remote-debugging-port=0", "about:blank"]);
    command.arg(format!("--user-data-dir={}", profile.path().display()));
    command.env("HOME", profile.path()).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
    command.spawn().ok()
}

/// Waits for the address of a browser's server, which it prints after `head`.
pub(crate) fn announced(process: &mut Child, head: &'static str) -> String {
    let lines = BufReader::new(process.stderr.take().unwrap()).lines();
    let (sender, receiver) = mpsc::channel();
    // The thread reads all that the browser prints: a full pipe would stop the browser.
    std::thread::spawn(move || {
        for line in lines.map_while(Result::ok) {
            if let Some(address) = line.strip_prefix(head) {
                let _ = sender.send(address.trim().to_owned());
            }
        }
    });
    receiver.recv_timeout(PATIENCE).expect("the browser prints the address of its server")
}

/// Page in a browser, whose scripts can be called.
pub(crate) trait Scripted {
    /// Opens an address.
    fn open(&mut self, address: &str);

    /// Evaluates a JavaScript expression, and waits for its value if it is a promise.
    fn value(&mut self, expression: &str) -> Value;

    /// Selects the entry `value` of the list with the id `list`.
    fn choose(&mut self, list: &str, value: &str) {
        self.value(&format!(
            "(list => {{ list.value = '{value}'; list.dispatchEvent(new Event('input', {{bubbles: true}})); \
             list.dispatchEvent(new Event('change', {{bubbles: true}})); }})(document.getElementById('{list}'))"
        ));
    }

    /// Waits until a JavaScript expression is true.
    fn wait(&mut self, expression: &str, limit: Duration) {
        let start = Instant::now();
        while self.value(&format!("Boolean({expression})")) != true {
            if start.elapsed() > limit {
                let seen =
                    self.value("document.body.innerText + ' ' + JSON.stringify(window.photoncard?.state)");
                panic!("not within {limit:?}: {expression}; the page shows {seen}; {:?}", self.faults());
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Errors of the page's scripts and resources, as far as they are recorded.
    fn faults(&self) -> &[String] {
        &[]
    }
}

/// Tab with a mouse and a keyboard.
pub(crate) trait Acting: Scripted {
    /// Drags by `shift` pixels with a button of the mouse, from a point of the page.
    fn press(&mut self, button: &str, from: [f64; 2], shift: [f64; 2]);

    /// Turns the wheel at a point of the page.
    fn scroll(&mut self, at: [f64; 2], pixels: f64);

    /// Presses a key and releases it. `code` is a value of `KeyboardEvent.code`.
    fn strike(&mut self, code: &str);
}

/// Tab of the browser, with a `DevTools` connection.
pub(crate) struct Tab {
    socket: WebSocket<TcpStream>,
    calls: u64,
    /// Errors of the page's scripts and resources.
    pub(crate) faults: Vec<String>,
}

impl Tab {
    fn connect(address: &str) -> Self {
        let host = address.strip_prefix("ws://").unwrap().split('/').next().unwrap();
        let stream = TcpStream::connect(host).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream.set_nodelay(true).unwrap();
        let (socket, _) = tungstenite::client(address, stream).unwrap();
        Self { socket, calls: 0, faults: Vec::new() }
    }

    /// Calls a method of the protocol, and records errors of the page until the answer.
    pub(crate) fn call(&mut self, method: &str, parameters: &Value) -> Value {
        self.calls += 1;
        let call = json!({"id": self.calls, "method": method, "params": parameters});
        self.socket.send(Message::text(call.to_string())).unwrap();
        loop {
            let message = self.socket.read().unwrap_or_else(|error| panic!("{method}: {error}"));
            let answer: Value = serde_json::from_str(message.to_text().unwrap()).unwrap();
            if answer["id"] == self.calls {
                assert!(answer["error"].is_null(), "{call}: {answer}");
                return answer["result"].clone();
            }
            self.note(&answer);
        }
    }

    fn note(&mut self, event: &Value) {
        let parameters = &event["params"];
        match event["method"].as_str() {
            Some("Runtime.exceptionThrown") => self.faults.push(parameters.to_string()),
            Some("Log.entryAdded") if parameters["entry"]["level"] == "error" => {
                self.faults.push(parameters["entry"].to_string());
            }
            _ => (),
        }
    }

    pub(crate) fn resize(&mut self, [width, height]: [u32; 2]) {
        let parameters = json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": false});
        self.call("Emulation.setDeviceMetricsOverride", &parameters);
    }

    fn mouse(&mut self, kind: &str, [x, y]: [f64; 2], more: &Value) {
        let mut parameters = json!({"type": kind, "x": x, "y": y});
        parameters.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        self.call("Input.dispatchMouseEvent", &parameters);
    }

    /// Drags from `[x, y]` by `[dx, dy]` pixels with the button `left`, `middle` or `right`; a zero shift is
    /// a click.
    pub(crate) fn press(&mut self, button: &str, [x, y]: [f64; 2], [dx, dy]: [f64; 2]) {
        let buttons = match button {
            "left" => 1,
            "right" => 2,
            _ => 4,
        };
        let held = json!({"button": button, "buttons": buttons, "clickCount": 1});
        self.mouse("mousePressed", [x, y], &held);
        for step in 1..=3 {
            let share = f64::from(step) / 3.0;
            self.mouse("mouseMoved", [x + share * dx, y + share * dy], &held);
        }
        self.mouse("mouseReleased", [x + dx, y + dy], &json!({"button": button, "clickCount": 1}));
    }

    pub(crate) fn wheel(&mut self, place: [f64; 2], pixels: f64) {
        self.mouse("mouseWheel", place, &json!({"deltaX": 0, "deltaY": pixels}));
    }

    /// Touches the screen with each finger, moves all fingers from their first to their second positions, and
    /// releases them.
    pub(crate) fn touch(&mut self, fingers: &[[[f64; 2]; 2]]) {
        let points = |share: f64| -> Vec<Value> {
            let at =
                |[[x, y], [to_x, to_y]]: &[[f64; 2]; 2]| (x + share * (to_x - x), y + share * (to_y - y));
            fingers
                .iter()
                .enumerate()
                .map(|(id, finger)| (id, at(finger)))
                .map(|(id, (x, y))| json!({"id": id, "x": x, "y": y}))
                .collect()
        };
        let steps = (1..=4).map(|step| ("touchMove", points(0.25 * f64::from(step))));
        let all = std::iter::once(("touchStart", points(0.0))).chain(steps).chain([("touchEnd", Vec::new())]);
        for (kind, points) in all {
            self.call("Input.dispatchTouchEvent", &json!({"type": kind, "touchPoints": points}));
        }
    }

    /// Holds the key `code`, such as `ArrowLeft`, for some milliseconds.
    pub(crate) fn hold(&mut self, code: &str, milliseconds: u64) {
        self.key("keyDown", code);
        std::thread::sleep(Duration::from_millis(milliseconds));
        self.key("keyUp", code);
    }

    /// Sends a key event: `keyDown` or `keyUp`.
    pub(crate) fn key(&mut self, kind: &str, code: &str) {
        self.call("Input.dispatchKeyEvent", &json!({"type": kind, "code": code}));
    }

    /// Size of the page's JavaScript heap and array buffers after garbage collection, bytes.
    pub(crate) fn memory(&mut self) -> u64 {
        self.call("HeapProfiler.collectGarbage", &json!({}));
        let usage = self.call("Runtime.getHeapUsage", &json!({}));
        ["usedSize", "backingStorageSize"].iter().filter_map(|part| usage[part].as_f64()).sum::<f64>() as u64
    }

    /// Colours of the pixels in the rectangle `[x, y, width, height]` of the page, as sRGB codes.
    pub(crate) fn pixels(&mut self, [x, y, width, height]: [f64; 4]) -> Vec<[u8; 3]> {
        let clip = json!({"x": x, "y": y, "width": width, "height": height, "scale": 1});
        let shot = self.call("Page.captureScreenshot", &json!({"format": "png", "clip": clip}));
        decoded(&BASE64.decode(shot["data"].as_str().unwrap().as_bytes()).unwrap())
    }
}

impl Scripted for Tab {
    fn open(&mut self, address: &str) {
        self.call("Page.navigate", &json!({"url": address}));
    }

    fn value(&mut self, expression: &str) -> Value {
        let parameters = json!({"expression": expression, "awaitPromise": true, "returnByValue": true});
        let result = self.call("Runtime.evaluate", &parameters);
        assert!(result["exceptionDetails"].is_null(), "{expression}: {}", result["exceptionDetails"]);
        result["result"]["value"].clone()
    }

    fn faults(&self) -> &[String] {
        &self.faults
    }
}

impl Acting for Tab {
    fn press(&mut self, button: &str, from: [f64; 2], shift: [f64; 2]) {
        Self::press(self, button, from, shift);
    }

    fn scroll(&mut self, at: [f64; 2], pixels: f64) {
        self.wheel(at, pixels);
    }

    fn strike(&mut self, code: &str) {
        self.hold(code, 0);
    }
}

/// Colours of a PNG's pixels, without alpha, as sRGB codes.
pub(crate) fn decoded(png: &[u8]) -> Vec<[u8; 3]> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    let channels = info.line_size / info.width as usize;
    bytes.chunks(channels).map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect()
}
