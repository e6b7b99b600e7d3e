//! Transforms of nodes, applied to positions and normals.

use glam::{DMat3, DMat4, DQuat, DVec3, Vec3};
use gltf::json;

use super::animation::NodePose;

/// Affine transform, and its matrix for normals.
#[derive(Clone)]
pub(super) struct Transform {
    pub(super) matrix: DMat4,
    normals: DMat3,
    /// True if the transform mirrors, which swaps the front and the back of triangles.
    pub(super) is_mirror: bool,
}

impl Transform {
    pub(super) fn new(matrix: DMat4) -> Self {
        let is_mirror = matrix.determinant() < 0.0;
        let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(glam::DVec4::truncate);
        // The cofactor matrix is the inverse transpose times the determinant. It exists for singular matrices
        // as well.
        let sign = if is_mirror { -1.0 } else { 1.0 };
        let normals = DMat3::from_cols(y.cross(z) * sign, z.cross(x) * sign, x.cross(y) * sign);
        Self { matrix, normals, is_mirror }
    }

    pub(super) fn place(&self, local: Vec3) -> Vec3 {
        self.matrix.transform_point3(local.as_dvec3()).as_vec3()
    }

    /// Tangent in world space, of any length.
    pub(super) fn tangent(&self, local: Vec3) -> DVec3 {
        self.matrix.transform_vector3(local.as_dvec3())
    }

    /// Unit normal in world space; `None` if its length is zero or not finite.
    pub(super) fn normal(&self, local: Vec3) -> Option<Vec3> {
        (self.normals * local.as_dvec3()).try_normalize().map(DVec3::as_vec3)
    }
}

/// Local transform of a node in a pose; `None` if it is not affine or not finite. A node with a matrix
/// ignores the pose.
pub(super) fn local(node: &json::Node, pose: Option<&NodePose>) -> Option<DMat4> {
    let transform = if let Some(columns) = node.matrix {
        DMat4::from_cols_array(&columns.map(f64::from))
    } else {
        let vector = |values: [f32; 3]| DVec3::from(values.map(f64::from));
        let translation = pose.and_then(|pose| pose.translation).or(node.translation.map(vector));
        let scale = pose.and_then(|pose| pose.scale).or(node.scale.map(vector));
        let stated = || node.rotation.map(|rotation| DQuat::from_array(rotation.0.map(f64::from)));
        let rotation = pose.and_then(|pose| pose.rotation).or_else(stated).unwrap_or(DQuat::IDENTITY);
        composed(translation.unwrap_or(DVec3::ZERO), rotation, scale.unwrap_or(DVec3::ONE))?
    };
    (transform.is_finite() && transform.row(3).to_array() == [0.0, 0.0, 0.0, 1.0]).then_some(transform)
}

/// Translation times rotation times scale; `None` if the quaternion's length is zero or not finite.
pub(super) fn composed(translation: DVec3, rotation: DQuat, scale: DVec3) -> Option<DMat4> {
    let length = rotation.length();
    let rotation = (length > 0.0 && length.is_finite()).then(|| rotation / length)?;
    Some(DMat4::from_scale_rotation_translation(scale, rotation, translation))
}
