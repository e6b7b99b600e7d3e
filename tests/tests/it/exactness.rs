//! Renders that differ only in gather order, tile size, chips or threads have identical pixels.

use std::sync::Mutex;

use photoncard_driver::film::{Film, LayerSums, PixelSums, Window};
use photoncard_driver::layer::Layers;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::photon_map::{PhotonLayout, map_photons};
use photoncard_driver::render::{
    CardAddress, CardSet, Integrator, PhotonMaps, Picture, Radiance, RenderSettings, Rendering, Sampling,
    Schedule,
};
use photoncard_driver::scene::{Camera, Lens, Projection, Scene, gltf};
use photoncard_driver::scheduler::{GatherOrder, tiles};
use photoncard_driver::sink::TileSink;
use photoncard_driver::study::WholeFrame;
use photoncard_firmware::kind::{ChipKind, FixedCapacity, MICRO, REFERENCE, Reference};
use photoncard_tests::everything::everything;
use photoncard_tests::render_or_panic;
use proptest::prelude::*;

fn glossy() -> Scene {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell-glossy.gltf");
    gltf::load(path.as_ref()).expect("a shipped scene loads")
}

fn settings() -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 37, height: 29, ..Picture::default() },
        photons: PhotonMaps { count: 5000, neighbors: 30, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 12, samples: 2, ..Integrator::default() },
        schedule: Schedule { order: GatherOrder::Tiled, ..Schedule::default() },
        cards: CardSet { addresses: vec![card("emulated:1")], ..CardSet::default() },
        ..RenderSettings::default()
    }
}

fn card(text: &str) -> CardAddress {
    text.parse().unwrap()
}

/// Sums of all pixels of a film, without those of layers.
fn sums(film: &Film) -> Vec<PixelSums> {
    film.sums().map(|sums| PixelSums { layers: None, ..sums }).collect()
}

/// Settings that no pixel may depend on.
fn variants() -> Vec<RenderSettings> {
    use GatherOrder::{Buckets, DirectionBins, Hash, Naive, Sort, Tiled};
    let tile = 16;
    let schedules = [
        (tile, Naive, None, None),
        (8, Tiled, None, None),
        (5, Naive, None, None),
        (64, Tiled, None, None),
        (64, Sort, None, Some(5000)),
        (tile, DirectionBins, None, None),
        (11, DirectionBins, Some(5), None),
        (tile, DirectionBins, Some(256), None),
        (tile, Hash, None, None),
        (9, Sort, None, Some(1)),
        (tile, Sort, Some(3), Some(2)),
        (7, Buckets, None, None),
        (64, Buckets, Some(5), Some(300)),
    ];
    let scheduled = schedules.map(|(tile, order, bins, queue)| RenderSettings {
        schedule: Schedule { tile: Some(tile), order, bins, queue, in_flight: None, ..Schedule::default() },
        ..settings()
    });
    let cards = [
        (&["emulated:2"][..], tile, Tiled, None),
        (&["emulated:3"], tile, Hash, Some(37)),
        (&["emulated-micro:2"], tile, Sort, Some(1000)),
        (&["emulated-micro:2", "emulated-large:1"], 6, Buckets, None),
        (&["emulated:7"], tile, Sort, None),
        (&["emulated:3"], tile, Naive, None),
        (&["emulated-large:1"], 6, Sort, None),
        (&["emulated-large:2", "emulated:1"], 8, Hash, Some(300)),
        (&["emulated:7"], 4, Tiled, None),
        (&["emulated-micro:2", "emulated:1"], tile, Tiled, None),
        (&["emulated-nano:2"], 8, Sort, None),
    ];
    let dealt = cards.map(|(cards, tile, order, queue)| RenderSettings {
        schedule: Schedule {
            tile: Some(tile),
            order,
            bins: None,
            queue,
            in_flight: None,
            ..Schedule::default()
        },
        cards: CardSet { addresses: cards.iter().copied().map(card).collect(), ..CardSet::default() },
        ..settings()
    });
    let in_kd_tree = |order, cards| {
        settings().with(|settings| {
            settings.photons.layout = PhotonLayout::Jensen;
            settings.schedule.order = order;
            settings.cards.addresses = vec![card(cards)];
        })
    };
    let in_kd_tree = [in_kd_tree(Tiled, "emulated:1"), in_kd_tree(Sort, "emulated-micro:2")];
    scheduled.into_iter().chain(dealt).chain(in_kd_tree).collect()
}

