//! The pose of a mesh: its node's transform, or its skin's matrices.

use std::borrow::Cow;

use glam::DMat4;

use super::primitive::Primitive;
use super::skin::Skin;
use super::transform::Transform;

/// The transforms of a mesh's vertices into the world.
pub(super) struct Pose<'s> {
    transform: Transform,
    skin: Option<&'s Skin>,
}

impl<'s> Pose<'s> {
    /// The node's own transform, or the pose of the skin, beside which the node's does not count.
    pub(super) fn new(world: DMat4, skin: Option<&'s Skin>) -> Self {
        Self { transform: Transform::new(world), skin }
    }

    /// The transform of a vertex.
    ///
    /// # Errors
    /// If the joints or weights of the vertex are not valid, with the reason.
    pub(super) fn of(&self, primitive: &Primitive<'_>, vertex: u64) -> Result<Cow<'_, Transform>, String> {
        match self.skin {
            Some(skin) if !primitive.influences.is_empty() => {
                Ok(Cow::Owned(Transform::new(skin.matrix(primitive, vertex)?)))
            }
            _ => Ok(Cow::Borrowed(&self.transform)),
        }
    }
}
