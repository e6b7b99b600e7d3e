//! Assignments to materials.

use glam::Vec3;

use crate::{Material, Reflection, Transmission};

/// Property of a material that can be assigned.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum MaterialProperty {
    Diffuse,
    Specular,
    Exponent,
    Metallic,
    Roughness,
    Transmission,
    Ior,
    Thickness,
    Alpha,
    Emission,
}

impl MaterialProperty {
    pub(super) const ALL: [(&str, Self); 10] = [
        ("diffuse", Self::Diffuse),
        ("specular", Self::Specular),
        ("exponent", Self::Exponent),
        ("metallic", Self::Metallic),
        ("roughness", Self::Roughness),
        ("transmission", Self::Transmission),
        ("ior", Self::Ior),
        ("thickness", Self::Thickness),
        ("alpha", Self::Alpha),
        ("emission", Self::Emission),
    ];

    /// Name of the property in an error message; `None` for a property whose value is a colour.
    pub(super) fn as_number(self) -> Option<&'static str> {
        match self {
            Self::Exponent => Some("the exponent"),
            Self::Metallic => Some("the metalness"),
            Self::Roughness => Some("the roughness"),
            Self::Transmission => Some("the transmission"),
            Self::Ior => Some("the index of refraction"),
            Self::Thickness => Some("the thickness"),
            Self::Alpha => Some("alpha"),
            Self::Diffuse | Self::Specular | Self::Emission => None,
        }
    }
}

impl Material {
    /// Sets a property to one number, or to a colour of three.
    ///
    /// # Errors
    /// Reason and remedy, if the material lacks the property, or the value is no valid thickness or index of
    /// refraction.
    pub(super) fn assign(
        &mut self,
        property: MaterialProperty,
        values: &[f32],
    ) -> Result<(), (&'static str, &'static str)> {
        let value = match *values {
            [red, green, blue] => Vec3::new(red, green, blue),
            [value, ..] => Vec3::splat(value),
            [] => return Ok(()),
        };
        if property == MaterialProperty::Thickness && !(0.0..f32::INFINITY).contains(&value.x) {
            return Err((
                "the thickness is not a length",
                "state 0 for a thin wall, or any length for a solid",
            ));
        }
        if property == MaterialProperty::Ior && !(1.0..f32::INFINITY).contains(&value.x) {
            return Err((
                "the index of refraction is below 1",
                "indices of refraction are 1 or more; glass has 1.5",
            ));
        }
        if property == MaterialProperty::Ior
            && let Some(layers) = &mut self.layers
        {
            layers.specular = Vec3::splat(f0(value.x));
        }
        match (property, &mut self.reflection) {
            (MaterialProperty::Emission, _) => self.emission = value,
            (MaterialProperty::Alpha, _) => {
                self.alpha = value.x;
                self.blends |= self.alpha_cutoff.is_none();
            }
            (
                MaterialProperty::Ior,
                Reflection::MetallicRoughness { dielectric, grazing, transmission, .. },
            ) => {
                *dielectric = Vec3::splat(f0(value.x) * *grazing);
                if let Some(transmission) = transmission {
                    transmission.ior = value.x;
                }
            }
            (
                MaterialProperty::Transmission,
                Reflection::MetallicRoughness { dielectric, grazing, transmission, .. },
            ) => {
                let ior = index_of_refraction(*dielectric, *grazing);
                let wall = Transmission { factor: 1.0, ior, is_volume: false, absorption: Vec3::ZERO };
                transmission.get_or_insert(wall).factor = value.x;
            }
            (
                MaterialProperty::Thickness,
                Reflection::MetallicRoughness { transmission: Some(transmission), .. },
            ) => {
                transmission.is_volume = value.x > 0.0;
            }
            (MaterialProperty::Thickness, Reflection::MetallicRoughness { transmission: None, .. }) => {
                return Err((
                    "the material transmits no light",
                    "set its transmission first, such as glass.transmission=1",
                ));
            }
            (MaterialProperty::Diffuse, Reflection::Phong { diffuse: target, .. })
            | (MaterialProperty::Diffuse, Reflection::MetallicRoughness { base_colour: target, .. })
            | (MaterialProperty::Specular, Reflection::Phong { specular: target, .. }) => *target = value,
            (MaterialProperty::Exponent, Reflection::Phong { exponent: target, .. })
            | (MaterialProperty::Metallic, Reflection::MetallicRoughness { metallic: target, .. })
            | (MaterialProperty::Roughness, Reflection::MetallicRoughness { roughness: target, .. }) => {
                *target = value.x;
            }
            (
                MaterialProperty::Specular | MaterialProperty::Exponent,
                Reflection::MetallicRoughness { .. },
            ) => {
                return Err((
                    "the material is a metallic-roughness one, which has no Phong lobe",
                    "set metallic or roughness instead, or state a lobe in the material's extras in the file",
                ));
            }
            (
                MaterialProperty::Metallic
                | MaterialProperty::Roughness
                | MaterialProperty::Transmission
                | MaterialProperty::Ior
                | MaterialProperty::Thickness,
                Reflection::Phong { .. },
            ) => {
                return Err((
                    "the material is a Lambertian or Phong one, which has neither metalness nor roughness nor transmission",
                    "set specular or exponent instead, or take the Phong lobe or the specular factor of 0 out of the file",
                ));
            }
        }
        Ok(())
    }
}

impl Reflection {
    /// Index of refraction: that of the transmission or, for an opaque material, the one that F0 and F90
    /// imply. `None` for a Phong reflection.
    pub fn ior(&self) -> Option<f32> {
        match *self {
            Self::Phong { .. } => None,
            Self::MetallicRoughness { transmission: Some(Transmission { ior, .. }), .. } => Some(ior),
            Self::MetallicRoughness { dielectric, grazing, .. } => {
                Some(index_of_refraction(dielectric, grazing))
            }
        }
    }
}

/// F0 of an index of refraction: `((n - 1) / (n + 1))^2`.
fn f0(ior: f32) -> f32 {
    let amplitude = (ior - 1.0) / (ior + 1.0);
    amplitude * amplitude
}

/// Index of refraction of a dielectric with this F0 and F90; 1.5 if F90 is 0.
fn index_of_refraction(f0: Vec3, f90: f32) -> f32 {
    if f90 <= 0.0 {
        return 1.5;
    }
    let amplitude = (f0.max_element() / f90).clamp(0.0, 0.99).sqrt();
    (1.0 + amplitude) / (1.0 - amplitude)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_index_of_refraction_comes_back_from_its_reflectance() {
        for ior in [1.0_f32, 1.33, 1.5, 2.4] {
            assert!((index_of_refraction(Vec3::splat(f0(ior)), 1.0) - ior).abs() < 1e-4);
        }
    }
}
