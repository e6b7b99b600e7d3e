//! Checksum of a scene.

use std::fmt::Write;

use glam::DVec3;
use photoncard_shared::checksum::Checksum;

use super::{Camera, Scene};

impl Scene {
    /// CRC-32C of all contents of the scene that a render reads, as eight hexadecimal digits.
    pub fn checksum(&self) -> String {
        self.checksum_after(self.bulk_checksum(), &self.cameras)
    }

    /// [`Self::checksum`] without the cameras. It covers everything that the card image depends on.
    pub fn checksum_without_cameras(&self) -> String {
        self.checksum_after(self.bulk_checksum(), &[])
    }

    /// Checksum of the triangles and texels.
    pub(super) fn bulk_checksum(&self) -> Checksum {
        let mut sum = Checksum::default();
        for triangle in &self.triangles {
            triangle.vertices.iter().for_each(|vertex| add(&mut sum, &vertex.to_array()));
            sum.update(&triangle.material.to_le_bytes());
            sum.update(&triangle.attributes.to_le_bytes());
        }
        for attributes in &self.attributes {
            sum.update(&[u8::from(attributes.normals.is_some())]);
            attributes.normals.iter().flatten().for_each(|normal| add(&mut sum, &normal.to_array()));
            attributes.coordinates.iter().flatten().for_each(|place| add(&mut sum, &place.to_array()));
            add(&mut sum, attributes.colours.as_flattened());
            sum.update(&attributes.tangents.to_le_bytes());
        }
        self.tangents.iter().flatten().for_each(|tangent| add(&mut sum, &tangent.to_array()));
        for image in &self.images {
            sum.update(image.texels.as_flattened());
        }
        if let Some(environment) = &self.environment {
            add(&mut sum, environment.texels.as_flattened());
        }
        sum
    }

    /// Checksum of all contents. `sum` is [`Self::bulk_checksum`]; `cameras` replace those of the scene.
    pub(super) fn checksum_after(&self, mut sum: Checksum, cameras: &[Camera]) -> String {
        sum.update(self.description(cameras).as_bytes());
        format!("{:08x}", sum.value())
    }

    /// Text of all contents except triangles, attributes and texels. Its floating-point numbers parse back
    /// exactly.
    fn description(&self, cameras: &[Camera]) -> String {
        let mut text = String::new();
        let _ = write!(text, "{:?}{:?}{:?}{:?}", self.materials, cameras, self.textures, self.lights);
        for image in &self.images {
            let _ = write!(text, "{} {} {:?}", image.width, image.height, image.encoding);
        }
        let _ = write!(text, "{:?}", self.environment.as_ref().map(|map| (map.width, map.height)));
        if self.offset != DVec3::ZERO {
            let _ = write!(text, "{:?}", self.offset);
        }
        if let Some(map) = self.environment.as_ref().filter(|map| map.strength != 1.0) {
            let _ = write!(text, "{:?}", map.strength);
        }
        text
    }
}

fn add(sum: &mut Checksum, values: &[f32]) {
    values.iter().for_each(|value| sum.update(&value.to_le_bytes()));
}
