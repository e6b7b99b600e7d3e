//! The page whose host runs in the browser, served as plain files.

use std::ffi::{OsStr, OsString};
use std::path::Path;
use std::time::Duration;

use data_encoding::BASE64;

use super::browser::{Acting, Browser, Scripted, Tab};
use super::firefox::Firefox;
use super::person::{Person, SETTLED, two_lights};
use super::random::act_with_own_host;
use super::server::{FileServer, run_shown};
use crate::support::{Room, scene, shipped, skip};

/// Time limit of a picture: the host's work is on one core, and not optimised for this machine.
const LIMIT: Duration = Duration::from_secs(150);

/// Options of a small picture of which no setting is left to pilot renders.
const SMALL: &str =
    "--quality paper --size 80x80 --photons 2000 --gather-rays 4 --neighbors 10 --shadow-rays 1 --spp 2";

/// WebAssembly module that browsers run; `None`, with a message, if there is none.
pub(super) fn module() -> Option<OsString> {
    let module = std::env::var_os("PHOTONCARD_TEST_MODULE");
    if module.is_none() {
        skip(
            "hosts and cards in a browser: PHOTONCARD_TEST_MODULE names no module, which host-cli/module.sh FILE builds",
        );
    }
    module
}

/// Writes the page into the folder `site`; `None` if there is no module.
fn site(room: &Room) -> Option<FileServer> {
    site_of(room, &[&shipped("cornell.gltf"), &shipped("room.glb")])
}

/// Writes the page with scenes of its own into the folder `site`; `None` if there is no module.
fn site_of(room: &Room, scenes: &[&str]) -> Option<FileServer> {
    let module = module()?;
    let mut command = room.command();
    command.args(["page", "site"]);
    for scene in scenes {
        command.args(["--scene", scene]);
    }
    command.arg("--module").arg(module);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(FileServer::start(room.path("site")))
}

/// Opens the page, which shows its scenes to choose.
fn start(browser: &mut Browser, server: &FileServer) -> Tab {
    let mut tab = browser.tab([900, 600]);
    tab.open(&server.address);
    tab.wait("document.querySelectorAll('#start-scenes button').length === 2", LIMIT);
    tab
}

/// Opens the picture of a command line by the page's address.
fn open(tab: &mut impl Scripted, server: &FileServer, line: &str) {
    tab.open("about:blank");
    let encoded: String = line.bytes().map(|byte| format!("%{byte:02X}")).collect();
    tab.open(&format!("{}#{encoded}", server.address));
}

/// Downloads the settled picture as an EXR, and returns its bytes.
fn downloaded(tab: &mut impl Scripted) -> Vec<u8> {
    tab.value(
        "(() => { window.taken = null; URL.createObjectURL = blob => { blob.arrayBuffer().then(bytes => \
         window.taken = btoa(Array.from(new Uint8Array(bytes), byte => String.fromCharCode(byte)).join(''))); return 'blob:none'; }; \
         HTMLAnchorElement.prototype.click = () => { }; return 0; })()",
    );
    tab.value("document.getElementById('save-exr').click()");
    tab.wait("window.taken", LIMIT);
    BASE64.decode(tab.value("window.taken").as_str().unwrap().as_bytes()).unwrap()
}

/// Checks that the downloaded EXR equals the one that the shown command line writes.
fn check_shown(room: &Room, tab: &mut impl Scripted) {
    tab.wait(SETTLED, LIMIT);
    let line = tab.value("document.getElementById('command').textContent");
    let line = line.as_str().unwrap();
    let saved = downloaded(tab);
    run_shown(room, line);
    assert!(saved == room.read("picture.exr"), "the downloaded picture differs from that of {line}");
}

#[test]
fn a_page_with_its_own_host_settles_to_the_picture_of_the_shown_command() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let Some(server) = site(&room) else { return };
    std::fs::create_dir_all(room.path("scenes")).unwrap();
    for name in ["cornell.gltf", "room.glb"] {
        std::fs::copy(shipped(name), room.path(&format!("scenes/{name}"))).unwrap();
    }
    let mut tab = browser.tab([900, 600]);
    open(&mut tab, &server, &format!("photoncard render scenes/cornell.gltf {SMALL}"));
    check_shown(&room, &mut tab);
    tab.check_walls();

    // A change of light, as on every page.
    tab.value("photoncard.connection.send({type: 'set', name: 'light.emission', value: 3})");
    tab.wait("photoncard.state.version > 1", LIMIT);
    check_shown(&room, &mut tab);

    open(&mut tab, &server, &format!("photoncard render scenes/room.glb {SMALL}"));
    check_shown(&room, &mut tab);
    assert_eq!(tab.faults, Vec::<String>::new());
}

