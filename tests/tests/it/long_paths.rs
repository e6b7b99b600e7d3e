//! Paths of many specular bounces are not cut off, in scenes of known radiance.

use glam::Vec3;
use photoncard_driver::render::{
    CardAddress, CardSet, Integrator, PhotonMaps, Picture, RenderSettings, Rendering,
};
use photoncard_driver::scene::{Material, Projection, Scene, Triangle};
use photoncard_tests::{camera, lambertian, mean, quad, radiances, render_or_panic, room, scene};

use super::specular::mirror;

fn settings() -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 16, height: 16, ..Picture::default() },
        photons: PhotonMaps { count: 20_000, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 0, samples: 256, ..Integrator::default() },
        cards: CardSet {
            addresses: vec!["emulated:2".parse::<CardAddress>().unwrap()],
            ..CardSet::default()
        },
        ..RenderSettings::default()
    }
}

/// Double-sided Lambertian material of `albedo` that emits `1 - albedo`: in uniform radiance 1 it is
/// invisible.
fn part_of_furnace(albedo: f32) -> Material {
    Material {
        emission: Vec3::splat(1.0 - albedo),
        double_sided: true,
        ..lambertian("part of furnace", albedo)
    }
}

fn rendered(scene: &Scene, settings: &RenderSettings) -> (f64, Rendering) {
    let rendering = render_or_panic(scene, settings);
    (mean(&radiances(&rendering.film)), rendering)
}

/// The lamp is at the end of a corridor between two mirrors. The camera's angle determines after how many
/// reflections it is seen.
#[test]
fn a_lamp_is_seen_after_any_number_of_reflections() {
    for (bounces, reflectance) in [(10_u16, 0.95_f32), (40, 0.95), (40, 0.99), (150, 0.99)] {
        let end = 0.5 * f32::from(bounces);
        let plane = |y: f32, up: f32| {
            let corner = |x: f32, z: f32| Vec3::new(x, y, -z * up);
            quad([corner(-1., -1.), corner(end, -1.), corner(end, 1.), corner(-1., 1.)], 0)
        };
        let corner = |y: f32, z: f32| Vec3::new(end, y, z);
        let lamp = quad([corner(0., 1.), corner(0., -1.), corner(1., -1.), corner(1., 1.)], 1);
        let view = camera(Vec3::new(0.0, 0.5, 0.0), Vec3::new(0.5, 1.0, 0.0));
        let scene = scene(
            [plane(0.0, 1.0), plane(1.0, -1.0), lamp].concat(),
            vec![mirror(reflectance), part_of_furnace(0.0)],
            photoncard_driver::scene::Camera { projection: Projection::perspective(5e-4), ..view },
        );
        let (seen, rendering) = rendered(&scene, &settings().with(|s| s.integrator.samples = 128));
        let expected = f64::from(reflectance).powi(bounces.into());
        // Of 32,768 paths, the share `expected` survives Russian roulette, with weight 1.
        let tolerance = 4.0 * ((1.0 - expected) / (32_768.0 * expected)).sqrt() + 1e-3;
        assert!((seen / expected - 1.0).abs() < tolerance, "{bounces}: {seen} instead of {expected}");
        assert_eq!(rendering.statistics.lost_paths, 0);
    }
}

/// Closed room of lossless mirrors with a small lamp and a small Lambertian plate. No two walls are parallel:
/// between parallel ones some paths would never leave.
fn mirror_room(forward: Vec3) -> Scene {
    let plate = |centre: Vec3, material: u32| -> [Triangle; 2] {
        let corner = |x: f32, z: f32| centre + Vec3::new(0.4 * x, 0.0, -0.3 * z);
        quad([corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)], material)
    };
    let mut triangles = room([0; 6]);
    for vertex in triangles.iter_mut().flat_map(|triangle| &mut triangle.vertices) {
        *vertex /= 1.0 + vertex.dot(Vec3::new(0.15, 0.06, 0.21));
    }
    triangles.extend(plate(Vec3::new(0.13, 0.8, -0.21), 1));
    triangles.extend(plate(Vec3::new(-0.2, -0.8, -0.1), 2));
    let materials = vec![mirror(1.0), part_of_furnace(0.0), part_of_furnace(0.7)];
    scene(triangles, materials, camera(Vec3::new(0.31, 0.17, 0.67), forward))
}

/// All pixels show the lamp's radiance, after any number of reflections of eye paths, gather rays or photons.
#[test]
fn a_room_of_mirrors_shows_the_radiance_of_its_lamp_everywhere() {
    let gathering = |caustic_photons| {
        settings().with(|s| {
            s.photons.caustic_photons = caustic_photons;
            (s.integrator.gather_rays, s.integrator.samples) = (16, 16);
        })
    };
    let ahead = Vec3::new(-0.3, -0.4, -1.0);
    for (settings, tolerance) in [(gathering(Some(0)), 0.02), (gathering(None), 0.03)] {
        let (seen, rendering) = rendered(&mirror_room(ahead), &settings);
        assert!((seen - 1.0).abs() < tolerance, "{seen} instead of 1");
        let lost = rendering.statistics.lost_paths as f64 / rendering.statistics.rays.gather as f64;
        assert!(lost < 1e-3, "{lost} of the paths are lost");
    }
}
