//! Exactness: renders that differ only in ordering, tile size, chips or threads have identical pixels.

use photoncard_driver::film::{Film, PixelValue, Window};
use photoncard_driver::photon_map::PhotonLayout;
use photoncard_driver::render::{CardAddress, Radiance, RenderSettings, Sampling, Unobserved, render};
use photoncard_driver::scene::{Scene, gltf};
use photoncard_driver::scheduler::GatherOrder;
use photoncard_firmware::kind::{MICRO, REFERENCE};
use photoncard_tests::everything::everything;
use photoncard_tests::render_or_panic;

fn glossy() -> Scene {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell-glossy.gltf");
    gltf::load(path.as_ref()).expect("a shipped scene loads")
}

fn settings() -> RenderSettings {
    RenderSettings {
        width: 37,
        height: 29,
        photons: 20_000,
        neighbors: 50,
        gather_rays: 12,
        samples: 2,
        order: GatherOrder::Tiled,
        cards: vec![card("emulated:1")],
        ..RenderSettings::default()
    }
}

fn card(text: &str) -> CardAddress {
    text.parse().unwrap()
}

/// Bits of a film: floats compare as numbers, bits as what they are.
fn bits(film: &Film) -> Vec<[u32; 10]> {
    film.pixels().iter().map(pixel_bits).collect()
}

fn pixel_bits(pixel: &PixelValue) -> [u32; 10] {
    let [[r, g, b], [p, q, s], [x, y, z]] = [pixel.radiance, pixel.albedo, pixel.normal];
    [r, g, b, p, q, s, x, y, z, pixel.depth].map(f32::to_bits)
}

/// Settings that must not change a bit of the picture.
fn variants() -> Vec<RenderSettings> {
    vec![
        RenderSettings { order: GatherOrder::Naive, ..settings() },
        RenderSettings { tile: 8, ..settings() },
        RenderSettings { tile: 5, order: GatherOrder::Naive, ..settings() },
        RenderSettings { tile: 64, ..settings() },
        RenderSettings { tile: 64, order: GatherOrder::Sort, queue: Some(5000), ..settings() },
        RenderSettings { cards: vec![card("emulated:2")], ..settings() },
        RenderSettings { order: GatherOrder::DirectionBins, ..settings() },
        RenderSettings { order: GatherOrder::DirectionBins, bins: Some(5), tile: 11, ..settings() },
        RenderSettings { order: GatherOrder::DirectionBins, bins: Some(256), ..settings() },
        RenderSettings { order: GatherOrder::Hash, ..settings() },
        RenderSettings {
            order: GatherOrder::Hash,
            queue: Some(37),
            cards: vec![card("emulated:3")],
            ..settings()
        },
        RenderSettings { order: GatherOrder::Sort, queue: Some(1), tile: 9, ..settings() },
        RenderSettings { order: GatherOrder::Sort, queue: Some(2), bins: Some(3), ..settings() },
        RenderSettings {
            order: GatherOrder::Sort,
            queue: Some(1000),
            cards: vec![card("emulated-micro:2")],
            ..settings()
        },
        RenderSettings { order: GatherOrder::Sort, cards: vec![card("emulated:7")], tile: 16, ..settings() },
        RenderSettings { cards: vec![card("emulated:3")], order: GatherOrder::Naive, ..settings() },
        RenderSettings { cards: vec![card("emulated:7")], tile: 4, ..settings() },
        RenderSettings { cards: vec![card("emulated-micro:2"), card("emulated:1")], ..settings() },
        RenderSettings { photon_layout: PhotonLayout::Jensen, ..settings() },
        RenderSettings {
            photon_layout: PhotonLayout::Jensen,
            order: GatherOrder::Sort,
            cards: vec![card("emulated-micro:2")],
            ..settings()
        },
        RenderSettings { order: GatherOrder::Hilbert, ..settings() },
        RenderSettings {
            order: GatherOrder::Hilbert,
            tile: 7,
            cards: vec![card("emulated:3")],
            ..settings()
        },
    ]
}

/// Checks all variants with a sampling, without and with records of irradiance.
fn check_variants(sampling: Sampling) {
    check_variants_of(&glossy(), &RenderSettings { sampling, ..settings() });
}

/// Checks all variants with the sampling and the radiance of some settings.
fn check_variants_of(scene: &Scene, settings_of: &RenderSettings) {
    let RenderSettings { sampling, radiance, caustic_photons, .. } = *settings_of;
    for (irradiance_error, samples) in [(None, 2), (Some(0.025), 1), (Some(0.025), 2)] {
        let with = |settings| RenderSettings {
            sampling,
            radiance,
            caustic_photons,
            irradiance_error,
            samples,
            ..settings
        };
        let expected = bits(&render_or_panic(scene, &with(settings())).film);
        for variant in variants() {
            let variant = with(variant);
            let film = render_or_panic(scene, &variant).film;
            assert!(bits(&film) == expected, "{variant:?} changes the picture");
        }
    }
}

