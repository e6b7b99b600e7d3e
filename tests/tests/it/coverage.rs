//! Layers for compositors have known values: alpha and premultiplied radiance, positions, and coverage by
//! object and by material.

use glam::{DMat4, DVec3, Vec3};
use photoncard_driver::cryptomatte::Matte;
use photoncard_driver::film::Film;
use photoncard_driver::render::{
    Filter, Integrator, PhotonMaps, Picture, RenderSettings, Rendering, Schedule,
};
use photoncard_driver::scene::{Environment, Instance, Material, Scene, Triangle};
use photoncard_shared::message::COVERAGE_STEPS;
use photoncard_tests::{camera, glass, lambertian, quad, render_or_panic, scene};

/// Side of the picture, pixels. At distance 1 from the eye, a pixel is 1/4 wide.
const SIDE: u32 = 8;
const SAMPLES: u32 = 64;
/// Radiance of the surfaces, which reflect nothing.
const OWN: f32 = 2.0;
/// Radiance of the environment.
const SKY: f32 = 5.0;

fn settings() -> RenderSettings {
    RenderSettings {
        picture: Picture {
            width: SIDE,
            height: SIDE,
            layers: "alpha,position,object,material".parse().unwrap(),
            transparent: true,
            ..Picture::default()
        },
        photons: PhotonMaps { count: 500, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 1, samples: SAMPLES, ..Integrator::default() },
        ..RenderSettings::default()
    }
}

fn emitter(name: &str) -> Material {
    Material { emission: Vec3::splat(OWN), ..lambertian(name, 0.0) }
}

/// Upright rectangle that faces the eye, at the distance `distance`, between these columns of pixels.
fn rectangle(columns: [f32; 2], distance: f32, material: u32, object: u32) -> [Triangle; 2] {
    let [left, right] = columns.map(|column| distance * (0.25 * column - 1.0));
    let corner = |x: f32, y: f32| Vec3::new(x, distance * y, -distance);
    let corners = [corner(left, -2.0), corner(right, -2.0), corner(right, 2.0), corner(left, 2.0)];
    quad(corners, material).map(|triangle| Triangle { object, ..triangle })
}

/// Scene of triangles under a white sky, seen from the origin along -z.
fn under_sky(triangles: Vec<Triangle>, materials: Vec<Material>) -> Scene {
    let names = ["first", "second", "third"].map(str::to_owned);
    scene(triangles, materials, camera(Vec3::ZERO, Vec3::NEG_Z)).with(|scene| {
        scene.objects = names.to_vec();
        scene.environment = Some(Environment::constant(Vec3::splat(SKY)));
    })
}

/// Scene of a rectangle that covers the first columns of pixels up to `edge`.
fn half_covered(edge: f32) -> Scene {
    under_sky(rectangle([-4.0, edge], 1.0, 0, 0).to_vec(), vec![emitter("light")])
}

/// Techniques under which each value must be the same.
fn techniques() -> Vec<RenderSettings> {
    let adaptive = |s: &mut RenderSettings| s.integrator.adaptive_threshold = Some(0.02);
    let filtered = |s: &mut RenderSettings| s.picture.filter = Filter::BlackmanHarris;
    vec![settings(), settings().with(adaptive), settings().with(filtered)]
}

#[test]
fn alpha_is_the_covered_share_and_radiance_is_premultiplied() {
    let edge = 4.25;
    for settings in techniques() {
        let film = render_or_panic(&half_covered(edge), &settings).film;
        let opaque = settings.clone().with(|s| s.picture.transparent = false);
        let behind = render_or_panic(&half_covered(edge), &opaque).film;
        for (x, y) in (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y))) {
            let [pixel, other] = [&film, &behind].map(|film| film.all_at(x, y).unwrap());
            assert_eq!(pixel.alpha, other.alpha);
            let [red, ..] = pixel.pixel.radiance;
            // Weights such as 1/3 are rounded to steps of coverage.
            assert!((red - OWN * pixel.alpha).abs() < 1e-5, "{x}: {red}, {}", pixel.alpha);
            let [over, ..] = other.pixel.radiance;
            let expected = red + SKY * (1.0 - pixel.alpha);
            assert!((over - expected).abs() < 1e-5 * SKY, "{x}: {over}, {expected}");
            // The wider filter reaches into the next column.
            let share = match x {
                0..=2 => Some(1.0),
                4 if settings.picture.filter == Filter::Box => Some(0.25_f32),
                6.. => Some(0.0),
                _ => None,
            };
            if let Some(share) = share {
                let tolerance = if x == 4 { 0.04 } else { 0.0 };
                assert!((pixel.alpha - share).abs() <= tolerance, "{x}: {}", pixel.alpha);
            }
        }
    }
}

