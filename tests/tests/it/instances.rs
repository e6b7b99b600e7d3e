//! An instance of a group of triangles looks like copies of its triangles, costs little memory, and is
//! rendered alike by all chips and orders.

use glam::{DMat4, DQuat, DVec3, Vec2, Vec3};
use photoncard_driver::film::Film;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::render::{Integrator, PhotonMaps, Picture, RenderSettings, Schedule};
use photoncard_driver::scene::{
    Encoding, Environment, Image, Instance, Layers, Material, NormalMap, Scene, SceneContents, Texture,
    Triangle, VertexAttributes,
};
use photoncard_driver::scheduler::GatherOrder;
use photoncard_firmware::memory::Lines;
use photoncard_firmware::sampler::hash;
use photoncard_firmware::scene::{
    BUNDLE_RAYS, Hit, Ray, RayKind, SceneImage, Surface, closest_hit, closest_hits, read_surface,
    transmittance, transmittances,
};
use photoncard_shared::address::Line;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout;
use photoncard_shared::message::FaultCode;
use photoncard_tests::shapes::add_textured_quad;
use photoncard_tests::{camera, glass, lambertian, mean, quad, radiances, render_or_panic, scene};

const GROUND: u32 = 0;
const LEAF: u32 = 1;

/// Pseudo-random number in [0, 1).
fn random(index: u32, dimension: u32) -> f32 {
    (hash(hash(index).wrapping_add(dimension)) >> 8) as f32 / 16_777_216.0
}

fn random_point(index: u32, dimension: u32) -> Vec3 {
    Vec3::from([0, 1, 2].map(|axis| random(index, dimension + axis))) * 2.0 - 1.0
}

/// Triangles of the size of leaves in a ball of radius 1.
fn crown(count: u32) -> Vec<Triangle> {
    let leaf = |index: u32| {
        let middle = random_point(index, 9).clamp_length_max(1.0);
        [0, 3, 6].map(|corner| middle + 0.3 * random_point(index, corner))
    };
    (0..count).map(|index| Triangle::new(leaf(index), LEAF)).collect()
}

/// Transforms that turn, stretch unequally and shift.
fn transforms(count: u32) -> impl Iterator<Item = DMat4> {
    (0..count).map(|index| {
        let vector = |dimension| random_point(1000 + index, dimension).as_dvec3();
        let turn = DQuat::from_axis_angle(vector(0).normalize(), 3.0 * vector(3).x);
        let place = vector(6) * DVec3::new(6.0, 1.0, 6.0);
        DMat4::from_scale_rotation_translation(DVec3::splat(0.8) + 0.5 * vector(9).abs(), turn, place)
    })
}

/// Ground under instances of a crown, in the light of a sky.
fn forest(material: Material) -> Scene {
    let corners = [[-9., -9.], [-9., 9.], [9., 9.], [9., -9.]].map(|[x, z]| Vec3::new(x, -2.0, z));
    let eye = camera(Vec3::new(0.0, 2.0, 12.0), Vec3::new(0.0, -0.2, -1.0));
    scene(quad(corners, GROUND).to_vec(), vec![lambertian("ground", 0.5), material], eye).with(|scene| {
        scene.groups = vec![crown(200)];
        scene.instances = transforms(12).filter_map(|transform| Instance::new(0, &transform)).collect();
        assert_eq!(scene.instances.len(), 12);
        scene.environment =
            Some(Environment { width: 1, height: 1, texels: vec![[1.0, 1.2, 1.5]], strength: 1.0 });
    })
}

fn matte() -> Material {
    let mut material = lambertian("leaf", 0.6);
    material.double_sided = true;
    material
}

fn rays(count: u32) -> Vec<Ray> {
    let ray = |index: u32| {
        let from = random_point(index, 20) * Vec3::new(12.0, 6.0, 12.0);
        let towards = (random_point(index, 23) * Vec3::new(6.0, 2.0, 6.0) - from).normalize();
        Ray {
            max_distance: if index.is_multiple_of(3) { 7.0 } else { f32::INFINITY },
            ..Ray::new(RayKind::Radiance, from, towards)
        }
    };
    (0..count).map(ray).collect()
}