#[test]
fn order_tiles_chips_and_kind_of_chip_do_not_change_a_bit() {
    check_variants(Sampling::Reflection);
}

#[test]
fn nor_do_they_with_rays_by_photons() {
    check_variants(Sampling::Photon);
}

#[test]
fn nor_do_they_with_rays_by_the_product() {
    check_variants(Sampling::Product);
}

#[test]
fn nor_do_they_with_rays_by_the_mixture() {
    check_variants(Sampling::Mixture);
}

#[test]
fn nor_do_they_with_precomputed_irradiance() {
    check_variants_of(&glossy(), &RenderSettings { radiance: Radiance::Precomputed, ..settings() });
}

#[test]
fn nor_do_they_with_textures_cut_outs_mirrors_glass_and_lights_of_every_kind() {
    check_variants_of(&everything(), &RenderSettings { caustic_photons: Some(3000), ..settings() });
}

#[test]
fn nor_do_they_with_more_records_than_a_chip_has_room_for() {
    // So small an error divides every cell, down to one record at every other pixel: these blocks are halved.
    let records = |width: u32, height: u32| (width.div_ceil(2) + 1) * (height.div_ceil(2) + 1);
    assert!(records(61, 61) > REFERENCE.irradiance_records && records(140, 1) > MICRO.irradiance_records);
    let scene = glossy();
    let settings = |tile, order, cards| RenderSettings {
        irradiance_error: Some(1e-5),
        gather_rays: 2,
        samples: 1,
        width: 140,
        height: 64,
        tile,
        order,
        cards: vec![card(cards)],
        ..settings()
    };
    let expected = bits(&render_or_panic(&scene, &settings(4, GatherOrder::Sort, "emulated:2")).film);
    for (tile, order, cards) in [
        (64, GatherOrder::Sort, "emulated:1"),
        (61, GatherOrder::DirectionBins, "emulated:2"),
        (16, GatherOrder::Naive, "emulated-micro:2"),
    ] {
        let rendering = render_or_panic(&scene, &settings(tile, order, cards));
        assert!(bits(&rendering.film) == expected, "tiles of {tile} on {cards} change the picture");
    }
}

/// Far to the right a place in the picture has few bits below the pixel: it may be rounded to the next pixel's border.
#[test]
fn nor_do_they_where_samples_are_rounded_to_the_next_pixel() {
    let scene = glossy();
    let settings = |tile| RenderSettings {
        width: 65_536,
        height: 4096,
        crop: Some(Window { x0: 33_008, x1: 33_072, y0: 2000, y1: 2032 }),
        irradiance_error: Some(1e-6),
        gather_rays: 1,
        samples: 8,
        tile,
        ..settings()
    };
    let expected = bits(&render_or_panic(&scene, &settings(16)).film);
    for tile in [32, 1] {
        assert!(bits(&render_or_panic(&scene, &settings(tile)).film) == expected, "tiles of {tile}");
    }
}

#[test]
fn a_frame_along_one_curve_is_for_emulated_reference_chips_alone() {
    let settings =
        RenderSettings { order: GatherOrder::Hilbert, cards: vec![card("emulated-micro:1")], ..settings() };
    let error = render(&glossy(), &settings, &Unobserved).err().expect("is refused");
    assert!(error.is_input() && error.to_string().contains("--order hilbert"), "{error}");
}

#[test]
fn the_threads_of_the_host_do_not_change_a_bit() {
    let scene = glossy();
    let expected = bits(&render_or_panic(&scene, &settings()).film);
    for threads in [1, 2, 5] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let film = pool.install(|| render_or_panic(&scene, &settings())).film;
        assert!(bits(&film) == expected, "{threads} threads change the picture");
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
        let part = render_or_panic(&scene, &RenderSettings { crop: Some(window), ..settings() }).film;
        for y in window.y0..window.y1 {
            for x in window.x0..window.x1 {
                let [a, b] = [&part, &whole].map(|film| film.pixel(x, y).map(pixel_bits));
                assert!(a.is_some() && a == b, "pixel {x}, {y} of {window:?} differs");
            }
        }
    }
}

#[test]
fn the_work_counted_does_not_depend_on_how_tiles_are_dealt() {
    let scene = glossy();
    let one = render_or_panic(&scene, &settings()).statistics;
    let three = RenderSettings { cards: vec![card("emulated:3")], order: GatherOrder::Naive, ..settings() };
    let three = render_or_panic(&scene, &three).statistics;
    assert_eq!(one.rays, three.rays);
    assert_eq!((one.gathers, one.photons_tested), (three.gathers, three.photons_tested));
    assert_eq!(one.rays.eye, 2 * 37 * 29 * 2, "a sample is looked at again when its pixel is complete");
}

#[test]
fn another_seed_is_another_picture() {
    let scene = glossy();
    let first = bits(&render_or_panic(&scene, &settings()).film);
    let second = bits(&render_or_panic(&scene, &RenderSettings { seed: 1, ..settings() }).film);
    assert!(first != second);
}
