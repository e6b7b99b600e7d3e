//! Page in a furnished room, as people who light it or look for a camera use it.

use serde_json::{Value, json};

use super::browser::{Browser, Scripted, Tab};
use super::person::{Person, SETTLED};
use super::server::{View, run_shown};
use super::{LIMIT, SMALL, WINDOW, opened};
use crate::support::{Room, shipped};

fn room_view(room: &Room) -> View {
    View::start(room, &shipped("room.glb"), &SMALL)
}

fn text(tab: &mut Tab, id: &str) -> String {
    tab.value(&format!("document.getElementById('{id}').textContent")).as_str().unwrap().to_owned()
}

fn is_hidden(tab: &mut Tab, id: &str) -> bool {
    tab.value(&format!("document.getElementById('{id}').hidden")) == true
}

/// Presses a key on the picture; 2 is control and 8 is shift in `modifiers`.
fn press_key(tab: &mut Tab, key: &str, modifiers: u32) {
    tab.value("document.getElementById('picture').focus()");
    for kind in ["keyDown", "keyUp"] {
        tab.call("Input.dispatchKeyEvent", &json!({"type": kind, "key": key, "modifiers": modifiers}));
    }
}

/// Strength of the first lamp, as typed into its field.
fn brighten(tab: &mut Tab, strength: f64) {
    let version = tab.value("photoncard.state.version");
    tab.value(&format!(
        "(field => {{ field.value = {strength}; field.dispatchEvent(new Event('input', {{bubbles: true}})); }})\
         (document.querySelector('#lights input[type=number]'))"
    ));
    tab.wait(&format!("photoncard.state.version > {version} && {SETTLED}"), LIMIT);
}

/// However far a drag turns the camera, it ends inside, and the page says why. It can be let out, and goes
/// back.
#[test]
fn the_camera_stays_in_the_room_and_goes_back() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = room_view(&room);
    let mut tab = opened(&mut browser, &view);
    let low: [f64; 3] = serde_json::from_value(tab.value("photoncard.scene.low")).unwrap();
    let high: [f64; 3] = serde_json::from_value(tab.value("photoncard.scene.high")).unwrap();
    let is_inside = |place: [f64; 3]| (0..3).all(|axis| low[axis] < place[axis] && place[axis] < high[axis]);
    let start = tab.position();
    let mut places = vec![start];
    for shift in [[80.0, 0.0], [160.0, 30.0], [-250.0, -60.0]] {
        tab.drag("left", [0.4, 0.4], shift);
        places.push(tab.position());
    }
    assert!(text(&mut tab, "hint").contains("wall"), "the page does not say why it stays");
    assert!(places.windows(2).all(|pair| pair[0] != pair[1]), "{places:?}");
    tab.hold("KeyS", 300);
    tab.wait(SETTLED, LIMIT);
    places.push(tab.position());
    assert!(places.iter().all(|place| is_inside(*place)), "{places:?}");
    assert!(tab.value("photoncard.picture.data.some((value, part) => part % 4 < 3 && value > 0)") == true);

    for _ in 1..places.len() {
        press_key(&mut tab, "z", 2);
    }
    assert_eq!(tab.position(), start);
    assert_eq!(tab.value("document.getElementById('undo').disabled"), true);
    press_key(&mut tab, "Z", 10);
    assert_eq!(tab.position(), places[1]);
    tab.click("undo");

    tab.click("inside");
    tab.drag("left", [0.4, 0.4], [80.0, 0.0]);
    let outside = tab.position();
    assert!(!is_inside(outside), "{outside:?}");
    assert_eq!(tab.faults, [""; 0]);
}

/// A lamp that is three times as bright looks brighter, and the PNG that the page shows has that exposure.
#[test]
fn the_exposure_stays_while_a_light_is_edited() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = room_view(&room);
    let mut tab = opened(&mut browser, &view);
    let code = "photoncard.exposure.of('radiance', photoncard.picture, true).scale";
    let scale = tab.value(code).as_f64().unwrap();
    assert!(is_hidden(&mut tab, "held"));
    brighten(&mut tab, 42.0);
    let held = tab.value(code).as_f64().unwrap();
    assert!((held / scale - 1.0).abs() < 1e-5, "{held} {scale}");
    assert!(!is_hidden(&mut tab, "held"));
    let line = tab.save("bright", "png");
    assert!(line.contains(" --exposure "), "{line}");
    run_shown(&room, &line);
    assert!(room.read("out/bright.png") == room.read("picture.png"), "{line}");
    tab.expose(None);
    let measured = tab.value(code).as_f64().unwrap();
    assert!(measured < 0.9 * held, "{measured} {held}");
    // Another edit holds it again, and the reset lets it go.
    brighten(&mut tab, 14.0);
    tab.click("reset");
    assert_eq!(tab.value("document.getElementById('automatic').checked"), true);
}

