//! Checks whether a card image fits a card's memory, and names the setting to lower if it does not.

use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::budget::Budget;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{Photon, Record};
use photoncard_shared::message::Radiance;

use super::settings::{PhotonLayout, PhotonSettings};
use super::store::{CAUSTIC_SECTIONS, PHOTON_SECTIONS};
use crate::pack::{CardImage, PackError, PackedScene};

/// Approximate number of photons divided by the number of lines of leaves and inner nodes.
const PHOTONS_OF_A_LEAF: usize = 9;

/// Checks whether the card image of a packed scene, with a photon map of these settings, can fit a card's
/// memory. The number of leaf lines is estimated; [`check_image`] counts them.
///
/// # Errors
/// [`PackError::Dram`], with the setting to lower.
pub fn check_packed(
    packed: &PackedScene,
    settings: &PhotonSettings,
    budget: &Budget,
) -> Result<(), PackError> {
    let per_line = match settings.layout {
        PhotonLayout::Jensen => Photon::PER_LINE,
        PhotonLayout::Lines => PHOTONS_OF_A_LEAF,
    };
    let points_per_line = (settings.radiance == Radiance::Precomputed).then_some(PHOTONS_OF_A_LEAF);
    let lines = |photons: usize| {
        photons.div_ceil(per_line) + points_per_line.map_or(0, |per_line| photons.div_ceil(per_line))
    };
    let photon_bytes = (lines(settings.photons) * LINE_BYTES) as u64;
    let scene_bytes = packed.image().bytes();
    let needed = scene_bytes + photon_bytes;
    let available = budget.dram_bytes;
    if needed <= available {
        return Ok(());
    }
    let free = available.saturating_sub(scene_bytes) / LINE_BYTES as u64;
    let room = match points_per_line {
        None => free * per_line as u64,
        // The last line of either section may be partly filled.
        Some(points) => free.saturating_sub(1) * (per_line * points) as u64 / (per_line + points) as u64,
    };
    let texels = bytes(packed.image(), SectionKind::Texels);
    let remedy = if room > 0 {
        lower(&format!("lower `photons.count` to {room} or less"), texels, needed)
    } else {
        simplify(scene_bytes, texels)
    };
    Err(PackError::Dram { needed, photons: photon_bytes, available, remedy })
}

/// Checks that a card image fits a card's memory.
///
/// # Errors
/// [`PackError::Dram`], with the setting to lower.
pub fn check_image(image: &CardImage, budget: &Budget) -> Result<(), PackError> {
    let (needed, available) = (image.bytes(), budget.dram_bytes);
    if needed <= available {
        return Ok(());
    }
    let of = |kind| bytes(image, kind);
    let photons: u64 = PHOTON_SECTIONS.into_iter().map(of).sum();
    let caustics: u64 = CAUSTIC_SECTIONS.into_iter().map(of).sum();
    let field = if is_most(caustics, photons) { "photons.caustic_photons" } else { "photons.count" };
    let remedy = lower(&format!("lower `{field}`"), of(SectionKind::Texels), needed);
    Err(PackError::Dram { needed, photons, available, remedy })
}

fn bytes(image: &CardImage, kind: SectionKind) -> u64 {
    image.section(kind).len() as u64 * LINE_BYTES as u64
}

/// Returns whether a part is more than half of the whole.
fn is_most(part: u64, all: u64) -> bool {
    part > all / 2
}

/// Text that suggests how photons can fit. It names textures too if texels take most of the card image.
fn lower(photons: &str, texels: u64, needed: u64) -> String {
    let textures =
        if is_most(texels, needed) { ", use smaller textures (`LoadSettings::texture_limit`)" } else { "" };
    format!(
        "{photons}{textures}, or use a card with more memory (an emulated one by `CardAddress::with_memory`)"
    )
}

/// Text that suggests how a scene can fit that is too large even without photons.
fn simplify(scene: u64, texels: u64) -> String {
    let part = if is_most(texels, scene) {
        format!(
            ", {texels} of them texels: use smaller textures (`LoadSettings::texture_limit`) or a smaller environment"
        )
    } else {
        ": simplify it".to_owned()
    };
    format!(
        "the scene alone takes {scene} bytes{part}, or use a card with more memory (an emulated one by `CardAddress::with_memory`)"
    )
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use photoncard_firmware::kind::REFERENCE;

    use photoncard_scene::{Encoding, Image, Material, Reflection, Scene, SceneContents, Texture, Triangle};

    use super::*;
    use crate::photon_map::map_photons;

    /// Triangle with a texture of `side` x `side` texels.
    fn textured(side: u32) -> PackedScene {
        let texels = vec![[0; 4]; (side * side) as usize];
        let image =
            Image { name: "noise".into(), width: side, height: side, texels, encoding: Encoding::Srgb };
        let black = Reflection::Phong { diffuse: Vec3::ZERO, specular: Vec3::ZERO, exponent: 0.0 };
        let scene = Scene::from(SceneContents {
            triangles: vec![Triangle::new([Vec3::ZERO, Vec3::X, Vec3::Y], 0)],
            materials: vec![Material::new("black", black)],
            images: vec![image],
            textures: vec![Texture::new(0)],
            ..SceneContents::default()
        });
        PackedScene::new(&scene).expect("it is small")
    }

    fn remedy(scene: &PackedScene, photons: usize, dram_bytes: u64) -> String {
        let budget = Budget { dram_bytes, ..REFERENCE };
        let settings = PhotonSettings {
            camera: None,
            seed: 0,
            photons,
            neighbors: 100,
            max_distance: None,
            caustic_photons: 0,
            caustic_neighbors: 100,
            layout: PhotonLayout::Lines,
            radiance: Radiance::Density,
        };
        match check_packed(scene, &settings, &budget) {
            Err(PackError::Dram { remedy, .. }) => remedy,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn smaller_textures_are_suggested_where_textures_take_the_memory() {
        let large = textured(1024);
        assert!(remedy(&large, 0, 1 << 20).contains("4194304 of them texels: use smaller textures"));
        let with_photons = remedy(&large, 100_000, 5 << 20);
        assert!(
            with_photons.starts_with("lower `photons.count` to ")
                && with_photons.contains("smaller textures")
        );
        assert!(!remedy(&textured(64), 1_000_000, 5 << 20).contains("textures"));
    }

    /// If caustic photons take most of the memory, fewer other photons would not help.
    #[test]
    fn fewer_photons_are_suggested_for_the_larger_of_the_maps() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/cornell-spheres.glb");
        let scene = photoncard_scene::gltf::load(path.as_ref()).expect("a shipped scene loads");
        for (photons, caustic_photons, expected) in
            [(500, 3000, "lower `photons.caustic_photons`"), (3000, 500, "lower `photons.count`")]
        {
            let settings = PhotonSettings {
                camera: None,
                seed: 0,
                photons,
                neighbors: 100,
                max_distance: None,
                caustic_photons,
                caustic_neighbors: 50,
                layout: PhotonLayout::Lines,
                radiance: Radiance::Density,
            };
            let packed = PackedScene::new(&scene).expect("it is small");
            let image = map_photons(packed, &settings, &|_| true).expect("it has light").image;
            let dram_bytes = image.bytes() - 1;
            match check_image(&image, &Budget { dram_bytes, ..REFERENCE }) {
                Err(PackError::Dram { remedy, .. }) => assert!(remedy.starts_with(expected), "{remedy}"),
                other => panic!("{other:?}"),
            }
        }
    }
}