/// Checks all variants with a sampling of gather rays, with and without irradiance records.
fn check_variants(sampling: Sampling) {
    check_variants_of(&glossy(), &few_pixels().with(|s| s.integrator.sampling = sampling));
}

/// Settings of a picture of several tiles of 16x16 pixels, with more gathers than the longest queue holds. It
/// is so small that dozens of renders take little time.
fn few_pixels() -> RenderSettings {
    settings().with(|s| (s.picture.width, s.picture.height) = (27, 19))
}

/// Checks that the pixels of all variants are those of a render with `settings_of`.
fn check_variants_of(scene: &Scene, settings_of: &RenderSettings) {
    let PhotonMaps { radiance, caustic_photons, .. } = settings_of.photons;
    let Picture { width, height, .. } = settings_of.picture;
    let sampling = settings_of.integrator.sampling;
    for (irradiance_error, samples) in [(None, 2), (Some(0.025), 1), (Some(0.025), 2)] {
        let with = |settings: RenderSettings| {
            settings.with(|s| {
                (s.picture.width, s.picture.height) = (width, height);
                s.photons.radiance = radiance;
                s.photons.caustic_photons = caustic_photons;
                s.integrator.sampling = sampling;
                s.integrator.irradiance_error = irradiance_error;
                s.integrator.samples = samples;
                s.picture.layers = settings_of.picture.layers.clone();
                s.picture.transparent = settings_of.picture.transparent;
                s.picture.light_groups = settings_of.picture.light_groups.clone();
                if !s.picture.light_groups.is_empty() {
                    // A chip has room for fewer pixels with sums for each group.
                    s.schedule.tile = s.schedule.tile.map(|side| side.min(9));
                }
            })
        };
        let expected = sums(&render_or_panic(scene, &with(settings())).film);
        // For a single sample per pixel, only three variants are rendered, with two kinds of chips.
        for variant in variants().into_iter().step_by(if samples == 1 { 8 } else { 1 }) {
            let variant = with(variant);
            if !scene.light_groups.names().is_empty() && !has_light_groups(&variant) {
                continue;
            }
            let film = render_or_panic(scene, &variant).film;
            assert!(sums(&film) == expected, "{variant:?} changes the picture");
        }
    }
}

/// Returns whether the photons of the settings have light groups, and their chips irradiance records for
/// each.
fn has_light_groups(settings: &RenderSettings) -> bool {
    let is_nano = settings.cards.addresses == [card("emulated-nano:2")];
    settings.photons.layout == PhotonLayout::Lines && !is_nano
}

/// Scene with every feature, whose lights are in the first `count` of three groups, none at 0.
fn with_light_groups(count: usize) -> Scene {
    let requests = ["rest=screen", "key=lamp", "sky=environment"].map(str::to_owned);
    let mut scene = everything();
    scene.set_light_groups(&requests[..count]).expect("there are these lights");
    scene
}

/// Camera that sees the same place as `camera`, with another projection: by `number` from 1 on a shifted thin
/// lens, parallel rays, a panorama.
fn projected(camera: &Camera, number: usize) -> Camera {
    let camera = camera.clone();
    match number {
        0 => camera,
        1 => Camera { shift: [0.1, -0.2], lens: Some(Lens { radius: 0.05, focus: 1.5 }), ..camera },
        2 => Camera { projection: Projection::Orthographic { half_height: 0.8 }, ..camera },
        _ => Camera { projection: Projection::Panorama { angles: [4.0, 2.0] }, ..camera },
    }
}

/// Sums of the layers of all pixels of a film; zero in a film without layers.
fn layer_sums(film: &Film) -> Vec<LayerSums> {
    film.sums().map(|sums| sums.layers.unwrap_or_default()).collect()
}

/// Layers that chips sum on request without more memory.
const COVERAGE: &str = "alpha,position,object,material";

/// Gather orders that chips have.
const CHIPS_ORDERS: [GatherOrder; 6] = {
    use GatherOrder::{Buckets, DirectionBins, Hash, Naive, Sort, Tiled};
    [Naive, Tiled, DirectionBins, Hash, Sort, Buckets]
};

