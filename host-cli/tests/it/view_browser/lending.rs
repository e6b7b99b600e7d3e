//! Cards that a browser lends to the command.

use std::time::Duration;

use super::browser::{Browser, Scripted};
use super::own_host::module;
use super::person::{Person, SETTLED};
use super::server::View;
use super::{SMALL, WINDOW, check_saved};
use crate::support::{Room, shipped};

/// Time limit of each wait, long enough for a busy machine.
const LIMIT: Duration = Duration::from_secs(150);

/// Tiles that cards of browsers have rendered, as the page states them.
const LENT_TILES: &str = "[...document.querySelectorAll('#cards *')].map(row => row.textContent)\
    .filter(text => text.includes('browser')).map(text => Number(/(\\d+) tile/.exec(text)?.[1] ?? 0)).reduce((a, b) => a + b, 0)";

#[test]
fn cards_of_a_browser_render_the_picture_of_the_shown_command() {
    let Some(mut browser) = Browser::start() else { return };
    let Some(module) = module() else { return };
    let room = Room::new();
    let options = ["--browser-cards", "--module", module.to_str().unwrap(), "--card", "emulated:1"];
    let view = View::start(&room, &shipped("cornell.gltf"), &[&SMALL[..], &options].concat());
    let mut lender = browser.tab(WINDOW);
    lender.open(&view.address.replace("/?", "/lend.html?"));
    lender.wait("document.getElementById('state')?.textContent", LIMIT);
    lender.value("document.getElementById('count').value = 3; document.getElementById('count').dispatchEvent(new Event('change'))");
    lender.wait("document.getElementById('state').textContent.startsWith('3 cards are lent')", LIMIT);

    let mut tab = browser.tab(WINDOW);
    tab.open(&view.address);
    tab.wait(SETTLED, LIMIT);
    // The first picture may have been rendered before the cards were lent.
    tab.drag("left", [0.5, 0.5], [40.0, 10.0]);
    tab.wait(&format!("{LENT_TILES} > 0"), LIMIT);
    tab.wait(SETTLED, LIMIT);
    check_saved(&room, &mut tab, "lent");

    // A lender that goes while it renders takes no tile with it.
    let version = tab.value("photoncard.state.version");
    tab.drag("left", [0.5, 0.5], [-30.0, 10.0]);
    tab.wait(&format!("photoncard.state.version > {version}"), LIMIT);
    lender.open("about:blank");
    tab.wait(SETTLED, LIMIT);
    tab.wait("!document.getElementById('cards').textContent.includes('browser')", LIMIT);
    check_saved(&room, &mut tab, "alone");
    assert_eq!((lender.faults, tab.faults), (Vec::new(), Vec::new()));
}

#[test]
fn cards_of_browsers_need_a_module_and_have_no_model_of_memory() {
    let room = Room::new();
    let scene = shipped("cornell.gltf");
    room.write("none.wasm", b"no module");
    for (options, said) in [
        (&["--browser-cards", "--module", "none.wasm"][..], "is no WebAssembly module"),
        (&["--browser-cards", "--counters"], "have no model of memory"),
        (&["--module", "none.wasm"], "--browser-cards"),
    ] {
        let outcome = room.run(&[&["view", &scene, "--listen", "127.0.0.1:0"], options].concat());
        assert_eq!(outcome.status, Some(2), "{}", outcome.stderr);
        assert!(outcome.stderr.contains(said), "{}", outcome.stderr);
    }
}
