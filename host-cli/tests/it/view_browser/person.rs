//! Use of the page's controls, as by a person.

use std::time::Duration;

use serde_json::{Value, json};

use super::browser::{Scripted, Tab};
use crate::support::shipped;

/// JavaScript expression that is true once the page shows the final picture with all changes.
pub(crate) const SETTLED: &str = "window.photoncard?.isSettled";

const LIMIT: Duration = Duration::from_secs(30);

pub(crate) trait Person {
    /// Sets the exposure in stops; `None` is automatic.
    fn expose(&mut self, stops: Option<f64>);
    /// Drags by `shift` pixels from a point of the picture, given in fractions of its sides. A zero shift is
    /// a click.
    fn drag(&mut self, button: &str, from: [f64; 2], shift: [f64; 2]);
    /// Rectangle `[x, y, width, height]` of the picture on the screen, pixels.
    fn picture(&mut self) -> [f64; 4];
    /// Hides the panel, and gives the picture one pixel for each pixel of the window.
    fn fill_window(&mut self);
    /// Presses the button with this id.
    fn click(&mut self, button: &str);
    /// Position of the page's camera.
    fn position(&mut self) -> [f64; 3];
    /// Toggles the switch of a light.
    fn switch(&mut self, light: &str);
    /// Labels of the visible fields of a material.
    fn labels(&mut self, material: &str) -> Vec<String>;
    /// Sets the field of a material that has this label; a switch is toggled.
    fn set_material(&mut self, material: &str, label: &str, value: f64);
    /// Presses the button by which a page takes over the control of the view (steers).
    fn take_over(&mut self);
    /// Saves the picture. Returns the command line that the page shows.
    fn save(&mut self, name: &str, ending: &str) -> String;
    /// Colours of the picture's pixels on the screen, as sRGB codes.
    fn shown(&mut self) -> Vec<[u8; 3]>;
    /// Checks that the Cornell box is shown, with one red and one green wall.
    fn check_walls(&mut self);
}

impl Person for Tab {
    fn expose(&mut self, stops: Option<f64>) {
        let automatic = "document.getElementById('automatic')";
        match stops {
            None => self.value(&format!("{automatic}.checked || {automatic}.click()")),
            Some(stops) => {
                self.choose("exposure", &stops.to_string());
                self.value(automatic)
            }
        };
        // The exposure is drawn in the next animation frame.
        self.value("new Promise(act => requestAnimationFrame(() => requestAnimationFrame(act)))");
    }

    fn drag(&mut self, button: &str, [across, down]: [f64; 2], shift: [f64; 2]) {
        let [x, y, width, height] = self.picture();
        self.press(button, [x + across * width, y + down * height], shift);
    }

    fn picture(&mut self) -> [f64; 4] {
        let place = "(({x, y, width, height}) => [x, y, width, height])(picture.getBoundingClientRect())";
        serde_json::from_value(self.value(place)).unwrap()
    }

    fn fill_window(&mut self) {
        self.resize([160, 260]);
        self.value("document.getElementById('panel').hidden || document.getElementById('toggle').click()");
        self.choose("side", "window");
        let sides = "(({width, height}) => [width, height].map(Math.floor))(stage.getBoundingClientRect())";
        self.wait(&format!("photoncard.picture.size.join() === {sides}.join()"), LIMIT);
        self.wait(SETTLED, LIMIT);
    }

    fn click(&mut self, button: &str) {
        self.value(&format!("document.getElementById('{button}').click()"));
    }

    fn position(&mut self) -> [f64; 3] {
        serde_json::from_value(self.value("photoncard.view.camera.position")).unwrap()
    }

    fn switch(&mut self, light: &str) {
        let version = self.value("photoncard.state.version");
        self.value(&format!(
            "[...document.querySelectorAll('#lights fieldset')].find(one => \
             one.querySelector('legend').textContent.split(',')[0] === '{light}').querySelector('input').click()"
        ));
        self.wait(&format!("photoncard.state.version > {version}"), LIMIT);
    }

