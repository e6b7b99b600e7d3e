//! The ray caster equals brute force, gives equal bits on every processor and in bundles, and loses no ray at
//! an edge.

use glam::Vec3;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::scene::{Material, Scene, Triangle, gltf};
use photoncard_firmware::memory::{Counted, Lines};
use photoncard_firmware::sampler::hash;
use photoncard_firmware::scene::{
    BUNDLE_RAYS, Bundle, ClosestHit, Hit, Passed, Ray, RayFrame, RayKind, SceneImage, ShadowRay, closest_hit,
    closest_hits, transmittance, transmittances,
};
use photoncard_firmware::simd::Level;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{BvhLeaf, LEAF_TRIANGLES, TriangleId};
use photoncard_tests::{camera, glass, lambertian, scene};

fn packed(triangles: Vec<Triangle>) -> PackedScene {
    let scene = scene(triangles, vec![lambertian("wall", 0.5)], camera(Vec3::ZERO, Vec3::NEG_Z));
    PackedScene::new(&scene).expect("packs")
}

/// Pseudo-random number in [0, 1).
fn random(index: u32, dimension: u32) -> f32 {
    (hash(hash(index).wrapping_add(dimension)) >> 8) as f32 / 16_777_216.0
}

fn random_point(index: u32, dimension: u32) -> Vec3 {
    Vec3::from([0, 1, 2].map(|axis| random(index, dimension + axis))) * 2.0 - 1.0
}

/// Sphere with dents, a closed surface of about `4 rings^2` triangles.
fn dented_sphere(center: Vec3, radius: f32, rings: u32) -> Vec<Triangle> {
    let segments = 2 * rings;
    let point = |ring: u32, segment: u32| {
        let polar = core::f32::consts::PI * ring as f32 / rings as f32;
        let around = core::f32::consts::TAU * (segment % segments) as f32 / segments as f32;
        // All points of a pole, and the ends of a ring, are equal to the bit.
        let (sine, cosine) = match ring {
            0 => (0.0, 1.0),
            _ if ring == rings => (0.0, -1.0),
            _ => polar.sin_cos(),
        };
        let dent = 0.8 + 0.2 * random(ring * segments + segment % segments, 0);
        let dent = if ring == 0 || ring == rings { 1.0 } else { dent };
        center + Vec3::new(sine * around.cos(), cosine, sine * around.sin()) * (radius * dent)
    };
    let mut triangles = Vec::new();
    for (ring, segment) in (0..rings).flat_map(|ring| (0..segments).map(move |segment| (ring, segment))) {
        let [a, b] = [point(ring, segment), point(ring, segment + 1)];
        let [c, d] = [point(ring + 1, segment + 1), point(ring + 1, segment)];
        if ring > 0 {
            triangles.push(Triangle::new([a, b, c], 0));
        }
        if ring + 1 < rings {
            triangles.push(Triangle::new([a, c, d], 0));
        }
    }
    triangles
}

/// Axis-aligned squares that cross each other.
fn boards() -> Vec<Triangle> {
    (0..40)
        .flat_map(|i| {
            let [u, v] = [Vec3::AXES[i % 3], Vec3::AXES[(i + 1) % 3]];
            let corner = (random_point(i as u32, 50) * 4.0).round() * 0.25;
            photoncard_tests::quad([corner, corner + u, corner + u + v, corner + v], 0)
        })
        .collect()
}

/// Random rays, rays along axes or in planes of triangles, rays to vertices and edges, and rays from far
/// away.
fn rays(triangles: &[Triangle], count: u32) -> Vec<Ray> {
    let unit = |v: Vec3| v.normalize_or(Vec3::X);
    (0..count)
        .map(|i| {
            let [a, b, c] = triangles[hash(i) as usize % triangles.len()].vertices;
            let size = a.distance(b) + b.distance(c);
            let origin = a + random_point(i, 10) * size * 4.0;
            let (origin, target) = match i % 8 {
                0 => (origin, origin + random_point(i, 20)),
                1 => (origin, origin + Vec3::AXES[i as usize / 8 % 3] * (random(i, 1) - 0.5)),
                2 => (origin, a),
                3 => (origin, a.lerp(b, random(i, 2))),
                4 => (c + (c - a) * 3.0, a.lerp(b, random(i, 2))),
                5 => (a + random_point(i, 10) * size * 1000.0, a.lerp(b, random(i, 2)).lerp(c, random(i, 3))),
                6 => (a, b),
                _ => (Vec3::new(a.x, origin.y, origin.z), a),
            };
            let max_distance = if i % 5 == 0 { size * random(i, 4) * 10.0 } else { f32::INFINITY };
            Ray { max_distance, ..Ray::new(RayKind::Radiance, origin, unit(target - origin)) }
        })
        .collect()
}