/// A kept picture stays over the present one up to the line, at any zoom.
#[test]
fn a_kept_picture_is_compared_with_another_one() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = room_view(&room);
    let mut tab = opened(&mut browser, &view);
    tab.expose(Some(0.0));
    tab.value("document.getElementById('compare').style.visibility = 'hidden'");
    let before = tab.shown();
    tab.click("keep");
    tab.choose("split", "100");
    tab.value("document.getElementById('edge').style.visibility = 'hidden'");
    brighten(&mut tab, 100.0);
    assert!(tab.shown() == before, "the kept picture covers the present one");
    tab.choose("split", "0");
    let bright = tab.shown();
    assert!(bright != before);
    tab.choose("split", "50");
    assert!(![&before, &bright].contains(&&tab.shown()));
    tab.click("drop-kept");
    assert!(tab.shown() == bright && is_hidden(&mut tab, "kept"));
    assert_eq!(tab.faults, [""; 0]);
}

/// The picture is magnified and dragged without a move of the camera.
#[test]
fn the_picture_is_magnified_and_dragged() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = room_view(&room);
    let mut tab = opened(&mut browser, &view);
    let (start, fitted) = (tab.position(), tab.picture());
    // Larger than the stage, in which a smaller picture stays in the middle.
    (0..3).for_each(|_| tab.click("zoom-in"));
    tab.click("hand");
    let [left, top, width, _] = tab.picture();
    assert!((width / fitted[2] - 1.5_f64.powi(3)).abs() < 1e-3, "{width}");
    let stage = "(({x, y, width, height}) => [x, y, width, height])(stage.getBoundingClientRect())";
    let stage: [f64; 4] = serde_json::from_value(tab.value(stage)).unwrap();
    let middle = [stage[0] + 0.5 * stage[2], stage[1] + 0.5 * stage[3]];
    tab.press("left", middle, [9.0, 6.0]);
    let dragged = tab.picture();
    assert!((dragged[0] - left - 9.0).abs() < 0.1 && (dragged[1] - top - 6.0).abs() < 0.1, "{dragged:?}");
    tab.wheel(middle, -200.0);
    assert!(tab.picture()[2] > width);
    assert_eq!(tab.position(), start);
    press_key(&mut tab, "0", 0);
    assert_eq!(tab.picture(), fitted);
    tab.click("hand");
    tab.press("left", middle, [20.0, 0.0]);
    assert_ne!(tab.position(), start);
}

#[test]
fn pixels_are_inspected() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = room_view(&room);
    let mut tab = opened(&mut browser, &view);
    tab.value("document.getElementById('inspector').open = true");
    let [x, y, width, height] = tab.picture();
    let place = json!({"type": "mouseMoved", "x": x + 0.5 * width, "y": y + 0.5 * height});
    tab.call("Input.dispatchMouseEvent", &place);
    tab.wait("document.getElementById('shown').textContent.includes('stops')", LIMIT);
    let [shown, clipping] = ["shown", "clipping"].map(|id| text(&mut tab, id));
    assert!(shown.starts_with('#') && clipping.contains("% clipped"), "{shown} {clipping}");
    let lit = "histogram.getContext('2d').getImageData(0, 0, histogram.width, histogram.height).data\
               .some((value, part) => part % 4 === 0 && value > 200)";
    assert_eq!(tab.value(lit), true, "the histogram is empty");
}

/// Bookmarks outlast the page, and are as many as were made.
#[test]
fn cameras_are_bookmarked_and_a_turntable_leaves_them() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = room_view(&room);
    let mut tab = opened(&mut browser, &view);
    let start = tab.position();
    tab.click("bookmark");
    tab.choose("period", "10");
    tab.click("turntable");
    tab.wait(
        &format!(
            "photoncard.view.camera.position.join() !== '{}'",
            json!(start).as_array().unwrap().iter().map(Value::to_string).collect::<Vec<_>>().join(",")
        ),
        LIMIT,
    );
    press_key(&mut tab, "Escape", 0);
    let stopped = tab.position();
    assert_ne!(stopped, start);
    tab.wait(SETTLED, LIMIT);
    assert_eq!((tab.position(), tab.value("photoncard.turntable.isOn")), (stopped, json!(false)));
    press_key(&mut tab, "1", 0);
    assert_eq!(tab.position(), start);
    tab.open(&view.address);
    tab.wait(SETTLED, LIMIT);
    assert_eq!(tab.value("document.getElementById('bookmarks').children.length"), 1);
    tab.value("document.querySelector('#bookmarks button:last-child').click()");
    assert_eq!(tab.value("document.getElementById('bookmarks').children.length"), 0);
}

