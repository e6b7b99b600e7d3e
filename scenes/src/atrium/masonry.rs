//! Masonry: walls with arched openings, mouldings, vaults and paving.

use glam::{Vec2, Vec3};

use super::dimensions::{EMBED, HALF};
use crate::mesh::{Mesh, on_circle};

/// Wall panel with one opening that is round at its top and centred on x = 0.
///
/// The panel has no end, top or bottom faces, because they would lie inside adjacent masonry.
pub(super) struct ArchedPanel {
    pub(super) width: f32,
    pub(super) bottom: f32,
    pub(super) springing: f32,
    pub(super) top: f32,
    pub(super) radius: f32,
    /// Offsets (z) of the front and the back face, metres.
    pub(super) faces: [f32; 2],
    /// Number of segments per quarter circle of the arch.
    pub(super) segments: usize,
    /// Number of strips of faces between the opening and the panel's outline.
    pub(super) strips: usize,
}

impl ArchedPanel {
    pub(super) fn mesh(&self) -> Mesh {
        let outline = self.outline();
        let [front, back] = self.faces;
        let size = [outline.len(), self.strips + 1];
        let at = |column: usize, strip: usize, offset: f32| {
            let [inner, outer] = outline[column];
            let point = inner + (outer - inner) * (strip as f32 / self.strips as f32);
            // The outline itself must be exact: the next panel shares it.
            let point = if strip == self.strips { outer } else { point };
            point.extend(offset)
        };
        let mut mesh = Mesh::default();
        mesh.grid(size, [false, false], |column, strip| at(column, strip, front));
        let last = outline.len() - 1;
        mesh.grid(size, [false, false], |column, strip| at(last - column, strip, back));
        mesh.grid([outline.len(), 3], [false, false], |column, row| {
            at(column, 0, back + (front - back) * (row as f32 / 2.0))
        });
        mesh
    }

    /// Returns the points of the opening's edge from right to left, each with the corresponding point of the
    /// panel's outline.
    fn outline(&self) -> Vec<[Vec2; 2]> {
        let half = self.width / 2.0;
        let mut right = Vec::new();
        let jamb = self.springing - self.bottom;
        let jamb_steps = (jamb / 0.7).ceil() as usize;
        for step in 0..jamb_steps {
            let y = self.bottom + jamb * (step as f32 / jamb_steps as f32);
            right.push([Vec2::new(self.radius, y), Vec2::new(half, y)]);
        }
        let rise = self.top - self.springing;
        let side = (self.segments as f32 * rise / (rise + half)).round() as usize;
        let along_top = self.segments - side;
        for step in 0..=self.segments {
            let inner = on_circle(step, 4 * self.segments) * self.radius + Vec2::new(0.0, self.springing);
            let outer = if step <= side {
                Vec2::new(half, self.springing + rise * (step as f32 / side as f32))
            } else {
                Vec2::new(half * ((self.segments - step) as f32 / along_top as f32), self.top)
            };
            right.push([inner, outer]);
        }
        if let Some(crown) = right.last_mut() {
            crown[0].x = 0.0;
        }
        // The left half is the exact mirror image of the right half, so that adjacent panels meet bit for
        // bit.
        let left: Vec<_> =
            right.iter().rev().skip(1).map(|pair| pair.map(|p| Vec2::new(-p.x, p.y))).collect();
        right.into_iter().chain(left).collect()
    }
}

/// Moulding over an arch: a rectangular section between two radii and two offsets, with bevelled front edges.
pub(super) fn arch_moulding(springing: f32, radii: [f32; 2], offsets: [f32; 2], segments: usize) -> Mesh {
    let [inner, outer] = radii;
    let [front, back] = offsets;
    let bevel = 0.25 * (outer - inner);
    let profile = [
        [inner, front + bevel],
        [inner + bevel, front],
        [outer - bevel, front],
        [outer, front + bevel],
        [outer, back],
        [inner, back],
    ];
    let mut mesh = Mesh::default();
    // One more station at either end extends the feet of the moulding down into their supports.
    mesh.grid([segments + 3, profile.len()], [false, true], |station, row| {
        let [radius, offset] = profile[row];
        let drop = if station == 0 || station == segments + 2 { EMBED + 0.01 } else { 0.0 };
        let p = on_circle(station.clamp(1, segments + 1) - 1, 2 * segments) * radius;
        Vec3::new(p.x, springing + p.y - drop, offset)
    });
    mesh
}