/// Closest hit by testing all triangles; of equal distances, that of the least index.
fn brute_force(image: &SceneImage, memory: &mut Lines, ray: &Ray) -> Option<Hit> {
    let frame = RayFrame::new(ray);
    let mut nearest: Option<Hit> = None;
    for leaf in 0..image.header.section(SectionKind::Triangles).records {
        let line = image.line(memory, SectionKind::Triangles, leaf, 0..LINE_BYTES as u32).expect("sound");
        for slot in 0..BvhLeaf(line).triangles() as usize {
            let triangle = BvhLeaf(line).triangle(slot);
            let until = nearest.map_or(ray.max_distance, |hit| hit.intersection.distance);
            if let Some(intersection) = frame.intersect(&triangle.vertices, until)
                && nearest.is_none_or(|hit| intersection.distance < hit.intersection.distance)
            {
                nearest = Some(Hit {
                    intersection,
                    triangle,
                    id: TriangleId::lone(leaf * LEAF_TRIANGLES as u32 + slot as u32),
                });
            }
        }
    }
    nearest
}

#[test]
fn hits_on_every_processor_equal_those_of_brute_force() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell-glossy.gltf");
    let cornell = gltf::load(path.as_ref()).expect("a shipped scene loads").triangles.clone();
    let cornell = cornell.into_iter().map(|triangle| Triangle { material: 0, ..triangle }).collect();
    let far = Vec3::new(1000.0, -3000.0, 0.1);
    let scenes = [
        cornell,
        boards(),
        dented_sphere(Vec3::ZERO, 1.0, 12),
        dented_sphere(far, 1.0, 12),
        dented_sphere(Vec3::ZERO, 1e-6, 9),
        dented_sphere(Vec3::ZERO, 1e6, 9),
        dented_sphere(Vec3::ZERO, 1.0, 2),
    ];
    for (number, triangles) in scenes.into_iter().enumerate() {
        let rays = rays(&triangles, 4000);
        let packed = packed(triangles);
        let (image, mut memory) = packed.view();
        let mut hits = 0;
        for ray in &rays {
            let expected = brute_force(&image, &mut memory, ray);
            hits += u32::from(expected.is_some());
            assert_eq!(closest_hit(&image, &mut memory, ray).unwrap(), expected, "{ray:?} in scene {number}");
            for level in Level::ALL {
                let closest = level.run(ClosestHit { scene: &image, memory: &mut memory, ray });
                assert!(
                    closest.is_none_or(|hit| hit == Ok(expected)),
                    "{level:?}: {ray:?} in scene {number}"
                );
                let passed = level.run(ShadowRay { scene: &image, memory: &mut memory, ray });
                let share = if expected.is_some() { Vec3::ZERO } else { Vec3::ONE };
                assert!(passed.is_none_or(|passed| passed == Ok(share)), "{level:?}: {ray:?}");
            }
        }
        assert!(hits > 1000 && hits < 3900, "{hits} of scene {number}");
    }
}

#[test]
fn no_ray_leaves_a_closed_surface() {
    for (center, radius) in [(Vec3::ZERO, 1.0), (Vec3::new(70.0, -900.0, 3.3), 1.0), (Vec3::ONE, 1e5)] {
        let triangles = dented_sphere(center, radius, 24);
        let packed = packed(triangles.clone());
        let (image, mut memory) = packed.view();
        for (i, triangle) in (0..).zip(triangles.iter().cycle().take(60_000)) {
            let [a, b, _] = triangle.vertices;
            let origin = center + random_point(i, 10) * (0.3 * radius);
            // Targets are vertices, edges, and points near edges.
            let target = match i % 4 {
                0 => a,
                1 => a.midpoint(b),
                2 => a.lerp(b, random(i, 1)),
                _ => a.lerp(b, random(i, 1)) + random_point(i, 20) * (1e-6 * radius),
            };
            let ray = Ray::new(RayKind::Radiance, origin, (target - origin).normalize());
            assert!(closest_hit(&image, &mut memory, &ray).unwrap().is_some(), "{ray:?} leaves");
            assert_eq!(transmittance(&image, &mut memory, &ray).unwrap(), Vec3::ZERO, "{ray:?} leaves");
        }
    }
}

