//! Footprint of a triangle on its texture: the texels that are visible on the triangle.

use photoncard_scene::{Texture, VertexAttributes, Wrap};

/// A triangle in texture coordinates.
pub(super) struct Footprint {
    wrap: [Wrap; 2],
    /// Transformed texture coordinates of the corners. The image extends from 0 to 1, from its upper left
    /// corner.
    corners: [[f64; 2]; 3],
}

/// Maximum magnitude of coordinates, cells. Above it, rounding blurs neighbouring cells.
const FARTHEST: f64 = 1e12;
/// Maximum number of cells in the bounding rectangle of a triangle whose cells are visited individually.
const MAX_CELLS: f64 = 8192.0;

impl Footprint {
    pub(super) fn new(texture: &Texture, attributes: &VertexAttributes) -> Self {
        let coordinates = attributes.coordinates[texture.set as usize & 1];
        let corners = coordinates.map(|coordinate| {
            let [u, v] = coordinate.to_array().map(f64::from);
            [0, 1].map(|axis| {
                let [a, b] = texture.matrix[axis].map(f64::from);
                a * u + b * v + f64::from(texture.offset[axis])
            })
        });
        Self { wrap: texture.wrap, corners }
    }

    /// Calls `visit` for every cell that contributes to the triangle's surface, with the cell's index and
    /// whether its centre lies on the triangle. A cell of a repeated image is visited repeatedly. `size` is
    /// the number of columns and rows of the image's grid; a cell contributes up to `reach` cells from its
    /// centre. Returns false, and visits no cell, if there are too many.
    pub(super) fn for_each_cell(
        &self,
        size: [u32; 2],
        reach: f64,
        mut visit: impl FnMut(usize, bool),
    ) -> bool {
        let [columns, rows] = size;
        let corners = self.corners.map(|[x, y]| [x * f64::from(columns), y * f64::from(rows)]);
        let side = |axis: usize| {
            let places = corners.map(|corner| corner[axis]);
            let lower = places.into_iter().fold(f64::INFINITY, f64::min);
            [lower, places.into_iter().fold(f64::NEG_INFINITY, f64::max)]
        };
        let [[left, right], [top, bottom]] = [side(0), side(1)];
        let all = (right - left + 2.0 * reach) * (bottom - top + 2.0 * reach);
        let is_near = corners.as_flattened().iter().all(|place| place.abs() < FARTHEST);
        // NaN fails both comparisons.
        let is_seen = is_near && all <= MAX_CELLS;
        if !is_seen {
            return false;
        }
        let cells = |lower: f64, upper: f64| {
            (lower - 0.5 - reach).ceil() as i64..=(upper - 0.5 + reach).floor() as i64
        };
        for row in cells(top, bottom) {
            let middle = row as f64 + 0.5;
            let Some([left, right]) = across(corners, middle - reach, middle + reach) else { continue };
            let first = wrapped(row, rows, self.wrap[1]) as usize * columns as usize;
            let inside = across(corners, middle, middle).unwrap_or([f64::INFINITY; 2]);
            for column in cells(left, right) {
                let is_inside = (inside[0]..=inside[1]).contains(&(column as f64 + 0.5));
                visit(first + wrapped(column, columns, self.wrap[0]) as usize, is_inside);
            }
        }
        true
    }
}

/// Horizontal interval `[left, right]` that a triangle covers between `top` and `bottom`; `None` if it does
/// not reach there.
fn across([a, b, c]: [[f64; 2]; 3], top: f64, bottom: f64) -> Option<[f64; 2]> {
    let mut sides: Option<[f64; 2]> = None;
    let mut include = |x: f64| {
        let [left, right] = sides.unwrap_or([x, x]);
        sides = Some([left.min(x), right.max(x)]);
    };
    for [[x0, y0], [x1, y1]] in [[a, b], [b, c], [c, a]] {
        if (top..=bottom).contains(&y0) {
            include(x0);
        }
        for border in [top, bottom] {
            if (y0 < border) != (y1 < border) {
                include(x0 + (x1 - x0) * ((border - y0) / (y1 - y0)));
            }
        }
    }
    sides
}

/// Column or row of the image at a coordinate that can lie beyond the image's borders.
fn wrapped(place: i64, size: u32, wrap: Wrap) -> u32 {
    let size = i64::from(size);
    let texel = match wrap {
        Wrap::Repeat => place.rem_euclid(size),
        Wrap::Mirror => {
            let place = place.rem_euclid(2 * size);
            place.min(2 * size - 1 - place)
        }
        Wrap::Clamp => place.clamp(0, size - 1),
    };
    texel as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_wrap_beyond_their_borders() {
        let all = |wrap: Wrap| [-5, -1, 0, 3, 4, 8].map(|place| wrapped(place, 4, wrap));
        assert_eq!(all(Wrap::Repeat), [3, 3, 0, 3, 0, 0]);
        assert_eq!(all(Wrap::Mirror), [3, 0, 0, 3, 3, 0]);
        assert_eq!(all(Wrap::Clamp), [0, 0, 0, 3, 3, 3]);
    }
}
