//! Names of objects in messages.

use gltf::json;

/// Name of a mesh, or `mesh N`.
pub(super) fn mesh_name(root: &json::Root, mesh: usize) -> String {
    root.meshes[mesh].name.clone().unwrap_or_else(|| format!("mesh {mesh}"))
}
