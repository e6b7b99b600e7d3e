//! Instances of a node's mesh (`EXT_mesh_gpu_instancing`).

use glam::{DMat4, DQuat, DVec3};
use gltf::json;
use gltf::json::accessor::{ComponentType, Type};
use serde::Deserialize;

use super::accessor::{Elements, Format, Integers, Source};
use super::extensions::INSTANCING;
use super::limits::MAX_TRIANGLES;
use super::transform::composed;
use crate::error::SceneError;

const REMEDY: &str = "export the scene without instances, or repair the extension's attributes";

const VECTORS: Format =
    Format { types: &[Type::Vec3], components: &[ComponentType::F32], integers: Integers::Whole };
const ROTATIONS: Format = Format {
    types: &[Type::Vec4],
    components: &[ComponentType::F32, ComponentType::I8, ComponentType::I16],
    integers: Integers::Normalized,
};

#[derive(Deserialize)]
struct Extension {
    attributes: InstanceAttributes,
}

/// Accessors of the instances' transforms. Attributes of other names are application-specific.
#[derive(Deserialize)]
#[serde(rename_all = "UPPERCASE")]
struct InstanceAttributes {
    translation: Option<usize>,
    rotation: Option<usize>,
    scale: Option<usize>,
}

pub(super) struct Instances<'a> {
    item: String,
    pub(super) count: u64,
    translation: Option<Elements<'a>>,
    rotation: Option<Elements<'a>>,
    scale: Option<Elements<'a>>,
}

impl<'a> Instances<'a> {
    /// Reads the instances of a node; `None` without the extension.
    pub(super) fn of(
        source: &Source<'a>,
        index: usize,
        node: &json::Node,
    ) -> Result<Option<Self>, SceneError> {
        let Some(value) = node.extensions.as_ref().and_then(|extensions| extensions.others.get(INSTANCING))
        else {
            return Ok(None);
        };
        let item = format!("nodes[{index}].extensions.{INSTANCING}");
        let fault = |reason: String| source.document.invalid(&item, reason, REMEDY);
        let Extension { attributes } =
            Extension::deserialize(value).map_err(|error| fault(error.to_string()))?;
        let elements = |accessor: Option<usize>, name: &str, format| {
            let item = format!("{item}.attributes.{name}");
            accessor.map(|accessor| Elements::new(source, accessor, &item, format)).transpose()
        };
        let translation = elements(attributes.translation, "TRANSLATION", &VECTORS)?;
        let rotation = elements(attributes.rotation, "ROTATION", &ROTATIONS)?;
        let scale = elements(attributes.scale, "SCALE", &VECTORS)?;
        let counts: Vec<_> =
            [&translation, &rotation, &scale].into_iter().flatten().map(|found| found.count).collect();
        let &[count, ref others @ ..] = &counts[..] else {
            return Err(fault("there is no attribute of instances".to_owned()));
        };
        if others.iter().any(|other| *other != count) {
            return Err(fault("the attributes differ in their counts".to_owned()));
        }
        if count > MAX_TRIANGLES as u64 {
            return Err(fault(format!("{count} instances are more than {MAX_TRIANGLES}")));
        }
        Ok(Some(Self { item, count, translation, rotation, scale }))
    }

    /// Transform of an instance in the node's local space.
    pub(super) fn transform(&self, source: &Source<'a>, instance: u64) -> Result<DMat4, SceneError> {
        let vector = |elements: &Option<Elements<'a>>, default: DVec3| {
            elements.as_ref().map_or(default, |found| DVec3::from(found.vec3(instance).map(f64::from)))
        };
        let rotation = self.rotation.as_ref().map_or(DQuat::IDENTITY, |found| {
            DQuat::from_array(found.floats(instance, [0.0; 4]).map(f64::from))
        });
        let (translation, scale) = (vector(&self.translation, DVec3::ZERO), vector(&self.scale, DVec3::ONE));
        let composed = composed(translation, rotation, scale).filter(DMat4::is_finite);
        composed.ok_or_else(|| {
            let reason =
                format!("the transform of instance {instance} is not finite, or has a zero rotation");
            source.document.invalid(&self.item, reason, REMEDY)
        })
    }
}