#[test]
fn rays_hit_instances_exactly_as_copies_of_their_triangles() {
    let scene = forest(matte());
    let [instances, copies] =
        [&scene, &scene.expanded(&[true])].map(|scene| PackedScene::new(scene).expect("packs"));
    let [(image, mut memory), (of_copies, mut memory_of_copies)] = [instances.view(), copies.view()];
    let rays = rays(20_000);
    let met = |hit: Option<Hit>| hit.map(|hit| (hit.intersection, hit.triangle));
    let mut on_instances = 0;
    for ray in &rays {
        let hit = closest_hit(&image, &mut memory, ray).expect("sound");
        let of_copy = closest_hit(&of_copies, &mut memory_of_copies, ray).expect("sound");
        assert_eq!(met(hit), met(of_copy), "{ray:?}");
        on_instances += u32::from(hit.is_some_and(|hit| hit.triangle.material == LEAF));
        let passed = transmittance(&image, &mut memory, ray).expect("sound");
        assert_eq!(passed, transmittance(&of_copies, &mut memory_of_copies, ray).expect("sound"));
    }
    assert!(on_instances > 5000, "{on_instances}");
    for bundle in rays.chunks(BUNDLE_RAYS) {
        let mut hits = [None; BUNDLE_RAYS];
        closest_hits(&image, &mut memory, bundle, &mut hits).expect("sound");
        let passed = transmittances(&image, &mut memory, bundle).expect("sound");
        for ((ray, hit), passed) in bundle.iter().zip(hits).zip(passed) {
            assert_eq!(hit, closest_hit(&image, &mut memory, ray).expect("sound"));
            assert_eq!(passed.0, transmittance(&image, &mut memory, ray).expect("sound"));
        }
    }
}

/// Forest whose leaves are squares with a round cut-out and a normal map, and tangents along u.
fn textured_forest() -> Scene {
    let mut layers = Layers::none(Vec3::ZERO);
    layers.normal = Some(NormalMap { texture: 1, scale: 1.0 });
    let texture = Some(0);
    let leaf = Material {
        base_texture: texture,
        alpha_cutoff: Some(0.5),
        layers: Some(Box::new(layers)),
        ..matte()
    };
    let mut square = Scene::default();
    for index in 0..40 {
        let middle = random_point(index, 9).clamp_length_max(1.0);
        let along = 0.3 * random_point(index, 0).normalize();
        let up = 0.3 * along.any_orthonormal_vector().normalize();
        let corners = [-along - up, along - up, along + up, up - along].map(|corner| middle + corner);
        add_textured_quad(&mut square, corners, [[0., 1.], [1., 1.], [1., 0.], [0., 0.]], LEAF);
        for attributes in square.attributes.len() - 2..square.attributes.len() {
            square.attributes[attributes].tangents = square.tangents.len() as u32;
            square.tangents.push([along.normalize().extend(1.0); 3]);
        }
    }
    forest(leaf).with(|scene| {
        let SceneContents { triangles, attributes, tangents, .. } = (*square).clone();
        (scene.groups, scene.attributes, scene.tangents) = (vec![triangles], attributes, tangents);
        let alpha = |index: u32| {
            let place = Vec2::new((index % 8) as f32, (index / 8) as f32) - 3.5;
            if place.length() < 3.0 { 0 } else { 255 }
        };
        let texels = (0..64).map(|index| [3 * index as u8, 200, 90, alpha(index)]).collect();
        let image = |name: &str, encoding, (width, height), texels| {
            let name = name.into();
            Image { name, width, height, texels, encoding }
        };
        scene.images = vec![
            image("leaf", Encoding::Srgb, (8, 8), texels),
            image("bumps", Encoding::Linear, (1, 1), vec![[171, 100, 240, 255]]),
        ];
        scene.textures = vec![Texture::new(0), Texture::new(1)];
    })
}

#[test]
fn textures_cut_outs_and_normal_maps_of_instances_are_those_of_copies() {
    let scene = textured_forest();
    let [instances, copies] =
        [&scene, &scene.expanded(&[true])].map(|scene| PackedScene::new(scene).expect("packs"));
    let surface = |(image, mut memory): (SceneImage, Lines), ray: &Ray| {
        let hit = closest_hit(&image, &mut memory, ray).expect("sound")?;
        let mut surface = Surface::NOWHERE;
        read_surface(&image, &mut memory, ray, &hit, &|_| 0.5, &mut surface).expect("sound");
        Some((surface, hit.id.instance))
    };
    let (mut on_instances, mut bent) = (0, 0);
    for ray in &rays(10_000) {
        let [instance, copy] = [&instances, &copies].map(|packed| surface(packed.view(), ray));
        assert_eq!(instance.is_some(), copy.is_some(), "{ray:?}");
        let (Some((one, instance)), Some((other, _))) = (instance, copy) else { continue };
        assert_eq!((one.position, one.geometric_normal), (other.position, other.geometric_normal));
        assert_eq!(one.reflection, other.reflection);
        assert!(one.normal.distance(other.normal) < 1e-4, "{} {}", one.normal, other.normal);
        on_instances += u32::from(instance != layout::NO_INSTANCE);
        bent += u32::from(one.normal.dot(one.geometric_normal) < 0.95);
    }
    assert!(on_instances > 1000 && bent > 1000, "{on_instances} {bent}");
}

