//! Light groups: named sets of light sources whose light a render keeps apart.

use photoncard_shared::budget::MAX_LIGHT_GROUPS;

/// Light groups of a scene; none unless they are requested.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LightGroups {
    pub(crate) names: Vec<String>,
    pub(crate) of_materials: Vec<u8>,
    pub(crate) of_lights: Vec<u8>,
    pub(crate) of_environment: u8,
}

impl LightGroups {
    /// Groups with these names and no sources.
    pub fn of_names(names: Vec<String>) -> Self {
        Self { names, ..Self::default() }
    }

    /// Returns whether these can be the names of a scene's groups: at most [`MAX_LIGHT_GROUPS`] names of 1 to
    /// 32 ASCII letters, digits, spaces, `-` and `_`, in increasing order.
    pub fn are_names(names: &[String]) -> bool {
        names.len() <= MAX_LIGHT_GROUPS
            && names.iter().all(|name| is_group_name(name))
            && names.is_sorted_by(|a, b| a < b)
    }

    /// Names of the groups, as [`Self::are_names`] requires.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Group of the emission of a material.
    pub fn of_material(&self, index: usize) -> u8 {
        self.of_materials.get(index).copied().unwrap_or(0)
    }

    /// Group of a punctual light.
    pub fn of_light(&self, index: usize) -> u8 {
        self.of_lights.get(index).copied().unwrap_or(0)
    }

    /// Group of the environment.
    pub fn of_environment(&self) -> u8 {
        self.of_environment
    }
}

pub(crate) fn is_group_name(name: &str) -> bool {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b" -_".contains(&byte);
    (1..=32).contains(&name.len()) && name.bytes().all(is_plain)
}

/// Source of light that a group can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightSource {
    /// Emission of the material with this index.
    Material(usize),
    /// Emission of the object with this index.
    Object(usize),
    /// Punctual light with this index.
    Light(usize),
    /// The environment.
    Environment,
}
