//! `photoncard scene info`.

use std::path::Path;

use photoncard_driver::scene::Reflection;
use photoncard_driver::scene::gltf::load;

use crate::console::print;
use crate::failure::Failure;

/// Prints what a scene holds.
pub(crate) fn info(path: &Path) -> Result<(), Failure> {
    let scene = load(path).map_err(Failure::input)?;
    let (lower, upper) = scene.bounds();
    let mut lines = Vec::new();
    lines.push(format!("triangles  {}", scene.triangles.len()));
    lines.push(format!("skipped    {} of zero area", scene.skipped_triangles));
    lines.push(format!("bounds     {lower} to {upper} m"));
    for camera in &scene.cameras {
        let degrees = camera.vertical_fov.to_degrees();
        lines.push(format!(
            "camera     {} at {}, vertical field of view {degrees:.1} degrees",
            camera.name, camera.origin
        ));
    }
    for material in &scene.materials {
        let mut parts = reflection(&material.reflection);
        if material.emission.max_element() > 0.0 {
            parts.push(format!("emission {} W/(sr m^2)", material.emission));
        }
        if material.double_sided {
            parts.push("double-sided".into());
        }
        lines.push(format!("material   {}: {}", material.name, parts.join(", ")));
    }
    for notice in &scene.notices {
        lines.push(format!("ignored    {notice}"));
    }
    print(&(lines.join("\n") + "\n"))
}

fn reflection(reflection: &Reflection) -> Vec<String> {
    match reflection {
        Reflection::Phong { diffuse, specular, exponent } => {
            let mut parts = vec![format!("diffuse {diffuse}")];
            if specular.max_element() > 0.0 {
                parts.push(format!("specular {specular} exponent {exponent}"));
            }
            parts
        }
        Reflection::MetallicRoughness { base_colour, metallic, roughness, dielectric, transmission } => {
            let mut parts = vec![format!(
                "base colour {base_colour}, metallic {metallic}, roughness {roughness}, dielectric {dielectric}"
            )];
            if let Some(transmission) = transmission {
                let kind = if transmission.is_volume { "volume" } else { "thin wall" };
                parts.push(format!(
                    "transmission {} through a {kind}, ior {}, absorption {} / m",
                    transmission.factor, transmission.ior, transmission.absorption
                ));
            }
            parts
        }
    }
}
