//! `photoncard scene info`.

use std::path::Path;

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
        let mut parts = vec![format!("diffuse {}", material.diffuse)];
        if material.specular.max_element() > 0.0 {
            parts.push(format!("specular {} exponent {}", material.specular, material.exponent));
        }
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
