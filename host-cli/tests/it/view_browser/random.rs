//! Random actions on the page: what people, networks and cards may do, in random order.

use std::time::Duration;

use serde_json::json;

use super::browser::{Acting, Scripted, Tab};
use super::person::Person;
use crate::support::{Emulator, Room};

/// Linear congruential generator (Knuth's MMIX) with a fixed seed.
struct Numbers(u64);

impl Numbers {
    /// Pseudo-random number in [0, 1).
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / (1_u64 << 24) as f64
    }

    /// Pseudo-random number in a range.
    fn of(&mut self, low: f64, high: f64) -> f64 {
        low + self.next() * (high - low)
    }

    fn one<'a>(&mut self, list: &[&'a str]) -> &'a str {
        list[(self.next() * list.len() as f64) as usize]
    }
}

/// Process of an emulated card that can be killed, and restarted at the same port.
pub(crate) struct Card {
    emulator: Option<Emulator>,
    port: String,
}

impl Card {
    pub(crate) fn start(room: &Room) -> Self {
        let emulator = Emulator::start(room, "tcp:0", &[]);
        let port = emulator.address.rsplit(':').next().unwrap().to_owned();
        Self { emulator: Some(emulator), port }
    }

    pub(crate) fn address(&self) -> String {
        format!("tcp:127.0.0.1:{}", self.port)
    }

    /// Kills the card if it runs; otherwise restarts it.
    fn toggle(&mut self, room: &Room) {
        self.emulator = match self.emulator.take() {
            Some(emulator) => {
                drop(emulator);
                None
            }
            None => Some(Emulator::start(room, &format!("tcp:{}", self.port), &[])),
        };
    }
}

/// Performs `actions` random actions.
pub(crate) fn act(room: &Room, tab: &mut Tab, card: &mut Card, actions: usize) {
    let mut numbers = Numbers(21);
    for _ in 0..actions {
        let place = [numbers.next(), numbers.next()];
        match (numbers.next() * 100.0) as u32 {
            0..30 => {
                let shift = [numbers.of(-40.0, 40.0), numbers.of(-40.0, 40.0)];
                tab.drag(numbers.one(&["left", "left", "right", "middle"]), place, shift);
            }
            30..40 => tab.drag("left", place, [0.0, 0.0]),
            40..52 => {
                let [x, y, width, height] = tab.picture();
                tab.wheel([x + place[0] * width, y + place[1] * height], numbers.of(-300.0, 300.0));
            }
            52..62 => {
                let key = numbers.one(&[
                    "KeyW",
                    "KeyA",
                    "KeyS",
                    "KeyD",
                    "KeyQ",
                    "KeyE",
                    "ArrowLeft",
                    "ArrowUp",
                    "Minus",
                ]);
                tab.hold(key, numbers.of(0.0, 30.0) as u64);
            }
            62..76 => edit(tab, &mut numbers),
            76..82 => {
                let (name, values) = match (numbers.next() * 4.0) as u32 {
                    0 => ("order", ["naive", "sort", "hash"]),
                    1 => ("sampling", ["brdf", "combined", "focused"]),
                    2 => ("spp", ["1", "2", "3"]),
                    _ => ("photons", ["500", "1000", "2000"]),
                };
                let value = numbers.one(&values);
                let value = value.parse::<u32>().map_or(json!(value), |number| json!(number));
                let message = json!({"type": "setting", "name": name, "value": value});
                tab.value(&format!("photoncard.connection.send({message})"));
            }
            82..86 => tab.resize([numbers.of(200.0, 700.0) as u32, numbers.of(200.0, 500.0) as u32]),
            86..89 => tab.choose("side", numbers.one(&["", "128", "window"])),
            89..93 => tab.choose("layer", numbers.one(&["radiance", "albedo", "N", "Z"])),
            93..95 => drop(tab.value("document.getElementById('reset').click()")),
            95..98 => drop(tab.value("photoncard.connection.drop()")),
            _ => card.toggle(room),
        }
        if numbers.next() < 0.05 {
            std::thread::sleep(Duration::from_millis(numbers.of(0.0, 400.0) as u64));
        }
    }
    // The last picture is small, so that it settles soon.
    tab.resize([360, 420]);
    tab.choose("side", "128");
}

/// Performs `actions` random actions on a page with its own host, which has no cards and no connection to
/// lose.
pub(crate) fn act_with_own_host(tab: &mut impl Acting, actions: usize) {
    let mut numbers = Numbers(48);
    for _ in 0..actions {
        let at = [numbers.of(40.0, 400.0), numbers.of(80.0, 400.0)];
        match (numbers.next() * 100.0) as u32 {
            0..35 => {
                let shift = [numbers.of(-40.0, 40.0), numbers.of(-40.0, 40.0)];
                tab.press(numbers.one(&["left", "left", "right", "middle"]), at, shift);
            }
            35..50 => tab.scroll(at, numbers.of(-300.0, 300.0)),
            50..60 => tab.strike(numbers.one(&["KeyW", "KeyA", "KeyS", "KeyD", "ArrowLeft", "ArrowUp"])),
            60..78 => edit(tab, &mut numbers),
            78..84 => {
                let sampling = numbers.one(&["brdf", "combined", "focused"]);
                let message = json!({"type": "setting", "name": "sampling", "value": sampling});
                tab.value(&format!("photoncard.connection.send({message})"));
            }
            84..88 => tab.choose("side", numbers.one(&["", "128"])),
            88..94 => tab.choose("layer", numbers.one(&["radiance", "albedo", "N", "Z"])),
            94..98 => drop(tab.value("document.getElementById('reset').click()")),
            _ => std::thread::sleep(Duration::from_millis(numbers.of(0.0, 400.0) as u64)),
        }
    }
    tab.choose("side", "128");
    tab.choose("layer", "radiance");
}

/// Types into a random field of the panel, or toggles a switch.
fn edit(tab: &mut impl Scripted, numbers: &mut Numbers) {
    let which = numbers.next();
    let value = numbers.of(0.0, 1.0);
    tab.value(&format!(
        "(fields => {{ const field = fields[Math.floor({which} * fields.length)]; \
         if (!field) return; \
         if (field.type === 'checkbox') {{ field.click(); return; }} \
         field.value = field.type === 'color' ? '#c0a080' : {value}; \
         field.dispatchEvent(new Event('input', {{bubbles: true}})); }})\
         (document.querySelectorAll('#lights input, #materials input'))"
    ));
}
