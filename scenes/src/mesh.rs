//! Triangle meshes, and the operations that build the shapes of the scenes.
//!
//! Front faces are counter-clockwise. Shapes share vertices along inner edges, so that they have no cracks.
//! Sines and cosines come from `libm`, so that every machine computes equal bits.

use glam::{Vec2, Vec3};

/// Mesh of indexed triangles.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Positions of the vertices, metres.
    pub positions: Vec<Vec3>,
    /// Indices of the three vertices of each triangle, counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Unit normals of the vertices; empty if the mesh is flat-shaded.
    pub normals: Vec<Vec3>,
    /// Texture coordinates of the vertices, the second one downwards; empty without a texture.
    pub coordinates: Vec<Vec2>,
    /// Colours of the vertices, linear red, green and blue; empty if they are white.
    pub colours: Vec<[f32; 3]>,
}

impl Mesh {
    /// Lower and upper corner of the mesh's bounding box.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let empty = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        self.positions.iter().fold(empty, |(min, max), &p| (min.min(p), max.max(p)))
    }

    fn vertex(&mut self, position: Vec3) -> u32 {
        self.positions.push(position);
        (self.positions.len() - 1) as u32
    }

    /// Adds a triangle unless two of its corners coincide (at the pole of a surface of revolution).
    fn triangle(&mut self, corners: [u32; 3]) {
        let [a, b, c] = corners.map(|index| self.positions[index as usize]);
        if a != b && b != c && c != a {
            self.triangles.push(corners);
        }
    }

    /// Adds two triangles that form a quadrilateral, divided along the diagonal from its first to its third
    /// vertex.
    fn quad_between(&mut self, [a, b, c, d]: [u32; 4]) {
        self.triangle([a, b, c]);
        self.triangle([a, c, d]);
    }

    /// Adds a planar quadrilateral with its own vertices.
    pub fn quad(&mut self, corners: [Vec3; 4]) {
        let corners = corners.map(|corner| self.vertex(corner));
        self.quad_between(corners);
    }

    /// Adds a [`Self::quad`] with texture coordinates. Either all or no vertices of a mesh must have them.
    pub fn textured_quad(&mut self, corners: [Vec3; 4], coordinates: [[f32; 2]; 4]) {
        self.quad(corners);
        self.coordinates.extend(coordinates.map(Vec2::from_array));
    }

    /// Adds a triangle with its own vertices.
    pub fn lone_triangle(&mut self, corners: [Vec3; 3]) {
        let corners = corners.map(|corner| self.vertex(corner));
        self.triangle(corners);
    }

    /// Adds an upright prism: sides, top and bottom. `footprint` has the (x, z) of each corner,
    /// counter-clockwise seen from above.
    pub fn prism(&mut self, footprint: [[f32; 2]; 4], bottom: f32, top: f32) {
        let at = |corner: usize, y: f32| Vec3::new(footprint[corner][0], y, footprint[corner][1]);
        for [from, to] in [[0, 1], [2, 3], [1, 2], [3, 0]] {
            self.quad([at(from, bottom), at(to, bottom), at(to, top), at(from, top)]);
        }
        self.quad([0, 1, 2, 3].map(|corner| at(corner, top)));
        self.quad([3, 2, 1, 0].map(|corner| at(corner, bottom)));
    }

    /// Adds an axis-aligned box.
    pub fn cuboid(&mut self, min: Vec3, max: Vec3) {
        let footprint = [[min.x, max.z], [max.x, max.z], [max.x, min.z], [min.x, min.z]];
        self.prism(footprint, min.y, max.y);
    }

    /// Adds a box centred on the y axis, of half-width `half` in x and z.
    pub fn block(&mut self, half: f32, bottom: f32, top: f32) {
        self.cuboid(Vec3::new(-half, bottom, -half), Vec3::new(half, top, half));
    }

    /// Adds a grid of `columns` by `rows` vertices at the positions `point(column, row)`. The front normal is
    /// the cross product of the step to the next column and the step to the next row. `wrap` joins the last
    /// column to the first, the last row to the first, or both.
    pub fn grid(&mut self, size: [usize; 2], wrap: [bool; 2], point: impl Fn(usize, usize) -> Vec3) {
        self.grid_cut(size, wrap, point, |_, _| false);
    }

    /// Adds a [`Self::grid`] whose cells are divided along the other diagonal where `other_cut(column, row)`
    /// is true.
    pub fn grid_cut(
        &mut self,
        [columns, rows]: [usize; 2],
        wrap: [bool; 2],
        point: impl Fn(usize, usize) -> Vec3,
        other_cut: impl Fn(usize, usize) -> bool,
    ) {
        let first = self.positions.len();
        for row in 0..rows {
            self.positions.extend((0..columns).map(|column| point(column, row)));
        }
        let index = |column: usize, row: usize| (first + row % rows * columns + column % columns) as u32;
        for row in 0..rows - usize::from(!wrap[1]) {
            for column in 0..columns - usize::from(!wrap[0]) {
                let mut cell = [
                    index(column, row),
                    index(column + 1, row),
                    index(column + 1, row + 1),
                    index(column, row + 1),
                ];
                if other_cut(column, row) {
                    cell.rotate_left(1);
                }
                self.quad_between(cell);
            }
        }
    }

    /// Adds a surface of revolution about the y axis. `profile` has a radius and a height for each row of
    /// vertices. Where the profile leads upwards, the surface faces away from the axis. If the profile begins
    /// and ends on the axis, the surface is closed.
    pub fn lathe(&mut self, segments: usize, profile: &[[f32; 2]]) {
        self.fluted_lathe(segments, profile, |_, _| 1.0);
    }

    /// Adds a [`Self::lathe`] whose radius at each vertex is multiplied by `flute(segment, row)`.
    pub fn fluted_lathe(
        &mut self,
        segments: usize,
        profile: &[[f32; 2]],
        flute: impl Fn(usize, usize) -> f32,
    ) {
        self.grid([segments, profile.len()], [true, false], |segment, row| {
            let [radius, height] = profile[row];
            let direction = on_circle(segment, segments);
            let radius = radius * flute(segment, row);
            Vec3::new(radius * direction.x, height, -radius * direction.y)
        });
    }

    /// Appends another mesh, moved by `offset`.
    pub fn append(&mut self, other: &Self, offset: Vec3) {
        let first = self.positions.len() as u32;
        self.positions.extend(other.positions.iter().map(|&p| p + offset));
        self.normals.extend(&other.normals);
        self.coordinates.extend(&other.coordinates);
        self.colours.extend(&other.colours);
        self.triangles.extend(other.triangles.iter().map(|corners| corners.map(|index| first + index)));
    }

    /// Rotates the mesh by 90 degrees about the y axis, from +z towards +x.
    #[must_use]
    pub fn quarter_turn(mut self) -> Self {
        for p in &mut self.positions {
            *p = Vec3::new(p.z, p.y, 0.0 - p.x);
        }
        for n in &mut self.normals {
            *n = Vec3::new(n.z, n.y, 0.0 - n.x);
        }
        self
    }

    /// Computes the normal of each vertex as the area-weighted mean of the normals of its triangles.
    #[must_use]
    pub fn smooth(mut self) -> Self {
        let mut sums = vec![Vec3::ZERO; self.positions.len()];
        for corners in &self.triangles {
            let [a, b, c] = corners.map(|index| self.positions[index as usize]);
            for index in corners {
                sums[*index as usize] += (b - a).cross(c - a);
            }
        }
        self.normals = sums.into_iter().map(Vec3::normalize_or_zero).collect();
        self
    }

    /// Volume of a closed mesh, m^3; negative if its front faces inwards.
    pub fn volume(&self) -> f32 {
        let corner = |index: u32| self.positions[index as usize];
        self.triangles.iter().map(|&[a, b, c]| corner(a).dot(corner(b).cross(corner(c)))).sum::<f32>() / 6.0
    }
}

/// Returns the point of the unit circle at the angle `2 pi index / count` from +x towards +y.
pub fn on_circle(index: usize, count: usize) -> Vec2 {
    let angle = core::f32::consts::TAU * index as f32 / count as f32;
    Vec2::new(libm::cosf(angle), libm::sinf(angle))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closed_shapes_face_outwards() {
        let mut cube = Mesh::default();
        cube.block(0.5, 0.0, 1.0);
        assert_eq!(cube.volume(), 1.0);

        let mut cylinder = Mesh::default();
        cylinder.lathe(256, &[[0.0, 0.0], [1.0, 0.0], [1.0, 2.0], [0.0, 2.0]]);
        assert!((cylinder.volume() - core::f32::consts::TAU).abs() < 1e-2);
        assert_eq!(cylinder.triangles.len(), 256 * 4);

        assert!(cube.quarter_turn().volume() > 0.0);
    }
}
