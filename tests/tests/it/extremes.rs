//! Scenes and settings at the limits of their ranges: large, tilted, very bright or saturated, or with one
//! kind of rays alone.

use glam::Vec3;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::photon::trace;
use photoncard_driver::render::{
    CardSet, Integrator, PhotonMaps, Picture, RenderSettings, Unobserved, render,
};
use photoncard_driver::scene::{Material, Projection, Scene, Triangle, gltf};
use photoncard_tests::{camera, lambertian, mean, quad, radiances, render_or_panic, room, scene};

fn settings() -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 16, height: 16, ..Picture::default() },
        photons: PhotonMaps { count: 20_000, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 16, ..Integrator::default() },
        cards: CardSet { addresses: vec!["emulated:2".parse().unwrap()], ..CardSet::default() },
        ..RenderSettings::default()
    }
}

fn emitting(name: &str, albedo: f32, radiance: Vec3) -> Material {
    Material { emission: radiance, ..lambertian(name, albedo) }
}

/// Floor of half side `half_side`, tilted about two axes, below a small parallel lamp. The camera is close to
/// it.
fn tilted_floor(half_side: f32) -> Scene {
    let (u, v) = (Vec3::new(0.8, 0.3, 0.2).normalize(), Vec3::new(-0.2, 0.5, -0.9));
    let v = (v - u * u.dot(v)).normalize();
    let n = u.cross(v);
    let square = |centre: Vec3, half: f32, sign: f32, material: u32| -> [Triangle; 2] {
        let (u, v) = (u * half, v * half * sign);
        quad([centre - u - v, centre + u - v, centre + u + v, centre - u + v], material)
    };
    let mut triangles = square(Vec3::new(0.1, 0.2, 0.3), half_side, 1.0, 0).to_vec();
    triangles.extend(square(n * 2.0, 0.5, -1.0, 1));
    let eye = Vec3::new(0.1, 0.2, 0.3) + n * 1.5 + u * 0.7;
    let mut view = camera(eye, -n + u * -0.4);
    view.projection = Projection::perspective(0.5);
    scene(triangles, vec![lambertian("floor", 0.5), emitting("lamp", 0.0, Vec3::ONE)], view)
}

#[test]
fn a_large_tilted_floor_is_not_darker_than_a_small_one() {
    let settings = settings().with(|s| {
        s.integrator.gather_rays = 0;
        s.integrator.shadow_rays = 16;
    });
    let expected = mean(&radiances(&render_or_panic(&tilted_floor(4.0), &settings).film));
    for half_side in [12.0, 50.0, 300.0, 1000.0] {
        let found = mean(&radiances(&render_or_panic(&tilted_floor(half_side), &settings).film));
        assert!((found / expected - 1.0).abs() < 0.01, "at {half_side} m: {found} and not {expected}");
    }
}

#[test]
fn many_samples_next_to_a_dazzling_lamp_do_not_overflow() {
    let side = 500.0;
    let mut triangles: Vec<Triangle> = quad(
        [
            Vec3::new(-side, 0., side),
            Vec3::new(side, 0., side),
            Vec3::new(side, 0., -side),
            Vec3::new(-side, 0., -side),
        ],
        0,
    )
    .to_vec();
    let lamp = |x: f32, z: f32| Vec3::new(0.5 * x, 0.3, 0.5 * z);
    triangles.extend(quad([lamp(-1., -1.), lamp(1., -1.), lamp(1., 1.), lamp(-1., 1.)], 1));
    let materials = vec![lambertian("floor", 0.5), emitting("lamp", 0.0, Vec3::splat(1000.0))];
    let scene = scene(triangles, materials, camera(Vec3::new(0.0, 0.15, 1.5), Vec3::new(0.0, -0.15, -1.5)));
    let picture = |samples: u32| {
        let settings = settings().with(|s| {
            s.picture.width = 8;
            s.picture.height = 8;
            s.integrator.samples = samples;
        });
        radiances(&render_or_panic(&scene, &settings).film)
    };
    let [few, many] = [picture(32), picture(512)];
    assert!(many.as_flattened().iter().all(|&radiance| radiance >= 0.0));
    assert!((mean(&many) / mean(&few) - 1.0).abs() < 0.05, "{} and {}", mean(&many), mean(&few));
}

