//! Page on different devices: touch, clipboard, narrow windows, and the loss of the graphics context.

use serde_json::{Value, json};

use super::browser::{Browser, Scripted, Tab};
use super::person::{Person, SETTLED};
use super::server::View;
use super::{LIMIT, SMALL, opened};
use crate::support::{Room, shipped};

type Vector = [f64; 3];

fn sub(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn length([x, y, z]: Vector) -> f64 {
    (x * x + y * y + z * z).sqrt()
}

/// Position and unit view vector of the camera, and its distance from the centre of the scene's bounding box.
fn camera(tab: &mut Tab) -> (Vector, Vector, f64) {
    let [position, target, low, high] =
        ["state.camera.position", "state.camera.look_at", "scene.low", "scene.high"]
            .map(|of| serde_json::from_value::<Vector>(tab.value(&format!("photoncard.{of}"))).unwrap());
    let view = sub(target, position);
    let middle = std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]));
    (position, view.map(|part| part / length(view)), length(sub(middle, position)))
}

#[test]
fn fingers_orbit_pan_and_zoom() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = View::start(&room, &shipped("cornell.gltf"), &SMALL);
    let mut tab = opened(&mut browser, &view);
    let [x, y, width, height] = tab.picture();
    let at = |across: f64, down: f64| [x + across * width, y + down * height];
    let mut touched = |fingers: &[[[f64; 2]; 2]]| {
        let before = camera(&mut tab);
        let version = tab.value("photoncard.state.version");
        tab.touch(fingers);
        tab.wait(&format!("photoncard.state.version > {version} && {SETTLED}"), LIMIT);
        (before, camera(&mut tab))
    };
    let near = |a: f64, b: f64| (a - b).abs() < 1e-3 * b;

    let ((_, before, radius), (_, after, still)) = touched(&[[at(0.5, 0.5), at(0.8, 0.6)]]);
    assert!(
        length(sub(after, before)) > 0.1 && near(still, radius),
        "one finger orbits: {after:?} {still} {radius}"
    );

    let ((from, before, _), (to, after, _)) =
        touched(&[[at(0.3, 0.5), at(0.4, 0.6)], [at(0.6, 0.5), at(0.7, 0.6)]]);
    let shift = sub(to, from);
    let along: f64 = shift.iter().zip(after).map(|(shift, view)| shift * view).sum();
    assert!(length(sub(after, before)) < 1e-3, "two fingers do not turn: {before:?} {after:?}");
    assert!(length(shift) > 0.05 && along.abs() < 0.1 * length(shift), "they pan: {shift:?} {along}");

    let ((from, before, _), (to, after, _)) =
        touched(&[[at(0.4, 0.5), at(0.2, 0.5)], [at(0.6, 0.5), at(0.8, 0.5)]]);
    let shift = sub(to, from);
    let along: f64 = shift.iter().zip(after).map(|(shift, view)| shift * view).sum();
    assert!(length(sub(after, before)) < 1e-3, "a pinch does not turn: {before:?} {after:?}");
    assert!(along > 0.5 && near(along, length(shift)), "it comes closer: {shift:?} {along}");
    assert_eq!(tab.faults, [""; 0]);
}

/// The page copies text by the clipboard or, where that is forbidden, by a selection.
#[test]
fn command_line_and_pose_are_copied() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = View::start(&room, &shipped("cornell.gltf"), &SMALL);
    let mut tab = opened(&mut browser, &view);
    let origin = view.address.split("/?").next().unwrap();
    let permissions = ["clipboardReadWrite", "clipboardSanitizedWrite"];
    tab.call("Browser.grantPermissions", &json!({"origin": origin, "permissions": permissions}));
    tab.call("Page.bringToFront", &json!({}));
    for is_insecure in [false, true] {
        if is_insecure {
            tab.value(
                "const { clipboard } = navigator; window.read = () => clipboard.readText(); \
                       Object.defineProperty(navigator, 'clipboard', { value: undefined })",
            );
        } else {
            tab.value("window.read = () => navigator.clipboard.readText()");
        }
        for (button, begin) in [("copy-command", "photoncard render "), ("copy-pose", "--camera-at ")] {
            let [x, y, width, height]: [f64; 4] = serde_json::from_value(tab.value(&format!(
                "(({{x, y, width, height}}) => [x, y, width, height])(document.getElementById('{button}').getBoundingClientRect())"
            )))
            .unwrap();
            tab.press("left", [x + 0.5 * width, y + 0.5 * height], [0.0, 0.0]);
            tab.wait(&format!("document.getElementById('{button}').textContent === 'Copied'"), LIMIT);
            let copied = tab.value("read()");
            assert!(copied.as_str().unwrap().starts_with(begin), "{copied}");
            if button == "copy-command" {
                assert_eq!(copied, tab.value("document.getElementById('command').textContent"));
            }
            tab.wait(&format!("document.getElementById('{button}').textContent !== 'Copied'"), LIMIT);
        }
    }
}

