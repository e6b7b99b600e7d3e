//! Pictures rendered one after another on the same cards equal those of new cards, and cards receive only the
//! lines that have changed.

use std::collections::HashMap;
use std::sync::Mutex;

use glam::Vec3;
use photoncard_driver::emulator::EmulatedKind;
use photoncard_driver::emulator::memory_model::CacheSettings;
use photoncard_driver::link::LineFaults;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::photon_map::map_photons;
use photoncard_driver::render::{
    CardError, CardSet, Integrator, Observer, Phase, PhotonMaps, Picture, RenderSettings, Renderer, Schedule,
    Statistics, Unobserved, render,
};
use photoncard_driver::scene::{Scene, gltf};
use photoncard_driver::sink::{FinishedTile, TileSink};
use photoncard_shared::address::{LINE_BYTES, Line};
use photoncard_shared::message::Tile;
use proptest::prelude::*;

/// Frame of a scene: everything that may change between two pictures.
#[derive(Clone, Debug, PartialEq)]
struct Frame {
    /// Displacement of the camera, decimetres.
    camera: u8,
    seed: u32,
    photons: usize,
    /// Factor of the lamp's emission in the file.
    lamp: u8,
    /// Green of the first wall, tenths.
    wall: u8,
}

fn frames() -> impl Strategy<Value = Vec<Frame>> {
    let frame = (0..3_u8, 0..2_u32, 200..203_usize, 1..3_u8, 1..3_u8);
    let frame =
        frame.prop_map(|(camera, seed, photons, lamp, wall)| Frame { camera, seed, photons, lamp, wall });
    // Most frames change one thing alone.
    proptest::collection::vec((frame, 0..6_u8), 2..5).prop_map(|frames| {
        let mut all: Vec<Frame> = Vec::new();
        for (frame, what) in frames {
            let last = all.last().cloned().unwrap_or_else(|| frame.clone());
            all.push(match what {
                0 | 1 => Frame { camera: frame.camera, ..last },
                2 => Frame { seed: frame.seed, ..last },
                3 => Frame { photons: frame.photons, ..last },
                4 => Frame { lamp: frame.lamp, ..last },
                _ => frame,
            });
        }
        all
    })
}

impl Frame {
    fn scene(&self, base: &Scene) -> Scene {
        let mut scene = base.clone();
        scene.cameras[0].origin += Vec3::X * (0.1 * f32::from(self.camera));
        for material in &mut scene.materials {
            material.emission *= f32::from(self.lamp);
        }
        scene
            .apply(&format!("{}.diffuse=0.5,{},0.5", scene.materials[0].name, 0.1 * f32::from(self.wall)))
            .unwrap();
        scene
    }

    fn settings(&self) -> RenderSettings {
        RenderSettings {
            picture: Picture { width: 12, height: 8, ..Picture::default() },
            photons: PhotonMaps { count: self.photons, neighbors: 10, ..PhotonMaps::default() },
            integrator: Integrator {
                gather_rays: 2,
                shadow_rays: 1,
                seed: self.seed,
                ..Integrator::default()
            },
            schedule: Schedule { tile: Some(4), ..Schedule::default() },
            cards: CardSet { addresses: vec!["emulated:1".parse().unwrap()], ..CardSet::default() },
            ..RenderSettings::default()
        }
    }

    /// Settings with which the card is loaded over its link, not by reference: the link may have faults, of
    /// rate 0.
    fn settings_over_link(&self) -> RenderSettings {
        self.settings().with(|settings| settings.cards.faults = Some(LineFaults::default()))
    }

    fn lines(&self, base: &Scene) -> Vec<Line> {
        let scene = self.scene(base);
        let packed = PackedScene::new(&scene).unwrap();
        let mapped = map_photons(packed, &self.settings().photon_settings(&scene), &|_| true).unwrap();
        mapped.image.lines().to_vec()
    }
}

fn base() -> Scene {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell.gltf");
    gltf::load(path.as_ref()).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10))]
    #[test]
    fn a_picture_does_not_depend_on_those_before_and_sends_only_changed_lines(frames in frames()) {
        let base = base();
        let (mut renderer, mut of_two) = (Renderer::default(), Renderer::default());
        let mut held: Vec<Line> = Vec::new();
        for frame in frames {
            let (scene, settings) = (frame.scene(&base), frame.settings_over_link());
            let kept = renderer.render(&scene, &settings, &Unobserved).unwrap();
            let by_reference = frame.settings();
            let fresh = render(&scene, &by_reference, &Unobserved).unwrap();
            prop_assert!(kept.film.sums().eq(fresh.film.sums()), "{frame:?}");
            let on_two = by_reference.with(|s| s.cards.addresses = vec!["emulated:2".parse().unwrap()]);
            let by_two = of_two.render(&scene, &on_two, &Unobserved).unwrap();
            prop_assert!(by_two.film.sums().eq(fresh.film.sums()), "{frame:?} on two cards");
            let lines = frame.lines(&base);
            let changed = (0..lines.len()).filter(|&line| held.get(line) != lines.get(line)).count();
            prop_assert_eq!(kept.statistics.link.image_bytes, vec![(changed * LINE_BYTES) as u64]);
            held = lines;
        }
    }
}

