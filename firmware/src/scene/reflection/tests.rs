//! Tests of every lobe: samples follow the density, weights are `f cos / p`, and the lobe is reciprocal.

use core::f32::consts::TAU;
use std::{format, vec, vec::Vec};

use glam::Vec3;

use super::ggx::GgxLobe;
use super::lobe::Lobe;
use super::phong::PhongLobe;
use super::sheen::SheenLobe;
use super::{ReflectedDirection, Reflection, Reflector};
use crate::sampler::{hash, unit_interval};

fn at(cosine: f32, azimuth: f32) -> Vec3 {
    let sine = (1.0 - cosine * cosine).sqrt();
    Vec3::new(sine * azimuth.cos(), cosine, sine * azimuth.sin())
}

fn seen(lobe: Lobe, cosine: f32) -> Reflector {
    let reflection = Reflection { diffuse: Vec3::ZERO, lobe };
    Reflector { normal: Vec3::Y, geometric_normal: Vec3::Y, outgoing: at(cosine, 0.3), reflection }
}

fn ggx(roughness: f32, cosine: f32) -> Lobe {
    Lobe::Ggx(GgxLobe::new(Vec3::new(1.0, 0.5, 0.0), Vec3::ONE, roughness, cosine))
}

/// Lobes of every model, each with outgoing directions near the normal, at 60 degrees and at a grazing angle.
fn reflectors() -> Vec<Reflector> {
    [0.95, 0.5, 0.15]
        .into_iter()
        .flat_map(|cosine| {
            let phong = |exponent| Lobe::Phong(PhongLobe { albedo: Vec3::new(0.9, 0.5, 0.1), exponent });
            let sheen = |roughness| Lobe::Sheen(SheenLobe::new(Vec3::new(0.9, 0.5, 0.1), roughness, cosine));
            let lobes =
                [phong(1.0), phong(40.0), ggx(0.25, cosine), ggx(0.6, cosine), ggx(1.0, cosine), sheen(0.5)];
            lobes.map(|lobe| seen(lobe, cosine))
        })
        .collect()
}

const ROWS: usize = 12;
const COLUMNS: usize = 24;
const CELLS: usize = ROWS * COLUMNS;

/// Number of the cell that contains a direction. The upper hemisphere is divided into cells of equal solid
/// angle; the last cell is for directions below.
fn cell(direction: Vec3) -> usize {
    if direction.y < 0.0 {
        return CELLS;
    }
    let row = ((direction.y * ROWS as f32) as usize).min(ROWS - 1);
    let turn = direction.z.atan2(direction.x) / TAU + 0.5;
    row * COLUMNS + ((turn * COLUMNS as f32) as usize).min(COLUMNS - 1)
}

/// Probabilities of the cells, from quadrature of the density.
fn probabilities(reflector: &Reflector) -> Vec<f64> {
    const FINE: usize = 24;
    let mut sums = vec![0.0_f64; CELLS + 1];
    let [heights, turns] = [ROWS * FINE, COLUMNS * FINE];
    let solid_angle = f64::from(TAU) / (heights * turns) as f64;
    for (height, turn) in (0..heights).flat_map(|height| (0..turns).map(move |turn| (height, turn))) {
        let cosine = (height as f32 + 0.5) / heights as f32;
        let direction = at(cosine, (turn as f32 + 0.5) / turns as f32 * TAU);
        sums[cell(direction)] += f64::from(reflector.lobe_density(direction)) * solid_angle;
    }
    sums[CELLS] = (1.0 - sums[..CELLS].iter().sum::<f64>()).max(0.0);
    sums
}

/// Pearson's chi-squared test. For `n` cells with at least 8 expected samples, the sum of `(found -
/// expected)^2 / expected` has the mean `n` and the variance `2 n`. Density and samples are computed in
/// single precision.
#[test]
fn samples_follow_their_density() {
    const SAMPLES: u32 = 40_000;
    for (index, reflector) in reflectors().iter().enumerate() {
        let mut found = vec![0_u32; CELLS + 1];
        for sample in 0..SAMPLES {
            let point = [1, 2].map(|axis| unit_interval(hash(hash(sample * 2 + axis) ^ index as u32)));
            found[cell(reflector.sample_lobe(point))] += 1;
        }
        let (mut sum, mut cells, mut rest) = (0.0, 0.0_f64, [0.0, 0.0]);
        for (&found, probability) in found.iter().zip(probabilities(reflector)) {
            let expected = probability * f64::from(SAMPLES);
            if expected >= 8.0 {
                sum += (f64::from(found) - expected).powi(2) / expected;
                cells += 1.0;
            } else {
                rest = [rest[0] + f64::from(found), rest[1] + expected];
            }
        }
        assert!(sum < cells + 5.0 * (2.0 * cells).sqrt(), "lobe {index}: {sum} of {cells} cells");
        assert!((rest[0] - rest[1]).abs() < 6.0 * rest[1].sqrt() + 8.0, "lobe {index}: {rest:?}");
    }
}

#[test]
fn weights_are_the_value_times_the_cosine_over_the_density() {
    for (index, reflector) in reflectors().iter().enumerate() {
        for sample in 0..200_u32 {
            let point = [1, 2].map(|axis| unit_interval(hash(sample * 2 + axis)));
            let ReflectedDirection { direction, weight } = reflector.sample_lobe_alone(point);
            assert_eq!(direction, reflector.sample_lobe(point));
            if direction.y < 0.02 {
                continue;
            }
            let density = reflector.lobe_density(direction);
            let expected = reflector.evaluate(direction) * (direction.y / density);
            let error = (weight - expected).abs().max_element();
            assert!(error < 1e-3 * expected.max_element() + 1e-6, "lobe {index}: {weight} {expected}");
        }
    }
}

