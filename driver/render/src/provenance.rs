//! Provenance of a render: everything that picture and statistics depend on, as values by option names.

use std::collections::BTreeMap;

use glam::Vec3;
use photoncard_scene::{Camera, Lens, Projection, Scene};
use photoncard_shared::budget::Budget;
use photoncard_shared::message::{FrameParameters, PROTOCOL_VERSION};
use serde::Serialize;
use serde_json::{Value, json};

use super::{NamedSettings, RenderSettings};
use crate::emulator::EmulatedKind;

/// Provenance of a render. The caller adds the names of its inputs, which the library does not know.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Provenance {
    /// Everything that pixels depend on. It is stored in picture files, and does not depend on the order of
    /// the work, caches or cards.
    pub pixels: NamedSettings,
    /// Everything else that the work depends on: order, photon map layout, cards, caches.
    pub work: NamedSettings,
}

impl Provenance {
    /// Provenance of a render of `scene`, seen by `camera`, on chips with `budgets`.
    pub(super) fn new(
        settings: &RenderSettings,
        scene: &Scene,
        camera: &Camera,
        frame: &FrameParameters,
        budgets: &[Budget],
    ) -> Self {
        let mut pixels = settings.identity(scene);
        pixels.extend(settings.picture.of_layers());
        // The distances in use, which are derived from the photons if none are stated.
        for (name, distance) in [("max-distance", frame.max_distance), ("near-distance", frame.near_distance)]
        {
            if pixels.get(name).is_none_or(Value::is_null) {
                pixels.insert(name.to_owned(), json!({ "auto": distance }));
            }
        }
        pixels.insert("view".to_owned(), view(camera));
        let mut work = settings.of_work();
        work.extend(settings.of_cards());
        work.insert("chips".to_owned(), json!(chips(budgets)));
        work.insert("protocol".to_owned(), json!(PROTOCOL_VERSION));
        Self { pixels, work }
    }
}

/// Description of the camera with all changes applied: name, position in metres, unit vectors, and the
/// projection: vertical field of view in degrees, half the height in metres, or angles in degrees. Lens shift
/// and lens are left out if there are none.
fn view(camera: &Camera) -> Value {
    let Camera { name, origin, right: _, up, forward, projection, shift, lens, aspect: _ } = camera;
    let [origin, up, forward] = [origin, up, forward].map(Vec3::to_array);
    let mut view = json!({"camera": name, "at": origin, "forward": forward, "up": up});
    match projection {
        Projection::Perspective { vertical_fov } => view["fov"] = json!(vertical_fov.to_degrees()),
        Projection::Orthographic { half_height } => view["orthographic"] = json!(2.0 * half_height),
        Projection::Panorama { angles } => view["panorama"] = json!(angles.map(f32::to_degrees)),
    }
    if *shift != [0.0; 2] {
        view["shift"] = json!(shift);
    }
    if let Some(Lens { radius, focus }) = lens {
        (view["aperture"], view["focus"]) = (json!(2.0 * radius), json!(focus));
    }
    view
}

/// Number of chips of each kind.
fn chips(budgets: &[Budget]) -> BTreeMap<&'static str, usize> {
    let mut chips = BTreeMap::new();
    for budget in budgets {
        *chips.entry(EmulatedKind::name_of(budget)).or_default() += 1;
    }
    chips
}

#[cfg(test)]
mod tests {
    use photoncard_firmware::kind::{MICRO, REFERENCE};

    use super::*;

    #[test]
    fn chips_are_counted_by_kind() {
        let other = Budget { samples: REFERENCE.samples + 1, ..REFERENCE };
        let counted = chips(&[REFERENCE, MICRO, REFERENCE, other]);
        assert_eq!(json!(counted), json!({"micro": 1, "other": 1, "reference": 2}));
    }
}
