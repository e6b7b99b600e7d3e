//! Interpolation of vertex attributes over a triangle: normals, texture coordinates, colours.

use glam::Vec3;
use photoncard_shared::image::{LEAF_ATTRIBUTES_PER_LINE, SectionKind};
use photoncard_shared::layout::{
    Attributes, Instance, LEAF_TRIANGLES, LeafAttributes, NO_INSTANCE, NO_TEXTURE, Record, Tangents,
    TriangleId, placed_normal, placed_vector,
};
use photoncard_shared::message::Fault;

use super::SceneImage;
use super::texture::{TexelChoice, read_texture, sample_texels};
use super::triangles::read_instance;
use crate::memory::MemoryPort;
use crate::vector::unit;

const ATTRIBUTES_PER_LINE: u32 = Attributes::PER_LINE as u32;

/// Vertex attributes of a triangle, and the barycentric coordinates at which they are interpolated.
pub(super) struct Corners {
    leaf: LeafAttributes,
    slot: u32,
    /// Index of the leaf line that holds the triangle's instance, or [`NO_INSTANCE`].
    instance: u32,
    attributes: Attributes,
    weights: [f32; 3],
}

impl Corners {
    /// Reads the attributes of a triangle, for the point with barycentric `weights`; `None` if the
    /// triangle has no attributes.
    pub(super) fn read(
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        TriangleId { index, instance }: TriangleId,
        weights: [f32; 3],
    ) -> Result<Option<Self>, Fault> {
        if scene.header.section(SectionKind::LeafAttributes).records == 0 {
            return Ok(None);
        }
        let [leaf, slot] = [index / LEAF_TRIANGLES as u32, index % LEAF_TRIANGLES as u32];
        let entry = scene.record::<4, LEAF_ATTRIBUTES_PER_LINE>(memory, SectionKind::LeafAttributes, leaf)?;
        let Some(leaf) = LeafAttributes::read(u32::from_le_bytes(*entry)) else { return Ok(None) };
        let mut attributes = Attributes::read(record(scene, memory, leaf.record(slot, 0))?);
        if let Some(normals) = attributes.normals.as_mut()
            && instance != NO_INSTANCE
        {
            let Instance { to_group, .. } = read_instance(scene, memory, instance)?;
            normals.iter_mut().for_each(|normal| *normal = placed_normal(&to_group, *normal));
        }
        Ok(Some(Self { leaf, slot, instance, attributes, weights }))
    }

    /// Interpolated unit shading normal on the front side; `None` if the triangle has no shading normals.
    pub(super) fn normal(&self) -> Option<Vec3> {
        self.attributes.normals.map(|normals| unit(self.interpolated(normals)))
    }

    /// Interpolated tangent, bitangent and normal on the front side. They are not normalised (the convention
    /// of `MikkTSpace`). A triangle without shading normals has the normal `front_normal`. The material must
    /// have a normal map.
    pub(super) fn frame(
        &self,
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        front_normal: Vec3,
    ) -> Result<[Vec3; 3], Fault> {
        let bytes = record(scene, memory, Tangents::locate(self.leaf, self.slot))?;
        let Tangents { mut directions, signs } = Tangents::read(bytes, self.slot);
        if self.instance != NO_INSTANCE {
            let Instance { to_world, .. } = read_instance(scene, memory, self.instance)?;
            directions.iter_mut().for_each(|tangent| *tangent = placed_vector(&to_world, *tangent));
        }
        let tangent = self.interpolated(directions);
        let sign: f32 = signs.into_iter().zip(self.weights).map(|(sign, weight)| sign * weight).sum();
        let normal = self.attributes.normals.map_or(front_normal, |normals| self.interpolated(normals));
        Ok([tangent, normal.cross(tangent) * sign, normal])
    }

    /// Weighted mean of the normalised `directions` at the three corners; not normalised.
    #[inline(always)]
    fn interpolated(&self, directions: [[f32; 3]; 3]) -> Vec3 {
        let weighted = directions.into_iter().zip(self.weights);
        weighted.map(|(direction, weight)| unit(direction.into()) * weight).sum()
    }

    /// Interpolated vertex colour: linear RGBA.
    pub(super) fn colour(&self) -> [f32; 4] {
        let mut sum = [0.0; 4];
        for (colour, weight) in self.attributes.colours.into_iter().zip(self.weights) {
            sum.iter_mut().zip(colour).for_each(|(sum, channel)| *sum += channel * weight);
        }
        sum
    }

    /// Index of the triangle's emitter; `None` if the triangle does not emit.
    pub(super) fn emitter(&self) -> Option<u32> {
        self.attributes.emitter
    }

    /// Value of texture `index` at the point, linear RGBA; 1 in all channels if `index` is [`NO_TEXTURE`].
    pub(super) fn texture(
        &self,
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        index: u16,
    ) -> Result<[f32; 4], Fault> {
        self.texture_by(scene, memory, index, None)
    }

    /// Does [`Self::texture`]. With a choice, one texel stands for those of the interpolation.
    pub(super) fn texture_by(
        &self,
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        index: u16,
        choice: Option<TexelChoice>,
    ) -> Result<[f32; 4], Fault> {
        if index == NO_TEXTURE {
            return Ok([1.0; 4]);
        }
        let texture = read_texture(scene, memory, u32::from(index))?;
        let corners = if texture.set == 1 && self.leaf.two_sets {
            let bytes = record(scene, memory, self.leaf.record(self.slot, 1))?;
            [0, 1, 2].map(|corner| Attributes::coordinate(bytes, corner))
        } else {
            self.attributes.coordinates
        };
        let mut place = [0.0; 2];
        for (corner, weight) in corners.into_iter().zip(self.weights) {
            place.iter_mut().zip(corner).for_each(|(sum, coordinate)| *sum += coordinate * weight);
        }
        sample_texels(scene, memory, &texture, place, choice)
    }
}

fn record<'m>(
    scene: &SceneImage,
    memory: &'m mut impl MemoryPort,
    index: u32,
) -> Result<&'m [u8; Attributes::BYTES], Fault> {
    scene.record::<{ Attributes::BYTES }, ATTRIBUTES_PER_LINE>(memory, SectionKind::Attributes, index)
}
