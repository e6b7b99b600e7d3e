//! Transforms of nodes, and what they do to places and to normals.

use glam::{DMat3, DMat4, DQuat, DVec3, Vec3};
use gltf::json;

/// A transform with the matrix for normals.
#[derive(Clone)]
pub(super) struct Transform {
    matrix: DMat4,
    normals: DMat3,
    /// Whether it turns the front of a triangle to the back.
    pub(super) is_mirror: bool,
}

impl Transform {
    pub(super) fn new(matrix: DMat4) -> Self {
        let is_mirror = matrix.determinant() < 0.0;
        let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(glam::DVec4::truncate);
        // The matrix of cofactors is the inverse transposed times the determinant. It is there where no inverse is.
        let sign = if is_mirror { -1.0 } else { 1.0 };
        let normals = DMat3::from_cols(y.cross(z) * sign, z.cross(x) * sign, x.cross(y) * sign);
        Self { matrix, normals, is_mirror }
    }

    pub(super) fn place(&self, local: Vec3) -> Vec3 {
        self.matrix.transform_point3(local.as_dvec3()).as_vec3()
    }

    /// The unit normal in the world, if it is one.
    pub(super) fn normal(&self, local: Vec3) -> Option<Vec3> {
        (self.normals * local.as_dvec3()).try_normalize().map(DVec3::as_vec3)
    }
}

/// The node's own transform, if it is an affine one.
pub(super) fn local(node: &json::Node) -> Option<DMat4> {
    let transform = if let Some(columns) = node.matrix {
        DMat4::from_cols_array(&columns.map(f64::from))
    } else {
        let vector =
            |values: Option<[f32; 3]>, default| values.map_or(default, |v| DVec3::from(v.map(f64::from)));
        let rotation = node.rotation.map_or([0.0, 0.0, 0.0, 1.0], |rotation| rotation.0);
        composed(vector(node.translation, DVec3::ZERO), rotation, vector(node.scale, DVec3::ONE))?
    };
    (transform.is_finite() && transform.row(3).to_array() == [0.0, 0.0, 0.0, 1.0]).then_some(transform)
}

/// Scale, then rotation, then translation; `None` if the quaternion is none of a rotation.
pub(super) fn composed(translation: DVec3, rotation: [f32; 4], scale: DVec3) -> Option<DMat4> {
    let rotation = DQuat::from_array(rotation.map(f64::from));
    let length = rotation.length();
    let rotation = (length > 0.0 && length.is_finite()).then(|| rotation / length)?;
    Some(DMat4::from_scale_rotation_translation(scale, rotation, translation))
}