/// Checks small pictures of scenes in Firefox.
fn check_in_firefox(scenes: &[&str], options: &str) {
    let Some(mut firefox) = Firefox::start() else { return };
    let room = Room::new();
    let Some(server) = site_of(&room, scenes) else { return };
    std::fs::create_dir_all(room.path("scenes")).unwrap();
    for scene in scenes {
        let name = Path::new(scene).file_name().and_then(OsStr::to_str).unwrap();
        std::fs::copy(scene, room.path(&format!("scenes/{name}"))).unwrap();
        open(&mut firefox, &server, &format!("photoncard render scenes/{name} {SMALL} {options}"));
        check_shown(&room, &mut firefox);
    }
}

#[test]
fn firefox_settles_to_the_same_picture() {
    check_in_firefox(&[&shipped("cornell.gltf"), &shipped("room.glb")], "");
}

#[test]
#[ignore = "PHOTONCARD_TEST_SCENE names a glb without lights, such as that of tests/peers/page.sh"]
fn firefox_settles_to_the_same_picture_of_a_file_of_others() {
    check_in_firefox(&[&std::env::var("PHOTONCARD_TEST_SCENE").unwrap()], "--environment 0.5,0.5,0.5");
}

/// Performs 500 random actions on a scene with two lights, and checks the picture that they end at.
fn check_random_actions(tab: &mut impl Acting) {
    let room = Room::new();
    std::fs::create_dir_all(room.path("scenes")).unwrap();
    room.write_scene("scenes/two-lights.gltf", &two_lights());
    let Some(server) = site_of(&room, &["scenes/two-lights.gltf"]) else { return };
    open(tab, &server, &format!("photoncard render scenes/two-lights.gltf {SMALL}"));
    tab.wait(SETTLED, LIMIT);
    act_with_own_host(tab, 500);
    // The last move of the camera may have been undone by a reset.
    tab.press("left", [200.0, 250.0], [30.0, 10.0]);
    tab.wait(SETTLED, LIMIT);
    let line = tab.value("document.getElementById('command').textContent");
    assert!(["--camera-at", "--set"].iter().all(|flag| line.as_str().unwrap().contains(flag)), "{line}");
    check_shown(&room, tab);
}

#[test]
fn five_hundred_random_actions_on_a_page_with_its_own_host_end_at_the_exact_picture() {
    let Some(mut browser) = Browser::start() else { return };
    let mut tab = browser.tab([900, 600]);
    check_random_actions(&mut tab);
    assert_eq!(tab.faults, Vec::<String>::new());
}

#[test]
fn five_hundred_random_actions_in_firefox_end_at_the_exact_picture() {
    let Some(mut firefox) = Firefox::start() else { return };
    check_random_actions(&mut firefox);
}

#[test]
fn a_page_with_its_own_host_works_without_a_network() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let Some(server) = site(&room) else { return };
    let line = format!("photoncard render scenes/cornell.gltf {SMALL}");
    let mut tab = browser.tab([900, 600]);
    open(&mut tab, &server, &line);
    tab.wait("navigator.serviceWorker.controller", LIMIT);
    tab.wait(SETTLED, LIMIT);
    server.end();
    open(&mut tab, &server, &line);
    tab.wait(SETTLED, LIMIT);
}

#[test]
fn what_a_page_ignores_of_a_scene_is_told() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let Some(server) = site(&room) else { return };
    let mut tab = start(&mut browser, &server);
    let mut scene = scene();
    scene["extensionsUsed"].as_array_mut().unwrap().push("EXT_unknown".into());
    tab.value(&format!("photoncard.start.take([['a.gltf', new File([{:?}], 'a.gltf')]])", scene.to_string()));
    let notices = "document.getElementById('notices')";
    tab.wait(&format!("!{notices}.hidden"), LIMIT);
    let told = tab.value(&format!("{notices}.textContent"));
    assert!(told.as_str().unwrap().contains("the extension EXT_unknown is ignored"), "{told}");
    // Another scene has notices of its own.
    tab.value("document.querySelector('#start-scenes button').click()");
    tab.wait(&format!("{notices}.hidden"), LIMIT);
}

