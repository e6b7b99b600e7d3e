//! Names of a file's objects, for people.

use gltf::json;

/// The mesh's name, or `mesh N`.
pub(super) fn mesh_name(root: &json::Root, mesh: usize) -> String {
    root.meshes[mesh].name.clone().unwrap_or_else(|| format!("mesh {mesh}"))
}
