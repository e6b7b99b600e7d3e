//! Lights of `KHR_lights_punctual` with the transforms of their nodes.

use glam::{DMat4, DVec3, Vec3};
use gltf::json::extensions::scene::khr_lights_punctual::{Light, Type};
use gltf::json::validation::Checked;

use super::document::Document;
use crate::error::SceneError;
use crate::scene::limits::EMISSION;
use crate::scene::{PunctualKind, PunctualLight, Scene};

/// Minimum difference of the cosines of a spot light's cones, as `KHR_lights_punctual` recommends. Exporters write equal
/// angles for a sharp edge.
const MIN_PENUMBRA: f32 = 0.001;

/// Tolerance by which a rounded outer cone angle may exceed a right angle.
const ANGLE_TOLERANCE: f32 = 1e-4;

/// Lights of the file.
pub(super) fn lights(document: &Document) -> &[Light] {
    let extensions = document.root.extensions.as_ref();
    extensions.and_then(|root| root.khr_lights_punctual.as_ref()).map_or(&[], |extension| &extension.lights)
}

/// Adds the light `index`, which exists, with the transform of `node`.
pub(super) fn place(
    document: &Document,
    index: usize,
    node: usize,
    world: &DMat4,
    scene: &mut Scene,
) -> Result<(), SceneError> {
    let light = &lights(document)[index];
    let item = |field: &str| format!("extensions.KHR_lights_punctual.lights[{index}].{field}");
    let intensity = Vec3::from(light.color) * light.intensity;
    let is_possible = |value: f32| value == 0.0 || EMISSION.contains(&value);
    if !intensity.to_array().into_iter().all(is_possible) {
        let reason = format!("the light's intensity is {intensity}, its colour included");
        let remedy = "state a colour of 0 or more, and an intensity of 0, or of 1e-20 to 1e20";
        return Err(document.invalid(item("intensity"), reason, remedy));
    }
    let position = world.w_axis.truncate().as_vec3();
    let direction = (-world.z_axis.truncate()).try_normalize().map(DVec3::as_vec3);
    let misplaced = || {
        let reason = "the light's node, with its parents, gives it no finite position or no direction";
        let remedy = "give the light's node and its parents a finite position and a scale other than 0";
        document.invalid(format!("nodes[{node}]"), reason, remedy)
    };
    if !position.is_finite() {
        return Err(misplaced());
    }
    let kind = match light.type_ {
        Checked::Valid(Type::Directional) => {
            PunctualKind::Directional { direction: direction.ok_or_else(misplaced)? }
        }
        Checked::Valid(Type::Spot) => {
            let (inner_cosine, outer_cosine) = cones(light).ok_or_else(|| {
                let remedy = "state 0 <= innerConeAngle < outerConeAngle <= pi / 2";
                document.invalid(item("spot"), "the angles of the light's cones are not possible", remedy)
            })?;
            let direction = direction.ok_or_else(misplaced)?;
            PunctualKind::Spot { position, direction, inner_cosine, outer_cosine }
        }
        // Validation has rejected other types.
        Checked::Valid(Type::Point) | Checked::Invalid => PunctualKind::Point { position },
    };
    let name = light.name.clone().unwrap_or_else(|| format!("light {index}"));
    scene.lights.push(PunctualLight { name, kind, intensity });
    Ok(())
}

/// Cosines of the inner and the outer cone angle of a spot light.
fn cones(light: &Light) -> Option<(f32, f32)> {
    let spot = light.spot.as_ref()?;
    let (inner, outer) = (spot.inner_cone_angle, spot.outer_cone_angle);
    let right = std::f32::consts::FRAC_PI_2;
    if !(outer > 0.0 && outer <= right + ANGLE_TOLERANCE && inner >= 0.0 && inner <= outer) {
        return None;
    }
    let (inner, outer) = (libm::cosf(inner), libm::cosf(outer.min(right)));
    Some((inner, outer.min(inner - MIN_PENUMBRA)))
}
