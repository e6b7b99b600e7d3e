//! Tangents of a primitive's corners: stated by `TANGENT`, or computed.

use glam::{DVec3, Vec2, Vec3, Vec4};
use photoncard_picture::allocation;
use photoncard_picture::foreign;

use super::mikktspace::{self, Corner};
use super::morph::Displaced;
use super::primitive::Tangents;
use super::transform::Transform;
use super::vertex::{Corners, VertexReader};
use crate::CornerTangents;
use crate::error::SceneError;

impl VertexReader<'_, '_> {
    /// Tangents of the primitive; `None` without a normal map.
    pub(super) fn tangents(&self) -> Result<Option<&Tangents>, SceneError> {
        let (Some(set), known) = (self.primitive.tangent_set, &self.primitive.known_tangents) else {
            return Ok(None);
        };
        if let Some(tangents) = known.get() {
            return Ok(Some(tangents));
        }
        let are_stated = self.primitive.tangents.is_some() && self.are_stated_sound()?;
        let tangents = if are_stated { Tangents::Stated } else { Tangents::Computed(self.computed(set)?) };
        Ok(Some(known.get_or_init(|| tangents)))
    }

    /// Returns whether the stated tangents of all triangles are finite and not zero, with a w other than 0.
    fn are_stated_sound(&self) -> Result<bool, SceneError> {
        for triangle in 0..self.primitive.triangles {
            let corners = self.indices(triangle)?;
            let is_sound =
                |tangent: Vec4| tangent.is_finite() && tangent.truncate() != Vec3::ZERO && tangent.w != 0.0;
            if !corners.into_iter().all(|vertex| is_sound(self.stated_tangent(vertex))) {
                self.not_finite.tangents.set(true);
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn stated_tangent(&self, vertex: u64) -> Vec4 {
        self.primitive.tangents.as_ref().map_or(Vec4::ZERO, |found| found.floats(vertex, [0.0; 4]).into())
    }

    /// Computes tangents from a set of texture coordinates by `MikkTSpace`.
    fn computed(&self, set: usize) -> Result<Vec<[Vec4; 3]>, SceneError> {
        let document = self.source.document;
        let count = self.primitive.triangles;
        allocation::check(count.saturating_mul(mikktspace::BYTES_OF_A_TRIANGLE))
            .map_err(|error| SceneError::memory(&document.path, "computing tangents", error))?;
        let mut triangles = Vec::with_capacity(count as usize);
        for triangle in 0..count {
            let vertices = self.indices(triangle)?;
            let [a, b, c] = vertices.map(|vertex| Vec3::from(self.primitive.positions.vec3(vertex)));
            let own = (b - a).cross(c - a).normalize_or_zero();
            let mut corners = [Corner { position: a, normal: own, coordinates: Vec2::ZERO }; 3];
            for ((corner, vertex), position) in corners.iter_mut().zip(vertices).zip([a, b, c]) {
                let stated = self.primitive.normals.as_ref().map(|normals| Vec3::from(normals.vec3(vertex)));
                let normal = stated.and_then(Vec3::try_normalize).unwrap_or(own);
                *corner = Corner { position, normal, coordinates: self.coordinate(set, vertex)? };
            }
            triangles.push(corners);
        }
        foreign::decode(
            || Ok(mikktspace::tangents(&triangles)),
            || {
                let item = format!("meshes[{}].primitives[{}]", self.mesh, self.primitive.index);
                let reason = "its tangents cannot be computed";
                document.invalid(item, reason, "export the mesh again, with tangents")
            },
        )
    }

    /// Transforms the tangents of a triangle's corners to world space. The results are perpendicular to
    /// `normals`.
    pub(super) fn placed_tangents(
        &self,
        tangents: &Tangents,
        triangle: u64,
        corners: &Corners<'_>,
        normals: [Vec3; 3],
    ) -> CornerTangents {
        [0, 1, 2].map(|corner| {
            let local = match tangents {
                Tangents::Stated => {
                    let vertex = corners.vertices[corner];
                    let stated = self.stated_tangent(vertex);
                    let along = stated.truncate();
                    self.displaced(along, corners.weights, Displaced::Tangent, vertex).extend(stated.w)
                }
                Tangents::Computed(list) => list[triangle as usize][corners.order[corner]],
            };
            world(local, &corners.transforms[corner], normals[corner].as_dvec3())
        })
    }
}

/// Transforms a tangent to world space, perpendicular to the corner's normal. A mirroring transform inverts
/// the sign of the bitangent in w.
fn world(local: Vec4, transform: &Transform, normal: DVec3) -> Vec4 {
    let along = transform.tangent(local.truncate());
    let tangent = (along - normal * normal.dot(along)).normalize_or_zero();
    let sign = if (local.w < 0.0) == transform.is_mirror { 1.0 } else { -1.0 };
    tangent.as_vec3().extend(sign)
}
