//! Page of `photoncard view` in a headless Chromium. It shows the picture of `photoncard render`, whatever a
//! person does.

mod browser;
mod devices;
mod firefox;
mod latency;
mod lending;
mod lighting;
mod own_host;
mod person;
mod random;
mod server;

use std::time::Duration;

use crate::support::{Room, shipped};
use browser::{Browser, Scripted, Tab, decoded};
use person::{Person, SETTLED, darkness};
use serde_json::json;
use server::{View, run_shown, serve_page};

/// Options of a small picture with direct, indirect and caustic light.
const SMALL: [&str; 14] = [
    "--quality",
    "paper",
    "--size",
    "80x80",
    "--photons",
    "2000",
    "--gather-rays",
    "4",
    "--neighbors",
    "10",
    "--shadow-rays",
    "1",
    "--spp",
    "2",
];

/// Size of the browser's window, pixels; it is so narrow that the panel is below the picture.
const WINDOW: [u32; 2] = [360, 420];

/// Script that makes WebGL2 unavailable to a page.
const WITHOUT_WEBGL2: &str = "const get = HTMLCanvasElement.prototype.getContext; HTMLCanvasElement.prototype.getContext = \
     function (kind, ...rest) { return kind === 'webgl2' ? null : get.call(this, kind, ...rest); }";

/// Time limit of each wait, long enough for a busy machine.
const LIMIT: Duration = Duration::from_secs(150);

/// Opens the page of a new view, and waits for its final picture.
fn opened(browser: &mut Browser, view: &View) -> Tab {
    let mut tab = browser.tab(WINDOW);
    tab.open(&view.address);
    tab.wait(SETTLED, LIMIT);
    tab
}

/// Checks that the EXR saved by the page equals the one that the shown command line writes.
fn check_saved(room: &Room, tab: &mut Tab, name: &str) {
    let line = tab.save(name, "exr");
    run_shown(room, &line);
    let [saved, expected] = [&format!("out/{name}.exr"), "picture.exr"].map(|path| room.read(path));
    assert!(saved == expected, "{name}.exr differs from the picture of {line}");
}

#[test]
fn the_modules_of_the_page_pass_their_tests() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = View::start(&room, &shipped("cornell.gltf"), &SMALL);
    let mut tab = opened(&mut browser, &view);
    assert_eq!(tab.value(include_str!("units.js")), json!([]));
}

#[test]
fn the_settled_picture_equals_that_of_the_shown_command() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = View::start(&room, &shipped("cornell.gltf"), &SMALL);
    let mut tab = opened(&mut browser, &view);
    assert_eq!(tab.value("photoncard.display.kind"), "WebGL2");
    tab.check_walls();
    check_saved(&room, &mut tab, "first");

    // A drag turns the camera, and the view settles to another picture.
    let [before, place] =
        ["photoncard.state.version", "photoncard.state.camera.position"].map(|of| tab.value(of));
    tab.drag("left", [0.5, 0.5], [60.0, 20.0]);
    tab.wait(&format!("photoncard.state.version > {before}"), LIMIT);
    tab.wait(SETTLED, LIMIT);
    assert_ne!(tab.value("photoncard.state.camera.position"), place);
    check_saved(&room, &mut tab, "turned");
    assert_eq!(tab.faults, [""; 0]);
}

/// Compares pictures drawn by the shader and, without WebGL2, by the processor.
#[test]
fn the_colours_on_the_screen_equal_those_of_the_png() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = View::start(&room, &shipped("cornell.gltf"), &SMALL);
    for (kind, script) in [("WebGL2", ""), ("2D canvas", WITHOUT_WEBGL2)] {
        let mut tab = browser.tab(WINDOW);
        tab.call("Page.addScriptToEvaluateOnNewDocument", &json!({"source": script}));
        tab.open(&view.address);
        tab.wait(SETTLED, LIMIT);
        tab.take_over();
        assert_eq!(tab.value("photoncard.display.kind"), kind);
        tab.fill_window();
        for (curve, exposure) in [("reinhard", None), ("aces", None), ("none", Some(-1.5))] {
            tab.choose("curve", curve);
            tab.expose(exposure);
            let name = format!("{curve}-{}", &kind[..2]);
            let line = tab.save(&name, "png");
            let png = room.read(&format!("out/{name}.png"));
            if line.ends_with(&format!("--tonemap {curve}")) {
                run_shown(&room, &line);
                assert!(png == room.read("picture.png"), "{name}.png differs from the picture of {line}");
            }
            let [shown, saved] = [tab.shown(), decoded(&png)];
            assert_eq!(shown.len(), saved.len());
            // The exponentiation of GPUs and browsers differs from the host's in the last bits.
            let differences =
                shown.as_flattened().iter().zip(saved.as_flattened()).map(|(a, b)| a.abs_diff(*b));
            assert!(differences.clone().all(|difference| difference <= 1), "{name}: {:?}", differences.max());
        }
        assert_eq!(tab.faults, [""; 0]);
        tab.call("Page.close", &json!({}));
    }
}

