//! Connected parts of surfaces, and whether they are closed.

use glam::Vec3;

/// Steps per radian to which the angle of a triangle around an edge is rounded. Triangles of equal rounded
/// angles are taken as coplanar.
const ANGLE_STEPS: f32 = 1e4;

/// A connected part of a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Indices of the part's triangles, ascending.
    pub triangles: Vec<u32>,
    /// True if every edge is traversed equally often in both directions, so that the part bounds a solid.
    pub is_closed: bool,
}

/// Edge between two vertices: the bits of their coordinates, the lesser vertex first.
type Ends = [[u32; 3]; 2];

/// Edge of one triangle, with the direction in which the triangle traverses it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Side {
    ends: Ends,
    triangle: u32,
    /// Corner of the triangle at which the edge begins.
    corner: usize,
    /// True if the triangle traverses the edge from the first of `ends` to the second.
    is_forward: bool,
}

/// Splits triangles into connected parts, in the order of their first triangles. Two triangles with a common
/// edge are connected if no third triangle has this edge. If more triangles share an edge, as where solids
/// touch, two neighbours around the edge are connected if the inside of a solid lies between them.
pub fn parts(triangles: &[[Vec3; 3]]) -> Vec<Part> {
    let mut sides: Vec<Side> =
        triangles.iter().zip(0..).flat_map(|(corners, index)| sides(corners, index)).collect();
    sides.sort_unstable();
    let mut forest = Forest::new(triangles.len());
    for around in sides.chunk_by(|one, other| one.ends == other.ends) {
        match around {
            [one, other] => forest.join(one.triangle, other.triangle),
            _ => partners(triangles, around).for_each(|[one, other]| forest.join(one, other)),
        }
    }
    let mut is_open = vec![false; triangles.len()];
    for around in sides.chunk_by(|one, other| one.ends == other.ends) {
        let mut passed: Vec<(u32, i32)> = around
            .iter()
            .map(|side| (forest.root(side.triangle), if side.is_forward { 1 } else { -1 }))
            .collect();
        passed.sort_unstable();
        for of_part in passed.chunk_by(|(one, _), (other, _)| one == other) {
            let sum: i32 = of_part.iter().map(|(_, direction)| direction).sum();
            is_open[of_part[0].0 as usize] |= sum != 0;
        }
    }
    let mut part_of = vec![usize::MAX; triangles.len()];
    let mut found: Vec<Part> = Vec::new();
    for triangle in 0..triangles.len() as u32 {
        let root = forest.root(triangle) as usize;
        if part_of[root] == usize::MAX {
            part_of[root] = found.len();
            found.push(Part { triangles: Vec::new(), is_closed: !is_open[root] });
        }
        found[part_of[root]].triangles.push(triangle);
    }
    found
}

fn sides(corners: &[Vec3; 3], triangle: u32) -> [Side; 3] {
    // Negative zero equals zero.
    let bits = corners.map(|corner| corner.to_array().map(|axis| (axis + 0.0).to_bits()));
    [0, 1, 2].map(|corner| {
        let [from, to] = [bits[corner], bits[(corner + 1) % 3]];
        Side { ends: [from.min(to), from.max(to)], triangle, corner, is_forward: from < to }
    })
}

/// Pairs of triangles that are neighbours around an edge and turn their backs to each other: the inside of a
/// solid lies between them.
fn partners(triangles: &[[Vec3; 3]], around: &[Side]) -> impl Iterator<Item = [u32; 2]> {
    let Some(first) = around.first() else { unreachable!("an edge is a triangle's") };
    let [from, to] = first.ends.map(|end| Vec3::from_array(end.map(f32::from_bits)));
    let axis = (to - from).normalize_or(Vec3::X);
    let (u, v) = axis.any_orthonormal_pair();
    let turn = (core::f32::consts::TAU * ANGLE_STEPS) as i32;
    let mut sorted: Vec<(i32, bool, u32)> = around
        .iter()
        .map(|side| {
            let across = triangles[side.triangle as usize][(side.corner + 2) % 3] - from;
            // `u`, `v` and the axis are a right-handed basis. A triangle that traverses the edge forwards
            // therefore faces greater angles.
            let angle = f32::atan2(across.dot(v), across.dot(u));
            let step = ((angle * ANGLE_STEPS).round() as i32).rem_euclid(turn);
            // Of triangles at one angle the forward ones come first, because the solid behind them is at
            // lesser angles.
            (step, !side.is_forward, side.triangle)
        })
        .collect();
    sorted.sort_unstable();
    let before = sorted.clone().into_iter().cycle().skip(sorted.len() - 1);
    sorted.into_iter().zip(before).filter_map(
        |((_, is_backward, triangle), (_, is_before_backward, before))| {
            (!is_backward && is_before_backward).then_some([triangle, before])
        },
    )
}