#[test]
fn instances_of_any_size_are_hit_as_copies_from_near_and_far() {
    for (scale, distance) in [(1e-3, 1.0), (1e-3, 1e4), (1.0, 1e5), (1e3, 1.0), (1e3, 1e6)] {
        let scene = forest(matte()).with(|scene| {
            let place = |transform: DMat4| DMat4::from_scale(DVec3::splat(scale)) * transform;
            scene.instances =
                transforms(12).filter_map(|transform| Instance::new(0, &place(transform))).collect();
        });
        let [instances, copies] =
            [&scene, &scene.expanded(&[true])].map(|scene| PackedScene::new(scene).expect("packs"));
        let [(image, mut memory), (of_copies, mut memory_of_copies)] = [instances.view(), copies.view()];
        let mut met = 0;
        for ray in (0..4000).map(|index| {
            let target = random_point(index, 23) * Vec3::new(6.0, 2.0, 6.0) * scale as f32;
            let towards = random_point(index, 26).normalize();
            Ray::new(RayKind::Radiance, target - towards * (distance * scale) as f32, towards)
        }) {
            let hit = closest_hit(&image, &mut memory, &ray).expect("sound");
            let of_copy = closest_hit(&of_copies, &mut memory_of_copies, &ray).expect("sound");
            // Far away many hits have equal distances. The order of the triangles, which breaks ties, is not
            // that of the copies.
            let distance_of = |hit: Option<Hit>| hit.map(|hit| hit.intersection.distance);
            assert_eq!(distance_of(hit), distance_of(of_copy), "{scale} {distance} {ray:?}");
            met += u32::from(hit.is_some_and(|hit| hit.triangle.material == LEAF));
        }
        assert!(met > 500, "{scale} {distance}: {met}");
    }
}

fn settings(order: GatherOrder, card: &str) -> RenderSettings {
    let mut settings = RenderSettings {
        picture: Picture { width: 48, height: 32, ..Picture::default() },
        photons: PhotonMaps { count: 20_000, neighbors: 30, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 8, samples: 4, ..Integrator::default() },
        schedule: Schedule { order, ..Schedule::default() },
        ..RenderSettings::default()
    };
    settings.cards.addresses = vec![card.parse().expect("an address")];
    settings
}

fn pictured(scene: &Scene, order: GatherOrder, card: &str) -> Film {
    render_or_panic(scene, &settings(order, card)).film
}

/// Mean radiance of blocks of 8x8 pixels.
fn blocks(film: &Film) -> Vec<f64> {
    let pixels = radiances(film);
    let block = |index: usize| {
        let first = 8 * (index % 6) + 8 * 48 * (index / 6);
        let rows = (0..8).flat_map(|row| pixels[first + 48 * row..][..8].to_vec());
        mean(&rows.collect::<Vec<_>>())
    };
    (0..24).map(block).collect()
}

#[test]
fn instances_are_lit_as_copies_of_their_triangles() {
    let bent = forest(matte()).with(|scene| {
        let SceneContents { groups, attributes, .. } = scene;
        for (index, triangle) in (0..).zip(&mut groups[0]) {
            triangle.attributes = index;
            let normal = triangle.scaled_normal().normalize();
            let normals = Some(
                [0.0, 0.2, -0.2].map(|bend| (normal + bend * normal.any_orthonormal_vector()).normalize()),
            );
            attributes.push(VertexAttributes {
                normals,
                coordinates: [[Vec2::ZERO; 3]; 2],
                ..VertexAttributes::NONE
            });
        }
    });
    for scene in [forest(matte()), bent] {
        let [instances, copies] = [&scene, &scene.expanded(&[true])]
            .map(|scene| blocks(&pictured(scene, GatherOrder::Sort, "emulated:1")));
        let ratio = instances.iter().sum::<f64>() / copies.iter().sum::<f64>();
        assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
        for (instance, copy) in instances.iter().zip(&copies) {
            assert!((instance / copy - 1.0).abs() < 0.08, "{instance} {copy}");
        }
    }
}

