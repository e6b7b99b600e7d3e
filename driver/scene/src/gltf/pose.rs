//! Pose of a mesh: the transform of its node, or the joint matrices of its skin, and the weights of its morph
//! targets.

use std::borrow::Cow;

use glam::DMat4;

use super::primitive::Primitive;
use super::skin::Skin;
use super::transform::Transform;

/// World transforms of a mesh's vertices, and weights of its morph targets.
pub(super) struct Pose<'s> {
    transform: Transform,
    skin: Option<&'s Skin>,
    /// Weights of the morph targets; those beyond the list are 0.
    pub(super) weights: &'s [f32],
}

impl<'s> Pose<'s> {
    /// Creates a pose. Primitives with joints ignore the node's world transform if there is a skin.
    pub(super) fn new(world: DMat4, skin: Option<&'s Skin>, weights: &'s [f32]) -> Self {
        Self { transform: Transform::new(world), skin, weights }
    }

    /// World transform of meshes without joints.
    pub(super) fn world(&self) -> &Transform {
        &self.transform
    }

    /// World transform of a vertex.
    ///
    /// # Errors
    /// The reason, if the joints or weights of the vertex are invalid.
    pub(super) fn of(&self, primitive: &Primitive<'_>, vertex: u64) -> Result<Cow<'_, Transform>, String> {
        match self.skin {
            Some(skin) if !primitive.influences.is_empty() => {
                Ok(Cow::Owned(Transform::new(skin.matrix(primitive, vertex)?)))
            }
            _ => Ok(Cow::Borrowed(&self.transform)),
        }
    }
}
