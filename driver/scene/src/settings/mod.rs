//! Assignments from the command line that replace a value of a material or a light: `floor.exponent=32`.

mod light;
mod light_groups;
mod material;
#[cfg(test)]
mod tests;

use std::path::Path;
use std::str::FromStr;

use glam::DVec3;

use self::light::LightProperty;
use self::material::MaterialProperty;
use super::{LightProfile, PunctualLight, Scene};
use crate::error::SceneError;
use crate::nearest::nearest;

const FORM: &str = "write NAME.PROPERTY=VALUE, for example floor.exponent=32 or lamp.emission=18,14,7; the properties of a \
                    material are diffuse, specular, exponent, metallic, roughness, transmission, ior, thickness, alpha and \
                    emission; those of a light are colour, intensity, position, angle and ies; and there is environment.strength";

/// Text between the name of a light and the path of its photometric file.
const PROFILE: &str = ".ies=";

/// Name of the environment in an assignment.
const ENVIRONMENT: &str = "environment";

/// Property of a material, a light or the environment that can be assigned.
#[derive(Clone, Copy)]
enum Property {
    Material(MaterialProperty),
    Light(LightProperty),
    Strength,
}

impl Property {
    fn of_name(name: &str) -> Option<Self> {
        let of_material = || MaterialProperty::ALL.into_iter().find(|(known, _)| *known == name);
        let of_light = || LightProperty::ALL.into_iter().find(|(known, _)| *known == name);
        of_material()
            .map(|(_, property)| Self::Material(property))
            .or_else(|| of_light().map(|(_, property)| Self::Light(property)))
            .or_else(|| (name == "strength").then_some(Self::Strength))
    }
}

struct Assignment<'a> {
    text: &'a str,
    name: &'a str,
    property: Property,
    values: Vec<f32>,
    /// `values` in double precision.
    precise: Vec<f64>,
}

impl<'a> Assignment<'a> {
    fn parse(text: &'a str) -> Result<Self, SceneError> {
        let form = |reason: String| fault(text, reason, FORM);
        let (left, value) = text.rsplit_once('=').ok_or_else(|| form("there is no =".into()))?;
        let (name, property) =
            left.rsplit_once('.').ok_or_else(|| form("there is no . between name and property".into()))?;
        let property = Property::of_name(property.trim())
            .ok_or_else(|| form(format!("there is no property '{}'", property.trim())))?;
        let none = || form(format!("'{value}' is neither a number nor three"));
        let (values, precise) = parse(value).zip(parse(value)).ok_or_else(none)?;
        Ok(Self { text, name, property, values, precise })
    }

    fn fault(&self, reason: impl Into<String>, remedy: &'static str) -> SceneError {
        fault(self.text, reason.into(), remedy)
    }
}

fn fault(assignment: &str, reason: String, remedy: &'static str) -> SceneError {
    SceneError::Setting { assignment: assignment.to_owned(), reason, remedy }
}

/// Photometric file that an assignment names, as `LIGHT.ies=FILE` does.
pub fn profile_of(assignment: &str) -> Option<&Path> {
    assignment.split_once(PROFILE).map(|(_, file)| Path::new(file.trim()))
}

impl Scene {
    /// Applies one assignment: `MATERIAL.PROPERTY=VALUE` to all materials of the name, `LIGHT.PROPERTY=VALUE`
    /// to all point, spot and directional lights of the name, or `environment.strength=VALUE`.
    ///
    /// Properties of every material are `diffuse` (the diffuse albedo, or the base colour of a
    /// metallic-roughness material), `alpha` (the coverage of a material without cut-outs) and `emission`. A
    /// Lambertian or Phong material also has `specular` and `exponent`. A metallic-roughness material also
    /// has `metallic`, `roughness`, `ior` (index of refraction, which also makes the reflectance colourless),
    /// `transmission` and `thickness` (above 0: the surface bounds a solid). Colours are `r,g,b`, or one
    /// number for all three channels; other values are one number. Textures still multiply the values. The
    /// emissive texture of a material that did not emit was not loaded; a notice says so.
    ///
    /// Properties of a light are `colour`, `intensity`, `position` and `angle`. Only the ratios of the
    /// colour's channels count. The intensity is that of the greatest channel: W/sr, or W/m^2 of a
    /// directional light. Setting it keeps the colour; a light of intensity 0 counts as white. The position
    /// is `x,y,z` in the file's coordinates, metres; only a point or spot light with a unique name has one.
    /// The angle is that across the disk of a directional light, degrees. The strength of the environment is
    /// a factor of its texels.
    ///
    /// `LIGHT.ies=FILE` gives a point or spot light the intensities of a [`LightProfile`] about its axes. The
    /// light keeps its hue and has the file's luminous flux.
    ///
    /// Materials and lights have no property in common, so that a material and a light may have the same
    /// name. A name may itself contain dots. [`Scene::check_light`] checks that the scene still has a light
    /// once all assignments are applied.
    ///
    /// # Errors
    /// If the text is not of this form, the scene has no material, light or environment of the name, it lacks
    /// the property, or a value would be out of range; the scene stays as it was.
    pub fn apply(&mut self, assignment: &str) -> Result<(), SceneError> {
        if let (Some((name, _)), Some(file)) = (assignment.split_once(PROFILE), profile_of(assignment)) {
            return self.apply_profile(assignment, name, file);
        }
        self.assign(assignment)
    }