#[test]
fn faults_end_in_a_sentence_and_the_page_goes_on() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let Some(server) = site(&room) else { return };
    let mut tab = start(&mut browser, &server);
    let reason = "document.getElementById('start-reason').textContent.toLowerCase()";
    for (name, text, expected) in [
        ("broken.glb", "no glTF at all", "broken.glb"),
        ("notes.txt", "x", "none of these files is a scene"),
        ("scene.zip", "no archive", "no zip archive"),
        (
            "lost.gltf",
            r#"{"asset":{"version":"2.0"},"buffers":[{"uri":"lost.bin","byteLength":4}],"bufferViews":[]}"#,
            "lost",
        ),
    ] {
        tab.value(&format!("photoncard.start.take([[{name:?}, new File([{text:?}], {name:?})]])"));
        tab.wait(&format!("{reason}.includes({expected:?})"), LIMIT);
    }
    // Another scene is still possible, and a lost host is told of.
    open(&mut tab, &server, &format!("photoncard render scenes/cornell.gltf {SMALL}"));
    tab.wait(SETTLED, LIMIT);
    tab.value("photoncard.connection.drop()");
    tab.wait(&format!("{reason}.includes('was ended')"), LIMIT);
    tab.value("document.querySelector('#start-scenes button').click()");
    tab.wait("window.photoncard.state", LIMIT);
}

#[test]
fn a_folder_with_other_files_is_not_written() {
    let room = Room::new();
    std::fs::create_dir(room.path("site")).unwrap();
    room.write("site/mine.txt", b"mine");
    let outcome = room.run(&["page", "site", "--module", "none.wasm"]);
    assert_eq!(outcome.status, Some(2), "{}", outcome.stderr);
    room.write("none.wasm", b"no module");
    let outcome = room.run(&["page", "site", "--module", "none.wasm"]);
    assert!(outcome.stderr.contains("is no WebAssembly module"), "{}", outcome.stderr);
    room.write("module.wasm", b"\0asm");
    let outcome = room.run(&["page", "site", "--module", "module.wasm"]);
    assert!(outcome.stderr.contains("has other files"), "{}", outcome.stderr);
    for (name, bytes, expected) in [
        ("a.glb", &b"no scene"[..], "is no glTF file"),
        ("a.gltf", br#"{"buffers":[{"uri":"a.bin"}]}"#, "names other files"),
        ("b.glb", b"glTF\x02\0\0\0\xff\0\0\0\xff\0\0\0JSON{}", "is no glTF file"),
    ] {
        room.write(name, bytes);
        let outcome = room.run(&["page", "new", "--module", "module.wasm", "--scene", name]);
        assert!(outcome.status == Some(2) && outcome.stderr.contains(expected), "{name}: {}", outcome.stderr);
    }
    assert!(room.run(&["page", "new", "--module", "module.wasm"]).status == Some(0));
    assert!(Path::new(&room.path("new/index.html")).is_file());
}

#[test]
fn a_page_that_is_written_again_has_its_own_files_alone() {
    let room = Room::new();
    room.write("module.wasm", b"\0asm");
    room.write("kept.txt", b"mine");
    for name in ["a.gltf", "b.gltf"] {
        room.write(name, b"{}");
        assert!(
            room.run(&["page", "site", "--module", "module.wasm", "--scene", name]).status == Some(0),
            "{name}"
        );
        room.write("site/mine.txt", b"mine");
    }
    assert!(!room.path("site/scenes/a.gltf").exists() && room.path("site/scenes/b.gltf").is_file());
    // A list that was changed names no file of others.
    room.write("site/files.json", br#"["./", "../kept.txt", "/kept.txt", "scenes"]"#);
    assert!(room.run(&["page", "site", "--module", "module.wasm"]).status == Some(0));
    assert!(room.path("kept.txt").is_file() && room.path("site/mine.txt").is_file());
}
