//! Caustics, paths `L S+ D S* E`, by a gather in the caustic map at the surface that the eye sees (Jensen
//! 1996, *Global illumination using photon maps*), or at the near end of a gather ray.

use glam::Vec3;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::encode_normal;
use photoncard_shared::message::{CausticGather, Fault};

use super::{Context, GatherPoint};
use crate::light_groups::{GroupedLight, LightGroups};
use crate::memory::{MemoryPort, Stage};
use crate::photon::{CausticSearch, LitBy, reflected_caustics};
use crate::scene::{PartialReflection, Reflection, Reflector};

/// Radiance of caustics that a gather point reflects, in the card image's radiance units.
///
/// # Errors
/// If the card image is invalid.
pub fn reflected<M: MemoryPort>(
    context: &mut Context<M>,
    point: &GatherPoint,
) -> Result<GroupedLight, Fault> {
    let frame = context.frame;
    let Some(CausticGather { max_distance, .. }) = frame.caustics else {
        return Ok(GroupedLight::NONE);
    };
    let photons = context.scene.header.section(SectionKind::CausticLeaves).records;
    let (reflection, lit_by) = lit(&point.surface.reflection, frame.gather_rays);
    if photons == 0 || reflection.is_black() {
        return Ok(GroupedLight::NONE);
    }
    context.memory.enter(Stage::Caustic);
    context.counters.caustic_gathers += 1;
    let header = &context.scene.header;
    let unit = header.caustic_power_unit / header.radiance_unit;
    // The reflection depends on the shading normal; photons have the code of the geometric normal.
    let surface = &point.surface;
    let reflector = Reflector { reflection, ..surface.reflector() };
    let (record, lobe) =
        PartialReflection::encode_present(&reflector, Vec3::splat(unit), point.pattern.dither(0));
    let record = record.among(encode_normal(surface.geometric_normal.to_array()));
    let caustics = reflected_caustics(CausticSearch {
        scene: context.scene,
        memory: context.memory,
        position: surface.position,
        max_radius: max_distance,
        reflection: &record,
        lobe,
        lit_by,
        normals: [surface.normal, surface.geometric_normal],
        groups: LightGroups::of(frame),
    })?;
    let counters = &mut context.counters;
    counters.normals_decoded += u64::from(caustics.normals_decoded);
    if !record.is_lambertian() {
        counters.photons_reflected += u64::from(caustics.photons);
        if record.is_of_microfacets() {
            counters.photons_on_microfacets += u64::from(caustics.photons);
        }
    }
    Ok(caustics.radiance)
}

/// Part of a reflection that the caustic map lights, and the photons that light the lobe. With gather rays, a
/// narrow lobe takes from the map at most the light of point, spot and distant lights: its gather rays find
/// the other lights.
fn lit(reflection: &Reflection, gather_rays: u32) -> (Reflection, LitBy) {
    if gather_rays == 0 || !reflection.has_narrow_lobe() {
        (*reflection, LitBy::All)
    } else if reflection.gathers_caustics() {
        (*reflection, LitBy::Punctual)
    } else {
        (reflection.without_narrow_lobe(), LitBy::All)
    }
}
