//! Irradiance, as a picture, as a layer of illuminance and by sensors, against known values.

use std::f64::consts::PI;
use std::sync::LazyLock;

use glam::Vec3;
use photoncard_driver::film::Film;
use photoncard_driver::layer::Layer;
use photoncard_driver::render::measure::{Meter, Point, Reading, SENSORS_TOGETHER};
use photoncard_driver::render::{
    CardAddress, CardSet, Integrator, PhotonMaps, Picture, RenderSettings, Renderer, Unobserved,
};
use photoncard_driver::scene::{LightAxes, Material, PunctualKind, PunctualLight, Scene, gltf};
use photoncard_driver::scheduler::GatherOrder;
use photoncard_tests::everything::everything;
use photoncard_tests::{camera, lambertian, mean, quad, radiances, render_or_panic, room, scene};
use proptest::prelude::*;

/// Weights of equal parts, with which a grey irradiance is its own luminance.
const GREY: [f64; 3] = [1.0 / 3.0; 3];

fn settings() -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 24, height: 24, ..Picture::default() },
        photons: PhotonMaps { count: 20_000, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 64, samples: 2, ..Integrator::default() },
        cards: CardSet { addresses: vec![address("emulated:1")], ..CardSet::default() },
        ..RenderSettings::default()
    }
}

fn address(text: &str) -> CardAddress {
    text.parse().unwrap()
}

fn measured(scene: &Scene, settings: &RenderSettings, points: &[Point]) -> Vec<Reading> {
    let mut meter = Meter::new(scene, settings, GREY);
    meter.measure(0, points, &Unobserved).unwrap_or_else(|error| panic!("{error}"))
}

fn at(position: [f64; 3], normal: [f64; 3]) -> Point {
    Point { position, normal }
}

fn grey(reading: &Reading) -> f64 {
    reading.irradiance().iter().sum::<f64>() / 3.0
}

/// Square in the plane y = `height` that faces down, with the centre (0, 0).
fn lamp(half: f32, height: f32, emission: f32) -> Scene {
    let corner = |x: f32, z: f32| Vec3::new(x * half, height, z * half);
    let corners = [corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)];
    let lamp = Material { emission: Vec3::splat(emission), ..lambertian("lamp", 0.0) };
    scene(quad(corners, 0).into(), vec![lamp], camera(Vec3::new(0.0, 0.5, 3.0), Vec3::NEG_Z))
}

/// Form factor from a horizontal point to a parallel rectangle `a` by `b`, whose corner lies straight above
/// at distance `c` (Howell, A Catalog of Radiation Heat Transfer Configuration Factors, B-4).
fn corner_factor(a: f64, b: f64, c: f64) -> f64 {
    let (x, y) = (a / c, b / c);
    let part = |x: f64, y: f64| x / (1.0 + x * x).sqrt() * (y / (1.0 + x * x).sqrt()).atan();
    (part(x, y) + part(y, x)) / (2.0 * PI)
}

#[test]
fn irradiance_in_a_furnace_is_pi_times_its_radiance() {
    for material in [lambertian("wall", 0.5), Material { double_sided: true, ..lambertian("wall", 0.2) }] {
        let albedo = if material.double_sided { 0.2 } else { 0.5 };
        let emitting = Material { emission: Vec3::ONE, ..material };
        let furnace = scene(room([0; 6]), vec![emitting], camera(Vec3::ZERO, Vec3::new(-0.3, -0.2, -1.0)));
        let expected = PI / (1.0 - albedo);
        let picture = settings().with(|s| s.picture.irradiance = true);
        let error = mean(&radiances(&render_or_panic(&furnace, &picture).film)) / expected - 1.0;
        assert!(error.abs() < 0.01, "the picture is off by {error}");
        let points: Vec<Point> = (0..40)
            .map(|index| {
                let turn = f64::from(index) * 2.4;
                at([0.8 * turn.sin(), 0.9 * (1.7 * turn).sin(), 0.0], [turn.cos(), turn.sin(), 0.3])
            })
            .collect();
        let more = settings().with(|s| (s.integrator.samples, s.photons.count) = (16, 100_000));
        let readings: Vec<f64> = measured(&furnace, &more, &points).iter().map(grey).collect();
        let error = readings.iter().sum::<f64>() / readings.len() as f64 / expected - 1.0;
        assert!(error.abs() < 0.003, "the mean of the sensors is off by {error}");
        for (index, reading) in readings.into_iter().enumerate() {
            let error = reading / expected - 1.0;
            assert!(error.abs() < 0.025, "sensor {index} is off by {error}");
        }
    }
}