#[test]
fn a_light_that_is_switched_off_darkens_the_picture() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    room.write_scene("two-lights.gltf", &person::two_lights());
    let view = View::start(&room, "two-lights.gltf", &SMALL);
    let mut tab = opened(&mut browser, &view);
    tab.expose(Some(0.0));
    let lit = darkness(&tab.shown());
    // One switch is that of the lamp's emission, the other that of a point light's intensity.
    for light in ["light", "bulb"] {
        tab.switch(light);
        tab.wait(SETTLED, LIMIT);
        let dark = darkness(&tab.shown());
        assert!(dark > lit + 5.0, "{light}: {dark} {lit}");
        check_saved(&room, &mut tab, light);
        tab.switch(light);
        tab.wait(SETTLED, LIMIT);
        assert_eq!(darkness(&tab.shown()), lit, "{light}");
    }
}

/// The panel shows the properties that a material has, and the thickness once the material transmits light.
#[test]
fn a_material_becomes_glass() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let options = [&SMALL[..], &["--caustic-photons", "2000"]].concat();
    let view = View::start(&room, &shipped("cornell-spheres.glb"), &options);
    let mut tab = opened(&mut browser, &view);
    assert_eq!(
        tab.labels("white"),
        ["Alpha", "Diffuse", "Emission", "Strength, W/(sr m²)", "Exponent", "Specular"]
    );
    let of_glass = ["Index of refraction", "Metallic", "Roughness", "Transmission"];
    assert_eq!(tab.labels("mirror")[4..], of_glass);
    for (label, value) in [("Metallic", 0.0), ("Transmission", 0.5)] {
        tab.set_material("mirror", label, value);
        tab.wait(SETTLED, LIMIT);
    }
    assert_eq!(tab.labels("mirror")[7..], ["Solid, not a thin wall", "Transmission"]);
    for (label, value) in
        [("Solid, not a thin wall", 1.0), ("Transmission", 1.0), ("Index of refraction", 2.5)]
    {
        tab.set_material("mirror", label, value);
        tab.wait(SETTLED, LIMIT);
    }
    let changes = "photoncard.state.changes.map(({name, value}) => `${name}=${value}`).join(' ')";
    let expected = "mirror.metallic=0 mirror.transmission=1 mirror.thickness=1 mirror.ior=2.5";
    assert_eq!(tab.value(changes), expected);
    check_saved(&room, &mut tab, "glass");
}

#[test]
fn only_one_of_two_pages_steers() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = View::start(&room, &shipped("cornell.gltf"), &SMALL);
    let mut first = opened(&mut browser, &view);
    let mut second = opened(&mut browser, &view);
    let camera = "JSON.stringify(photoncard.state.camera)";
    let before = first.value(camera);
    second.drag("left", [0.5, 0.5], [60.0, 20.0]);
    first.drag("left", [0.5, 0.5], [-30.0, 10.0]);
    first.wait(&format!("{camera} !== '{}'", before.as_str().unwrap()), LIMIT);
    first.wait(SETTLED, LIMIT);
    let after = first.value(camera);
    second.wait(&format!("{camera} === '{}' && {SETTLED}", after.as_str().unwrap()), LIMIT);
    let pixels = "photoncard.picture.data.filter((_, part) => part % 4 < 3).join()";
    assert!(first.value(pixels) == second.value(pixels), "the pages show different pictures");

    second.take_over();
    first.wait("!document.getElementById('spectator').hidden", LIMIT);
    second.drag("left", [0.5, 0.5], [60.0, 20.0]);
    first.wait(&format!("{camera} !== '{}'", after.as_str().unwrap()), LIMIT);
}

