//! Headless Firefox, driven by `WebDriver BiDi`.

use std::net::TcpStream;
use std::process::{Child, Command, Stdio};

use serde_json::{Value, json};
use tempfile::TempDir;
use tungstenite::{Message, WebSocket};

use super::browser::{Acting, PATIENCE, Scripted, announced};
use crate::support::skip;

/// Names of Firefox's program, in order of preference.
const PROGRAMS: [&str; 2] = ["firefox", "firefox-esr"];

/// Process of a browser with an empty profile and one tab. Dropping it ends the process.
pub(crate) struct Firefox {
    process: Child,
    socket: WebSocket<TcpStream>,
    calls: u64,
    tab: String,
    _profile: TempDir,
}

impl Firefox {
    /// Starts Firefox. Returns `None`, and prints why, if the tests are to be skipped.
    pub(crate) fn start() -> Option<Self> {
        if let Ok(reason) = std::env::var("PHOTONCARD_SKIP_FIREFOX") {
            skip(&format!("Firefox is not tested, as PHOTONCARD_SKIP_FIREFOX is set: {reason}"));
            return None;
        }
        let profile = tempfile::tempdir().unwrap();
        let mut process = PROGRAMS.iter().find_map(|program| launch(program, &profile)).expect(
            "there is no Firefox; install it (apt-get install firefox-esr), or leave its test out by setting \
             PHOTONCARD_SKIP_FIREFOX to the reason",
        );
        let address = announced(&mut process, "WebDriver BiDi listening on ");
        let stream = TcpStream::connect(address.trim_start_matches("ws://")).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let (socket, _) = tungstenite::client(format!("{address}/session"), stream).unwrap();
        let mut this = Self { process, socket, calls: 0, tab: String::new(), _profile: profile };
        this.call("session.new", &json!({"capabilities": {}}));
        let tab = this.call("browsingContext.create", &json!({"type": "tab"}));
        tab["context"].as_str().unwrap().clone_into(&mut this.tab);
        Some(this)
    }

    /// Performs actions of an input source of the kind `kind`.
    fn perform(&mut self, kind: &str, actions: &Value) {
        let source = json!({"type": kind, "id": kind, "actions": actions});
        self.call("input.performActions", &json!({"context": self.tab, "actions": [source]}));
    }

    fn call(&mut self, method: &str, parameters: &Value) -> Value {
        self.calls += 1;
        let call = json!({"id": self.calls, "method": method, "params": parameters});
        self.socket.send(Message::text(call.to_string())).unwrap();
        loop {
            let message = self.socket.read().unwrap_or_else(|error| panic!("{method}: {error}"));
            let Message::Text(text) = message else { continue };
            let answer: Value = serde_json::from_str(&text).unwrap();
            if answer["id"] == self.calls {
                assert_eq!(answer["type"], "success", "{call}: {answer}");
                return answer["result"].clone();
            }
        }
    }
}

impl Scripted for Firefox {
    fn open(&mut self, address: &str) {
        let tab = self.tab.clone();
        self.call("browsingContext.navigate", &json!({"context": tab, "url": address, "wait": "complete"}));
    }

    fn value(&mut self, expression: &str) -> Value {
        let wrapped = format!("Promise.resolve({expression}).then(value => JSON.stringify(value ?? null))");
        let target = json!({"context": self.tab});
        let parameters = json!({"expression": wrapped, "target": target, "awaitPromise": true});
        let answer = self.call("script.evaluate", &parameters);
        assert_eq!(answer["type"], "success", "{expression}: {answer}");
        serde_json::from_str(answer["result"]["value"].as_str().unwrap()).unwrap()
    }
}

impl Acting for Firefox {
    fn press(&mut self, button: &str, [x, y]: [f64; 2], [across, down]: [f64; 2]) {
        let button = ["left", "middle", "right"].iter().position(|name| *name == button);
        let to = |x: f64, y: f64| json!({"type": "pointerMove", "x": x.round(), "y": y.round()});
        let steps = [
            to(x, y),
            json!({"type": "pointerDown", "button": button}),
            to(x + 0.5 * across, y + 0.5 * down),
            to(x + across, y + down),
            json!({"type": "pointerUp", "button": button}),
        ];
        self.perform("pointer", &json!(steps));
    }

    fn scroll(&mut self, [x, y]: [f64; 2], pixels: f64) {
        let turn =
            json!({"type": "scroll", "x": x.round(), "y": y.round(), "deltaX": 0, "deltaY": pixels.round()});
        self.perform("wheel", &json!([turn]));
    }

    fn strike(&mut self, code: &str) {
        // WebDriver, section 17.4.2: keys without a character have code points of the private use area.
        let value = match code {
            "ArrowLeft" => "\u{e012}".to_owned(),
            "ArrowUp" => "\u{e013}".to_owned(),
            letter => letter.trim_start_matches("Key").to_lowercase(),
        };
        let steps = ["keyDown", "keyUp"].map(|kind| json!({"type": kind, "value": value}));
        self.perform("key", &json!(steps));
    }
}

impl Drop for Firefox {
    fn drop(&mut self) {
        // Both calls fail if the process has ended already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn launch(program: &str, profile: &TempDir) -> Option<Child> {
    let mut command = Command::new(program);
    command.args(["--headless", "--no-remote", "--remote-debugging-port=0", "--profile"]);
    command.arg(profile.path()).env("HOME", profile.path());
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().ok()
}