/// Integrals of `f cos` and of the density over the directions above the triangle and the shading horizon.
fn integrals(reflector: &Reflector) -> [f64; 2] {
    const ROWS: usize = 300;
    const COLUMNS: usize = 600;
    let mut sums = [0.0_f64; 2];
    for (row, column) in (0..ROWS).flat_map(|row| (0..COLUMNS).map(move |column| (row, column))) {
        let direction = at((row as f32 + 0.5) / ROWS as f32, (column as f32 + 0.5) / COLUMNS as f32 * TAU);
        if reflector.geometric_normal.dot(direction) > 0.0 {
            let (value, density) = reflector.sampled(direction);
            assert_eq!((reflector.evaluate(direction), reflector.lobe_density(direction)), (value, density));
            sums[0] += f64::from(value.x * direction.y);
            sums[1] += f64::from(density);
        }
    }
    sums.map(|sum| sum * f64::from(TAU) / (ROWS * COLUMNS) as f64)
}

#[test]
fn a_lobe_loses_no_light_below_a_triangle_that_its_normal_is_not_of() {
    for (index, flat) in reflectors().iter().enumerate() {
        for (tilt, azimuth) in [(0.2_f32, 0.3), (0.2, 3.4), (0.6, 0.3), (0.6, 1.9)] {
            let tilted = Reflector { geometric_normal: at(tilt.cos(), azimuth), ..*flat };
            if tilted.geometric_normal.dot(tilted.outgoing) <= 0.0 {
                continue;
            }
            let ([all, density], [kept, kept_density]) = (integrals(flat), integrals(&tilted));
            let name = format!("lobe {index}, {tilt} {azimuth}");
            assert!((kept / all - 1.0).abs() < 2e-2, "{name}: {kept} of {all}");
            assert!((kept_density / density - 1.0).abs() < 2e-2, "{name}: {kept_density} of {density}");

            let (mut sum, side) = (0.0_f64, 200_u16);
            for sample in 0..side * side {
                let point = [sample % side, sample / side].map(|i| (f32::from(i) + 0.5) / f32::from(side));
                let ReflectedDirection { direction, weight } = tilted.sample_lobe_alone(point);
                let is_above = tilted.geometric_normal.dot(direction) > 0.0 && direction.y > 0.0;
                assert!(is_above || weight == Vec3::ZERO, "{name}: {direction}");
                sum += f64::from(weight.x);
            }
            let mean = sum / (f64::from(side) * f64::from(side));
            assert!((mean / all - 1.0).abs() < 2e-2, "{name}: samples {mean} of {all}");
        }
    }
}

/// Tests that a lobe transports the same power by samples for eye rays and by samples for photons. The power
/// is weighted by a function of both directions.
#[test]
fn photons_of_a_lobe_transport_the_power_that_eye_rays_find() {
    let triangle = Vec3::Y;
    let importance = |eye: Vec3, light: Vec3| f64::from((1.5 + eye.x) * (1.5 + light.x) * (1.0 + light.y));
    for (index, flat) in reflectors().iter().take(6).enumerate() {
        for tilt in [0.2_f32, 0.6] {
            let on_triangle = |outgoing: Vec3| Reflector {
                normal: at(tilt.cos(), 0.3),
                geometric_normal: triangle,
                outgoing,
                ..*flat
            };
            let (mut found, mut brought, samples) = (0.0_f64, 0.0_f64, 100_000_u32);
            for sample in 0..samples {
                let [height, turn, u, v] = [1, 2, 3, 4].map(|axis| unit_interval(hash(hash(sample) + axis)));
                let start = at(height, turn * TAU);
                let reflector = on_triangle(start);
                let normal = reflector.normal;
                if normal.dot(start) <= 0.0 {
                    continue;
                }
                let ReflectedDirection { direction, weight } = reflector.sample_lobe_alone([u, v]);
                if direction.y > 0.0 && normal.dot(direction) > 0.0 {
                    found += f64::from(weight.x * start.y) * importance(start, direction);
                }
                let (from, ReflectedDirection { direction, weight }) = reflector.sample_photon([u, v]);
                let exit = normal.dot(direction);
                if direction.y > 0.0 && exit > 0.0 {
                    // The power that arrives is proportional to the cosine to the triangle.
                    let share = normal.dot(from) * direction.y / exit;
                    brought += f64::from(weight.x * share) * importance(direction, start);
                }
            }
            assert!((brought / found - 1.0).abs() < 0.03, "lobe {index}, {tilt}: {brought} of {found}");
        }
    }
}

#[test]
fn every_lobe_is_reciprocal() {
    for roughness in [0.1, 0.4, 0.9] {
        for (o, i) in [(0.9, 0.2), (0.5, 0.5), (0.05, 0.7)] {
            let [outgoing, incident] = [at(o, 0.3), at(i, 3.0)];
            let [there, back] = [(outgoing, incident), (incident, outgoing)].map(|(from, to)| {
                let reflector = Reflector { outgoing: from, ..seen(ggx(roughness, from.y), from.y) };
                reflector.evaluate(to)
            });
            assert!((there - back).abs().max_element() <= 1e-4 * there.max_element(), "{there} {back}");
        }
    }
}