#[test]
fn sensors_below_a_square_lamp_measure_its_form_factor() {
    let (half, height, emission) = (0.5, 2.0, 3.0);
    let lit = lamp(half as f32, height as f32, emission);
    let more = settings().with(|s| {
        (s.integrator.samples, s.integrator.shadow_rays, s.integrator.gather_rays) = (1024, 32, 4);
    });
    let places = [0.0, 0.3, 0.9, 1.7];
    let points: Vec<Point> = places.iter().map(|&x| at([x, 0.0, 0.0], [0.0, 2.0, 0.0])).collect();
    let away = at([0.0; 3], [0.0, -1.0, 0.0]);
    let readings = measured(&lit, &more, &[points, vec![away]].concat());
    for (x, reading) in places.into_iter().zip(&readings) {
        // Two rectangles from the point's column to the edges of the lamp, on both sides of the axis.
        let to_edge = |edge: f64| edge.signum() * 2.0 * corner_factor(edge.abs(), half, height);
        let factor = to_edge(x + half) - to_edge(x - half);
        let expected = f64::from(emission) * PI * factor;
        let error = grey(reading) / expected - 1.0;
        assert!(error.abs() < 0.002, "at {x}: off by {error}");
        assert_eq!(reading.indirect, [0.0; 3], "nothing reflects");
        assert!(reading.error < 0.001 * expected, "at {x}: error {}", reading.error);
    }
    assert_eq!(readings.last().map(grey), Some(0.0), "the lamp is behind the sensor");
}

#[test]
fn a_sensor_below_a_point_light_measures_the_law_of_squares_and_cosines() {
    let mut lit = lamp(0.1, 5.0, 0.0);
    let intensity = Vec3::splat(7.0);
    let kind = PunctualKind::Point { position: Vec3::new(0.0, 2.0, 0.0) };
    lit.lights = vec![PunctualLight { name: "light".into(), kind, intensity, axes: LightAxes::default() }];
    let [reading] = measured(&lit, &settings(), &[at([1.5, 0.0, 0.0], [0.0, 1.0, 0.0])])[..] else {
        panic!("one reading");
    };
    assert!((grey(&reading) / (7.0 * 2.0 / 2.5_f64.powi(3)) - 1.0).abs() < 3e-5);
    assert!(reading.error < 1e-6, "there is no noise: {}", reading.error);
}

#[test]
fn the_irradiance_of_a_lambertian_surface_is_pi_times_its_radiance_over_its_albedo() {
    let albedo = 0.4;
    let mut walls = lamp(0.5, 0.99, 20.0);
    walls.cameras = vec![camera(Vec3::new(0.0, 0.0, 0.9), Vec3::NEG_Z)];
    walls.materials.push(lambertian("wall", albedo));
    walls.triangles.extend(room([1; 6]));
    let same = settings().with(|s| s.picture.filter = photoncard_driver::render::Filter::Box);
    let radiance = render_or_panic(&walls, &same).film;
    let irradiance = render_or_panic(&walls, &same.clone().with(|s| s.picture.irradiance = true)).film;
    let mut compared = 0;
    for (radiance, irradiance) in radiance.pixels().zip(irradiance.pixels()) {
        if radiance.albedo[0] > 0.39 && radiance.radiance[0] > 0.0 {
            let expected = radiance.radiance[0] * std::f32::consts::PI / albedo;
            let error = irradiance.radiance[0] / expected - 1.0;
            // Directions are sampled by the product with the albedo, which is grey: rays are the same.
            assert!(error.abs() < 1e-3, "off by {error}");
            compared += 1;
        }
    }
    assert!(compared > 400, "{compared} pixels show walls");
}

