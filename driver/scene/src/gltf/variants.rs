//! Variants of materials (`KHR_materials_variants`).

use gltf::json;

use super::document::Document;
use super::names::listed;
use crate::error::SceneError;

pub(super) fn names(document: &Document) -> Vec<String> {
    let stated =
        document.root.extensions.as_ref().and_then(|extensions| extensions.khr_materials_variants.as_ref());
    stated.iter().flat_map(|stated| &stated.variants).map(|variant| variant.name.clone()).collect()
}

/// Replaces the material of every primitive that has another one in variant `name`.
pub(super) fn select(document: &mut Document, name: &str) -> Result<(), SceneError> {
    let names = names(document);
    let Some(variant) = names.iter().position(|known| known == name) else {
        return Err(SceneError::UnknownVariant { name: name.to_owned(), variants: listed(&names) });
    };
    let materials = document.root.materials.len();
    let mut beyond = None;
    for (m, mesh) in document.root.meshes.iter_mut().enumerate() {
        for (p, primitive) in mesh.primitives.iter_mut().enumerate() {
            match material_in(primitive, variant) {
                Some(material) if material as usize >= materials => {
                    beyond = beyond.or(Some((m, p, material)));
                }
                Some(material) => primitive.material = Some(json::Index::new(material)),
                None => {}
            }
        }
    }
    let Some((m, p, material)) = beyond else { return Ok(()) };
    let item = format!("meshes[{m}].primitives[{p}].extensions.KHR_materials_variants");
    let reason = format!("material {material} does not exist, there are {materials}");
    Err(document.invalid(item, reason, "export the scene again; the file is inconsistent"))
}

/// Material of a primitive in a variant; `None` if the variant does not map it.
fn material_in(primitive: &json::mesh::Primitive, variant: usize) -> Option<u32> {
    let stated = primitive.extensions.as_ref()?.khr_materials_variants.as_ref()?;
    let of_variant = |index: &u32| *index as usize == variant;
    let mapping = stated.mappings.iter().find(|mapping| mapping.variants.iter().any(of_variant))?;
    Some(mapping.material)
}