/// A pane of glass covers the background as in Cycles: the environment is seen through it.
#[test]
fn glass_covers_the_environment_behind_it() {
    let pane = under_sky(rectangle([0.0, 4.0], 1.0, 0, 0).to_vec(), vec![glass("pane", Vec3::ONE, false)]);
    let film = render_or_panic(&pane, &settings()).film;
    for (x, y) in (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y))) {
        let pixel = film.all_at(x, y).unwrap();
        let [red, ..] = pixel.pixel.radiance;
        if x < 4 {
            assert_eq!(pixel.alpha, 1.0);
            // The pane transmits and reflects the sky, of one radiance.
            assert!((red / SKY - 1.0).abs() < 0.01, "{red}");
        } else {
            assert_eq!((pixel.alpha, red), (0.0, 0.0));
        }
    }
}

#[test]
fn positions_are_those_of_the_first_surface_in_the_coordinates_of_the_file() {
    let offset = DVec3::new(1000.0, -200.0, 0.5);
    for distance in [1.0, 3.0] {
        let triangles = rectangle([-4.0, 4.0], distance, 0, 0).to_vec();
        let scene = under_sky(triangles, vec![emitter("light")]).with(|scene| scene.offset = offset);
        for settings in techniques() {
            let film = render_or_panic(&scene, &settings).film;
            for (x, y) in (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y))) {
                let pixel = film.all_at(x, y).unwrap();
                if x >= 6 {
                    assert_eq!(pixel.position, [0.0; 3]);
                } else if x < 3 {
                    let place = DVec3::from(pixel.position.map(f64::from)) - offset;
                    let depth = f64::from(pixel.pixel.depth);
                    assert!((place.z + depth).abs() < 1e-4 && (depth - f64::from(distance)).abs() < 1e-4);
                    let middle = |place: u32| f64::from(distance) * (0.25 * (f64::from(place) + 0.5) - 1.0);
                    let width = f64::from(distance) * 0.25;
                    assert!((place.x - middle(x)).abs() < 0.06 * width, "{place} at {x}");
                    assert!((place.y + middle(y)).abs() < 0.06 * width, "{place} at {y}");
                }
            }
        }
    }
}

/// Coverage of a pixel by name in a matte, from its channels.
fn coverage(rendering: &Rendering, matte: Matte, (x, y): (u32, u32)) -> Vec<[u32; 2]> {
    let identities = rendering.identities.as_ref().expect("mattes have names");
    let channels = matte.values(&rendering.film, identities);
    let index = (y * SIDE + x) as usize;
    let values: Vec<u32> = channels.iter().map(|channel| channel[index].to_bits()).collect();
    values.as_chunks().0.iter().copied().filter(|[identifier, _]| *identifier != 0).collect()
}

fn sum(entries: &[[u32; 2]]) -> f32 {
    entries.iter().map(|[_, share]| f32::from_bits(*share)).sum()
}

#[test]
fn two_objects_share_a_pixel_and_their_coverage_adds_up_to_alpha() {
    // The first object takes three quarters of a column of pixels; the second one, nearer, an eighth of it;
    // the rest is sky.
    let mut triangles = rectangle([-4.0, 3.75], 2.0, 0, 0).to_vec();
    triangles.extend(rectangle([3.0, 3.125], 1.0, 1, 1));
    // The second material is on the first object too, outside the picture.
    triangles.extend(rectangle([12.0, 13.0], 1.0, 1, 0));
    let materials = ["light", "lamp"].map(emitter).to_vec();
    for settings in techniques() {
        let rendering = render_or_panic(&under_sky(triangles.clone(), materials.clone()), &settings);
        for x in 0..SIDE {
            let alpha = rendering.film.all_at(x, 3).unwrap().alpha;
            let sums = rendering.film.sums_at(x, 3).unwrap();
            assert_eq!(sums.identities.unwrap().total(), sums.coverage.unwrap());
            for matte in [Matte::Object, Matte::Material] {
                let entries = coverage(&rendering, matte, (x, 3));
                assert!((sum(&entries) - alpha).abs() < 1e-6, "{x}");
                let shares: Vec<f32> = entries.iter().map(|[_, share]| f32::from_bits(*share)).collect();
                assert!(shares.is_sorted_by(|a, b| a >= b), "{shares:?}");
                if x == 3 && settings.picture.filter == Filter::Box {
                    let [first, second] = shares[..] else { panic!("{shares:?}") };
                    assert!((first - 0.625).abs() < 0.05 && (second - 0.125).abs() < 0.05, "{shares:?}");
                }
            }
        }
    }
}

