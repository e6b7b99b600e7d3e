//! Scenes from glTF 2.0 files, `.gltf` and `.glb`.
//!
//! The `gltf` crate supplies the JSON's types and the rules it must keep. Its readers of binary data trust the file
//! and panic on a bad one, so the bytes are read here: every offset, stride and count is checked before use, and
//! nothing is allocated for a count alone.

mod accessor;
mod buffers;
mod camera;
mod document;
mod material;
mod mesh;
mod notices;

use std::path::Path;

use glam::{DMat4, DQuat, DVec3};

use self::accessor::Source;
use self::camera::CameraPlacer;
use self::document::Document;
use self::mesh::MeshPlacer;
use self::notices::Notices;
use crate::error::SceneError;
use crate::scene::Scene;

/// The most triangles a scene may hold, those of zero area included.
pub const MAX_TRIANGLES: usize = 1 << 24;

/// The deepest hierarchy of nodes.
const MAX_DEPTH: usize = 1024;

/// Loads the default scene of a glTF file, or its first.
///
/// What the file holds and the renderer does not use is named in [`Scene::notices`].
///
/// # Errors
/// If the file, or a file it refers to, cannot be read, breaks a rule of glTF, or holds no triangle with an area. The
/// error names the place and the remedy. Whether there is light is for [`Scene::check_light`] to say.
pub fn load(path: &Path) -> Result<Scene, SceneError> {
    let document = Document::read(path)?;
    let buffers = buffers::load(&document)?;
    let mut notices = Notices::default();
    let materials = material::load(&document, &mut notices)?;
    let mut scene = Scene { materials, ..Scene::default() };
    let meshes = MeshPlacer::new(Source { document: &document, buffers: &buffers });
    place_nodes(&document, meshes, &mut scene, &mut notices)?;
    let file = || path.to_owned();
    match (scene.triangles.is_empty(), scene.skipped_triangles) {
        (true, 0) => return Err(SceneError::NoGeometry { file: file() }),
        (true, skipped) => return Err(SceneError::OnlyZeroArea { file: file(), skipped }),
        _ => {}
    }
    if scene.cameras.is_empty() {
        scene.cameras.push(camera::frame(&scene));
        notices.framed = true;
    }
    scene.notices = notices.finish(&document);
    Ok(scene)
}

/// Walks the scene's nodes, each parent before its children, and places their meshes and cameras.
fn place_nodes(
    document: &Document,
    mut meshes: MeshPlacer<'_>,
    scene: &mut Scene,
    notices: &mut Notices,
) -> Result<(), SceneError> {
    let root = &document.root;
    let chosen = root.scene.map_or(0, |scene| scene.value());
    let Some(chosen) = root.scenes.get(chosen) else {
        return Err(SceneError::NoScene { file: document.path.clone() });
    };
    let mut cameras = CameraPlacer::new(document);
    let mut seen = vec![false; root.nodes.len()];
    // The node, the transform of its parents, and its depth; the next one last.
    let mut open: Vec<_> = chosen.nodes.iter().rev().map(|node| (node.value(), DMat4::IDENTITY, 0)).collect();
    while let Some((index, parent, depth)) = open.pop() {
        let fault = |reason, remedy| Err(document.invalid(format!("nodes[{index}]"), reason, remedy));
        if std::mem::replace(&mut seen[index], true) {
            let reason = "the node is reached twice: it has two parents, or is its own descendant";
            return fault(reason, "give every node one parent; a mesh may be shown by several nodes instead");
        }
        if depth > MAX_DEPTH {
            let reason = format!("the node lies more than {MAX_DEPTH} levels deep");
            return Err(document.invalid(
                format!("nodes[{index}]"),
                reason,
                "flatten the hierarchy of nodes",
            ));
        }
        let node = &root.nodes[index];
        let Some(local) = local_transform(node) else {
            let reason =
                "the transform is not finite, or does not keep parallels parallel, or has a zero rotation";
            return fault(reason, "give the node a finite translation, rotation and scale");
        };
        let world = parent * local;
        if let Some(mesh) = node.mesh {
            meshes.place(mesh.value(), &world, scene, notices)?;
        }
        if let Some(camera) = node.camera {
            cameras.place(camera.value(), index, &world, scene, notices)?;
        }
        let children = node.children.iter().flatten().rev();
        open.extend(children.map(|child| (child.value(), world, depth + 1)));
    }
    Ok(())
}

/// The node's own transform, if it is an affine one.
fn local_transform(node: &gltf::json::Node) -> Option<DMat4> {
    let transform = if let Some(columns) = node.matrix {
        DMat4::from_cols_array(&columns.map(f64::from))
    } else {
        let vector =
            |values: Option<[f32; 3]>, default| values.map_or(default, |v| DVec3::from(v.map(f64::from)));
        let rotation = node.rotation.map_or(Some(DQuat::IDENTITY), |rotation| {
            let rotation = DQuat::from_array(rotation.0.map(f64::from));
            let length = rotation.length();
            (length > 0.0 && length.is_finite()).then(|| rotation / length)
        })?;
        let (scale, translation) = (vector(node.scale, DVec3::ONE), vector(node.translation, DVec3::ZERO));
        DMat4::from_scale_rotation_translation(scale, rotation, translation)
    };
    (transform.is_finite() && transform.row(3).to_array() == [0.0, 0.0, 0.0, 1.0]).then_some(transform)
}
