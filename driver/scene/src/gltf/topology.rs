//! Topologies of triangles: lists, strips and fans.

use gltf::json;
use gltf::json::mesh::{Mode, Semantic};
use gltf::json::validation::Checked;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Topology {
    List,
    Strip,
    Fan,
}

impl Topology {
    /// Topology of a primitive, if it consists of triangles.
    pub(super) fn of(primitive: &json::mesh::Primitive) -> Option<Self> {
        match primitive.mode {
            Checked::Valid(Mode::Triangles) => Some(Self::List),
            Checked::Valid(Mode::TriangleStrip) => Some(Self::Strip),
            Checked::Valid(Mode::TriangleFan) => Some(Self::Fan),
            _ => None,
        }
    }

    /// Topology of a primitive that is rendered, which consists of triangles and has positions.
    pub(super) fn of_rendered(primitive: &json::mesh::Primitive) -> Option<Self> {
        Self::of(primitive).filter(|_| has_positions(primitive))
    }

    /// Number of whole triangles that `vertices` vertices form, and whether vertices are left over.
    pub(super) fn triangles(self, vertices: u64) -> (u64, bool) {
        match self {
            Self::List => (vertices / 3, !vertices.is_multiple_of(3)),
            Self::Strip | Self::Fan => (vertices.saturating_sub(2), matches!(vertices, 1 | 2)),
        }
    }

    /// Vertices of a triangle, counter-clockwise (glTF 2.0, 3.7.2.1).
    pub(super) fn vertices(self, triangle: u64) -> [u64; 3] {
        let odd = triangle % 2;
        match self {
            Self::List => [3 * triangle, 3 * triangle + 1, 3 * triangle + 2],
            Self::Strip => [triangle, triangle + 1 + odd, triangle + 2 - odd],
            Self::Fan => [triangle + 1, triangle + 2, 0],
        }
    }
}

/// Returns whether a primitive has positions. Only extensions define primitives without positions.
pub(super) fn has_positions(primitive: &json::mesh::Primitive) -> bool {
    primitive.attributes.contains_key(&Checked::Valid(Semantic::Positions))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares orientation: the two triangles of a quadrilateral face one way in a strip and in a fan.
    #[test]
    fn strips_and_fans_keep_their_side() {
        assert_eq!([0, 1].map(|triangle| Topology::List.vertices(triangle)), [[0, 1, 2], [3, 4, 5]]);
        assert_eq!([0, 1].map(|triangle| Topology::Strip.vertices(triangle)), [[0, 1, 2], [1, 3, 2]]);
        assert_eq!([0, 1].map(|triangle| Topology::Fan.vertices(triangle)), [[1, 2, 0], [2, 3, 0]]);
    }

    #[test]
    fn vertices_make_whole_triangles() {
        let counts = |topology: Topology| [0, 1, 2, 3, 4].map(|count| topology.triangles(count));
        assert_eq!(counts(Topology::List), [(0, false), (0, true), (0, true), (1, false), (1, true)]);
        assert_eq!(counts(Topology::Strip), [(0, false), (0, true), (0, true), (1, false), (2, false)]);
        assert_eq!(counts(Topology::Fan), counts(Topology::Strip));
    }
}