    fn labels(&mut self, material: &str) -> Vec<String> {
        let shown = self.value(&format!(
            "{}.filter(label => !label.hidden).map(label => label.firstChild.textContent || label.textContent)",
            labels_of(material)
        ));
        serde_json::from_value(shown).unwrap()
    }

    fn set_material(&mut self, material: &str, label: &str, value: f64) {
        let version = self.value("photoncard.state.version");
        self.value(&format!(
            "(input => {{ if (input.type === 'checkbox') return input.click(); input.value = {value}; \
             input.dispatchEvent(new Event('input', {{bubbles: true}})); }})\
             ({}.find(label => label.textContent.startsWith('{label}')).querySelector('input'))",
            labels_of(material)
        ));
        self.wait(&format!("photoncard.state.version > {version}"), LIMIT);
    }

    fn take_over(&mut self) {
        self.wait("photoncard.scene", LIMIT);
        self.value("document.getElementById('spectator').hidden || document.getElementById('steer').click()");
        self.wait("document.getElementById('spectator').hidden", LIMIT);
        self.wait(SETTLED, LIMIT);
    }

    fn save(&mut self, name: &str, ending: &str) -> String {
        self.value(&format!(
            "document.getElementById('name').value = '{name}'; document.getElementById('save-{ending}').click()"
        ));
        self.wait(
            &format!("document.getElementById('saved').textContent.endsWith('{name}.{ending}')"),
            LIMIT,
        );
        let line = self.value("document.getElementById('command').textContent");
        line.as_str().unwrap().to_owned()
    }

    fn shown(&mut self) -> Vec<[u8; 3]> {
        self.value("document.activeElement.blur()");
        self.value("for (const id of ['times', 'toggle', 'centre']) document.getElementById(id).style.visibility = 'hidden'");
        let place = self.picture();
        self.pixels(place)
    }

    fn check_walls(&mut self) {
        let [left, right] = [0.08, 0.92].map(|share| {
            let at = format!("photoncard.picture.at([{share} * photoncard.picture.size[0], photoncard.picture.size[1] / 2])");
            serde_json::from_value::<[f64; 3]>(self.value(&at)).unwrap()
        });
        let walls = [left, right];
        assert!(walls.iter().any(|[red, green, _]| *red > 1.5 * green), "{walls:?}");
        assert!(walls.iter().any(|[red, green, _]| *green > 1.5 * red), "{walls:?}");
    }
}

/// JavaScript expression for the labels of a material's fields.
fn labels_of(material: &str) -> String {
    format!(
        "[...[...document.querySelectorAll('#materials details')].find(one => \
         one.querySelector('summary').textContent === '{material}').querySelectorAll('label')]"
    )
}

/// Mean of `255 - code` over all channels of all pixels.
pub(crate) fn darkness(pixels: &[[u8; 3]]) -> f64 {
    let sum: u64 = pixels.as_flattened().iter().map(|&code| u64::from(255 - code)).sum();
    sum as f64 / (3 * pixels.len()) as f64
}

/// Cornell box with a point light besides its lamp.
pub(crate) fn two_lights() -> Value {
    let mut scene: Value = serde_json::from_slice(&std::fs::read(shipped("cornell.gltf")).unwrap()).unwrap();
    let add = |list: &mut Value, entry: Value| {
        let list = list.as_array_mut().unwrap();
        list.push(entry);
        list.len() - 1
    };
    let bulb = json!({"name": "bulb", "type": "point", "intensity": 2.0});
    scene["extensions"] = json!({"KHR_lights_punctual": {"lights": [bulb]}});
    add(&mut scene["extensionsUsed"], json!("KHR_lights_punctual"));
    let node = json!({"translation": [0.0, 0.4, 0.7], "extensions": {"KHR_lights_punctual": {"light": 0}}});
    let node = add(&mut scene["nodes"], node);
    add(&mut scene["scenes"][0]["nodes"], json!(node));
    scene
}
