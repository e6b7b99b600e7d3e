//! Irradiance gradients (Ward, Heckbert 1992, *Irradiance gradients*) from rays in cells of the hemisphere.
//!
//! The translational gradient is a sum over the borders of neighbouring cells: the speed of a border over the
//! hemisphere as the point moves, in proportion to the inverse distance of the nearer cell, times the difference of the
//! cells' radiances. So it is linear in the radiances, with coefficients that depend on distances alone. The survey
//! finds these before any photon is gathered, so that gathers can add their terms in any order.

use core::f32::consts::{FRAC_1_PI, PI};

use crate::importance::{CELLS, COLUMNS, ROWS, cell_at, cell_centre};
use crate::render::GatherPoint;

/// Distances to a record's surroundings in each cell, over their harmonic mean; logarithmic 8-bit codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Distances([u8; CELLS]);

/// Codes per factor of two.
const STEPS_PER_OCTAVE: u32 = 16;
/// Code of the harmonic mean distance.
const MEAN_CODE: u32 = 128;

impl Distances {
    pub(super) fn new(inverse_distances: &[f32; CELLS], mean: f32) -> Self {
        Self(inverse_distances.map(|inverse| encode(1.0 / (inverse * mean))))
    }

    /// Distance in a cell, over the harmonic mean.
    fn get(&self, cell: usize) -> f32 {
        decode(self.0.get(cell).copied().unwrap_or(u8::MAX))
    }
}

/// Number of low bits of an `f32` below the code's.
const SHIFT: u32 = 23 - STEPS_PER_OCTAVE.ilog2();
/// Bits of 1.0 above the low ones.
const ONE: u32 = 1.0_f32.to_bits() >> SHIFT;

/// Code of a ratio: sixteen codes per factor of two, from 2^-8 to 2^8; ratios out of range are clamped, NaN is the
/// maximum.
fn encode(ratio: f32) -> u8 {
    ((ratio.to_bits() >> SHIFT) + MEAN_CODE).saturating_sub(ONE).min(u8::MAX as u32) as u8
}

fn decode(code: u8) -> f32 {
    f32::from_bits(((code as u32 + ONE - MEAN_CODE) << SHIFT) | 1 << (SHIFT - 1))
}

/// Weight of a gather ray in each cell in the translational gradient, along tangent and bitangent, times the harmonic
/// mean distance: dimensionless, so that sums do not depend on the scale of the scene.
pub(super) type Coefficients = [[f32; 2]; CELLS];