/// A tile of 64x64 pixels has more gather points than a chip holds: its gather rays are cast in two stripes.
#[test]
fn tiles_with_more_pixels_than_gather_points_are_exact() {
    const { assert!(64 * 64 > <Reference as ChipKind>::Points::ENTRIES, "one stripe") };
    for irradiance_error in [None, Some(1e-3)] {
        let picture = |tile, order, cards| {
            let settings = settings().with(|s| {
                (s.picture.width, s.picture.height) = (64, 64);
                s.integrator.gather_rays = 8;
                s.integrator.irradiance_error = irradiance_error;
                (s.schedule.tile, s.schedule.order) = (Some(tile), order);
                s.cards.addresses = vec![card(cards)];
            });
            sums(&render_or_panic(&glossy(), &settings).film)
        };
        let expected = picture(16, GatherOrder::Tiled, "emulated-micro:2");
        for (order, cards) in [
            (GatherOrder::Sort, "emulated:1"),
            (GatherOrder::Buckets, "emulated:1"),
            (GatherOrder::DirectionBins, "emulated:1"),
            (GatherOrder::Naive, "emulated-large:1"),
        ] {
            assert!(picture(64, order, cards) == expected, "{order:?} on {cards}, {irradiance_error:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 32, ..ProptestConfig::default() })]

    /// Gathers wait across tiles, with any number of tiles in flight, kind of chip, order and length of
    /// queue.
    #[test]
    fn pixels_do_not_depend_on_tiles_in_flight(
        tile in 2_u32..9,
        order in prop::sample::select(&CHIPS_ORDERS[..]),
        queue in prop_oneof![Just(None), (1_u32..40).prop_map(Some), (40_u32..700).prop_map(Some)],
        in_flight in prop_oneof![Just(None), (1_u32..5).prop_map(Some)],
        cards in prop::sample::select(&["emulated-micro:2", "emulated:1", "emulated-large:1", "emulated-large:2"][..]),
        irradiance_error in prop::sample::select(&[None, Some(0.1), Some(1e-4)][..]),
        has_layers: bool,
        is_adaptive: bool,
        projection in 0_usize..4,
        transparent: bool,
        groups in 0_usize..4,
    ) {
        let scene = with_light_groups(groups);
        let scene = scene.with(|scene| scene.cameras[0] = projected(&scene.cameras[0], projection));
        // With layers and light groups, a chip has room for fewer pixels.
        let widest = if has_layers && groups > 0 { 5 } else { 8 };
        let base = settings().with(|s| {
            (s.picture.width, s.picture.height) = (17, 13);
            s.photons.count = 1500;
            s.photons.caustic_photons = Some(300);
            s.integrator.gather_rays = 8;
            s.integrator.irradiance_error = irradiance_error;
            if is_adaptive {
                (s.integrator.samples, s.integrator.adaptive_threshold) = (5, Some(0.5));
            }
            s.picture.layers = if has_layers { Layers::all() } else { Layers::default() };
            s.picture.transparent = transparent;
            s.picture.light_groups = scene.light_groups.names().to_vec();
            s.schedule.tile = Some(widest);
        });
        let expected = render_or_panic(&scene, &base).film;
        let changed = base.with(|s| {
            let has_room = cards.starts_with("emulated-large");
            let in_flight = in_flight.filter(|_| has_room);
            s.schedule = Schedule {
                tile: Some(tile.min(widest)),
                order,
                bins: None,
                queue,
                in_flight,
                ..Schedule::default()
            };
            s.cards.addresses = vec![card(cards)];
        });
        let film = render_or_panic(&scene, &changed).film;
        prop_assert!(sums(&film) == sums(&expected));
        prop_assert!(layer_sums(&film) == layer_sums(&expected));
    }
}

#[test]
fn pixels_do_not_depend_on_order_tiles_or_chips() {
    check_variants(Sampling::Reflection);
}

#[test]
fn photon_sampling_is_exact() {
    check_variants(Sampling::Photon);
}

#[test]
fn product_sampling_is_exact() {
    check_variants(Sampling::Product);
}

#[test]
fn mixture_sampling_is_exact() {
    check_variants(Sampling::Mixture);
}

#[test]
fn focused_sampling_is_exact() {
    check_variants(Sampling::Focused);
}

#[test]
fn precomputed_irradiance_is_exact() {
    check_variants_of(&glossy(), &few_pixels().with(|s| s.photons.radiance = Radiance::Precomputed));
}

#[test]
fn textures_cut_outs_mirrors_glass_and_lights_of_every_kind_are_exact() {
    let small = few_pixels().with(|s| {
        (s.picture.width, s.picture.height) = (21, 17);
        s.photons.caustic_photons = Some(1000);
        s.picture.layers = COVERAGE.parse().unwrap();
        s.picture.transparent = true;
    });
    check_variants_of(&everything(), &small);
}

#[test]
fn light_groups_are_exact() {
    let scene = with_light_groups(3);
    let small = few_pixels().with(|s| {
        (s.picture.width, s.picture.height) = (21, 17);
        s.photons.caustic_photons = Some(1000);
        s.picture.light_groups = scene.light_groups.names().to_vec();
    });
    check_variants_of(&scene, &small);
}

#[test]
fn every_projection_is_exact() {
    for number in 1..4 {
        let scene = glossy().with(|scene| scene.cameras[0] = projected(&scene.cameras[0], number));
        check_variants_of(&scene, &few_pixels());
    }
}

#[test]
fn adaptive_sampling_is_exact() {
    let scene = everything();
    for irradiance_error in [None, Some(0.1)] {
        let with = |settings: RenderSettings| {
            settings.with(|s| {
                (s.picture.width, s.picture.height) = (17, 9);
                (s.photons.count, s.photons.caustic_photons) = (3000, Some(500));
                // Each path of a sample has eight or more of the sample's rays, which are enough for a
                // direction table from photons.
                s.integrator.gather_rays = if irradiance_error.is_some() { 128 } else { 24 };
                s.integrator.irradiance_error = irradiance_error;
                (s.integrator.samples, s.integrator.adaptive_threshold) = (5, Some(0.03));
                s.picture.layers = COVERAGE.parse().unwrap();
            })
        };
        let adaptive = render_or_panic(&scene, &with(settings()));
        let expected = sums(&adaptive.film);
        let even = with(settings()).with(|s| s.integrator.adaptive_threshold = None);
        let of_even = render_or_panic(&scene, &even).statistics.rays.eye;
        assert!(adaptive.statistics.rays.eye > 2 * of_even, "pixels have several paths a sample");
        // Each variant is rendered either with the irradiance cache or without it.
        let is_here = |index: usize| index / 2 % 2 == usize::from(irradiance_error.is_some());
        for (_, variant) in variants().into_iter().enumerate().filter(|(index, _)| is_here(*index)) {
            let variant = with(variant);
            let film = render_or_panic(&scene, &variant).film;
            assert!(sums(&film) == expected, "{variant:?} changes the picture");
        }
    }
}

#[test]
fn more_records_than_a_chip_has_room_for_are_exact() {
    // So small an error bound divides cells until there is a record at every other pixel; blocks with more
    // records than a chip holds are halved.
    let records = |width: u32, height: u32| (width.div_ceil(2) + 1) * (height.div_ceil(2) + 1);
    assert!(records(61, 61) > REFERENCE.irradiance_records && records(140, 1) > MICRO.irradiance_records);
    let scene = glossy();
    let settings = |tile, order, cards| {
        settings().with(|s| {
            s.picture.width = 140;
            s.picture.height = 64;
            s.integrator.irradiance_error = Some(1e-5);
            s.integrator.gather_rays = 8;
            s.integrator.samples = 1;
            s.schedule.tile = Some(tile);
            s.schedule.order = order;
            s.cards.addresses = vec![card(cards)];
        })
    };
    let expected = sums(&render_or_panic(&scene, &settings(4, GatherOrder::Sort, "emulated:2")).film);
    for (tile, order, cards) in [
        (64, GatherOrder::Sort, "emulated:1"),
        (64, GatherOrder::Buckets, "emulated:1"),
        (16, GatherOrder::Buckets, "emulated-micro:2"),
        (61, GatherOrder::DirectionBins, "emulated:2"),
        (16, GatherOrder::Naive, "emulated-micro:2"),
    ] {
        let rendering = render_or_panic(&scene, &settings(tile, order, cards));
        assert!(sums(&rendering.film) == expected, "tiles of {tile} on {cards} change the picture");
    }
}

/// From x = 32768 on, an `f32` has 8 bits for the position within a pixel: a sample may be rounded to the
/// border of the next pixel.
#[test]
fn samples_rounded_to_the_next_pixel_are_exact() {
    let scene = glossy();
    let settings = |tile| {
        settings().with(|s| {
            s.picture.width = 65_536;
            s.picture.height = 4096;
            s.picture.crop = Some(Window { x0: 33_008, x1: 33_072, y0: 2000, y1: 2032 });
            s.integrator.irradiance_error = Some(1e-6);
            s.integrator.gather_rays = 1;
            s.integrator.samples = 8;
            s.schedule.tile = Some(tile);
        })
    };
    let expected = sums(&render_or_panic(&scene, &settings(16)).film);
    for tile in [32, 1] {
        assert!(sums(&render_or_panic(&scene, &settings(tile)).film) == expected, "tiles of {tile}");
    }
}

/// In frames of the order `hilbert`, which only studies have, the host does the gathers of the chips.
#[test]
fn gathers_along_one_curve_through_a_frame_bring_the_light_of_any_order() {
    let scene = everything();
    let packed = || PackedScene::with_identities(&scene).unwrap();
    let mapped = map_photons(packed(), &settings().photon_settings(&scene), &|_| true).unwrap();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    let caches = "photon=16K/128/4,scene=16K/128/4".parse().unwrap();
    for (irradiance_error, layers) in
        [(None, Layers::NONE), (Some(0.025), Layers::NONE), (None, Layers::all())]
    {
        let settings = settings().with(|s| {
            s.integrator.irradiance_error = irradiance_error;
            s.picture.layers = layers;
        });
        let frame = settings.frame(&settings.camera(&scene).unwrap(), &mapped.gathers);
        let tiles = tiles(settings.window(), 7, GatherOrder::Sort);
        let (image, frame) = (&mapped.image, &frame);
        let whole =
            WholeFrame { image, frame, tiles: &tiles, caches: &caches, pool: &pool, is_stopped: &|| false };
        let along_curve = whole.render().unwrap();
        let film = Mutex::new(settings.film(packed().sum_scale()).unwrap());
        along_curve.tiles.iter().for_each(|tile| film.put(tile));
        let film = film.into_inner().unwrap();
        let Rendering { film: expected, statistics, .. } = render_or_panic(&scene, &settings);
        assert!(film.sums().eq(expected.sums()), "{:?}", (irradiance_error, settings.picture.layers));
        if irradiance_error.is_none() {
            assert_eq!(along_curve.counters.gathers, statistics.gathers);
        }
    }
}

#[test]
fn pixels_do_not_depend_on_threads_of_the_host() {
    let scene = glossy();
    let expected = sums(&render_or_panic(&scene, &settings()).film);
    for threads in [1, 2, 5] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let film = pool.install(|| render_or_panic(&scene, &settings())).film;
        assert!(sums(&film) == expected, "{threads} threads change the picture");
    }
}

#[test]
fn a_crop_is_the_same_region_of_the_whole() {
    let scene = glossy();
    let whole = render_or_panic(&scene, &settings()).film;
    for window in [
        Window { x0: 3, x1: 20, y0: 7, y1: 29 },
        Window { x0: 36, x1: 37, y0: 28, y1: 29 },
        Window { x0: 0, x1: 37, y0: 10, y1: 11 },
    ] {
        let part = render_or_panic(&scene, &settings().with(|s| s.picture.crop = Some(window))).film;
        for y in window.y0..window.y1 {
            for x in window.x0..window.x1 {
                let [a, b] = [&part, &whole].map(|film| film.sums_at(x, y));
                assert!(a.is_some() && a == b, "pixel {x}, {y} of {window:?} differs");
            }
        }
    }
}

#[test]
fn the_work_counted_does_not_depend_on_how_tiles_are_dealt() {
    let scene = glossy();
    let one = render_or_panic(&scene, &settings()).statistics;
    let three = settings().with(|s| {
        s.schedule.order = GatherOrder::Naive;
        s.cards.addresses = vec![card("emulated:3")];
    });
    let three = render_or_panic(&scene, &three).statistics;
    assert_eq!(one.rays, three.rays);
    assert_eq!((one.gathers, one.photons_tested), (three.gathers, three.photons_tested));
    assert_eq!(one.rays.eye, 2 * 37 * 29 * 2, "a sample is looked at again when its pixel is complete");
}

#[test]
fn another_seed_is_another_picture() {
    let scene = glossy();
    let first = sums(&render_or_panic(&scene, &settings()).film);
    let second = sums(&render_or_panic(&scene, &settings().with(|s| s.integrator.seed = 1)).film);
    assert!(first != second);
}