/// Rays as a chip casts them together: of neighbouring pixels, or from one point to a light or in all
/// directions; and random rays.
fn bundle(scene: &Scene, triangles: &[Triangle], index: u32) -> Vec<Ray> {
    let count = 1 + index % BUNDLE_RAYS as u32;
    let of = |ray: u32| index * BUNDLE_RAYS as u32 + ray;
    let camera = scene.camera(None).expect("a scene has a camera");
    let [from, to] = [1, 2].map(|salt| {
        let [a, b, c] = triangles[hash(index + salt) as usize % triangles.len()].vertices;
        a.lerp(b, random(index, salt)).lerp(c, 0.3)
    });
    let across = |ray: u32| random_point(of(ray), 40);
    match index % 4 {
        0 => (0..count)
            .map(|ray| {
                let place =
                    [random(index, 5), random(index, 6) + 0.002 * ray as f32].map(|at| 2.0 * at - 1.0);
                let direction = camera.forward + camera.right * place[0] + camera.up * place[1];
                Ray::new(RayKind::Radiance, camera.origin, direction.normalize())
            })
            .collect(),
        1 => (0..count)
            .map(|ray| {
                let way = to + across(ray) * 0.2 - from;
                Ray {
                    max_distance: way.length() * 0.999,
                    ..Ray::new(RayKind::Radiance, from, way.normalize_or(Vec3::Y))
                }
            })
            .collect(),
        2 => (0..count)
            .map(|ray| Ray::new(RayKind::Radiance, from, across(ray).normalize_or(Vec3::X)))
            .collect(),
        _ => rays(triangles, of(count)).split_off(of(0) as usize),
    }
}

#[test]
fn rays_of_a_bundle_hit_as_single_rays_do_in_every_shipped_scene() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes");
    let paths =
        std::fs::read_dir(folder).expect("there are scenes").map(|entry| entry.expect("a file").path());
    let is_scene = |path: &std::path::PathBuf| {
        path.extension().is_some_and(|extension| extension == "gltf" || extension == "glb")
    };
    let mut scenes: Vec<Scene> =
        paths.filter(is_scene).map(|path| gltf::load(&path).expect("a shipped scene loads")).collect();
    assert!(scenes.len() > 8, "{}", scenes.len());
    let sheet = Material { blends: true, alpha: 0.5, double_sided: true, ..lambertian("sheet", 0.5) };
    let eye = || camera(Vec3::splat(3.0), Vec3::NEG_ONE.normalize());
    scenes.push(scene(boards(), vec![sheet], eye()));
    scenes.push(scene(boards(), vec![glass("panes", Vec3::new(0.9, 0.5, 0.1), false)], eye()));
    let mut partly = 0;
    for (number, scene) in scenes.iter().enumerate() {
        let packed = PackedScene::new(scene).expect("packs");
        let (image, mut memory) = packed.view();
        let mut hits = 0;
        for index in 0..200 {
            let rays = bundle(scene, &scene.triangles, index);
            let alone: Vec<_> =
                rays.iter().map(|ray| closest_hit(&image, &mut memory, ray).expect("sound")).collect();
            hits += alone.iter().flatten().count();
            let mut together = [None; BUNDLE_RAYS];
            closest_hits(&image, &mut memory, &rays, &mut together).expect("sound");
            let passed = transmittances(&image, &mut memory, &rays).expect("sound");
            assert_eq!(together[..rays.len()], alone, "bundle {index} of scene {number}");
            for ((ray, hit), Passed(share)) in rays.iter().zip(&alone).zip(passed) {
                assert_eq!(
                    share,
                    transmittance(&image, &mut memory, ray).expect("sound"),
                    "{index} of {number}"
                );
                let meets_glass = hit.is_some_and(|hit| hit.triangle.flat_glass);
                partly += u32::from(share != Vec3::ZERO && share != Vec3::ONE);
                assert!(meets_glass || (share == Vec3::ONE) == hit.is_none(), "{index} of {number}");
            }
            for level in Level::ALL {
                let (mut closest, mut any) = ([None; BUNDLE_RAYS], [Passed::ALL; BUNDLE_RAYS]);
                let (scene, memory, rays) = (&image, &mut memory, &rays[..]);
                let found = level.run(Bundle { scene, memory, rays, searches: &mut closest });
                assert!(found.is_none_or(|found| found.is_ok() && closest == together), "{level:?}");
                let found = level.run(Bundle { scene, memory, rays, searches: &mut any });
                assert!(found.is_none_or(|found| found.is_ok() && any == passed), "{level:?}");
            }
        }
        assert!(hits > 200, "{hits} of scene {number}");
    }
    assert!(partly > 100, "{partly} rays through glass alone");
}

#[test]
fn shadow_rays_in_bundles_make_the_requests_of_single_ones() {
    let scene = gltf::load(concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell-glossy.gltf").as_ref())
        .expect("a shipped scene loads");
    let packed = PackedScene::new(&scene).expect("packs");
    let (image, memory) = packed.view();
    let requests = |cast: &dyn Fn(&mut Counted<Lines>)| {
        let mut counted = Counted::new(memory);
        cast(&mut counted);
        counted.traffic().sum(|_, _| true).requests
    };
    for index in 0..100 {
        let rays = bundle(&scene, &scene.triangles, index);
        let alone = requests(&|memory| {
            for ray in &rays {
                transmittance(&image, memory, ray).expect("sound");
            }
        });
        let together = requests(&|memory| {
            transmittances(&image, memory, &rays).expect("sound");
        });
        assert_eq!(together, alone, "{index}");
    }
}
