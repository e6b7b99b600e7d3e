//! Whether a card has the memory for an image, and what to lower if not.

use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::budget::Budget;
use photoncard_shared::image::{Section, SectionKind};
use photoncard_shared::layout::{Photon, Record};
use photoncard_shared::message::Radiance;

use super::card_image::{CAUSTIC_SECTIONS, PHOTON_SECTIONS};
use super::{CardImage, PackError, PackedScene};
use crate::photon::PhotonLayout;

/// Photons of a line of leaves, the inner nodes' lines counted in, about.
const PHOTONS_OF_A_LEAF: usize = 9;

impl PackedScene {
    /// Checks that an image of this scene may fit a card's memory with so many photons: in leaves as they are about, and
    /// with irradiance points if radiance is precomputed.
    ///
    /// # Errors
    /// If not; the error says what to lower.
    pub fn check_budget(
        &self,
        photons: usize,
        layout: PhotonLayout,
        radiance: Radiance,
        budget: &Budget,
    ) -> Result<(), PackError> {
        let per_line = match layout {
            PhotonLayout::Jensen => Photon::PER_LINE,
            // With the inner nodes; what does not fit after all is found when the map is there.
            PhotonLayout::Lines => PHOTONS_OF_A_LEAF,
        };
        let points_per_line = (radiance == Radiance::Precomputed).then_some(PHOTONS_OF_A_LEAF);
        let lines = |photons: usize| {
            photons.div_ceil(per_line) + points_per_line.map_or(0, |per_line| photons.div_ceil(per_line))
        };
        let photon_bytes = (lines(photons) * LINE_BYTES) as u64;
        let needed = self.bytes() + photon_bytes;
        let available = budget.dram_bytes as u64;
        if needed <= available {
            return Ok(());
        }
        let free = available.saturating_sub(self.bytes()) / LINE_BYTES as u64;
        let room = match points_per_line {
            None => free * per_line as u64,
            // Both last lines may be short.
            Some(points) => free.saturating_sub(1) * (per_line * points) as u64 / (per_line + points) as u64,
        };
        let texels = bytes(self.sections[SectionKind::Texels as usize], SectionKind::Texels);
        let remedy = if room > 0 {
            lower(&format!("lower --photons to {room} or less"), texels, needed)
        } else {
            self.simplify(texels)
        };
        Err(PackError::Dram { needed, photons: photon_bytes, available, remedy })
    }

    /// What to do about a scene that is too large without any photons.
    fn simplify(&self, texels: u64) -> String {
        let scene = self.bytes();
        let part = if is_most(texels, scene) {
            format!(", {texels} of them texels: use smaller textures or a smaller environment")
        } else {
            ": simplify it".to_owned()
        };
        format!("the scene alone takes {scene} bytes{part}, or use a card with more memory")
    }
}

impl CardImage {
    /// Checks that the image fits a card's memory.
    ///
    /// # Errors
    /// If not.
    pub fn check_budget(&self, budget: &Budget) -> Result<(), PackError> {
        let (needed, available) = (self.bytes(), budget.dram_bytes as u64);
        if needed <= available {
            return Ok(());
        }
        let (scene, _) = self.view();
        let of = |kind: SectionKind| bytes(scene.header.section(kind), kind);
        let photons: u64 = PHOTON_SECTIONS.into_iter().map(of).sum();
        let caustics: u64 = CAUSTIC_SECTIONS.into_iter().map(of).sum();
        let option = if is_most(caustics, photons) { "--caustic-photons" } else { "--photons" };
        let remedy = lower(&format!("lower {option}"), of(SectionKind::Texels), needed);
        Err(PackError::Dram { needed, photons, available, remedy })
    }
}

/// The bytes of a section's lines.
fn bytes(section: Section, kind: SectionKind) -> u64 {
    u64::from(section.records.div_ceil(kind.records_per_line())) * LINE_BYTES as u64
}

/// Whether a part is the largest.
fn is_most(part: u64, all: u64) -> bool {
    part > all / 2
}

/// What to do about photons that do not fit, or else about so many bytes of texels.
fn lower(photons: &str, texels: u64, needed: u64) -> String {
    let textures = if is_most(texels, needed) { ", use smaller textures" } else { "" };
    format!("{photons}{textures}, or use a card with more memory")
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use photoncard_shared::budget::REFERENCE;

    use super::*;
    use crate::photon::map_photons;
    use crate::render::RenderSettings;
    use crate::scene::{Encoding, Image, Material, Reflection, Scene, Texture, Triangle};

    /// A triangle, and an image of so many texels a side.
    fn textured(side: u32) -> PackedScene {
        let texels = vec![[0; 4]; (side * side) as usize];
        let image =
            Image { name: "noise".into(), width: side, height: side, texels, encoding: Encoding::Srgb };
        let black = Reflection::Phong { diffuse: Vec3::ZERO, specular: Vec3::ZERO, exponent: 0.0 };
        let scene = Scene {
            triangles: vec![Triangle::new([Vec3::ZERO, Vec3::X, Vec3::Y], 0)],
            materials: vec![Material::new("black", black)],
            images: vec![image],
            textures: vec![Texture::new(0)],
            ..Scene::default()
        };
        PackedScene::new(&scene).expect("it is small")
    }

    fn remedy(scene: &PackedScene, photons: usize, dram_bytes: u32) -> String {
        let budget = Budget { dram_bytes, ..REFERENCE };
        let error = scene.check_budget(photons, PhotonLayout::Lines, Radiance::Density, &budget);
        match error {
            Err(PackError::Dram { remedy, .. }) => remedy,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn textures_are_to_be_smaller_where_they_take_the_memory() {
        let large = textured(1024);
        assert!(remedy(&large, 0, 1 << 20).contains("4194304 of them texels: use smaller textures"));
        let with_photons = remedy(&large, 100_000, 5 << 20);
        assert!(with_photons.starts_with("lower --photons to ") && with_photons.contains("smaller textures"));
        assert!(!remedy(&textured(64), 1_000_000, 5 << 20).contains("textures"));
    }

    /// Where photons of caustics take the memory, fewer others would not help.
    #[test]
    fn the_larger_of_the_photon_maps_is_to_be_lowered() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell-spheres.glb");
        let scene = crate::scene::gltf::load(path.as_ref()).expect("a shipped scene loads");
        for (photons, caustic_photons, expected) in
            [(500, 3000, "lower --caustic-photons"), (3000, 500, "lower --photons")]
        {
            let settings =
                RenderSettings { photons, caustic_photons: Some(caustic_photons), ..Default::default() };
            let packed = PackedScene::new(&scene).expect("it is small");
            let mapped =
                map_photons(packed, &settings.photon_settings(&scene), &|_| true).expect("it has light");
            let dram_bytes = mapped.image.bytes() as u32 - 1;
            match mapped.image.check_budget(&Budget { dram_bytes, ..REFERENCE }) {
                Err(PackError::Dram { remedy, .. }) => assert!(remedy.starts_with(expected), "{remedy}"),
                other => panic!("{other:?}"),
            }
        }
    }
}