#[test]
fn a_new_camera_sends_no_line_and_traces_no_photon() {
    let base = base();
    let frame = Frame { camera: 0, seed: 0, photons: 300, lamp: 1, wall: 1 };
    let mut renderer = Renderer::default();
    let first =
        renderer.render(&frame.scene(&base), &frame.settings_over_link(), &Unobserved).unwrap().statistics;
    assert_eq!(first.link.image_bytes, [first.image_bytes]);
    let moved = Frame { camera: 2, ..frame };
    let second =
        renderer.render(&moved.scene(&base), &moved.settings_over_link(), &Unobserved).unwrap().statistics;
    assert_eq!(second.link.image_bytes, [0]);
    assert_eq!((second.time_s.photons, second.photon_paths), (0.0, first.photon_paths));
}

/// Pictures of a scene whose checksums are known equal those of a scene that is read anew, provenance
/// included.
#[test]
fn a_kept_scene_gives_the_pictures_of_a_new_one() {
    let base = base();
    let frame = Frame { camera: 0, seed: 0, photons: 300, lamp: 1, wall: 1 };
    let mut renderer = Renderer::default();
    for (x, focus) in [(0.0, None), (0.2, Some([11, 7])), (0.3, Some([0, 0]))] {
        let settings = frame.settings().with(|settings| {
            settings.picture.camera_at = Some([x, 1.0, 3.0]);
            settings.schedule.focus = focus;
        });
        let kept = renderer.render(&base, &settings, &Unobserved).unwrap();
        let fresh = render(&base.clone().with(|_| ()), &settings, &Unobserved).unwrap();
        assert!(kept.film.sums().eq(fresh.film.sums()), "{x}");
        assert_eq!(kept.statistics.provenance, fresh.statistics.provenance);
    }
}

/// The observer learns of each tile, first its card with the lines that it has read, and then its pixels.
#[test]
fn an_observer_receives_every_tile_with_its_card() {
    /// Card of a tile, and lines that it has read from DRAM.
    type Report = (String, Option<u64>);

    #[derive(Default)]
    struct Watcher(Mutex<(HashMap<u32, Report>, u64)>);

    impl Observer for Watcher {
        fn progress(&self, _: Phase, _: u64, _: u64) {}

        fn is_stopped(&self) -> bool {
            false
        }

        fn rendered(&self, card: &str, tile: &Tile, dram_lines: Option<u64>) {
            self.0.lock().unwrap().0.insert(tile.id, (card.to_owned(), dram_lines));
        }

        fn tiles(&self) -> Option<&dyn TileSink> {
            Some(self)
        }
    }

    impl TileSink for Watcher {
        fn put(&self, tile: &FinishedTile) {
            let (cards, pixels) = &mut *self.0.lock().unwrap();
            assert!(cards.contains_key(&tile.tile().id));
            *pixels += tile.tile().pixels();
        }

        fn revoke(&self, _: &Tile) {}
    }

    let frame = Frame { camera: 0, seed: 0, photons: 300, lamp: 1, wall: 1 };
    for caches in [None, Some(CacheSettings::default())] {
        let settings = frame.settings().with(|s| {
            s.cards.addresses = vec!["emulated:2".parse().unwrap()];
            s.cards.caches = caches;
        });
        let watcher = Watcher::default();
        let rendering = render(&frame.scene(&base()), &settings, &watcher).unwrap();
        let (cards, pixels) = watcher.0.into_inner().unwrap();
        assert_eq!((cards.len(), pixels), (6, 12 * 8));
        assert!(cards.values().all(|(card, _)| settings.cards.names().contains(card)), "{cards:?}");
        let of_tiles: Option<u64> = cards.values().map(|(_, lines)| *lines).sum();
        let of_frame = rendering
            .statistics
            .memory
            .map(|memory| (memory.photon_map.dram_bytes + memory.scene.dram_bytes) / LINE_BYTES as u64);
        assert_eq!(of_tiles, of_frame);
        assert!(of_tiles.is_none_or(|lines| lines > 0));
    }
}

