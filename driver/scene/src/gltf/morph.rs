//! Morph targets: displacements of a primitive's vertices (glTF 2.0, 3.7.2.2).

use glam::Vec3;
use gltf::json;
use gltf::json::accessor::{ComponentType, Type};

use super::accessor::{Elements, Format, Integers, Source};
use crate::error::SceneError;

const DISPLACEMENTS: Format = Format {
    types: &[Type::Vec3],
    components: &[
        ComponentType::F32,
        ComponentType::I8,
        ComponentType::U8,
        ComponentType::I16,
        ComponentType::U16,
    ],
    integers: Integers::AsStated,
};

/// Maximum number of morph targets of a primitive. Even a target that takes few bytes of the file costs time
/// for every vertex.
const MAX_TARGETS: usize = 1024;

/// Accessors of one morph target's displacements, each with as many elements as the primitive has vertices.
pub(super) struct MorphTarget<'a> {
    positions: Option<Elements<'a>>,
    normals: Option<Elements<'a>>,
    tangents: Option<Elements<'a>>,
}

/// Attribute that a morph target displaces.
#[derive(Clone, Copy)]
pub(super) enum Displaced {
    Position,
    Normal,
    Tangent,
}

impl MorphTarget<'_> {
    fn of(&self, attribute: Displaced) -> Option<&Elements<'_>> {
        match attribute {
            Displaced::Position => self.positions.as_ref(),
            Displaced::Normal => self.normals.as_ref(),
            Displaced::Tangent => self.tangents.as_ref(),
        }
    }
}

/// Reads the morph targets of a primitive of `count` vertices. `item` is the JSON path of the primitive.
pub(super) fn targets<'a>(
    source: &Source<'a>,
    item: &str,
    primitive: &json::mesh::Primitive,
    count: u64,
) -> Result<Vec<MorphTarget<'a>>, SceneError> {
    let stated = primitive.targets.as_deref().unwrap_or_default();
    if stated.len() > MAX_TARGETS {
        let reason = format!("there are {} of them, and at most {MAX_TARGETS} are read", stated.len());
        let remedy = "leave out the morph targets that no animation needs";
        return Err(source.document.invalid(format!("{item}.targets"), reason, remedy));
    }
    let stated = stated.iter().enumerate();
    let targets = stated.map(|(index, target)| {
        let read = |name: &str, accessor: Option<usize>| {
            let item = format!("{item}.targets[{index}].{name}");
            let Some(accessor) = accessor else { return Ok(None) };
            let found = Elements::new(source, accessor, &item, &DISPLACEMENTS)?;
            if found.count == count {
                return Ok(Some(found));
            }
            let reason = format!("there are {} of them, and {count} positions", found.count);
            let remedy = "export the mesh again; its morph targets do not fit it";
            Err(source.document.invalid(item, reason, remedy))
        };
        Ok(MorphTarget {
            positions: read("POSITION", target.positions.map(|accessor| accessor.value()))?,
            normals: read("NORMAL", target.normals.map(|accessor| accessor.value()))?,
            tangents: read("TANGENT", target.tangents.map(|accessor| accessor.value()))?,
        })
    });
    targets.collect()
}

/// Attribute of a vertex plus the weighted displacements of the morph targets.
pub(super) fn displaced(
    base: Vec3,
    targets: &[MorphTarget<'_>],
    weights: &[f32],
    attribute: Displaced,
    vertex: u64,
) -> Vec3 {
    let mut sum = base;
    for (target, &weight) in targets.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
        if let Some(displacements) = target.of(attribute) {
            sum += weight * Vec3::from(displacements.vec3(vertex));
        }
    }
    sum
}
