//! Compares gradients with differences of irradiance.

use glam::Vec3;

use super::*;
use crate::irradiance_cache::record::{Irradiance, Record};
use crate::sampler::{Dimension, Pattern};
use crate::scene::{Surface, magnitude};
use crate::vector::max;

fn white(position: Vec3, normal: Vec3) -> Surface {
    Surface::white(position, normal, magnitude(&[position]))
}

/// Hit of a ray from `origin` on a ceiling at height 1: its distance, and a radiance that grows along x.
fn ceiling(origin: Vec3, direction: Vec3) -> (f32, f32) {
    let distance = (1.0 - origin.y) / max(direction.y, 1e-3);
    let x = (origin + direction * distance).x;
    (distance, 1.0 + 1.0 / (1.0 + libm::expf(-2.0 * x)))
}

/// Irradiance over pi from the ceiling, with gradients, gathered by `rays` rays.
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
fn distances_survive_encoding() {
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
fn a_record_extrapolates_the_irradiance_around_it() {
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

#[test]
fn a_record_in_a_gap_is_not_valid_beyond_it() {
    let in_gap = Record { distance: 0.015, ..Record::new(&white(Vec3::ZERO, Vec3::Y), 1.0) };
    assert!(in_gap.error(1.0, 0.04, Vec3::Y * 0.01, Vec3::Y).is_infinite());
    assert!(in_gap.error(1.0, 0.04, Vec3::X * 0.1, Vec3::Y).is_finite());
}
