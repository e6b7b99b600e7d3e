//! Connections to a view: who may connect, what they may send, and how many there are.

use std::net::TcpStream;

use serde_json::json;
use tungstenite::Message;

use super::page::{View, camera};
use super::small_view;
use crate::support::Room;

#[test]
fn pages_of_other_sites_are_refused() {
    let room = Room::new();
    let view = small_view(&room, &[]);
    let View { host, token, .. } = &view;
    let socket = format!("/socket?token={token}");
    let own = format!("http://{host}");
    for (target, host, origin) in [
        (&*socket, host.as_str(), Some("http://evil.example")),
        (&*socket, host, Some("null")),
        (&*socket, host, None),
        (&*socket, "evil.example", Some("http://evil.example")),
        (&*socket, "evil.example", Some(own.as_str())),
        ("/socket?token=00000000000000000000000000000000", host, Some(&own)),
        ("/socket", host, Some(&own)),
    ] {
        assert_eq!(view.try_connect(target, host, origin).err(), Some(403), "{target} {host} {origin:?}");
    }
    let page = format!("/?token={token}");
    assert_eq!(view.get(&page, "evil.example").0, 403);
    assert_eq!(view.get("/", host).0, 403);
    assert_eq!(view.get("/index.html", host).0, 403);
    let (status, text) = view.get(&page, host);
    assert!(status == 200 && text.contains("main.js"), "{text}");
    for header in [
        "Content-Security-Policy: default-src 'self'",
        "Referrer-Policy: no-referrer",
        "Cache-Control: no-store",
    ] {
        assert!(text.contains(header), "{header}: {text}");
    }
    assert_eq!(view.get("/main.js", host).0, 200);
    assert_eq!(view.get("/../../Cargo.toml", host).0, 404);
    view.connect().wait_for("hello");
}

#[test]
fn hostile_messages_are_answered_or_end_their_connection_alone() {
    let room = Room::new();
    std::fs::create_dir(room.path("out")).unwrap();
    room.write("secret.exr", "secret");
    let view = small_view(&room, &["--out", "out"]);
    let mut page = view.connect();
    page.settle();
    for message in [
        json!({}),
        json!({"type": "camera", "position": [0, 0, 1e300], "look_at": [0, 0, 0], "fov": 40, "moving": false}),
        json!({"type": "camera", "position": [1, 1, 1], "look_at": [1, 1, 1], "fov": 40, "moving": false}),
        json!({"type": "set", "name": "floor.diffuse", "value": 1e30}),
        json!({"type": "set", "name": "floor.diffuse=1;rm -rf", "value": 1}),
        json!({"type": "setting", "name": "photons", "value": 0}),
        json!({"type": "setting", "name": "photons", "value": 4_000_000_000_u64}),
        json!({"type": "size", "size": [1_000_000, 1_000_000]}),
        json!({"type": "save", "name": "../secret.exr"}),
        json!({"type": "save", "name": "/tmp/a.exr"}),
        json!({"type": "save", "name": "a.sh"}),
        json!({"type": "drop", "name": "../sky.hdr", "bytes": 9}),
        json!({"type": "drop", "name": "sky.hdr", "bytes": 1_u64 << 40}),
        json!({"type": "turn", "degrees": 1e9}),
    ] {
        page.send(&message);
        let error = page.wait_for("error");
        assert!(error["text"].as_str().is_some_and(|text| !text.is_empty()), "{message}: {error}");
    }
    for raw in [
        Message::text("no JSON"),
        Message::text("[".repeat(60_000)),
        Message::text(json!({"type": "save", "name": "a".repeat(80_000)}).to_string()),
        Message::binary(vec![0; 100]),
    ] {
        let mut foe = view.connect();
        foe.wait_for("hello");
        foe.send_raw(raw);
        foe.wait_for_end();
    }
    page.send(&camera(0.2, false));
    page.settle();
    assert_eq!(room.names(), ["out", "scene.gltf", "secret.exr"]);
    assert_eq!(room.read("secret.exr"), b"secret");
    assert_eq!(std::fs::read_dir(room.path("out")).unwrap().count(), 0);
}

/// A view accepts 16 connections. A page that closes its connection frees its place at once, before the view
/// sends it any message.
#[test]
fn pages_that_have_gone_free_their_places() {
    let room = Room::new();
    let view = small_view(&room, &[]);
    view.connect().settle();
    for _ in 0..40 {
        let mut page = view.connect();
        page.wait("state", |state| state["settled"] == true);
        page.leave();
    }
}

/// More silent connections than a view accepts neither close a page's connection nor keep the next page out.
#[test]
fn silent_connections_do_not_exclude_pages() {
    let room = Room::new();
    let view = small_view(&room, &[]);
    let mut page = view.connect();
    page.settle();
    let silent: Vec<TcpStream> =
        (0..40).map(|_| TcpStream::connect(&view.host).expect("the server listens")).collect();
    view.connect().settle();
    page.send(&camera(0.2, false));
    page.settle();
    drop(silent);
}
