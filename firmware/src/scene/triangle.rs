//! Ray against triangle, watertight: Woop, Benthin, Wald 2013, *Watertight ray/triangle intersection*.
//!
//! A ray that passes an edge shared by two triangles meets at least one of them. Coordinates are sheared so that the
//! ray runs along +z; the signs of three edge functions decide. Where one is zero in `f32` it is computed again in
//! `f64`, in which the products are exact.

use glam::Vec3;

use super::Ray;

/// A ray made ready for many triangles.
#[derive(Clone, Copy, Debug)]
pub struct RayFrame {
    origin: Vec3,
    /// The axes: the greatest component of the direction is the last.
    axes: [usize; 3],
    shear: [f32; 3],
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intersection {
    /// Distance along the ray, metres.
    pub distance: f32,
    /// Weights of the three corners, of sum 1.
    pub barycentric: [f32; 3],
}

#[inline(always)]
fn component(v: Vec3, axis: usize) -> f32 {
    match axis {
        0 => v.x,
        1 => v.y,
        _ => v.z,
    }
}

impl RayFrame {
    /// Makes a ray ready.
    #[inline(always)]
    pub fn new(ray: &Ray) -> Self {
        let magnitude = ray.direction.abs();
        let last = if magnitude.x > magnitude.y && magnitude.x > magnitude.z {
            0
        } else if magnitude.y > magnitude.z {
            1
        } else {
            2
        };
        let axes = [(last + 1) % 3, (last + 2) % 3, last];
        let along = component(ray.direction, last);
        let shear = [
            component(ray.direction, axes[0]) / along,
            component(ray.direction, axes[1]) / along,
            1.0 / along,
        ];
        Self { origin: ray.origin, axes, shear }
    }

    /// The corner relative to the origin, sheared; and its depth before scaling.
    #[inline(always)]
    fn shear(&self, vertex: [f32; 3]) -> ([f32; 2], f32) {
        let relative = Vec3::from_array(vertex) - self.origin;
        let depth = component(relative, self.axes[2]);
        let x = component(relative, self.axes[0]) - self.shear[0] * depth;
        let y = component(relative, self.axes[1]) - self.shear[1] * depth;
        ([x, y], depth)
    }

    /// Where the ray meets a triangle, from either side, at a distance in (0, `max_distance`].
    #[inline(always)]
    pub fn intersect(&self, vertices: &[[f32; 3]; 3], max_distance: f32) -> Option<Intersection> {
        let [(a, a_depth), (b, b_depth), (c, c_depth)] = vertices.map(|vertex| self.shear(vertex));
        let mut edges = [cross(c, b), cross(a, c), cross(b, a)];
        if edges.contains(&0.0) {
            edges = [cross_exact(c, b), cross_exact(a, c), cross_exact(b, a)];
        }
        let [u, v, w] = edges;
        let negative = u < 0.0 || v < 0.0 || w < 0.0;
        let positive = u > 0.0 || v > 0.0 || w > 0.0;
        let determinant = u + v + w;
        if negative && positive || determinant == 0.0 {
            return None;
        }
        let inverse = 1.0 / determinant;
        let distance = (u * a_depth + v * b_depth + w * c_depth) * self.shear[2] * inverse;
        let inside = distance > 0.0 && distance <= max_distance;
        inside.then_some(Intersection { distance, barycentric: [u * inverse, v * inverse, w * inverse] })
    }
}

#[inline(always)]
fn cross([ax, ay]: [f32; 2], [bx, by]: [f32; 2]) -> f32 {
    ax * by - ay * bx
}

#[cold]
fn cross_exact([ax, ay]: [f32; 2], [bx, by]: [f32; 2]) -> f32 {
    (ax as f64 * by as f64 - ay as f64 * bx as f64) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLE: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

    fn meet(origin: [f32; 3], direction: [f32; 3]) -> Option<Intersection> {
        let ray = Ray::new(origin.into(), Vec3::from(direction).normalize());
        RayFrame::new(&ray).intersect(&TRIANGLE, ray.max_distance)
    }

    #[test]
    fn a_ray_meets_a_triangle_from_both_sides_at_its_distance() {
        let above = meet([0.25, 0.5, 2.0], [0.0, 0.0, -1.0]).unwrap();
        assert_eq!(above.distance, 2.0);
        assert_eq!(above.barycentric, [0.25, 0.25, 0.5]);
        assert_eq!(meet([0.25, 0.5, -3.0], [0.0, 0.0, 1.0]).unwrap().distance, 3.0);
    }

    #[test]
    fn a_ray_misses_beside_behind_and_along_the_plane() {
        assert_eq!(meet([0.75, 0.5, 2.0], [0.0, 0.0, -1.0]), None);
        assert_eq!(meet([0.25, 0.5, 2.0], [0.0, 0.0, 1.0]), None);
        assert_eq!(meet([-1.0, 0.2, 0.0], [1.0, 0.0, 0.0]), None);
    }

    #[test]
    fn no_ray_passes_between_two_triangles() {
        let quad = [[-1.0_f32, -1.0, 0.3], [1.1, -1.0, 0.0], [1.0, 1.3, 0.2], [-1.0, 1.0, -0.1]];
        let halves = [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]];
        for i in 0..20_000 {
            let t = (i as f32 + 100.0) / 20_200.0;
            let target = Vec3::from(quad[0]) * (1.0 - t) + Vec3::from(quad[2]) * t;
            let origin = Vec3::new(0.3, -0.2 + t, 4.0 - t);
            let ray = Ray::new(origin, (target - origin).normalize());
            let frame = RayFrame::new(&ray);
            assert!(halves.iter().any(|half| frame.intersect(half, f32::INFINITY).is_some()), "{t}");
        }
    }
}
