//! Memory of the host: for a photon map under construction, and for a card image that emulated cards share.

use std::sync::atomic::{AtomicUsize, Ordering};

use photoncard_driver::pack::PackedScene;
use photoncard_driver::photon_map::map_photons;
use photoncard_driver::render::{
    CardSet, Integrator, Observer, Phase, PhotonMaps, Picture, RenderSettings, Schedule, render,
};
use photoncard_driver::scene::{Scene, gltf};

use crate::{ALONE, MEMORY};

const PHOTONS: usize = 600_000;
/// Maximum number of bytes per photon, with its share of the card image.
const BYTES_A_PHOTON: usize = 40;

fn cornell() -> Scene {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell.gltf");
    gltf::load(path.as_ref()).expect("a shipped scene loads")
}

fn settings(chips: usize) -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 32, height: 32, ..Picture::default() },
        photons: PhotonMaps { count: PHOTONS, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 1, ..Integrator::default() },
        schedule: Schedule { tile: Some(16), ..Schedule::default() },
        cards: CardSet {
            addresses: vec![format!("emulated:{chips}").parse().expect("an address")],
            ..CardSet::default()
        },
        ..RenderSettings::default()
    }
}

/// Observer that records the greatest memory in use while tiles are rendered.
#[derive(Default)]
struct WhileRendering(AtomicUsize);

impl Observer for WhileRendering {
    fn progress(&self, phase: Phase, _: u64, _: u64) {
        if phase == Phase::Tiles {
            self.0.fetch_max(MEMORY.current_usage(), Ordering::Relaxed);
        }
    }

    fn is_stopped(&self) -> bool {
        false
    }
}

/// Maximum number of bytes in use while `chips` chips render a picture, and number of bytes of the card
/// image.
fn rendering(scene: &Scene, chips: usize) -> (usize, usize) {
    let observer = WhileRendering::default();
    let before = MEMORY.current_usage();
    let rendering = render(scene, &settings(chips), &observer).expect("renders");
    (observer.0.into_inner() - before, rendering.statistics.image_bytes as usize)
}

// One test for both: allocations of another test at the same time would count.
#[test]
fn a_photon_takes_at_most_forty_bytes_and_cards_share_the_image() {
    let _alone = ALONE.lock();
    let scene = cornell();
    let packed = PackedScene::new(&scene).expect("packs");
    let before = MEMORY.current_usage();
    MEMORY.reset_peak_usage();
    let mapped = map_photons(packed, &settings(1).photon_settings(&scene), &|_| true).expect("maps");
    let peak = MEMORY.peak_usage() - before;
    println!("{} bytes a photon at the most", peak as f64 / PHOTONS as f64);
    assert!(peak <= BYTES_A_PHOTON * PHOTONS, "{peak} bytes for {PHOTONS} photons");
    drop(mapped);

    let (with_one, image) = rendering(&scene, 1);
    let (with_four, _) = rendering(&scene, 4);
    println!("{with_one} bytes with one chip, {with_four} with four, an image of {image}");
    assert!(with_one >= image);
    // Each chip takes as much memory as the first, without a copy of the card image.
    let chip = with_one - image;
    assert!(
        with_four < image + 4 * chip + image / 2,
        "{with_four} bytes with four chips, {with_one} with one"
    );
    assert!(chip < image, "{chip} bytes besides an image of {image}");
}
