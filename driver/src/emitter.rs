//! The scene's emitters: its emissive triangles, each with the probability that its power gives it.

use photoncard_shared::layout::{DOUBLE_SIDED, Emitter};

use crate::scene::Scene;

/// All emissive triangles, and how they are chosen.
#[derive(Debug)]
pub struct Emitters {
    records: Vec<Emitter>,
    thresholds: Vec<u32>,
    power: f64,
}

/// 2^32: all probabilities together.
const ALL: f64 = 4_294_967_296.0;

impl Emitters {
    /// The emitters of a scene.
    pub fn new(scene: &Scene) -> Self {
        let mut records = Vec::new();
        let mut powers = Vec::new();
        for triangle in &scene.triangles {
            let material = &scene.materials[triangle.material as usize];
            let area = triangle.area() as f64;
            let sides = if material.double_sided { 2.0 } else { 1.0 };
            let mean = material.emission.to_array().iter().map(|&c| c as f64).sum::<f64>() / 3.0;
            let power = mean * area * std::f64::consts::PI * sides;
            if power > 0.0 {
                records.push(Emitter {
                    vertices: triangle.vertices.map(|vertex| vertex.to_array()),
                    emission: material.emission.to_array(),
                    density: area as f32,
                    flags: if material.double_sided { DOUBLE_SIDED } else { 0 },
                });
                powers.push(power);
            }
        }
        let thresholds = thresholds(&powers);
        let mut before = 0;
        for (record, &threshold) in records.iter_mut().zip(&thresholds) {
            // Until here `density` held the area.
            record.density = ((threshold - before) as f64 / ALL / record.density as f64) as f32;
            before = threshold;
        }
        Self { records, thresholds, power: powers.iter().sum() }
    }

    /// The records of the card image.
    pub fn records(&self) -> &[Emitter] {
        &self.records
    }

    /// The upper end of each emitter's share of 2^32.
    pub fn thresholds(&self) -> &[u32] {
        &self.thresholds
    }

    /// Probability density, 1/m^2, of a point on one side of an emitter for each unit of its mean radiance.
    pub fn density_per_radiance(&self) -> f32 {
        if self.power > 0.0 { (std::f64::consts::PI / self.power) as f32 } else { 0.0 }
    }

    /// Watts in the strongest channel of the strongest photon, as if it were the only one.
    pub fn strongest_emission(&self) -> f32 {
        let emission = |emitter: &Emitter| {
            let sides = if emitter.flags & DOUBLE_SIDED != 0 { 2.0 } else { 1.0 };
            let radiance = emitter.emission.into_iter().fold(0.0, f32::max);
            radiance * (std::f32::consts::PI * sides / emitter.density)
        };
        self.records.iter().map(emission).filter(|watts| watts.is_finite()).fold(0.0, f32::max)
    }

    /// Emitted power, watts, mean of the channels.
    pub fn power(&self) -> f64 {
        self.power
    }
}

/// Cumulated shares of 2^32. Each is at least 1, so that every emitter can be chosen; the last ends at 2^32 - 1.
fn thresholds(powers: &[f64]) -> Vec<u32> {
    let total: f64 = powers.iter().sum();
    let spare = ALL - 1.0 - powers.len() as f64;
    let mut sum = 0.0;
    let mut thresholds: Vec<u32> = powers
        .iter()
        .zip(1_u32..)
        .map(|(power, index)| {
            sum += power;
            ((sum / total * spare) as u32).saturating_add(index)
        })
        .collect();
    if let Some(last) = thresholds.last_mut() {
        *last = u32::MAX;
    }
    thresholds
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_follow_power_and_none_is_empty() {
        let thresholds = thresholds(&[1.0, 1e-30, 3.0]);
        assert!((thresholds[0] as f64 / ALL - 0.25).abs() < 1e-8);
        assert!(thresholds[1] > thresholds[0]);
        assert_eq!(thresholds[2], u32::MAX);
    }
}