#[test]
fn chips_of_the_process_share_the_image_unless_their_memory_is_modelled() {
    let base = base();
    let frame = Frame { camera: 0, seed: 0, photons: 300, lamp: 1, wall: 1 };
    let on = |addresses: &str, change: fn(&mut RenderSettings)| {
        let settings = frame.settings().with(|settings| {
            settings.cards.addresses = vec![addresses.parse().unwrap()];
            change(settings);
        });
        render(&frame.scene(&base), &settings, &Unobserved).unwrap()
    };
    let shared = on("emulated:3", |_| {});
    assert_eq!(shared.statistics.link.image_bytes, [0; 3]);
    let loaded = on("emulated:1", |settings| settings.cards.faults = Some(LineFaults::default()));
    assert_eq!(loaded.statistics.link.image_bytes, [loaded.statistics.image_bytes]);
    assert!(shared.film.sums().eq(loaded.film.sums()));
    // Counters of modelled memories count loads as well. Two chips would not render this picture while the
    // third is loaded.
    let modelled = on("emulated:3", |settings| {
        settings.cards.caches = Some(CacheSettings::default());
        (settings.picture.width, settings.picture.height) = (32, 32);
        settings.integrator.gather_rays = 50;
    });
    assert!(modelled.statistics.link.image_bytes.iter().all(|&bytes| bytes > 0));
}

#[test]
fn other_cards_and_modelled_memory_are_connected_anew() {
    let base = base();
    let frame = Frame { camera: 0, seed: 0, photons: 300, lamp: 1, wall: 1 };
    let scene = frame.scene(&base);
    let mut renderer = Renderer::default();
    for (addresses, is_modelled) in
        [("emulated:2", false), ("emulated:1", false), ("emulated:1", true), ("emulated:1", true)]
    {
        let settings = frame.settings().with(|settings| {
            settings.cards.addresses = vec![addresses.parse().unwrap()];
            settings.cards.caches = is_modelled.then(CacheSettings::default);
        });
        let Ok(found) = renderer.render(&scene, &settings, &Unobserved) else { panic!("{addresses}") };
        let fresh = render(&scene, &settings, &Unobserved).unwrap();
        assert!(found.film.sums().eq(fresh.film.sums()), "{addresses}");
        assert_eq!(found.statistics.memory, fresh.statistics.memory);
        let bytes = |statistics: &Statistics| statistics.link.image_bytes.iter().sum::<u64>();
        if is_modelled {
            assert_eq!(bytes(&found.statistics), bytes(&fresh.statistics), "{addresses}");
        } else if addresses == "emulated:1" {
            // A card without a model shares the image that the host has kept.
            assert_eq!(bytes(&found.statistics), 0, "{addresses}");
        }
    }
}

/// A card is left out while the setting `queue` exceeds its capacity, which is reported once until the card
/// fits again.
#[test]
fn a_card_that_was_left_out_has_part_in_the_next_picture_that_fits_it() {
    #[derive(Default)]
    struct Losses(Mutex<Vec<String>>);

    impl Observer for Losses {
        fn progress(&self, _: Phase, _: u64, _: u64) {}

        fn is_stopped(&self) -> bool {
            false
        }

        fn lost(&self, card: &str, _: &CardError) {
            self.0.lock().unwrap().push(card.to_owned());
        }
    }

    let frame = Frame { camera: 0, seed: 0, photons: 300, lamp: 1, wall: 1 };
    let scene = frame.scene(&base());
    let too_long = Some(EmulatedKind::Micro.budget().gather_queue + 1);
    let (mut renderer, losses) = (Renderer::default(), Losses::default());
    for (queue, given_up, told) in
        [(None, 0, 0), (too_long, 1, 1), (too_long, 1, 1), (None, 0, 1), (too_long, 1, 2)]
    {
        let settings = frame.settings().with(|settings| {
            let cards = ["emulated:1", "emulated-micro:1"];
            settings.cards.addresses = cards.map(|card| card.parse().unwrap()).to_vec();
            settings.schedule.queue = queue;
        });
        let kept = renderer.render(&scene, &settings, &losses).unwrap();
        let statistics = &kept.statistics;
        assert_eq!((statistics.cards, statistics.cards_given_up), (2, given_up));
        assert_eq!(*losses.0.lock().unwrap(), vec!["card 1"; told]);
        let fresh = render(&scene, &settings, &Unobserved).unwrap();
        assert!(kept.film.sums().eq(fresh.film.sums()));
    }
}
