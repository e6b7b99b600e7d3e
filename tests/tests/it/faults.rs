//! A render over links with faults gives an equal picture, and its statistics report the repairs.

use photoncard_driver::film::PixelValue;
use photoncard_driver::render::{CardSet, Integrator, PhotonMaps, Picture, RenderSettings, Statistics};
use photoncard_driver::scene::gltf;
use photoncard_tests::render_or_panic;

fn settings() -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 40, height: 40, ..Picture::default() },
        photons: PhotonMaps { count: 5_000, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 2, ..Integrator::default() },
        cards: CardSet {
            addresses: vec![
                "emulated:2".parse().expect("cards"),
                "emulated-micro:1".parse().expect("a card"),
            ],
            ..CardSet::default()
        },
        ..RenderSettings::default()
    }
}

fn render(faults: Option<&str>) -> (Vec<PixelValue>, Statistics) {
    let path = format!("{}/../scenes/cornell.gltf", env!("CARGO_MANIFEST_DIR"));
    let scene = gltf::load(path.as_ref()).expect("a shipped scene loads");
    let faults = faults.map(|faults| faults.parse().expect("faults"));
    let rendering = render_or_panic(&scene, &settings().with(|s| s.cards.faults = faults));
    (rendering.film.pixels().collect(), rendering.statistics)
}

#[test]
fn bad_lines_do_not_change_the_picture() {
    let (expected, sound) = render(None);
    assert_eq!((sound.link.damaged_frames, sound.link.resets), (0, 0));
    for faults in [
        "flips=1e-6,seed=1",
        "flips=1e-5,seed=2",
        "flips=1e-4,seed=3",
        "drops=1e-4,seed=4",
        "repeats=1e-4,seed=5",
        "delays=1e-3,seed=6",
        "flips=1e-4,drops=1e-4,repeats=1e-4,delays=1e-3,seed=7",
    ] {
        let (pixels, statistics) = render(Some(faults));
        assert!(pixels == expected, "{faults}: another picture");
        println!("{faults}: {:?}", statistics.link);
        if faults.contains("1e-4") {
            assert!(statistics.link.retransmitted_frames > 0, "{faults}: {:?}", statistics.link);
        }
        assert_eq!(statistics.gathers, sound.gathers, "{faults}");
    }
}
