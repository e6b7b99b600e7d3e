//! Measures latency and frame rate of the view, by the clock of the page; `tests/view_latency.sh` prints
//! them.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use serde_json::Value;

use super::browser::{Browser, Scripted, Tab};
use super::server::View;
use crate::support::{Room, shipped};

/// Time limit for any picture.
const LIMIT: Duration = Duration::from_secs(120);
/// Number of camera moves of which the median is taken.
const MOVES: usize = 7;

/// Prints a table row: scene, what is measured, value, goal.
fn row(scene: &str, what: &str, value: f64, unit: &str, goal: &str) {
    println!("| {scene} | {what} | {value:.0} {unit} | {goal} |");
}

#[test]
#[ignore = "a measurement, which takes minutes: tests/view_latency.sh"]
fn latency() {
    let Some(mut browser) = Browser::start() else { return };
    println!("| scene | measured | value | goal |\n|---|---|---|---|");
    for (scene, file, goals) in [
        ("Cornell box", "cornell.gltf", ["1000", "60", "600", "10", "700"]),
        ("atrium", "atrium.glb", ["6000", "120", "2000", "4", "none"]),
    ] {
        let [opening, coarse, full, rate, light] = goals;
        row(scene, "command started to first picture", opened(&mut browser, file), "ms", opening);
        let room = Room::new();
        let [first, whole] = moved(&mut browser, &room, file, "128x128", ["first", "coarse"]);
        row(scene, "camera moved to first tile, 128x128", first, "ms", "none");
        row(scene, "camera moved to coarse picture, 128x128", whole, "ms", coarse);
        let [whole, refined] = moved(&mut browser, &room, file, "512x512", ["coarse", "full"]);
        row(scene, "camera moved to coarse picture, 512x512", whole, "ms", "none");
        row(scene, "camera moved to every pixel, 512x512", refined, "ms", full);
        row(scene, "pictures a second while turning, 256x256", turned(&mut browser, &room, file), "", rate);
        if scene == "Cornell box" {
            row(
                scene,
                "light changed to first picture, 512x512",
                relit(&mut browser, &room, file),
                "ms",
                light,
            );
        }
    }
}

/// Opens a tab and waits for the first coarse picture.
fn shown(browser: &mut Browser, view: &View) -> Tab {
    let mut tab = browser.tab([1100, 760]);
    tab.open(&view.address);
    tab.wait("window.photoncard?.times.measured[0]?.coarse", LIMIT);
    tab
}

fn start(room: &Room, file: &str, size: &str) -> View {
    View::start(room, &shipped(file), &["--size", size])
}

/// Opens a tab and waits until tiles of the final picture arrive: its settings are then chosen, and its
/// photons traced.
fn refined(browser: &mut Browser, view: &View) -> Tab {
    let mut tab = shown(browser, view);
    tab.wait("photoncard.state.settled || photoncard.picture.samples === photoncard.state.spp", LIMIT);
    tab
}

/// Milliseconds from the start of the command to the first coarse picture, with all defaults.
fn opened(browser: &mut Browser, file: &str) -> f64 {
    let room = Room::new();
    let started = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs_f64() * 1000.0;
    let view = View::start(&room, &shipped(file), &[]);
    let mut tab = shown(browser, &view);
    let first = tab.value("performance.timeOrigin + photoncard.times.measured[0].coarse");
    first.as_f64().unwrap() - started
}

/// Median times from a camera move to each of the stages `parts` of the picture, milliseconds. The stages
/// have the page's names.
fn moved<const N: usize>(
    browser: &mut Browser,
    room: &Room,
    file: &str,
    size: &str,
    parts: [&str; N],
) -> [f64; N] {
    let view = start(room, file, size);
    let mut tab = refined(browser, &view);
    let mut times: [Vec<f64>; N] = std::array::from_fn(|_| Vec::new());
    for number in 0..MOVES {
        let turn = if number % 2 == 0 { 0.05 } else { -0.05 };
        // The message says that the camera rests: a moving camera would be answered by coarse pictures alone.
        let count = tab.value("photoncard.times.measured.length");
        tab.value(&format!(
            "import('/camera.js').then(({{ turned }}) => {{ const {{ camera }} = photoncard.view; \
             photoncard.view.move(turned(camera, camera.position, {turn}, 0), false); }})"
        ));
        let newest = format!("photoncard.times.measured[{count}]");
        tab.wait(&format!("{newest}?.{}", parts[N - 1]), LIMIT);
        for (part, times) in parts.iter().zip(&mut times) {
            times.push(number_of(&tab.value(&format!("{newest}.{part}"))));
        }
        std::thread::sleep(Duration::from_millis(500));
    }
    times.map(median)
}

/// Median number of complete pictures per second while the camera turns, read every half second from 2 to 6 s
/// after the start.
fn turned(browser: &mut Browser, room: &Room, file: &str) -> f64 {
    let view = start(room, file, "256x256");
    let mut tab = refined(browser, &view);
    tab.key("keyDown", "ArrowLeft");
    let start = Instant::now();
    let mut rates = Vec::new();
    while start.elapsed() < Duration::from_secs(6) {
        std::thread::sleep(Duration::from_millis(500));
        rates.push(number_of(&tab.value("photoncard.times.rate")));
    }
    tab.key("keyUp", "ArrowLeft");
    median(rates.split_off(3))
}

/// Median time from a change of the lamp's strength to the first coarse picture, milliseconds.
fn relit(browser: &mut Browser, room: &Room, file: &str) -> f64 {
    let view = start(room, file, "512x512");
    let mut tab = refined(browser, &view);
    let mut times = Vec::new();
    for number in 0..MOVES {
        std::thread::sleep(Duration::from_secs(1));
        let count = tab.value("photoncard.times.measured.length");
        let strength = 10 + number;
        tab.value(&format!(
            "(field => {{ field.value = {strength}; field.dispatchEvent(new Event('input', {{bubbles: true}})); }})\
             (document.querySelector('#lights input[type=number]'))"
        ));
        tab.wait(&format!("photoncard.times.measured[{count}]?.coarse"), LIMIT);
        times.push(number_of(&tab.value(&format!("photoncard.times.measured[{count}].coarse"))));
    }
    median(times)
}

fn number_of(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