/// Groin vault over a square bay centred on the y axis: two half cylinders that intersect in the diagonals.
///
/// The vault extends into the walls at both ends of z and, with `all_round`, also of x.
pub(super) fn groin_vault(springing: f32, radius: f32, all_round: bool) -> Mesh {
    const STEPS: usize = 10;
    // Position across the vault and height of the lines between a cylinder's facets. The angles of the lines
    // are equidistant, so that the facets are equal.
    let line = |index: usize| on_circle(STEPS - index, 2 * STEPS) * radius;
    let walled = |index: usize| match index {
        0 => Vec2::new(-radius - EMBED, 0.0),
        index if index == STEPS + 2 => Vec2::new(radius + EMBED, 0.0),
        index => line(index - 1),
    };
    let across = |index: usize| if all_round { walled(index) } else { line(index) };
    let columns = if all_round { STEPS + 3 } else { STEPS + 1 };
    let mut mesh = Mesh::default();
    mesh.grid_cut(
        [columns, STEPS + 3],
        [false, false],
        |column, row| {
            let (u, v) = (across(column), walled(row));
            Vec3::new(u.x, springing + u.y.max(v.y).max(0.0), v.x)
        },
        // Each cell that a groin crosses is divided along the groin.
        |column, row| (column < columns / 2) != (row < (STEPS + 2) / 2),
    );
    mesh
}

/// Sweeps a profile around the court, with mitred corners.
///
/// `profile` is a closed polygon of (offset, height) in metres, counter-clockwise if offsets point to the
/// right.
pub(super) fn ring(profile: &[[f32; 2]]) -> Mesh {
    const STEPS: [usize; 2] = [16, 6];
    // Corners of the court in units of its half size. The first side leads from -x to +x at +z.
    let corners = [Vec2::new(-1.0, 1.0), Vec2::ONE, Vec2::new(1.0, -1.0), Vec2::NEG_ONE];
    let stations: Vec<Vec2> = (0..4)
        .flat_map(|side| {
            let (from, to, steps) = (corners[side], corners[(side + 1) % 4], STEPS[side % 2]);
            (0..steps).map(move |step| from + (to - from) * (step as f32 / steps as f32))
        })
        .collect();
    let mut mesh = Mesh::default();
    mesh.grid([stations.len(), profile.len()], [true, true], |station, row| {
        let [offset, height] = profile[row];
        let p = stations[station] * (HALF + offset);
        Vec3::new(p.x, height, p.y)
    });
    mesh
}

/// Square slabs of side `size`, metres, at y = 0. Columns and rows run from `min` to `max`, exclusive. A slab
/// is laid where `chosen(column, row)` is true.
pub(super) fn paving(min: [i32; 2], max: [i32; 2], size: f32, chosen: impl Fn(i32, i32) -> bool) -> Mesh {
    let mut mesh = Mesh::default();
    for column in min[0]..max[0] {
        for row in min[1]..max[1] {
            if chosen(column, row) {
                let at =
                    |dx: i32, dz: i32| Vec3::new((column + dx) as f32 * size, 0.0, (row + dz) as f32 * size);
                mesh.quad([at(0, 1), at(1, 1), at(1, 0), at(0, 0)]);
            }
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_faces_outwards() {
        let mesh = ring(&[[-0.5, 0.0], [0.5, 0.0], [0.5, 1.0], [-0.5, 1.0]]);
        let volume = 25.0 * 10.0 - 23.0 * 8.0;
        assert!((mesh.volume() - volume).abs() < 1e-2, "{}", mesh.volume());
    }

    #[test]
    fn the_outline_of_a_panel_is_symmetric_and_its_area_right() {
        let panel = ArchedPanel {
            width: 3.0,
            bottom: 0.0,
            springing: 2.0,
            top: 4.0,
            radius: 1.0,
            faces: [-0.5, 0.5],
            segments: 32,
            strips: 2,
        };
        let outline = panel.outline();
        for (a, b) in outline.iter().zip(outline.iter().rev()) {
            assert_eq!(a[1], Vec2::new(-b[1].x, b[1].y));
        }
        // Sum of the areas of front and back, positive for triangles that face outwards.
        let mesh = panel.mesh();
        let flat = |corners: &&[u32; 3]| {
            let z = corners.map(|index| mesh.positions[index as usize].z);
            z[0] == z[1] && z[1] == z[2]
        };
        let area: f32 = mesh
            .triangles
            .iter()
            .filter(flat)
            .map(|corners| {
                let [a, b, c] = corners.map(|index| mesh.positions[index as usize]);
                0.5 * (b - a).cross(c - a).z * a.z.signum()
            })
            .sum();
        let expected = 2.0 * (3.0 * 4.0 - 2.0 * 2.0 - core::f32::consts::FRAC_PI_2);
        assert!((area - expected).abs() < 1e-2, "{area} {expected}");
    }
}
