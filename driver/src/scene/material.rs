//! The ranges a material's values must keep, however they were stated.

use glam::Vec3;

use super::Material;

/// How far above 1 the sum of the two albedos may lie: they are often written in three digits.
const SUM_TOLERANCE: f32 = 1e-4;

/// The largest exponent: the lobe is then under a degree wide, and a mirror to the photons.
pub const MAX_EXPONENT: f32 = 10_000.0;

/// A value of a material that is out of its range.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct OutOfRange {
    /// Which value.
    pub(super) property: Property,
    /// What is wrong with it.
    pub(super) reason: String,
    /// What to do.
    pub(super) remedy: &'static str,
}

/// A value of a material that can be set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Property {
    Diffuse,
    Specular,
    Exponent,
    Emission,
}

impl Property {
    pub(super) const ALL: [(&str, Self); 4] = [
        ("diffuse", Self::Diffuse),
        ("specular", Self::Specular),
        ("exponent", Self::Exponent),
        ("emission", Self::Emission),
    ];
}

fn every(vector: Vec3, holds: impl Fn(f32) -> bool) -> bool {
    vector.to_array().into_iter().all(holds)
}

/// Radiances that an emitter may have, W/(sr m^2): their products and squares stay within single precision.
const EMISSION: std::ops::RangeInclusive<f32> = 1e-20..=1e20;

impl Material {
    /// Checks that no value is negative, infinite or not a number, and that no more light leaves than arrives.
    pub(super) fn check(&self) -> Result<(), OutOfRange> {
        let fault = |property, reason: String, remedy| Err(OutOfRange { property, reason, remedy });
        let albedo = |value: f32| (0.0..=1.0).contains(&value);
        let Self { diffuse, specular, exponent, emission, .. } = self;
        if !every(*diffuse, albedo) {
            let reason = format!("the diffuse albedo is {diffuse}");
            return fault(Property::Diffuse, reason, "albedos are 0 to 1 in each channel");
        }
        if !every(*specular, albedo) {
            let reason = format!("the specular albedo is {specular}");
            return fault(Property::Specular, reason, "albedos are 0 to 1 in each channel");
        }
        if !every(*diffuse + *specular, |sum| sum <= 1.0 + SUM_TOLERANCE) {
            let reason = format!(
                "the diffuse and the specular albedo add up to {}: more light leaves than arrives",
                *diffuse + *specular
            );
            return fault(
                Property::Specular,
                reason,
                "lower one of the two until no channel's sum exceeds 1",
            );
        }
        if !(0.0..=MAX_EXPONENT).contains(exponent) {
            let reason = format!("the Phong exponent is {exponent}");
            return fault(Property::Exponent, reason, "the exponent is 0 to 10000");
        }
        if !every(*emission, |value| value == 0.0 || EMISSION.contains(&value)) {
            let reason = format!("the emission is {emission}");
            return fault(
                Property::Emission,
                reason,
                "emission is a radiance of 0, or of 1e-20 to 1e20, in each channel",
            );
        }
        Ok(())
    }

    /// Whether any channel emits.
    pub fn is_emissive(&self) -> bool {
        self.emission.max_element() > 0.0
    }
}