#[test]
fn instances_have_the_same_pixels_on_all_chips_and_in_all_orders() {
    let scene = forest(matte());
    let first = pictured(&scene, GatherOrder::Naive, "emulated:1");
    let others = [
        (GatherOrder::Sort, "emulated:3"),
        (GatherOrder::DirectionBins, "emulated-micro:1"),
        (GatherOrder::Hash, "emulated-large:2"),
    ];
    for (order, card) in others {
        assert!(first.sums().eq(pictured(&scene, order, card).sums()), "{order:?} {card}");
    }
}

#[test]
fn instances_of_a_material_that_emits_or_focuses_are_expanded() {
    let mut lamp = matte();
    lamp.emission = Vec3::splat(3.0);
    for (material, expands) in [(matte(), false), (lamp, true), (glass("glass", Vec3::ONE, true), true)] {
        let scene = forest(material);
        let packed = PackedScene::new(&scene).expect("packs");
        let (image, mut memory) = packed.view();
        let has_instance = rays(2000).iter().any(|ray| {
            let hit = closest_hit(&image, &mut memory, ray).expect("sound");
            hit.is_some_and(|hit| hit.id.instance != layout::NO_INSTANCE)
        });
        assert_eq!(has_instance, !expands);
    }
}

/// Replaces the instances of a card image, and returns the fault of the rays that meet one.
fn fault_with(change: impl Fn(&mut layout::Instance)) -> Option<FaultCode> {
    let packed = PackedScene::new(&forest(matte())).expect("packs");
    let (image, Lines(lines)) = packed.view();
    let mut lines: Vec<Line> = lines.to_vec();
    let section = image.header.section(SectionKind::Triangles);
    for line in &mut lines[section.first_line as usize..][..section.records as usize] {
        if let Some(mut instance) = layout::Instance::read(&line.0) {
            change(&mut instance);
            line.0 = instance.to_bytes();
        }
    }
    let mut memory = Lines(&lines);
    let mut found = None;
    for bundle in rays(512).chunks(BUNDLE_RAYS) {
        let mut hits = [None; BUNDLE_RAYS];
        let faults = [
            bundle.iter().find_map(|ray| closest_hit(&image, &mut memory, ray).err()),
            closest_hits(&image, &mut memory, bundle, &mut hits).err(),
            transmittances(&image, &mut memory, bundle).err(),
        ];
        found = found.or(faults.into_iter().flatten().next());
    }
    found.map(|fault| fault.code)
}

#[test]
fn deep_trees_of_a_scene_and_of_a_group_fit_the_stack_together() {
    // Triangles on a spiral, each a fifth smaller than the last, have deep trees.
    let spiral = |count: i32, material| {
        let triangle = |index: i32| {
            let size = 0.8_f32.powi(index % 120);
            let place = Vec3::new(size, size * (index as f32).cos(), (index / 120) as f32 * 1e-3);
            let corners = [Vec3::ZERO, Vec3::X, Vec3::Y].map(|corner| place + corner * (0.1 * size));
            Triangle::new(corners, material)
        };
        (0..count).map(triangle).collect::<Vec<_>>()
    };
    let scene = forest(matte()).with(|scene| {
        scene.triangles.extend(spiral(60_000, GROUND));
        scene.groups = vec![spiral(40_000, LEAF)];
    });
    PackedScene::new(&scene).expect("packs");
}

#[test]
fn an_unsound_instance_is_a_fault() {
    assert_eq!(fault_with(|_| {}), None);
    // The root of the scene, whose leaves are instances: the group would contain itself.
    assert_eq!(fault_with(|instance| instance.root = 0), Some(FaultCode::Record));
    assert_eq!(fault_with(|instance| instance.root = u32::MAX), Some(FaultCode::Record));
    // A transform of numbers that are none meets nothing, or anything.
    fault_with(|instance| instance.to_group = [[f32::NAN; 4]; 3]);
    fault_with(|instance| instance.to_world = [[f32::INFINITY; 4]; 3]);
}