#[test]
fn the_layer_of_illuminance_is_the_irradiance_picture_in_lux() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell-glossy.gltf");
    let glossy = gltf::load(path.as_ref()).expect("a shipped scene loads");
    let base = settings().with(|s| s.integrator.irradiance_error = Some(0.1));
    let plain = render_or_panic(&glossy, &base);
    assert_eq!(plain.illuminance, None);
    let layered = base.clone().with(|s| {
        s.picture.layers = s.picture.layers.with([Layer::Illuminance]);
        s.picture.lumens_per_watt = Some(179.0);
    });
    let rendering = render_or_panic(&glossy, &layered);
    assert!(rendering.film.sums().eq(plain.film.sums()), "the picture is the same");
    let lux = rendering.illuminance.expect("a layer of illuminance");
    let irradiance = render_or_panic(&glossy, &base.with(|s| s.picture.irradiance = true)).film;
    for (lux, pixel) in lux.iter().zip(irradiance.pixels()) {
        let [red, green, blue] = pixel.radiance;
        assert_eq!(*lux, 179.0 * (0.2126 * red + 0.7152 * green + 0.0722 * blue));
    }
    assert!(lux.iter().any(|&lux| lux > 0.0));
}

#[test]
fn readings_depend_on_number_and_place_alone() {
    let lit = everything();
    let points: Vec<Point> = (0..300)
        .map(|index| {
            let turn = f64::from(index) * 0.77;
            at(
                [0.5 * turn.sin(), 0.5 * (1.3 * turn).cos(), 0.4 * (0.7 * turn).sin()],
                [turn.cos(), turn.sin(), 0.2],
            )
        })
        .collect();
    let few = settings().with(|s| (s.photons.count, s.integrator.gather_rays) = (3000, 12));
    let expected = measured(&lit, &few, &points);
    assert!(expected.iter().any(|reading| grey(reading) > 0.0));
    // Fewer sensors, and other ones behind them.
    assert_eq!(measured(&lit, &few, &points[..270]), expected[..270]);
    // A second group on the same cards, as a fresh meter measures it.
    let second = SENSORS_TOGETHER as u32;
    let mut meter = Meter::new(&lit, &few, GREY);
    assert_eq!(meter.measure(0, &points, &Unobserved).unwrap(), expected);
    let after = meter.measure(second, &points[..20], &Unobserved).unwrap();
    let alone = Meter::new(&lit, &few, GREY).measure(second, &points[..20], &Unobserved).unwrap();
    assert_eq!(after, alone);
    assert_ne!(after, expected[..20], "random numbers are those of the sensor's number");
    assert_eq!(meter.measure(0, &points, &Unobserved).unwrap(), expected);
}

/// Readings and pictures of the scene with every feature on one card, in the order of tiles.
struct Reference {
    lit: Scene,
    points: Vec<Point>,
    readings: Vec<Reading>,
    /// Pictures without and with an irradiance cache.
    films: [Film; 2],
}

static REFERENCE: LazyLock<Reference> = LazyLock::new(|| {
    let (lit, base) = (everything(), in_order());
    let points: Vec<Point> = (0..70)
        .map(|index| at([0.01 * f64::from(index) - 0.3, 0.1, 0.2], [0.1, 1.0, 0.02 * f64::from(index)]))
        .collect();
    let film = |cache| render_or_panic(&lit, &base.clone().with(|s| with_cache(s, cache))).film;
    let films = [false, true].map(film);
    Reference { readings: measured(&lit, &base, &points), films, points, lit }
});

fn in_order() -> RenderSettings {
    settings().with(|s| {
        (s.picture.width, s.picture.height) = (13, 11);
        (s.photons.count, s.integrator.gather_rays, s.photons.neighbors) = (1500, 8, 20);
        s.photons.caustic_neighbors = 20;
        s.picture.irradiance = true;
        s.schedule.order = GatherOrder::Tiled;
    })
}