/// A refusal goes away when it is closed, and when something else was changed.
#[test]
fn refusals_go_away() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = View::start(&room, &shipped("cornell.gltf"), &SMALL);
    let mut tab = opened(&mut browser, &view);
    let darken = "document.querySelector('#lights input').click()";
    let is_told = "!document.getElementById('message').hidden";
    tab.value(darken);
    tab.wait(is_told, LIMIT);
    assert!(text(&mut tab, "reason").contains("light"));
    tab.click("hush");
    assert!(is_hidden(&mut tab, "message"));
    tab.value(darken);
    tab.wait(is_told, LIMIT);
    tab.drag("left", [0.5, 0.5], [30.0, 0.0]);
    // The message would go by itself after eight seconds, later than the picture is there.
    tab.wait("document.getElementById('message').hidden", LIMIT);
}

/// A view without `--out` offers downloads, of pictures that are not finished too.
#[test]
fn pictures_are_downloaded() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = View::start_without_folder(&room, &shipped("room.glb"), &SMALL);
    let mut tab = browser.tab(WINDOW);
    let folder = room.path("downloads").display().to_string();
    tab.call("Browser.setDownloadBehavior", &json!({"behavior": "allow", "downloadPath": folder}));
    tab.open(&view.address);
    tab.wait(SETTLED, LIMIT);
    let line = tab.save("finished", "exr");
    run_shown(&room, &line);
    let path = room.path("downloads/finished.exr");
    let start = std::time::Instant::now();
    while !path.exists() && start.elapsed() < LIMIT {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    assert!(room.read("downloads/finished.exr") == room.read("picture.exr"), "{line}");
    // The download of a picture with so many samples does not wait for them.
    let many = json!({"type": "setting", "name": "spp", "value": 4096});
    tab.value(&format!("photoncard.connection.send({many})"));
    tab.wait("photoncard.state.spp === 4096 && photoncard.state.samples > 0", LIMIT);
    tab.value("document.getElementById('save-png').click()");
    tab.wait("document.getElementById('saved').textContent.endsWith('finished-unsettled.png')", LIMIT);
}

/// A map that is chosen lights the scene, and its turn is that of the shown command.
#[test]
fn an_environment_map_is_dropped_on_the_page() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = View::start(&room, &shipped("cornell.gltf"), &SMALL);
    let mut tab = opened(&mut browser, &view);
    room.write("sky.exr", std::fs::read(shipped("sky.exr")).unwrap());
    let document = tab.call("DOM.getDocument", &json!({}));
    let root = &document["root"]["nodeId"];
    let field = tab.call("DOM.querySelector", &json!({"nodeId": root, "selector": "#map"}));
    let files = [room.path("sky.exr").display().to_string()];
    tab.call("DOM.setFileInputFiles", &json!({"nodeId": field["nodeId"], "files": files}));
    tab.wait(
        &format!(
            "document.getElementById('map-name').textContent.startsWith('sky.exr, dropped') && {SETTLED}"
        ),
        LIMIT,
    );
    tab.choose("rotation", "90");
    tab.wait(&format!("photoncard.state?.command.includes('--environment-rotation 90') && {SETTLED}"), LIMIT);
    super::check_saved(&room, &mut tab, "lit");
    assert_eq!(tab.faults, [""; 0]);
}

/// Buttons are large enough for fingers, and the tools fit a phone.
#[test]
fn a_phone_has_targets_for_fingers() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = room_view(&room);
    let mut tab = browser.tab([390, 844]);
    tab.call("Emulation.setTouchEmulationEnabled", &json!({"enabled": true}));
    tab.open(&view.address);
    tab.wait(SETTLED, LIMIT);
    tab.value("for (const one of document.querySelectorAll('details')) one.open = true");
    let small = tab.value(
        "[...document.querySelectorAll('button, input, select, summary')].filter(one => one.offsetParent)\
         .map(one => [one.id || one.textContent || one.type, one.getBoundingClientRect()])\
         .filter(([, {width, height}]) => width < 24 || height < 24).map(([name]) => name)",
    );
    assert_eq!(small, json!([]));
    assert_eq!(tab.value("tools.scrollWidth <= tools.clientWidth"), true, "tools are cut off");
    assert_eq!(tab.value("document.documentElement.scrollWidth"), 390);
}
