//! Assignments from the command line that replace a value of a material: `floor.exponent=32`.

use glam::Vec3;

use super::{Material, Reflection, Scene, Transmission};
use crate::error::SceneError;

const FORM: &str = "write MATERIAL.PROPERTY=VALUE, for example floor.exponent=32 or lamp.emission=18,14,7; the \
                    properties are diffuse, specular, exponent, metallic, roughness, transmission, ior, thickness, alpha and \
                    emission";

/// Maximum number of names that an error proposes.
const PROPOSED: usize = 5;

/// A property that can be set.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Property {
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

impl Property {
    const ALL: [(&str, Self); 10] = [
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

    /// Name of the property in an error; `None` if its value is a colour.
    fn as_number(self) -> Option<&'static str> {
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

impl Scene {
    /// Applies `MATERIAL.PROPERTY=VALUE` to every material of the name.
    ///
    /// The property is `diffuse` (the diffuse albedo, or the base colour of a metallic-roughness material), `alpha` (the coverage of
    /// a material without cut-outs) or `emission` of any material, `specular` or `exponent` of one that states a Phong lobe or is
    /// Lambertian, or `metallic`, `roughness`, `ior` (index of refraction, in place of the colour of the reflectance too),
    /// `transmission` or `thickness` (above 0: the surface bounds a solid) of a metallic-roughness one. Colours are `r,g,b` or one number for all three, the
    /// others one number. Textures keep multiplying the values; the emissive texture of a material that did
    /// not emit was not loaded, as a notice says. The material's name may itself contain dots.
    /// [`Scene::check_light`] checks that the scene still has a light once all assignments are applied.
    ///
    /// # Errors
    /// If the text is not of this form, no material has the name, a material lacks the property, or a value would be out of
    /// range; the scene stays as it was.
    pub fn apply(&mut self, assignment: &str) -> Result<(), SceneError> {
        let fault = |reason: String, remedy| SceneError::Setting {
            assignment: assignment.to_owned(),
            reason,
            remedy,
        };
        let form = |reason: &str| fault(reason.to_owned(), FORM);
        let (left, value) = assignment.rsplit_once('=').ok_or_else(|| form("there is no ="))?;
        let (name, property) =
            left.rsplit_once('.').ok_or_else(|| form("there is no . between material and property"))?;
        let property = Property::ALL
            .into_iter()
            .find_map(|(known, kind)| (known == property.trim()).then_some(kind))
            .ok_or_else(|| fault(format!("there is no property '{}'", property.trim()), FORM))?;
        let values =
            parse(value).ok_or_else(|| fault(format!("'{value}' is neither a number nor r,g,b"), FORM))?;
        if let Some(name) = property.as_number().filter(|_| values.len() != 1) {
            return Err(form(&format!("{name} is one number")));
        }
        let selected: Vec<_> =
            (0..self.materials.len()).filter(|&index| self.materials[index].name == name).collect();
        if selected.is_empty() {
            return Err(SceneError::UnknownMaterial {
                assignment: assignment.to_owned(),
                material: name.to_owned(),
                nearest: nearest(name, &self.materials),
            });
        }
        // All materials are checked before any is changed: materials of one name may differ in their valid properties.
        let mut changed = Vec::with_capacity(selected.len());
        for index in selected {
            let mut material = self.materials[index].clone();
            material.set(property, &values).map_err(|(reason, remedy)| fault(reason.to_owned(), remedy))?;
            material.check().map_err(|out_of_range| fault(out_of_range.reason, out_of_range.remedy))?;
            changed.push((index, material));
        }
        for (index, material) in changed {
            self.materials[index] = material;
        }
        Ok(())
    }
}

impl Material {
    /// Sets a property.
    ///
    /// # Errors
    /// If the material lacks the property: the reason and the remedy.
    fn set(&mut self, property: Property, values: &[f32]) -> Result<(), (&'static str, &'static str)> {
        let value = match *values {
            [red, green, blue] => Vec3::new(red, green, blue),
            [value, ..] => Vec3::splat(value),
            [] => return Ok(()),
        };
        if property == Property::Thickness && !(0.0..f32::INFINITY).contains(&value.x) {
            return Err((
                "the thickness is not a length",
                "state 0 for a thin wall, or any length for a solid",
            ));
        }
        if property == Property::Ior && !(1.0..f32::INFINITY).contains(&value.x) {
            return Err((
                "the index of refraction is below 1",
                "indices of refraction are 1 or more; glass has 1.5",
            ));
        }
        if property == Property::Ior
            && let Some(layers) = &mut self.layers
        {
            layers.specular = Vec3::splat(f0(value.x));
        }
        match (property, &mut self.reflection) {
            (Property::Emission, _) => self.emission = value,
            (Property::Alpha, _) => {
                self.alpha = value.x;
                self.blends |= self.alpha_cutoff.is_none();
            }
            (Property::Ior, Reflection::MetallicRoughness { dielectric, grazing, transmission, .. }) => {
                *dielectric = Vec3::splat(f0(value.x) * *grazing);
                if let Some(transmission) = transmission {
                    transmission.ior = value.x;
                }
            }
            (
                Property::Transmission,
                Reflection::MetallicRoughness { dielectric, grazing, transmission, .. },
            ) => {
                let ior = index_of_refraction(*dielectric, *grazing);
                let wall = Transmission { factor: 1.0, ior, is_volume: false, absorption: Vec3::ZERO };
                transmission.get_or_insert(wall).factor = value.x;
            }
            (Property::Thickness, Reflection::MetallicRoughness { transmission: Some(transmission), .. }) => {
                transmission.is_volume = value.x > 0.0;
            }
            (Property::Thickness, Reflection::MetallicRoughness { transmission: None, .. }) => {
                return Err((
                    "the material transmits no light",
                    "set its transmission first, such as glass.transmission=1",
                ));
            }
            (Property::Diffuse, Reflection::Phong { diffuse: target, .. })
            | (Property::Diffuse, Reflection::MetallicRoughness { base_colour: target, .. })
            | (Property::Specular, Reflection::Phong { specular: target, .. }) => *target = value,
            (Property::Exponent, Reflection::Phong { exponent: target, .. })
            | (Property::Metallic, Reflection::MetallicRoughness { metallic: target, .. })
            | (Property::Roughness, Reflection::MetallicRoughness { roughness: target, .. }) => {
                *target = value.x;
            }
            (Property::Specular | Property::Exponent, Reflection::MetallicRoughness { .. }) => {
                return Err((
                    "the material is a metallic-roughness one, which has no Phong lobe",
                    "set metallic or roughness instead, or state a lobe in the material's extras in the file",
                ));
            }
            (
                Property::Metallic
                | Property::Roughness
                | Property::Transmission
                | Property::Ior
                | Property::Thickness,
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

/// F0 of an index of refraction: `((n - 1) / (n + 1))^2`.
fn f0(ior: f32) -> f32 {
    let amplitude = (ior - 1.0) / (ior + 1.0);
    amplitude * amplitude
}

/// Index of refraction of a dielectric's F0 and F90; 1.5 for one without reflectance.
fn index_of_refraction(f0: Vec3, f90: f32) -> f32 {
    if f90 <= 0.0 {
        return 1.5;
    }
    let amplitude = (f0.max_element() / f90).clamp(0.0, 0.99).sqrt();
    (1.0 + amplitude) / (1.0 - amplitude)
}

/// Parses one number, or three with commas between them.
fn parse(text: &str) -> Option<Vec<f32>> {
    let values: Option<Vec<f32>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    values.filter(|values| matches!(values.len(), 1 | 3))
}

/// Names of materials that are most similar to an unknown name, as a list in text.
fn nearest(name: &str, materials: &[Material]) -> String {
    let mut names: Vec<_> = materials.iter().map(|material| material.name.as_str()).collect();
    names.sort_by_cached_key(|candidate| edit_distance(name, candidate));
    names.dedup();
    let rest = names.len().saturating_sub(PROPOSED);
    let listed: Vec<_> = names.iter().take(PROPOSED).map(|name| format!("'{name}'")).collect();
    if rest == 0 { listed.join(", ") } else { format!("{} ({rest} more)", listed.join(", ")) }
}

/// Levenshtein distance of the first 64 characters, ignoring case.
fn edit_distance(a: &str, b: &str) -> usize {
    const COMPARED: usize = 64;
    let letters = |text: &str| text.chars().take(COMPARED).flat_map(char::to_lowercase).collect::<Vec<_>>();
    let (a, b) = (letters(a), letters(b));
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene() -> Scene {
        let material = |name: &str| Material::lambertian(name, Vec3::splat(0.5));
        let mut materials = ["floor", "wall.left", "a=b", "floor"].map(material).to_vec();
        materials.push(Material::new("metal", METAL));
        Scene { materials, ..Scene::default() }
    }

    const METAL: Reflection = Reflection::MetallicRoughness {
        base_colour: Vec3::splat(0.9),
        metallic: 1.0,
        roughness: 0.5,
        dielectric: Vec3::splat(0.04),
        grazing: 1.0,
        transmission: None,
    };

    fn exponent(material: &Material) -> f32 {
        let Reflection::Phong { exponent, .. } = material.reflection else { panic!("{material:?}") };
        exponent
    }

    #[test]
    fn glass_is_made_of_any_dielectric() {
        let mut scene = scene();
        for assignment in [
            "metal.metallic=0",
            "metal.transmission=0.9",
            "metal.thickness=0.01",
            "metal.ior=1.33",
            "floor.alpha=0.5",
        ] {
            scene.apply(assignment).unwrap();
        }
        let Reflection::MetallicRoughness { dielectric, transmission, .. } = scene.materials[4].reflection
        else {
            panic!("{:?}", scene.materials[4]);
        };
        assert!((dielectric.x - 0.020_06).abs() < 1e-4, "{dielectric}");
        let glass = Transmission { factor: 0.9, ior: 1.33, is_volume: true, absorption: Vec3::ZERO };
        assert_eq!(transmission, Some(glass));
        assert!(scene.materials[0].blends && scene.materials[0].alpha == 0.5);
        assert!(scene.apply("floor.ior=1.5").is_err());
        for impossible in ["metal.ior=0.5", "metal.ior=nan", "metal.thickness=-3", "metal.thickness=nan"] {
            assert!(scene.apply(impossible).is_err(), "{impossible}");
        }
        assert!(scene.apply("metal.transmission=2").is_err());
    }

    #[test]
    fn an_index_of_refraction_comes_back_from_its_reflectance() {
        for ior in [1.0_f32, 1.33, 1.5, 2.4] {
            assert!((index_of_refraction(Vec3::splat(f0(ior)), 1.0) - ior).abs() < 1e-4);
        }
    }

    #[test]
    fn each_property_is_set_on_every_material_of_the_name() {
        let mut scene = scene();
        for assignment in
            ["floor.exponent=32", "floor.specular=0.1,0.2,0.3", "floor.diffuse=.25", "floor.emission= 5"]
        {
            scene.apply(assignment).unwrap();
        }
        for index in [0, 3] {
            let mut expected = Material::phong("floor", Vec3::splat(0.25), Vec3::new(0.1, 0.2, 0.3), 32.0);
            expected.emission = Vec3::splat(5.0);
            assert_eq!(scene.materials[index], expected);
        }
        assert_eq!(exponent(&scene.materials[1]), 0.0);
    }

    #[test]
    fn a_metallic_roughness_material_has_properties_of_its_own() {
        let mut scene = scene();
        for assignment in ["metal.metallic=0.5", "metal.roughness=0.25", "metal.diffuse=0.1,0.2,0.3"] {
            scene.apply(assignment).unwrap();
        }
        let reflection = scene.materials[4].reflection;
        let Reflection::MetallicRoughness { base_colour, metallic, roughness, .. } = reflection else {
            panic!("{reflection:?}")
        };
        assert_eq!((base_colour, metallic, roughness), (Vec3::new(0.1, 0.2, 0.3), 0.5, 0.25));
    }

    #[test]
    fn names_may_hold_dots_and_equals_signs() {
        let mut scene = scene();
        scene.apply("wall.left.exponent=2").unwrap();
        scene.apply("a=b.exponent=3").unwrap();
        assert_eq!([1, 2].map(|index| exponent(&scene.materials[index])), [2.0, 3.0]);
    }

    #[test]
    fn an_unknown_material_is_answered_with_the_names_there_are() {
        let error = scene().apply("flor.exponent=32").unwrap_err();
        let help = miette::Diagnostic::help(&error).unwrap().to_string();
        assert!(matches!(error, SceneError::UnknownMaterial { .. }));
        assert!(help.starts_with("choose one of: 'floor', "), "{help}");
    }

    #[test]
    fn bad_settings_change_nothing() {
        let untouched = scene();
        for assignment in [
            "",
            "floor",
            "floor.exponent",
            "floor=3",
            "floor.gloss=3",
            "floor.exponent=",
            "floor.exponent=x",
            "floor.exponent=1,2,3",
            "floor.exponent=-1",
            "floor.exponent=10001",
            "floor.exponent=nan",
            "floor.diffuse=1,2",
            "floor.diffuse=1.5",
            "floor.diffuse=inf",
            "floor.specular=0.6",
            "floor.specular=-0.1",
            "floor.emission=-1",
            "floor.emission=inf",
            "floor.emission=1,,2",
            "floor.metallic=1",
            "floor.roughness=1",
            "metal.specular=0.1",
            "metal.exponent=4",
            "metal.metallic=1.5",
            "metal.roughness=-1",
            "metal.roughness=0,0,0",
            "metal.diffuse=2",
            ".exponent=1",
            "=",
        ] {
            let mut scene = scene();
            let error = scene.apply(assignment).unwrap_err();
            assert!(miette::Diagnostic::help(&error).is_some(), "{assignment}");
            assert!(error.to_string().contains(&format!("`{assignment}`")), "{error}");
            assert_eq!(scene.materials, untouched.materials, "{assignment}");
        }
    }

    /// Either all materials of a name are changed, or none.
    #[test]
    fn materials_of_one_name_change_together() {
        let mut scene = scene();
        scene.materials[3] = Material::lambertian("floor", Vec3::ONE);
        let before = scene.materials.clone();
        assert!(scene.apply("floor.specular=0.3").is_err());
        assert_eq!(scene.materials, before);
    }

    #[test]
    fn edit_distances_are_those_of_levenshtein() {
        for (a, b, distance) in [("", "", 0), ("", "ab", 2), ("kitten", "sitting", 3), ("Floor", "floor", 0)]
        {
            assert_eq!((edit_distance(a, b), edit_distance(b, a)), (distance, distance), "{a} {b}");
        }
    }
}