fn with_cache(settings: &mut RenderSettings, cache: bool) {
    settings.integrator.irradiance_error = cache.then_some(0.2);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]
    #[test]
    fn readings_and_irradiance_pictures_do_not_depend_on_order_or_cards(
        order in prop::sample::select(vec![GatherOrder::Naive, GatherOrder::DirectionBins, GatherOrder::Hash, GatherOrder::Sort, GatherOrder::Buckets]),
        cards in prop::sample::select(vec!["emulated:1", "emulated:3", "emulated-micro:2", "emulated-nano:1"]),
        tile in 1..9_u32,
        cache: bool,
    ) {
        let base = in_order();
        let changed = base.clone().with(|s| {
            (s.schedule.order, s.schedule.tile) = (order, Some(tile.min(4)));
            s.cards.addresses = vec![address(cards)];
            if cards.contains("nano") && order == GatherOrder::Buckets {
                s.schedule.order = GatherOrder::Sort;
            }
        });
        let Reference { lit, points, readings, films } = &*REFERENCE;
        prop_assert_eq!(&measured(lit, &changed, points), readings);
        let film = render_or_panic(lit, &changed.with(|s| with_cache(s, cache))).film;
        prop_assert!(film.sums().eq(films[usize::from(cache)].sums()));
    }
}

#[test]
fn sensors_of_no_place_are_refused_by_number() {
    let lit = lamp(0.5, 2.0, 1.0);
    let good = at([0.0; 3], [0.0, 1.0, 0.0]);
    for bad in [at([1e30, 0.0, 0.0], [0.0, 1.0, 0.0]), at([f64::NAN; 3], [1.0; 3]), at([0.0; 3], [0.0; 3])] {
        let mut meter = Meter::new(&lit, &settings(), GREY);
        let error = meter.measure(0, &[good, good, bad], &Unobserved).unwrap_err();
        assert!(error.to_string().contains("sensor 3"), "{error}");
    }
    assert_eq!(Meter::new(&lit, &settings(), GREY).measure(0, &[], &Unobserved).unwrap(), []);
    // The cards serve a picture after a measurement.
    let mut renderer = Renderer::default();
    assert!(renderer.render(&lit, &settings(), &Unobserved).is_ok());
}

/// Square floor of this half side at y = 0, black.
fn ground(half: f32) -> [photoncard_driver::scene::Triangle; 2] {
    let at = |x: f32, z: f32| Vec3::new(x * half, 0.0, z * half);
    quad([at(-1.0, 1.0), at(1.0, 1.0), at(1.0, -1.0), at(-1.0, -1.0)], 1)
}

#[test]
fn the_size_of_the_ground_changes_no_reading() {
    for half in [10.0, 1e4, 1e5] {
        let mut lit = lamp(0.5, 2.0, 3.0);
        lit.materials.push(lambertian("ground", 0.0));
        lit.triangles.extend(ground(half));
        // A table top, below which it is dark.
        let corner = |x: f32, z: f32| Vec3::new(x, 0.81, z);
        lit.triangles.extend(quad([corner(2., 1.), corner(4., 1.), corner(4., -1.), corner(2., -1.)], 1));
        lit.triangles.extend(quad([corner(2., 1.), corner(2., -1.), corner(4., -1.), corner(4., 1.)], 1));
        let kind = PunctualKind::Point { position: Vec3::new(-8.0, 2.0, 0.0) };
        lit.lights = vec![PunctualLight {
            name: "light".into(),
            kind,
            intensity: Vec3::splat(100.0),
            axes: LightAxes::default(),
        }];
        let more = settings().with(|s| (s.integrator.samples, s.integrator.shadow_rays) = (64, 32));
        let up = [0.0, 1.0, 0.0];
        let points = [at([-8.0, 0.8, 0.0], up), at([-8.0, 1.98, 0.0], up), at([3.0, 0.8, 0.0], up)];
        let [below, near, under_table] = measured(&lit, &more, &points)[..] else { panic!("three readings") };
        assert!((grey(&below) / (100.0 / 1.44) - 1.0).abs() < 0.01, "{half}: {below:?}");
        assert!((grey(&near) / 2.5e5 - 1.0).abs() < 0.15, "{half}: {near:?}");
        assert_eq!(grey(&under_table), 0.0, "{half}: {under_table:?}");
    }
}