#[test]
fn direct_light_by_shadow_rays_by_gather_rays_and_by_both_is_equal() {
    // Only the floor reflects light: all light on it is direct.
    let materials =
        vec![lambertian("black", 0.0), lambertian("floor", 0.6), emitting("lamp", 0.0, Vec3::ONE)];
    let scene = scene(room([0, 0, 1, 2, 0, 0]), materials, camera(Vec3::ZERO, Vec3::new(0.01, -1.0, 0.02)));
    let picture = |shadow_rays: u32, gather_rays: u32| {
        let settings = settings().with(|s| {
            s.integrator.shadow_rays = shadow_rays;
            s.integrator.gather_rays = gather_rays;
            s.integrator.samples = 16;
        });
        radiances(&render_or_panic(&scene, &settings).film)
    };
    let expected = mean(&picture(64, 0));
    for (shadow_rays, gather_rays) in [(0, 64), (8, 16), (1, 64)] {
        let found = picture(shadow_rays, gather_rays);
        assert!(found.as_flattened().iter().all(|radiance| radiance.is_finite()));
        let error = mean(&found) / expected - 1.0;
        assert!(error.abs() < 0.01, "{shadow_rays} shadow and {gather_rays} gather rays are off by {error}");
    }
    assert_eq!(mean(&picture(0, 0)), 0.0);
}

#[test]
fn the_stored_power_of_coloured_light_is_right_in_every_channel() {
    let emission = Vec3::new(1.0, 0.01, 0.003);
    let scene = scene(
        room([0, 0, 0, 1, 0, 0]),
        vec![lambertian("wall", 0.5), emitting("lamp", 0.5, emission)],
        camera(Vec3::ZERO, Vec3::NEG_Z),
    );
    let packed = PackedScene::new(&scene).unwrap();
    for photons in [50_000, 70_000] {
        let pass = trace(&packed, 0, photons, &|_| true).unwrap();
        for channel in 0..3 {
            let stored: f64 = pass.photons.iter().map(|photon| photon.power.decode()[channel] as f64).sum();
            let emitted = std::f64::consts::PI * 4.0 * emission[channel] as f64;
            let error = stored * pass.photons.power_unit() as f64 / (emitted / 0.5) - 1.0;
            assert!(error.abs() < 0.015, "{photons} photons, channel {channel}: off by {error}");
        }
    }
}

/// Cornell box, with a triangle at `distance` along each axis.
fn box_and_far_triangle(distance: f32) -> Scene {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell.gltf");
    let mut scene = gltf::load(path.as_ref()).expect("a shipped scene loads");
    let corner = Vec3::splat(distance);
    scene.triangles.push(Triangle::new([corner, corner + Vec3::X, corner + Vec3::Y], 0));
    scene
}

/// Photon positions are rounded to a grid, which a distant triangle must not make visibly coarser.
#[test]
fn a_far_triangle_does_not_change_the_picture() {
    let settings = RenderSettings {
        picture: Picture { width: 32, height: 32, ..Picture::default() },
        photons: PhotonMaps { count: 100_000, max_distance: Some(0.1), ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 16, ..Integrator::default() },
        ..RenderSettings::default()
    };
    let picture = |distance| radiances(&render_or_panic(&box_and_far_triangle(distance), &settings).film);
    let near = picture(10.0);
    let far = picture(3000.0);
    assert!((mean(&far) / mean(&near) - 1.0).abs() < 2e-3, "{} {}", mean(&far), mean(&near));
    let error = render(&box_and_far_triangle(1e6), &settings, &Unobserved).err().expect("is refused");
    assert!(error.is_input() && error.to_string().contains("too wide"), "{error}");
}

/// Without gather rays a shadow ray has the weight 1, however close its emitter is.
#[test]
fn shadow_rays_beside_a_small_lamp_do_not_darken() {
    let vertical = |x: f32, side: f32| {
        [
            Vec3::new(x, 0.0, -side),
            Vec3::new(x, 0.0, side),
            Vec3::new(x, side, side),
            Vec3::new(x, side, -side),
        ]
    };
    let floor = [[-500.0, -500.0], [-500.0, 500.0], [500.0, 500.0], [500.0, -500.0]];
    let mut triangles = quad(floor.map(|[x, z]| Vec3::new(x, 0.0, z)), 0).to_vec();
    triangles.extend(quad(vertical(0.0, 0.05), 1));
    let lamp = Material { double_sided: true, ..emitting("lamp", 0.5, Vec3::splat(100.0)) };
    let scene = scene(
        triangles,
        vec![lambertian("floor", 0.5), lamp],
        camera(Vec3::new(0.3, 0.2, 0.0), Vec3::new(-0.3, -0.2, 0.01)),
    );
    let settings = RenderSettings {
        picture: Picture { width: 64, height: 64, ..Picture::default() },
        photons: PhotonMaps { count: 1000, neighbors: 10, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 0, shadow_rays: 2, samples: 4, ..Integrator::default() },
        ..RenderSettings::default()
    };
    let radiances = radiances(&render_or_panic(&scene, &settings).film);
    assert!(radiances.as_flattened().iter().all(|&radiance| radiance >= 0.0));
}
