//! The hemisphere above a surface, divided into 4x8 cells of equal projected solid angle. A cosine-weighted
//! direction lies in each cell with probability 1/32 (Jensen 1995).
//!
//! Rows divide the square of the sine of the angle to the normal, columns the azimuth. Cells are numbered in
//! boustrophedon order, so that consecutive cells are neighbours.

use core::f32::consts::PI;

use glam::Vec3;

use crate::vector::{about, max, sqrt, tangents};

/// Number of rows, from the normal to the horizon.
pub const ROWS: usize = 4;
/// Number of columns, around the normal.
pub const COLUMNS: usize = 8;
/// Number of cells.
pub const CELLS: usize = ROWS * COLUMNS;

/// Row and column of a cell.
#[inline(always)]
fn row_and_step(cell: u8) -> [u8; 2] {
    let [row, step] = [cell / COLUMNS as u8, cell % COLUMNS as u8];
    [row, if row.is_multiple_of(2) { step } else { COLUMNS as u8 - 1 - step }]
}

#[inline(always)]
pub(crate) fn cell_at(row: usize, column: usize) -> usize {
    row * COLUMNS + if row.is_multiple_of(2) { column } else { COLUMNS - 1 - column }
}

/// Number of the cell that contains the unit vector `direction`; `None` at or below the horizon of `normal`.
#[inline(always)]
pub fn cell_of(normal: Vec3, direction: Vec3) -> Option<u8> {
    let (tangent, bitangent) = tangents(normal);
    let [x, y, z] = [tangent, bitangent, normal].map(|axis| axis.dot(direction));
    if z <= 0.0 {
        return None;
    }
    let row = ((max(1.0 - z * z, 0.0) * ROWS as f32) as usize).min(ROWS - 1);
    // The octant of the azimuth, from signs and one comparison.
    let column = match (y >= 0.0, x >= 0.0) {
        (true, true) => usize::from(y >= x),
        (true, false) => 2 + usize::from(-x >= y),
        (false, false) => 4 + usize::from(-y >= -x),
        (false, true) => 6 + usize::from(x >= -y),
    };
    Some(cell_at(row, column) as u8)
}

/// Maps a point of the unit square to a direction in a cell, uniformly in projected solid angle. The
/// coordinate `along` follows the numbering of the cells, `across` goes from the normal to the horizon.
#[inline(always)]
pub(crate) fn direction_in(normal: Vec3, cell: u8, [along, across]: [f32; 2]) -> Vec3 {
    let [row, column] = row_and_step(cell);
    let turn = if row.is_multiple_of(2) { along } else { 1.0 - along };
    let azimuth = (column as f32 + turn) * (2.0 * PI / COLUMNS as f32);
    let sine_squared = (row as f32 + across) * (1.0 / ROWS as f32);
    let sine = sqrt(sine_squared);
    let cosine = sqrt(max(1.0 - sine_squared, 0.0));
    about(normal, azimuth, sine, cosine)
}

/// Centre of a cell: its azimuth, radians, and `sin^2` of its polar angle.
pub(crate) fn cell_centre(cell: u8) -> [f32; 2] {
    let [row, column] = row_and_step(cell);
    [(column as f32 + 0.5) * (2.0 * PI / COLUMNS as f32), (row as f32 + 0.5) * (1.0 / ROWS as f32)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_direction_of_a_cell_lies_in_that_cell() {
        for normal in [Vec3::Y, Vec3::new(1.0, -2.0, 0.5).normalize(), Vec3::NEG_Z] {
            for cell in 0..CELLS as u8 {
                for i in 0..100 {
                    let point = [(i % 10) as f32 / 10.0 + 0.05, (i / 10) as f32 / 10.0 + 0.05];
                    let direction = direction_in(normal, cell, point);
                    assert!((direction.length() - 1.0).abs() < 1e-5);
                    assert_eq!(cell_of(normal, direction), Some(cell), "{point:?}");
                }
            }
        }
        assert_eq!(cell_of(Vec3::Y, Vec3::NEG_Y), None);
        assert_eq!(cell_of(Vec3::Y, Vec3::X), None);
    }

    #[test]
    fn neighbours_of_the_walk_share_a_border() {
        for cell in 0..CELLS as u8 - 1 {
            let end = direction_in(Vec3::Z, cell, [1.0, 1.0]);
            let [row, next_row] = [cell, cell + 1].map(|cell| row_and_step(cell)[0]);
            let start = direction_in(Vec3::Z, cell + 1, [0.0, if row == next_row { 1.0 } else { 0.0 }]);
            // Between two rows the azimuth turns back, so that the next row begins where the last one ended.
            assert!(end.distance(start) < 1e-3, "{cell}: {end} {start}");
        }
    }
}
