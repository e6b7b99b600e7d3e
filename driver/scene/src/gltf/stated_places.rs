//! Translations of nodes in double precision. The `gltf` crate keeps single precision, which is too coarse
//! far from the origin.

use glam::DVec3;
use photoncard_picture::foreign;
use serde::Deserialize;

use super::document::Document;

#[derive(Deserialize)]
struct File {
    #[serde(default)]
    nodes: Vec<Node>,
}

#[derive(Deserialize)]
struct Node {
    translation: Option<[f64; 3]>,
    matrix: Option<[f64; 16]>,
}

/// Reads the translation of each node from the JSON: the last column of its matrix or, without one, its
/// `translation`. `None` for nodes with neither.
pub(super) fn read(document: &Document) -> Vec<Option<DVec3>> {
    let parsed = foreign::decode(|| Ok(serde_json::from_str(document.text()).ok()), || ());
    let File { nodes } = parsed.ok().flatten().unwrap_or(File { nodes: Vec::new() });
    let place = |Node { translation, matrix }| {
        let column = |columns: [f64; 16]| DVec3::new(columns[12], columns[13], columns[14]);
        matrix.map(column).or(translation.map(DVec3::from_array)).filter(|place| place.is_finite())
    };
    nodes.into_iter().map(place).collect()
}