/// The reset also moves the page's own camera, and the next move starts there.
#[test]
fn undoing_all_changes_takes_the_camera_back() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = View::start(&room, &shipped("cornell.gltf"), &SMALL);
    let mut tab = opened(&mut browser, &view);
    let [own, known] =
        ["view", "state"].map(|part| format!("JSON.stringify(photoncard.{part}.camera.position)"));
    let start = tab.value(&known);
    let start = start.as_str().unwrap();

    // A camera of the file can be chosen again once a drag has left it.
    tab.choose("camera", "0");
    assert_eq!(tab.value("document.getElementById('camera').value"), "0");
    tab.drag("left", [0.5, 0.5], [60.0, 20.0]);
    tab.wait(&format!("{known} !== '{start}' && {SETTLED}"), LIMIT);
    assert_eq!(tab.value("document.getElementById('camera').value"), "");

    tab.choose("layer", "direct");
    tab.wait(&format!("photoncard.state.settings.layers !== 'albedo,N,Z' && {SETTLED}"), LIMIT);
    tab.value("document.getElementById('reset').click()");
    tab.wait(&format!("{known} === '{start}' && {SETTLED}"), LIMIT);
    assert_eq!(tab.value(&own), start);
    assert_eq!(tab.value("photoncard.picture.data.some((value, part) => part % 4 < 3 && value > 0)"), true);

    // If the command refuses a camera, the page returns to the camera before.
    tab.value("photoncard.view.move({ position: [0, 0, 1e16], look_at: [0, 0, 0], fov: 40 }, false)");
    tab.wait(&format!("{own} === '{start}'"), LIMIT);
    let fov = "document.getElementById('fov').value";
    let before = tab.value(fov);
    tab.choose("fov", "200");
    assert_eq!(tab.value(fov), before);
    assert_eq!(tab.faults, [""; 0]);
}

/// A page of another origin has the token, and is refused all the same.
#[test]
fn a_page_of_another_origin_is_refused() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = View::start(&room, &shipped("cornell.gltf"), &SMALL);
    let page = format!(
        "<script>const socket = new WebSocket('{}'); socket.onopen = () => document.title = 'open'; \
         socket.onerror = () => document.title ||= 'refused';</script>",
        view.socket()
    );
    let mut tab = browser.tab(WINDOW);
    tab.open(&serve_page(page));
    tab.wait("document.title", LIMIT);
    assert_eq!(tab.value("document.title"), "refused");
    // The view goes on, and its own page connects.
    opened(&mut browser, &view);
}

/// Maximum growth of the page's memory after many actions, bytes: a small picture and the last measured
/// times.
const MAX_PAGE: u64 = 8 << 20;
/// Maximum growth of the command's memory after many actions, bytes: tiles of two pictures and three films,
/// each of 700x500 pixels (the largest window) with all layers.
const MAX_COMMAND: u64 = 5 * 700 * 500 * 112;

fn check_memory((whose, after, before): (&str, u64, u64), limit: u64) {
    assert!(after <= before + limit, "the {whose} holds {after} bytes, and held {before}");
}

#[test]
fn two_hundred_random_actions_end_at_the_exact_picture() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    room.write_scene("two-lights.gltf", &person::two_lights());
    let mut cards = random::Card::start(&room);
    let remote = cards.address();
    let options = [&SMALL[..], &["--card", "emulated:1", "--card", &remote]].concat();
    let view = View::start(&room, "two-lights.gltf", &options);
    let mut tab = opened(&mut browser, &view);
    let (page, command) = (tab.memory(), view.memory());
    random::act(&room, &mut tab, &mut cards, 200);
    tab.choose("layer", "radiance");
    tab.wait(SETTLED, LIMIT);
    check_saved(&room, &mut tab, "last");
    check_memory(("page", tab.memory(), page), MAX_PAGE);
    if let (Some(after), Some(before)) = (view.memory(), command) {
        check_memory(("command", after, before), MAX_COMMAND);
    }
    // The browser reports the WebSockets that were closed as errors.
    tab.faults.retain(|fault| !fault.contains("WebSocket"));
    assert_eq!(tab.faults, [""; 0]);
}
