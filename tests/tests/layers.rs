//! Layers: they add up to the picture, do not change it, and hold the quantities of their names.

use photoncard_driver::film::{Film, FilmPixel, PixelLayers, PixelValue};
use photoncard_driver::layer::Layers;
use photoncard_driver::photon_map::PhotonLayout;
use photoncard_driver::render::{
    CardAddress, CardSet, Integrator, PhotonMaps, Picture, RenderError, RenderSettings, Rendering,
    Unobserved, render,
};
use photoncard_driver::scene::{Reflection, Scene, gltf};
use photoncard_driver::scheduler::GatherOrder;
use photoncard_tests::render_or_panic;

fn load(name: &str) -> Scene {
    let path = format!("{}/../scenes/{name}", env!("CARGO_MANIFEST_DIR"));
    gltf::load(path.as_ref()).expect("a shipped scene loads")
}

fn card(text: &str) -> CardAddress {
    text.parse().unwrap()
}

fn settings() -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 37, height: 29, layers: Layers::all(), ..Picture::default() },
        photons: PhotonMaps { count: 20_000, neighbors: 50, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 12, samples: 2, ..Integrator::default() },
        cards: CardSet { addresses: vec![card("emulated:1")], ..CardSet::default() },
        ..RenderSettings::default()
    }
}

/// Bits of the pixels without layers.
fn picture_bits(film: &Film) -> Vec<u8> {
    film.pixels().iter().flat_map(PixelValue::to_bytes).collect()
}

/// Bits of the layers.
fn layer_bits(film: &Film) -> Vec<u8> {
    film.all().flat_map(|pixel| pixel.layers.to_bytes()).collect()
}

/// Checks that a pixel's components add up to its radiance, except for rounding.
fn adds_up(FilmPixel { pixel, layers }: FilmPixel) -> bool {
    let PixelLayers { direct, indirect, caustic, .. } = layers;
    (0..3).all(|axis| {
        let sum = f64::from(direct[axis]) + f64::from(indirect[axis]) + f64::from(caustic[axis]);
        (sum - f64::from(pixel.radiance[axis])).abs() <= 2.0 * f64::from(f32::EPSILON) * sum
    })
}

/// Other settings with equal pixels, with layers.
fn variants() -> Vec<RenderSettings> {
    let orders = [
        GatherOrder::Naive,
        GatherOrder::Tiled,
        GatherOrder::DirectionBins,
        GatherOrder::Hash,
        GatherOrder::Sort,
        GatherOrder::Hilbert,
    ];
    let of_order = |order| settings().with(|s| s.schedule.order = order);
    let others = [
        settings().with(|s| {
            s.schedule.tile = 32;
            s.schedule.queue = Some(5000);
        }),
        settings().with(|s| {
            s.schedule.tile = 8;
            s.cards.addresses = vec![card("emulated-micro:2")];
        }),
        of_order(GatherOrder::Hilbert).with(|s| {
            s.schedule.tile = 5;
            s.cards.addresses = vec![card("emulated:2")];
        }),
        settings().with(|s| {
            s.photons.layout = PhotonLayout::Jensen;
            s.schedule.queue = Some(37);
        }),
    ];
    orders.into_iter().map(of_order).chain(others).collect()
}

#[test]
fn layers_add_up_to_the_picture_and_change_no_bit_of_it() {
    let scene = load("cornell-glossy.gltf");
    for irradiance_error in [None, Some(0.025)] {
        let with =
            |settings: RenderSettings| settings.with(|s| s.integrator.irradiance_error = irradiance_error);
        let plain = with(settings().with(|s| s.picture.layers = Layers::default()));
        let plain = render_or_panic(&scene, &plain).film;
        assert!(!plain.has_layers());
        let mut expected = None;
        for variant in variants() {
            let variant = with(variant);
            let film = render_or_panic(&scene, &variant).film;
            assert!(picture_bits(&film) == picture_bits(&plain), "{variant:?} changes the picture");
            let expected = expected.get_or_insert_with(|| layer_bits(&film));
            assert!(layer_bits(&film) == *expected, "{variant:?} changes the layers");
            assert!(film.all().all(adds_up), "{variant:?}");
            for light in [|layers: PixelLayers| layers.direct, |layers: PixelLayers| layers.indirect] {
                assert!(film.all().any(|pixel| light(pixel.layers)[1] > 0.0));
            }
        }
    }
}

