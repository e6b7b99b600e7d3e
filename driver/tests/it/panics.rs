//! Panics of a host's thread: the render ends with the panic, and does not hang.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};

use photoncard_driver::render::{
    CardSet, Integrator, Observer, Phase, PhotonMaps, Picture, RenderSettings, render,
};
use photoncard_driver::scene::gltf;

/// Observer that panics in the thread of the card that first reports tiles.
#[derive(Default)]
struct Panics {
    has_panicked: AtomicBool,
}

impl Observer for Panics {
    fn progress(&self, phase: Phase, _: u64, _: u64) {
        if phase == Phase::Tiles && !self.has_panicked.swap(true, Ordering::Relaxed) {
            panic!("the observer panics");
        }
    }

    fn is_stopped(&self) -> bool {
        false
    }
}

#[test]
fn a_panic_in_the_thread_of_one_card_ends_the_others() {
    let scene = format!("{}/../scenes/cornell.gltf", env!("CARGO_MANIFEST_DIR"));
    let scene = gltf::load(scene.as_ref()).unwrap();
    let settings = RenderSettings {
        picture: Picture { width: 4096, height: 4096, ..Picture::default() },
        photons: PhotonMaps { count: 1000, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 10, ..Integrator::default() },
        cards: CardSet { addresses: vec!["emulated:2".parse().unwrap()], ..CardSet::default() },
        ..RenderSettings::default()
    };
    // The whole render would take hours.
    let render = || render(&scene, &settings, &Panics::default()).map(drop);
    assert!(catch_unwind(AssertUnwindSafe(render)).is_err());
}