#[test]
fn a_lost_graphics_context_comes_back_with_the_picture() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = View::start(&room, &shipped("cornell.gltf"), &SMALL);
    let mut tab = opened(&mut browser, &view);
    let before = tab.shown();
    tab.value("window.loss = photoncard.display.gl.getExtension('WEBGL_lose_context'); loss.loseContext()");
    tab.wait("photoncard.display.gl.isContextLost()", LIMIT);
    // Tiles that arrive before the context is restored are drawn after it.
    tab.drag("left", [0.5, 0.5], [40.0, 0.0]);
    tab.wait(SETTLED, LIMIT);
    tab.value("document.getElementById('reset').click()");
    tab.value("loss.restoreContext()");
    let is_back =
        "!photoncard.display.gl.isContextLost() && !photoncard.state.command.includes('--camera-at')";
    tab.wait(&format!("{is_back} && {SETTLED}"), LIMIT);
    assert!(tab.shown() == before, "the picture is another one");
    assert!(before.iter().any(|pixel| pixel[0] > 100), "the picture is black");
}

/// In windows of any size, the controls of the picture are inside and do not overlap.
#[test]
fn narrow_windows_cut_nothing_off() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = View::start(&room, &shipped("cornell.gltf"), &SMALL);
    let mut tab = opened(&mut browser, &view);
    tab.choose("overlay", "lines");
    for size in [[320, 480], [380, 700], [700, 380], [1200, 800]] {
        tab.resize(size);
        tab.wait(SETTLED, LIMIT);
        let faults = tab.value(
            "(boxes => [...boxes.filter(([, box]) => box.left < 0 || box.top < 0 || box.right > innerWidth || box.bottom > innerHeight || \
             box.width < 8 || box.height < 8).map(([id]) => `${id} is cut off`), \
             ...boxes.flatMap(([a, one], index) => boxes.slice(index + 1).filter(([, other]) => one.left < other.right && \
             other.left < one.right && one.top < other.bottom && other.top < one.bottom).map(([b]) => `${a} covers ${b}`)), \
             ...document.documentElement.scrollWidth > innerWidth ? ['the page is too wide'] : [], \
             ...panel.scrollWidth > panel.clientWidth ? ['the panel is too wide'] : []])\
             (['notes', 'toggle', 'status', 'command', 'copy-command', 'copy-pose', 'panel'].map(id => \
             [id, document.getElementById(id).getBoundingClientRect()]))",
        );
        assert_eq!(faults, json!([]), "{size:?}");
    }
}

/// Overlays drawn by the shader equal those drawn by the processor, and show the tiles' counts.
#[test]
fn overlays_map_the_work_of_tiles() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let options =
        [&SMALL[..], &["--irradiance-cache", "on", "--tile", "16", "--counters", "--card", "emulated:1"]]
            .concat();
    let view = View::start(&room, &shipped("cornell.gltf"), &options);
    let mut shown: Vec<Vec<Vec<[u8; 3]>>> = Vec::new();
    for script in ["", super::WITHOUT_WEBGL2] {
        let mut tab = browser.tab(super::WINDOW);
        tab.call("Page.addScriptToEvaluateOnNewDocument", &json!({"source": script}));
        tab.open(&view.address);
        tab.wait(SETTLED, LIMIT);
        tab.take_over();
        tab.fill_window();
        let overlays = ["none", "card", "gathers", "records", "lines"].map(|overlay| {
            tab.choose("overlay", overlay);
            tab.wait(SETTLED, LIMIT);
            let legend = tab.value("legend.hidden ? '' : legend.innerText");
            let greatest = tab.value("photoncard.picture.greatest").as_f64().unwrap();
            assert_eq!(legend != json!(""), !["none", "card"].contains(&overlay), "{legend}");
            assert!(greatest > 0.0 || ["none", "card"].contains(&overlay), "{overlay}");
            tab.shown()
        });
        assert!((1..5).all(|number| overlays[number] != overlays[0]), "an overlay is not seen");
        assert!((3..5).all(|number| overlays[number] != overlays[2]), "overlays look alike");
        shown.push(overlays.into());
        tab.call("Page.close", &json!({}));
    }
    let [shader, processor] = [0, 1].map(|kind| shown[kind].concat().into_flattened());
    assert_eq!(shader.len(), processor.len());
    let difference = shader.iter().zip(&processor).map(|(a, b)| a.abs_diff(*b)).max();
    assert!(difference <= Some(2), "shader and processor differ: {difference:?}");
}

/// If a view does not model memory, the overlay of DRAM lines says so.
#[test]
fn missing_counts_are_reported() {
    let Some(mut browser) = Browser::start() else { return };
    let room = Room::new();
    let view = View::start(&room, &shipped("cornell.gltf"), &SMALL);
    let mut tab = opened(&mut browser, &view);
    tab.choose("overlay", "lines");
    tab.wait(&format!("{SETTLED} && legend.innerText.includes('--counters')"), LIMIT);
    tab.choose("overlay", "gathers");
    tab.wait(&format!("{SETTLED} && legend.innerText.includes('gathers a pixel')"), LIMIT);
    let [x, y, width, height] = tab.picture();
    tab.call(
        "Input.dispatchMouseEvent",
        &json!({"type": "mouseMoved", "x": x + 0.5 * width, "y": y + 0.5 * height}),
    );
    tab.wait("legend.innerText.includes('here')", LIMIT);
    let Value::Number(mark) =
        tab.value("photoncard.picture.markAt(photoncard.picture.size.map(side => side / 2))")
    else {
        panic!("no number")
    };
    assert!(mark.as_f64().unwrap() > 0.0);
}
