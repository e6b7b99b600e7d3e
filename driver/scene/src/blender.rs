//! Files of Blender's glTF exporter: recognition by `asset.generator`, units and falloff of its lights, and
//! help about contents that its default settings leave out.

use super::light_units::LightUnits;

/// Start of `asset.generator` in a file of Blender's exporter; `v` and the version follow.
const NAME: &str = "Khronos glTF Blender I/O";

/// First version of Blender's exporter that writes intensities in candela and lux by default; earlier ones
/// write watts.
const PHOTOMETRIC_SINCE: (u32, u32) = (3, 4);

/// Help of the error that a file of Blender's exporter has no light.
pub(super) const NO_LIGHT: &str = "tick Include > Data > Punctual Lights in Blender's export dialog, or pass \
     export_lights=True to export_scene.gltf; area lights and the world are not exported: make emissive planes of area \
     lights, and add the world by --environment; or give a material an Emission Strength above 0";

/// Help of the error that a file of Blender's exporter has no camera.
pub(super) const NO_CAMERA: &str = "tick Include > Data > Cameras in Blender's export dialog, or pass \
     export_cameras=True to export_scene.gltf";

/// Returns whether `asset.generator` names Blender's exporter.
pub(super) fn is_exporter(generator: Option<&str>) -> bool {
    generator.is_some_and(|name| name.starts_with(NAME))
}

/// Returns the units of the lights in a file with this `asset.generator`; `None` if the file is not of
/// Blender's exporter.
///
/// The file does not state the exporter's *Lighting Mode*; the default, *Standard*, is assumed.
pub(super) fn light_units(generator: Option<&str>) -> Option<LightUnits> {
    let rest = generator?.strip_prefix(NAME)?;
    let is_early = version(rest).is_some_and(|version| version < PHOTOMETRIC_SINCE);
    Some(if is_early { LightUnits::Watts } else { LightUnits::Photometric })
}

/// Parses the major and minor version of a text such as ` v5.0.21`.
fn version(text: &str) -> Option<(u32, u32)> {
    let mut numbers = text.trim_start().strip_prefix('v')?.split('.').map(str::parse);
    Some((numbers.next()?.ok()?, numbers.next()?.ok()?))
}

/// Returns the cosine of the inner cone angle at which glTF's spot falloff emits the same flux as Blender's.
/// `inner` and `outer` are the cone angles in the file, radians; `outer_cosine` is the cosine of `outer`.
///
/// The exporter writes `inner = outer (1 - blend)`. Blender's falloff is a smooth step of the cosine from 0
/// at `cos outer` to 1 at `cos outer + w`, where `w = blend (1 - cos outer)`. Its integral over the width `w`
/// is `w / 2`. The integral of glTF's squared ramp over a width `v` is `v / 3`. The spots have equal flux for
/// `v = 3 w / 4`.
pub(super) fn inner_cosine(inner: f32, outer: f32, outer_cosine: f32) -> f32 {
    let blend = 1.0 - inner / outer;
    outer_cosine + 0.75 * blend * (1.0 - outer_cosine)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_states_the_units_of_the_lights() {
        for (generator, units) in [
            (Some("Khronos glTF Blender I/O v5.0.21"), Some(LightUnits::Photometric)),
            (Some("Khronos glTF Blender I/O v3.4.50"), Some(LightUnits::Photometric)),
            (Some("Khronos glTF Blender I/O v3.3.35"), Some(LightUnits::Watts)),
            (Some("Khronos glTF Blender I/O v1.2.75"), Some(LightUnits::Watts)),
            (Some("Khronos glTF Blender I/O"), Some(LightUnits::Photometric)),
            (Some("Khronos glTF Blender I/O v9"), Some(LightUnits::Photometric)),
            (Some("glTF-Transform v4.5.1"), None),
            (Some(""), None),
            (None, None),
        ] {
            assert_eq!(light_units(generator), units, "{generator:?}");
            assert_eq!(is_exporter(generator), units.is_some(), "{generator:?}");
        }
    }

    /// Integral of `falloff` over the cosine, from 0 to 1.
    fn flux(falloff: impl Fn(f64) -> f64) -> f64 {
        let steps = 100_000;
        (0..steps).map(|step| falloff((f64::from(step) + 0.5) / f64::from(steps))).sum::<f64>()
            / f64::from(steps)
    }

    #[test]
    fn a_spot_has_the_flux_of_blenders_falloff() {
        for (size, blend) in [(0.8_f64, 0.15), (1.2, 0.5), (1.0, 1.0), (3.1, 0.3)] {
            let (outer, inner) = (0.5 * size, 0.5 * size * (1.0 - blend));
            let edge = outer.cos();
            let of_blender = flux(|cosine| {
                let t = ((cosine - edge) / (blend * (1.0 - edge))).clamp(0.0, 1.0);
                t * t * (3.0 - 2.0 * t)
            });
            let full = f64::from(inner_cosine(inner as f32, outer as f32, edge as f32));
            let of_gltf = flux(|cosine| ((cosine - edge) / (full - edge)).clamp(0.0, 1.0).powi(2));
            assert!((of_gltf / of_blender - 1.0).abs() < 1e-3, "{of_gltf} {of_blender}");
        }
    }
}