    /// Does what [`Self::apply`] does, but reads no file: for assignments of strangers.
    ///
    /// # Errors
    /// As [`Self::apply`], and for `LIGHT.ies=FILE`.
    pub fn assign(&mut self, assignment: &str) -> Result<(), SceneError> {
        let assignment = Assignment::parse(assignment)?;
        match assignment.property {
            Property::Material(property) => self.apply_to_materials(&assignment, property),
            Property::Light(property) => self.apply_to_lights(&assignment, property),
            Property::Strength => self.apply_to_environment(&assignment),
        }
    }

    fn apply_to_materials(
        &mut self,
        assignment: &Assignment,
        property: MaterialProperty,
    ) -> Result<(), SceneError> {
        let &Assignment { text, name, ref values, .. } = assignment;
        if let Some(name) = property.as_number().filter(|_| values.len() != 1) {
            return Err(assignment.fault(format!("{name} is one number"), FORM));
        }
        let mut changed = self.materials.clone();
        let mut selected = changed.iter_mut().filter(|material| material.name == name).peekable();
        if selected.peek().is_none() {
            return Err(self.no_material(assignment));
        }
        // Materials of one name may differ in their valid properties: all are changed, or none.
        for material in selected {
            material.assign(property, values).map_err(|(reason, remedy)| assignment.fault(reason, remedy))?;
            material.check().map_err(|bad| fault(text, bad.reason, bad.remedy))?;
        }
        self.materials = changed;
        Ok(())
    }

    fn no_material(&self, assignment: &Assignment) -> SceneError {
        let name = assignment.name;
        if self.lights.iter().any(|light| light.name == name) {
            let reason = format!("'{name}' is a light, which has colour, intensity, position, angle and ies");
            return assignment.fault(reason, "set one of these, or the property of a material");
        }
        SceneError::UnknownMaterial {
            assignment: assignment.text.to_owned(),
            material: name.to_owned(),
            nearest: nearest(name, self.materials.iter().map(|material| material.name.as_str())),
        }
    }

    fn apply_to_lights(
        &mut self,
        assignment: &Assignment,
        property: LightProperty,
    ) -> Result<(), SceneError> {
        let name = assignment.name;
        let mut changed = self.lights.clone();
        let mut selected: Vec<&mut PunctualLight> =
            changed.iter_mut().filter(|light| light.name == name).collect();
        match selected.len() {
            0 => return Err(self.no_light(assignment.text, name)),
            1 => {}
            count if property == LightProperty::Position => {
                let reason = format!("{count} lights have the name '{name}', and would be in one place");
                return Err(assignment.fault(reason, "give each light of the file a name of its own"));
            }
            _ => {}
        }
        let values = match (property, &assignment.precise[..]) {
            (LightProperty::Position, &[x, y, z]) => self.in_scene(DVec3::new(x, y, z)).to_array().to_vec(),
            _ => assignment.values.clone(),
        };
        for light in &mut selected {
            let set = light.assign(property, &values);
            set.map_err(|(reason, remedy)| assignment.fault(reason, remedy))?;
        }
        self.lights = changed;
        Ok(())
    }

    fn apply_profile(&mut self, text: &str, name: &str, file: &Path) -> Result<(), SceneError> {
        let indices = 0..self.lights.len();
        let selected: Vec<usize> = indices.filter(|&index| self.lights[index].name == name).collect();
        if selected.is_empty() {
            return Err(self.no_light(text, name));
        }
        let profile = LightProfile::load(file)?;
        let before = self.lights.clone();
        for index in selected {
            if let Err((reason, remedy)) = self.set_profile(index, &profile) {
                self.lights = before;
                return Err(fault(text, reason.to_owned(), remedy));
            }
        }
        Ok(())
    }

    fn no_light(&self, text: &str, name: &str) -> SceneError {
        let reason = if self.materials.iter().any(|material| material.name == name) {
            format!("'{name}' is a material, and no point, spot or directional light")
        } else if self.lights.is_empty() {
            format!("there is no light '{name}': the scene has no point, spot or directional lights")
        } else {
            let names = nearest(name, self.lights.iter().map(|light| light.name.as_str()));
            format!("there is no light '{name}'; there are {names}")
        };
        fault(text, reason, "set a light by its name, or the emission of a material")
    }

    fn apply_to_environment(&mut self, assignment: &Assignment) -> Result<(), SceneError> {
        if assignment.name != ENVIRONMENT {
            let reason = "the strength is a property of the environment alone";
            return Err(assignment.fault(reason, "write environment.strength=2, or LIGHT.intensity=2"));
        }
        let Some(environment) = &mut self.environment else {
            return Err(assignment.fault("the scene has no environment", "add one by --environment"));
        };
        let set = environment.set_strength(&assignment.values);
        set.map_err(|(reason, remedy)| assignment.fault(reason, remedy))
    }
}

/// Parses one number, or three with commas between them.
fn parse<T: FromStr>(text: &str) -> Option<Vec<T>> {
    let values: Option<Vec<T>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    values.filter(|values| matches!(values.len(), 1 | 3))
}
