//! Overlap of triangles in a plane.

use std::collections::HashMap;

use glam::DVec2;

/// Depth, relative to the cells' side, up to which triangles that share an edge or a corner may overlap.
const TOLERANCE: f64 = 1e-6;

/// Triangles in a plane, none of which overlaps another, in cells of a grid.
pub(super) struct Plane {
    /// Side of a cell.
    cell: f64,
    cells: HashMap<[i64; 2], Vec<u32>>,
    triangles: Vec<[DVec2; 3]>,
}

impl Plane {
    /// Creates an empty plane for triangles of about `area` each.
    pub(super) fn new(area: f64) -> Self {
        let cell = (2.0 * area).sqrt().max(f64::MIN_POSITIVE);
        Self { cell, cells: HashMap::new(), triangles: Vec::new() }
    }

    /// Adds a triangle; returns false, and does not add it, if it overlaps one that is there.
    pub(super) fn add(&mut self, triangle: [DVec2; 3]) -> bool {
        let [low, high] = bounds(&triangle).map(|corner| (corner / self.cell).floor());
        if !low.is_finite() || !high.is_finite() || (high - low).max_element() > 1e4 {
            return false;
        }
        let touched = self.touched(&triangle, [low.y as i64, high.y as i64]);
        let depth = TOLERANCE * self.cell;
        let others = touched.iter().filter_map(|cell| self.cells.get(cell)).flatten();
        let mut met = others.filter_map(|&other| self.triangles.get(other as usize));
        if met.any(|other| overlap(&triangle, other, depth)) {
            return false;
        }
        let index = self.triangles.len() as u32;
        self.triangles.push(triangle);
        touched.into_iter().for_each(|cell| self.cells.entry(cell).or_default().push(index));
        true
    }

    /// Cells that a triangle touches, in the rows from `first` to `last`.
    fn touched(&self, triangle: &[DVec2; 3], [first, last]: [i64; 2]) -> Vec<[i64; 2]> {
        let [a, b, c] = triangle.map(|corner| corner / self.cell);
        let mut touched = Vec::new();
        for row in first..=last {
            let (top, bottom) = (row as f64 - TOLERANCE, row as f64 + 1.0 + TOLERANCE);
            let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
            for [from, to] in [[a, b], [b, c], [c, a]] {
                let rise = to.y - from.y;
                // Shares of the edge between the borders of the row.
                let at =
                    |height: f64| if rise == 0.0 { 0.0 } else { ((height - from.y) / rise).clamp(0.0, 1.0) };
                if from.y.min(to.y) <= bottom && from.y.max(to.y) >= top {
                    let ends = if rise == 0.0 { [0.0, 1.0] } else { [at(top), at(bottom)] };
                    for x in ends.map(|share| from.x + (to.x - from.x) * share) {
                        (left, right) = (left.min(x), right.max(x));
                    }
                }
            }
            let columns = ((left - TOLERANCE).floor() as i64)..=((right + TOLERANCE).floor() as i64);
            touched.extend(columns.filter(|_| left <= right).map(|column| [column, row]));
        }
        touched
    }
}

/// Lower and upper corner of the rectangle around points.
pub(super) fn bounds(points: &[DVec2]) -> [DVec2; 2] {
    let empty = [DVec2::INFINITY, DVec2::NEG_INFINITY];
    points.iter().fold(empty, |[low, high], point| [low.min(*point), high.max(*point)])
}

/// Twice the signed area of a triangle.
pub(super) fn doubled_area([a, b, c]: &[DVec2; 3]) -> f64 {
    (*b - *a).perp_dot(*c - *a)
}

/// Returns whether two triangles overlap by more than `depth`: no line along an edge of either separates
/// them (separating axis theorem).
pub(super) fn overlap(one: &[DVec2; 3], other: &[DVec2; 3], depth: f64) -> bool {
    !separates(one, other, depth) && !separates(other, one, depth)
}

/// Returns whether a line along an edge of a triangle has all other points on its outer side.
pub(super) fn separates(triangle: &[DVec2; 3], points: &[DVec2], depth: f64) -> bool {
    let side = doubled_area(triangle).signum();
    let [a, b, c] = *triangle;
    [[a, b], [b, c], [c, a]].iter().any(|[from, to]| {
        let edge = (*to - *from).normalize_or_zero() * side;
        edge != DVec2::ZERO && points.iter().all(|point| edge.perp_dot(*point - *from) <= depth)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(corners: [[f64; 2]; 3]) -> [DVec2; 3] {
        corners.map(DVec2::from_array)
    }

    #[test]
    fn neighbours_do_not_overlap_and_crossing_or_equal_triangles_do() {
        let lower = triangle([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]);
        let upper = triangle([[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        let mut plane = Plane::new(0.5);
        assert!(plane.add(lower) && plane.add(upper));
        assert!(!plane.add(lower), "twice");
        assert!(!plane.add(triangle([[0.2, 0.1], [0.3, 0.1], [0.25, 0.15]])), "within");
        assert!(!plane.add(triangle([[-1.0, 0.5], [2.0, 0.4], [2.0, 0.6]])), "across");
        assert!(plane.add(triangle([[1.0, 0.0], [2.0, 0.0], [1.0, 1.0]])), "beside, mirrored or not");
        assert!(!plane.add(triangle([[f64::NAN, 0.0], [2.0, 0.0], [1.0, 1.0]])));
    }
}