/// Disjoint-set forest.
struct Forest {
    parents: Vec<u32>,
}

impl Forest {
    fn new(count: usize) -> Self {
        Self { parents: (0..count as u32).collect() }
    }

    fn root(&mut self, mut item: u32) -> u32 {
        while self.parents[item as usize] != item {
            let parent = self.parents[item as usize];
            self.parents[item as usize] = self.parents[parent as usize];
            item = parent;
        }
        item
    }

    fn join(&mut self, one: u32, other: u32) {
        let (one, other) = (self.root(one), self.root(other));
        self.parents[one.max(other) as usize] = one.min(other);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Triangles of an axis-aligned box that faces outwards.
    fn block(lower: Vec3, upper: Vec3) -> Vec<[Vec3; 3]> {
        let corner = |bits: usize| {
            Vec3::from([0, 1, 2].map(|axis| if bits >> axis & 1 == 1 { upper[axis] } else { lower[axis] }))
        };
        [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]]
            .into_iter()
            .flat_map(|face| {
                let [a, b, c, d] = face.map(corner);
                [[a, b, c], [a, c, d]]
            })
            .collect()
    }

    fn sheet(z: f32) -> Vec<[Vec3; 3]> {
        let [a, b, c, d] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| Vec3::new(x, y, z));
        vec![[a, b, c], [a, c, d]]
    }

    #[track_caller]
    fn check(triangles: &[[Vec3; 3]], expected: &[(usize, bool)]) {
        let found: Vec<_> =
            parts(triangles).iter().map(|part| (part.triangles.len(), part.is_closed)).collect();
        assert_eq!(found, expected);
    }

    #[test]
    fn a_box_is_closed_and_one_without_a_face_and_a_sheet_are_not() {
        let block = block(Vec3::ZERO, Vec3::ONE);
        check(&block, &[(12, true)]);
        check(&block[2..], &[(10, false)]);
        check(&[sheet(3.0), block].concat(), &[(2, false), (12, true)]);
        check(&[], &[]);
    }

    #[test]
    fn solids_that_touch_are_apart() {
        let at = |x: f32, y: f32| block(Vec3::new(x, y, 0.0), Vec3::new(x + 1.0, y + 1.0, 1.0));
        check(&[at(0.0, 0.0), at(1.0, 0.0)].concat(), &[(12, true); 2]);
        check(&[at(0.0, 0.0), at(1.0, 1.0)].concat(), &[(12, true); 2]);
        let wall: Vec<_> = (0..9).flat_map(|index| at((index % 3) as f32, (index / 3) as f32)).collect();
        check(&wall, &[(12, true); 9]);
    }

    #[test]
    fn a_liquid_and_the_cavity_that_it_fills_are_apart() {
        let outside = block(Vec3::NEG_ONE, Vec3::splat(2.0));
        let cavity = block(Vec3::ZERO, Vec3::ONE).into_iter().map(|[a, b, c]| [a, c, b]).collect();
        check(&[outside, cavity, block(Vec3::ZERO, Vec3::ONE)].concat(), &[(12, true); 3]);
    }

    #[test]
    fn a_sheet_on_the_edge_of_a_solid_leaves_it_closed() {
        for flip in [false, true] {
            let mut sheet = sheet(1.0);
            for corners in &mut sheet {
                corners.iter_mut().for_each(|corner| corner.x += 1.0);
                if flip {
                    corners.swap(1, 2);
                }
            }
            check(&[block(Vec3::ZERO, Vec3::ONE), sheet].concat(), &[(12, true), (2, false)]);
        }
    }
}
