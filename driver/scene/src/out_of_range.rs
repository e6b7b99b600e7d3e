//! Values of materials that are out of their ranges.

use glam::Vec3;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct OutOfRange {
    pub(super) property: Property,
    /// Description of the fault, as a clause.
    pub(super) reason: String,
    /// Valid range or another remedy, as a clause.
    pub(super) remedy: &'static str,
}

/// Property of a material that has a range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Property {
    /// Diffuse albedo, or base colour.
    Diffuse,
    Specular,
    Exponent,
    Emission,
    Metallic,
    Roughness,
    Dielectric,
    Alpha,
    AlphaCutoff,
    Transmission,
    Ior,
    Absorption,
    NormalScale,
    Coat,
    Sheen,
    DiffuseTransmission,
}

pub(super) fn every(vector: Vec3, holds: impl Fn(f32) -> bool) -> bool {
    vector.to_array().into_iter().all(holds)
}

pub(super) fn is_share(value: f32) -> bool {
    (0.0..=1.0).contains(&value)
}

pub(super) fn fault(property: Property, reason: String, remedy: &'static str) -> Result<(), OutOfRange> {
    Err(OutOfRange { property, reason, remedy })
}
