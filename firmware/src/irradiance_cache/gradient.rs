//! Irradiance gradients (Ward, Heckbert 1992, *Irradiance gradients*) from rays in cells of the hemisphere.
//!
//! The translational gradient is a sum over the borders of neighbouring cells: how fast a border sweeps over the
//! hemisphere as the point moves, which goes with the inverse distance of the nearer cell, times the difference of the
//! cells' radiance. So it is linear in the radiances, with coefficients that only distances decide. Those are known from a
//! survey before any photon is gathered, and each gather adds its part in whatever order it is done.

use core::f32::consts::{FRAC_1_PI, PI};

use crate::importance::{CELLS, COLUMNS, ROWS, cell_at, cell_centre};
use crate::render::GatherPoint;

/// The distance of what is around a point in each cell, over their harmonic mean; in eight bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Distances([u8; CELLS]);

/// Steps of a factor of two in a distance's code.
const STEPS_PER_OCTAVE: u32 = 16;
/// The code of the mean distance.
const MEAN_CODE: u32 = 128;

impl Distances {
    pub(super) fn new(inverse_distances: &[f32; CELLS], mean: f32) -> Self {
        Self(inverse_distances.map(|inverse| encode(1.0 / (inverse * mean))))
    }

    /// The distance in a cell, over their harmonic mean.
    fn get(&self, cell: usize) -> f32 {
        decode(self.0.get(cell).copied().unwrap_or(u8::MAX))
    }
}

/// Bits of a float below those of the code's step.
const SHIFT: u32 = 23 - STEPS_PER_OCTAVE.ilog2();
/// The upper bits of 1.0.
const ONE: u32 = 1.0_f32.to_bits() >> SHIFT;

/// Sixteen steps an octave from 2^-8 to 2^8; what is more or no number is the most.
fn encode(ratio: f32) -> u8 {
    ((ratio.to_bits() >> SHIFT) + MEAN_CODE).saturating_sub(ONE).min(u8::MAX as u32) as u8
}

fn decode(code: u8) -> f32 {
    f32::from_bits(((code as u32 + ONE - MEAN_CODE) << SHIFT) | 1 << (SHIFT - 1))
}

/// How much of what a gather ray of each cell brings goes into the translational gradient, along the tangent and the
/// bitangent, over the harmonic mean distance: without unit, so that sums are of one size in scenes of any.
pub(super) type Coefficients = [[f32; 2]; CELLS];

/// The coefficients of the cells for the rays of a gather point whose reflection is white and Lambertian.
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
        let way = [speed * libm::cosf(azimuth), speed * libm::sinf(azimuth)];
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
            // A border between rows: sin cos^2 times the angle of the column, over pi.
            let sine_squared = row as f32 / ROWS as f32;
            let length = 2.0 / COLUMNS as f32 * libm::sqrtf(sine_squared) * (1.0 - sine_squared);
            border([cell_at(row - 1, column), cell_at(row, column)], length, azimuth);
        }
        let before = (column + COLUMNS - 1) % COLUMNS;
        let across = column as f32 * column_angle + 0.5 * PI;
        for row in 0..ROWS {
            // A border between columns: the difference of the sines of its ends, over pi.
            let sine = |row: usize| libm::sqrtf(row as f32 / ROWS as f32);
            let length = (sine(row + 1) - sine(row)) * FRAC_1_PI;
            border([cell_at(row, before), cell_at(row, column)], length, across);
        }
    }
    for (cell, sum) in coefficients.iter_mut().enumerate() {
        // From what a ray brings, its share of the mean, to the mean radiance of the cell.
        let rays = rays.get(cell).copied().unwrap_or(0).max(1) as f32;
        let expected_rays = point.directions.cell_share(cell) * point.rays as f32;
        let factor = CELLS as f32 * expected_rays / rays;
        *sum = sum.map(|component| component * factor);
    }
    coefficients
}

/// How much of what a ray of a cell brings goes into the rotational gradient, along the tangent and the bitangent.
pub(super) fn rotation(cell: u8) -> [f32; 2] {
    let [azimuth, sine_squared] = cell_centre(cell);
    let tangent = libm::sqrtf(sine_squared / (1.0 - sine_squared));
    // Along the axis about which the normal turns towards the cell: a right angle from its azimuth.
    [-tangent * libm::sinf(azimuth), tangent * libm::cosf(azimuth)]
}

#[cfg(test)]
mod tests;
