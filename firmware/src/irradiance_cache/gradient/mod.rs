//! Irradiance gradients (Ward, Heckbert 1992, *Irradiance gradients*) from rays in cells of the hemisphere.
//!
//! The translational gradient is a sum over the borders of neighbouring cells. Each term is the difference of
//! the two cells' radiances times the speed at which the border moves over the hemisphere when the point
//! moves. This speed is proportional to the inverse distance in the nearer cell. The gradient is therefore
//! linear in the radiances, with coefficients that depend only on distances. The survey finds the distances
//! before any photon is gathered, so that gathers can add their terms in any order.

use core::f32::consts::{FRAC_1_PI, PI};

use crate::importance::{CELLS, COLUMNS, ROWS, cell_at, cell_centre};
use crate::render::GatherPoint;
use crate::vector::sqrt;

/// Distance from a record to its surroundings in each cell, divided by the harmonic mean of the distances.
/// Stored as logarithmic 8-bit codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Distances([u8; CELLS]);

/// Number of codes per factor of two.
const STEPS_PER_OCTAVE: u32 = 16;
/// Code of the harmonic mean distance.
const MEAN_CODE: u32 = 128;

impl Distances {
    pub(super) fn new(inverse_distances: &[f32; CELLS], mean: f32) -> Self {
        Self(inverse_distances.map(|inverse| encode(1.0 / (inverse * mean))))
    }

    /// Distance in a cell, divided by the harmonic mean.
    fn get(&self, cell: usize) -> f32 {
        decode(self.0.get(cell).copied().unwrap_or(u8::MAX))
    }
}

/// Number of low bits of an `f32` that a code omits.
const SHIFT: u32 = 23 - STEPS_PER_OCTAVE.ilog2();
/// Bits of 1.0 without the omitted low bits.
const ONE: u32 = 1.0_f32.to_bits() >> SHIFT;

/// Code of a ratio, with sixteen codes per factor of two, from 2^-8 to 2^8. Ratios out of range are clamped;
/// NaN becomes the maximum.
fn encode(ratio: f32) -> u8 {
    ((ratio.to_bits() >> SHIFT) + MEAN_CODE).saturating_sub(ONE).min(u8::MAX as u32) as u8
}

fn decode(code: u8) -> f32 {
    f32::from_bits(((code as u32 + ONE - MEAN_CODE) << SHIFT) | 1 << (SHIFT - 1))
}

/// Weights of gather rays in the translational gradient, for each cell of the hemisphere, along tangent and
/// bitangent. They are multiplied by the harmonic mean distance and thus dimensionless: sums do not depend on
/// the scale of the scene.
pub(super) type Coefficients = [[f32; 2]; CELLS];

/// Weight of each hemisphere cell's rays in the translational gradient at a gather point, as if its surface
/// were white and Lambertian. Cells without rays have weight 0.
pub(super) fn coefficients(point: &GatherPoint, distances: &Distances) -> Coefficients {
    let rays = point.directions.rays_in_cells(point.pattern, point.rays);
    let mut coefficients = [[0.0; 2]; CELLS];
    let mut border = |[less, more]: [usize; 2], length: f32, azimuth: f32| {
        let known = |cell: usize| rays.get(cell).is_some_and(|&rays| rays > 0);
        if !known(less) || !known(more) {
            return;
        }
        let nearer = crate::vector::min(distances.get(less), distances.get(more));
        let speed = length / nearer;
        let (sine, cosine) = libm::sincosf(azimuth);
        let way = [speed * cosine, speed * sine];
        for (cell, sign) in [(less, -1.0), (more, 1.0)] {
            if let Some(sum) = coefficients.get_mut(cell) {
                sum[0] += sign * way[0];
                sum[1] += sign * way[1];
            }
        }
    };
    let column_angle = 2.0 * PI / COLUMNS as f32;
    for column in 0..COLUMNS {
        let azimuth = (column as f32 + 0.5) * column_angle;
        for row in 1..ROWS {
            // Border between rows: sin cos^2 times the column's angle, over pi.
            let sine_squared = row as f32 / ROWS as f32;
            let length = 2.0 / COLUMNS as f32 * sqrt(sine_squared) * (1.0 - sine_squared);
            border([cell_at(row - 1, column), cell_at(row, column)], length, azimuth);
        }
        let before = (column + COLUMNS - 1) % COLUMNS;
        let across = column as f32 * column_angle + 0.5 * PI;
        for row in 0..ROWS {
            // Border between columns: the difference of the sines of its ends, over pi.
            let sine = |row: usize| sqrt(row as f32 / ROWS as f32);
            let length = (sine(row + 1) - sine(row)) * FRAC_1_PI;
            border([cell_at(row, before), cell_at(row, column)], length, across);
        }
    }
    for (cell, sum) in coefficients.iter_mut().enumerate() {
        // Converts a ray's contribution, its share of the mean, to the mean radiance of the cell.
        let rays = rays.get(cell).copied().unwrap_or(0).max(1) as f32;
        let expected_rays = point.directions.cell_share(cell) * point.rays as f32;
        let factor = CELLS as f32 * expected_rays / rays;
        *sum = sum.map(|component| component * factor);
    }
    coefficients
}

/// Weight of a gather ray in cell `cell` in the rotational gradient, along tangent and bitangent.
pub(super) fn rotation(cell: u8) -> [f32; 2] {
    let [azimuth, sine_squared] = cell_centre(cell);
    let tangent = sqrt(sine_squared / (1.0 - sine_squared));
    // The axis about which the normal turns towards the cell is perpendicular to the cell's azimuth.
    let (sine, cosine) = libm::sincosf(azimuth);
    [-tangent * sine, tangent * cosine]
}

#[cfg(test)]
mod tests;
