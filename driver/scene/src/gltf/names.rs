//! Names of objects in messages.

use gltf::json;

/// Name of a mesh, or `mesh N`.
pub(super) fn mesh_name(root: &json::Root, mesh: usize) -> String {
    root.meshes[mesh].name.clone().unwrap_or_else(|| format!("mesh {mesh}"))
}

/// Name of a node in a message: `node 'NAME'` or `node N`. The node need not exist.
pub(super) fn node_name(root: &json::Root, node: usize) -> String {
    let name = root.nodes.get(node).and_then(|node| node.name.as_ref());
    name.map_or_else(|| format!("node {node}"), |name| format!("node '{name}'"))
}

/// Name of the object that a node is: the node's name, or `node N`.
pub(super) fn object_name(root: &json::Root, node: usize) -> String {
    let name = root.nodes.get(node).and_then(|node| node.name.clone());
    name.unwrap_or_else(|| format!("node {node}"))
}

/// List of names in quotation marks, for an error that offers them as choices.
pub(super) fn listed(names: &[String]) -> String {
    if names.is_empty() {
        return "none: leave the option out".to_owned();
    }
    let quoted: Vec<_> = names.iter().map(|name| format!("'{name}'")).collect();
    quoted.join(", ")
}