/// Of many identities in a pixel, those of least hash remain, with their whole coverage.
#[test]
fn more_identities_than_a_pixel_keeps_are_dropped_whole() {
    let count = 40;
    let strips: Vec<Triangle> = (0..count)
        .flat_map(|index| {
            let left = 3.0 + index as f32 / count as f32;
            rectangle([left, left + 1.0 / count as f32], 1.0, 0, index)
        })
        .collect();
    let scene = under_sky(strips, vec![emitter("light")]).with(|scene| {
        scene.objects = (0..count).map(|index| format!("strip {index}")).collect();
    });
    let settings = settings().with(|s| s.integrator.samples = 1000);
    let rendering = render_or_panic(&scene, &settings);
    let sums = rendering.film.sums_at(3, 3).unwrap();
    let identities = sums.identities.unwrap();
    assert_eq!(identities.iter().count(), 12);
    assert_eq!(sums.coverage, Some(1000 * COVERAGE_STEPS));
    let hash = |identity| photoncard_shared::hash::hash(identity);
    let mut all: Vec<u32> = (0..count).collect();
    all.sort_by_key(|&identity| hash(identity));
    assert!(identities.iter().map(|(identity, _)| identity).eq(all[..12].iter().copied()));
    for (_, covered) in identities.iter() {
        let share = f64::from(covered) / f64::from(COVERAGE_STEPS) / 1000.0;
        assert!((share * f64::from(count) - 1.0).abs() < 0.4, "{share}");
    }
}

/// Instances have their own names, and their group's materials.
#[test]
fn an_instance_is_the_object_that_its_triangles_would_be() {
    let materials = || vec![lambertian("leaf", 0.5), lambertian("unused", 0.5), lambertian("bark", 0.5)];
    let group: Vec<Triangle> =
        [rectangle([0.5, 3.0], 1.0, 2, 9), rectangle([3.0, 4.5], 1.0, 0, 9)].as_flattened().to_vec();
    let mut instanced = under_sky(rectangle([6.0, 6.5], 1.0, 0, 2).to_vec(), materials());
    instanced.groups = vec![group];
    let places = [DVec3::new(0.0, 0.3, -1.0), DVec3::new(0.6, -0.4, 0.0)];
    instanced.instances = (0..)
        .zip(places)
        .filter_map(|(object, place)| {
            let instance = Instance::new(0, &DMat4::from_translation(place))?;
            Some(Instance { object, ..instance })
        })
        .collect();
    let expanded = instanced.expanded(&[true]);
    assert!(expanded.instances.is_empty());
    let [found, expected] = [&instanced, &expanded].map(|scene| render_or_panic(scene, &settings()));
    let names = |rendering: &Rendering| rendering.identities.as_deref().cloned().unwrap();
    let values = |rendering: &Rendering, matte: Matte| -> Vec<Vec<u32>> {
        let channels = matte.values(&rendering.film, &names(rendering));
        channels.iter().map(|channel| channel.iter().map(|value| value.to_bits()).collect()).collect()
    };
    for (matte, count) in [(Matte::Object, 3), (Matte::Material, 2)] {
        assert!(values(&found, matte) == values(&expected, matte), "{matte:?}");
        let mut seen: Vec<u32> = values(&found, matte)[0].clone();
        seen.sort_unstable();
        seen.dedup();
        assert!(seen.len() > count, "{matte:?}: each name is first in a pixel, and so is none");
        assert_eq!(matte.attributes(&names(&found)), matte.attributes(&names(&expected)));
    }
    assert!(!format!("{:?}", names(&found)).contains("unused"));
}

/// Sums of light, albedo, normal and depth.
fn plain(film: &Film) -> Vec<u8> {
    let form = photoncard_driver::film::PixelForm::PLAIN;
    let mut bytes = Vec::new();
    film.sums().for_each(|sums| sums.in_form(form).write(&mut |part| bytes.extend_from_slice(part)));
    bytes
}

#[test]
fn layers_on_request_do_not_change_the_others() {
    let scene = half_covered(4.25);
    let without = settings().with(|s| {
        s.picture.transparent = false;
        s.picture.layers = Default::default();
        s.schedule = Schedule::default();
    });
    let expected = plain(&render_or_panic(&scene, &without).film);
    for layers in ["alpha", "position", "object", "material", "all"] {
        let with = without.clone().with(|s| s.picture.layers = layers.parse().unwrap());
        assert!(plain(&render_or_panic(&scene, &with).film) == expected, "{layers}");
    }
}