/// Coefficients of the cells for the rays of a gather point on a white Lambertian surface.
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
            // Border between rows: sin cos^2 times the column's angle, over pi.
            let sine_squared = row as f32 / ROWS as f32;
            let length = 2.0 / COLUMNS as f32 * libm::sqrtf(sine_squared) * (1.0 - sine_squared);
            border([cell_at(row - 1, column), cell_at(row, column)], length, azimuth);
        }
        let before = (column + COLUMNS - 1) % COLUMNS;
        let across = column as f32 * column_angle + 0.5 * PI;
        for row in 0..ROWS {
            // Border between columns: the difference of the sines of its ends, over pi.
            let sine = |row: usize| libm::sqrtf(row as f32 / ROWS as f32);
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

/// Weight of a gather ray in a cell in the rotational gradient, along tangent and bitangent.
pub(super) fn rotation(cell: u8) -> [f32; 2] {
    let [azimuth, sine_squared] = cell_centre(cell);
    let tangent = libm::sqrtf(sine_squared / (1.0 - sine_squared));
    // The axis about which the normal turns towards the cell is perpendicular to the cell's azimuth.
    [-tangent * libm::sinf(azimuth), tangent * libm::cosf(azimuth)]
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::irradiance_cache::record::{Irradiance, Record};
    use crate::sampler::{Dimension, Pattern};
    use crate::scene::{Surface, magnitude};
    use crate::vector::max;

    fn white(position: Vec3, normal: Vec3) -> Surface {
        Surface::white(position, normal, magnitude(&[position]))
    }

    /// A ceiling at height 1, whose radiance grows along x: distance and radiance along a ray from `origin`.
    fn ceiling(origin: Vec3, direction: Vec3) -> (f32, f32) {
        let distance = (1.0 - origin.y) / max(direction.y, 1e-3);
        let x = (origin + direction * distance).x;
        (distance, 1.0 + 1.0 / (1.0 + libm::expf(-2.0 * x)))
    }

    /// Irradiance over pi of the ceiling, with gradients, from `rays` rays.
    fn gathered(position: Vec3, normal: Vec3, rays: u32) -> Irradiance {
        let pattern = Pattern::new(1, 2, 3, 0, Dimension::Irradiance);
        let point = GatherPoint::record(white(position, normal), pattern, rays);
        let mut inverse = [0.0; CELLS];
        let mut counts = [0.0; CELLS];
        let samples: std::vec::Vec<_> =
            (0..rays).filter_map(|i| point.directions.sample(&point.reflector(), pattern, i, rays)).collect();
        for sampled in &samples {
            let cell = sampled.cell as usize;
            inverse[cell] += 1.0 / ceiling(position, sampled.direction).0;
            counts[cell] += 1.0;
        }
        let inverse: [f32; CELLS] = core::array::from_fn(|cell| inverse[cell] / counts[cell]);
        let radius = CELLS as f32 / inverse.iter().sum::<f32>();
        let coefficients = coefficients(&point, &Distances::new(&inverse, radius));
        let mut irradiance = Irradiance::default();
        for sampled in samples {
            let brought = sampled.weight * (ceiling(position, sampled.direction).1 / rays as f32);
            irradiance.mean += brought;
            let coefficients = coefficients[sampled.cell as usize];
            let terms = irradiance.translation.iter_mut().zip(coefficients);
            terms.for_each(|(sum, coefficient)| *sum += brought * (coefficient / radius));
            let terms = irradiance.rotation.iter_mut().zip(rotation(sampled.cell));
            terms.for_each(|(sum, coefficient)| *sum += brought * coefficient);
        }
        irradiance
    }

    #[test]
    fn distances_survive_their_code() {
        for ratio in [0.01, 0.5, 0.99, 1.0, 1.5, 100.0] {
            assert!((decode(encode(ratio)) / ratio - 1.0).abs() < 0.04, "{ratio}");
        }
        assert!(decode(encode(f32::INFINITY)) > 200.0 && decode(encode(0.0)) < 0.01);
    }

    #[test]
    fn even_light_has_no_translational_gradient() {
        let pattern = Pattern::new(7, 0, 0, 0, Dimension::Irradiance);
        let mut inverse = [0.0; CELLS];
        inverse.iter_mut().enumerate().for_each(|(cell, inverse)| *inverse = 0.2 + (cell * 7 % 13) as f32);
        let point = GatherPoint::record(white(Vec3::ZERO, Vec3::Y), pattern, 100);
        let coefficients = coefficients(&point, &Distances::new(&inverse, 0.1));
        let rays = point.directions.rays_in_cells(pattern, 100);
        for axis in 0..2 {
            let terms = coefficients.iter().zip(rays).map(|(c, rays)| c[axis] * rays as f32);
            let [sum, greatest] = [terms.clone().sum::<f32>(), terms.fold(0.0, max)];
            assert!(sum.abs() < 1e-4 * greatest, "{sum} {greatest}");
        }
    }

    #[test]
    fn a_record_tells_the_irradiance_around_it() {
        let normal = Vec3::new(0.1, 1.0, -0.2).normalize();
        let origin = Vec3::new(0.2, 0.0, 0.1);
        let here = gathered(origin, normal, 10_000);
        let tangent = Vec3::X - normal * normal.x;
        for step in [-0.2, 0.2] {
            let place = origin + tangent * step;
            let expected = gathered(place, normal, 10_000).mean.x - here.mean.x;
            let found = here.at(origin, normal, place, normal).x - here.mean.x;
            assert!((found / expected - 1.0).abs() < 0.35, "moved: {found} of {expected}");
        }
        for turned in [Vec3::X, Vec3::Z, Vec3::NEG_X] {
            let turned = (normal + turned * 0.15).normalize();
            let expected = gathered(origin, turned, 10_000).mean.x - here.mean.x;
            let found = here.at(origin, normal, origin, turned).x - here.mean.x;
            assert!((found - expected).abs() < 0.3 * expected.abs() + 2e-3, "turned: {found} of {expected}");
        }
    }

    #[test]
    fn the_error_of_a_record_grows_with_distance_and_turn_and_is_infinite_off_its_plane() {
        let record = Record::new(&white(Vec3::ZERO, Vec3::Y), 1.0);
        let error = |position, normal: Vec3| record.error(1.0, 0.04, position, normal.normalize());
        assert_eq!(error(Vec3::ZERO, Vec3::Y), 0.0);
        assert!((error(Vec3::X * 0.1, Vec3::Y) - 0.01).abs() < 1e-6);
        assert!(error(Vec3::X * 0.1, Vec3::new(0.1, 1.0, 0.0)) > 0.01);
        assert!(error(Vec3::Y * 0.03, Vec3::Y).is_infinite() && error(Vec3::ZERO, Vec3::NEG_Y).is_infinite());
    }
}
