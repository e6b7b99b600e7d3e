//! Groups of triangles, and their instances in the scene.

use glam::{DMat3, DMat4, DVec3, Vec3};
use photoncard_shared::layout::{Rows, placed_normal, placed_point};

use crate::triangle::VertexAttributes;

/// A copy of a group of triangles, placed by a transform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// Index into [`SceneContents::groups`](crate::SceneContents::groups).
    pub group: u32,
    /// Transform from the group's space to the world. It does not mirror.
    pub to_world: Rows,
    /// Inverse of [`Self::to_world`].
    pub to_group: Rows,
    /// Index into [`SceneContents::objects`](crate::SceneContents::objects).
    pub object: u32,
}

/// Minimum and maximum absolute determinant of a transform that can be inverted in single precision.
const DETERMINANTS: [f64; 2] = [1e-18, 1e18];
/// Maximum condition number of a transform, the product of its Frobenius norm and that of its inverse; 3 for
/// rotations. The rounding errors of rays in a group's space are proportional to it.
const MAX_CONDITION: f64 = 100.0;

impl Instance {
    /// Returns whether a transform mirrors; `None` if its inverse is not exact enough in single precision, so
    /// that no instance can have it.
    pub(crate) fn mirrors(to_world: &DMat4) -> Option<bool> {
        let [least, greatest] = DETERMINANTS;
        let linear = DMat3::from_mat4(*to_world);
        let determinant = linear.determinant();
        let norm =
            |matrix: DMat3| matrix.to_cols_array().iter().map(|value| value * value).sum::<f64>().sqrt();
        let is_exact = (least..greatest).contains(&determinant.abs())
            && norm(linear) * norm(linear.inverse()) <= MAX_CONDITION;
        is_exact.then_some(determinant < 0.0)
    }

    /// Creates an instance; `None` if the transform mirrors or cannot be inverted in single precision.
    pub fn new(group: u32, to_world: &DMat4) -> Option<Self> {
        let mirrors = Self::mirrors(to_world)?;
        let to_world = rows(to_world);
        let of_rounded = DMat4::from_cols_array(&columns(&to_world));
        let to_group = rows(&of_rounded.inverse());
        let is_finite = to_world.iter().chain(&to_group).flatten().all(|value| value.is_finite());
        (is_finite && !mirrors).then_some(Self { group, to_world, to_group, object: 0 })
    }

    /// Lower and upper corner of the box around the instance, metres, computed from the corners of its
    /// group's box in the group's space.
    pub fn bounds(&self, [lower, upper]: [Vec3; 2]) -> [Vec3; 2] {
        let corner = |which: usize| {
            let side = |axis: usize| if which >> axis & 1 == 0 { lower[axis] } else { upper[axis] };
            Vec3::from(placed_point(&self.to_world, [side(0), side(1), side(2)]))
        };
        (1..8).map(corner).fold([corner(0); 2], |[low, high], corner| [low.min(corner), high.max(corner)])
    }

    /// Factor by which the transform enlarges areas: the mean over three areas, each perpendicular to one
    /// axis of the group's space.
    pub fn area_factor(&self) -> f64 {
        let column = |axis: usize| DVec3::from(self.to_world.map(|row| f64::from(row[axis])));
        let [x, y, z] = [0, 1, 2].map(column);
        [y.cross(z), z.cross(x), x.cross(y)].map(DVec3::length).iter().sum::<f64>() / 3.0
    }

    /// Transforms the normals in a triangle's attributes from the group's space to the world.
    pub(crate) fn attributes(&self, attributes: &VertexAttributes) -> VertexAttributes {
        let placed = |normal: Vec3| placed_normal(&self.to_group, normal.to_array()).into();
        let normals =
            attributes.normals.map(|normals| normals.map(|normal| Vec3::normalize_or_zero(placed(normal))));
        VertexAttributes { normals, ..*attributes }
    }
}

fn rows(matrix: &DMat4) -> Rows {
    [0, 1, 2].map(|row| matrix.row(row).as_vec4().to_array())
}

fn columns([x, y, z]: &Rows) -> [f64; 16] {
    let rows = [x, y, z, &[0.0, 0.0, 0.0, 1.0]];
    std::array::from_fn(|index| f64::from(rows[index % 4][index / 4]))
}