#[test]
fn what_no_photon_brings_is_direct() {
    let scene = load("cornell.gltf");
    let film = render_or_panic(&scene, &settings().with(|s| s.integrator.gather_rays = 0)).film;
    for FilmPixel { pixel, layers } in film.all() {
        assert_eq!(layers, PixelLayers { direct: pixel.radiance, ..PixelLayers::default() });
    }
    // Without shadow rays direct light comes from gather rays alone, whose weight is then 1.
    let without = render_or_panic(&scene, &settings().with(|s| s.integrator.shadow_rays = 0)).film;
    let with = render_or_panic(&scene, &settings()).film;
    for (without, with) in without.all().zip(with.all()) {
        assert_eq!(without.layers.indirect, with.layers.indirect);
    }
    assert!(without.all().zip(with.all()).any(|(without, with)| without.layers.direct != with.layers.direct));
}

fn gathers(rendering: &Rendering) -> Vec<f32> {
    rendering.film.all().map(|pixel| pixel.layers.gathers).collect()
}

#[test]
fn every_sample_gathers_that_is_not_interpolated() {
    let scene = load("cornell.gltf");
    let plain = render_or_panic(&scene, &settings());
    for (pixel, gathers) in plain.film.pixels().iter().zip(gathers(&plain)) {
        // Samples that look past the box have neither.
        assert_eq!(gathers == 0.0, pixel.albedo == [0.0; 3]);
        assert!([0.0, 1.0, 2.0].contains(&gathers));
    }
    assert!(gathers(&plain).iter().filter(|&&gathers| gathers == 2.0).count() > 37 * 29 / 2);

    let cached = render_or_panic(&scene, &settings().with(|s| s.integrator.irradiance_error = Some(0.025)));
    assert!(gathers(&cached).iter().zip(gathers(&plain)).all(|(with, without)| *with <= without));
    let [with, without] =
        [&cached, &plain].map(|rendering| f64::from(gathers(rendering).iter().sum::<f32>()));
    assert!(with < without);
    // All surfaces of the box are Lambertian.
    let share = cached.statistics.interpolated_share;
    assert!((with - (1.0 - share) * without).abs() < 1e-3, "{with} of {without}, share {share}");
}

#[test]
fn albedo_and_normals_are_fit_for_a_denoiser() {
    let mut scene = load("cornell-glossy.gltf");
    for material in &mut scene.materials {
        if let Reflection::Phong { specular, .. } = &mut material.reflection {
            *specular = glam::Vec3::splat(0.9);
        }
    }
    let film = render_or_panic(&scene, &settings()).film;
    for pixel in film.pixels() {
        assert!(pixel.albedo.iter().all(|albedo| (0.0..=1.0).contains(albedo)), "{:?}", pixel.albedo);
        assert!(glam::Vec3::from(pixel.normal).length() < 1.0 + 1e-5, "{:?}", pixel.normal);
    }
    assert!(film.pixels().iter().any(|pixel| pixel.albedo.contains(&1.0)));
}

#[test]
fn tiles_with_layers_that_no_chip_holds_are_refused_with_a_remedy() {
    let scene = load("cornell.gltf");
    for (tile, cards, most) in [(33, "emulated:1", 32), (64, "emulated:1", 32), (9, "emulated-micro:1", 8)] {
        for order in [GatherOrder::Sort, GatherOrder::Naive, GatherOrder::Hilbert] {
            let cards = vec![card(cards)];
            if order == GatherOrder::Hilbert && most == 8 {
                continue;
            }
            let settings = settings().with(|s| {
                s.schedule.tile = tile;
                s.schedule.order = order;
                s.cards.addresses = cards;
            });
            let error = render(&scene, &settings, &Unobserved).err().expect("is refused");
            let said = error.to_string();
            assert!(error.is_input() && said.contains(&format!("1 to {most}")), "{said}");
            assert!(said.contains("--tile") && said.contains("--aov"), "{said}");
            let RenderError::Setting { remedy, .. } = error else { panic!("{said}") };
            assert!(remedy.contains(&format!("choose {most} or less")), "{remedy}");
        }
    }
    // Layers that the host always has take no room.
    for aov in ["albedo,N,Z", "none"] {
        let layers = aov.parse().unwrap();
        render_or_panic(
            &scene,
            &settings().with(|s| {
                s.picture.layers = layers;
                s.schedule.tile = 64;
            }),
        );
    }
}

#[test]
fn the_default_tile_has_room_on_every_card() {
    for (aov, cards, side) in [
        ("all", "emulated:2", 16),
        ("all", "emulated-micro:2", 8),
        ("gathers", "tcp:localhost:7000", 8),
        ("Z", "tcp:localhost:7000", 16),
        ("none", "emulated-micro:1", 16),
    ] {
        let cards = [card("emulated:1"), card(cards)];
        assert_eq!(RenderSettings::default_tile(&aov.parse().unwrap(), &cards), side, "{aov} {cards:?}");
    }
}
