//! Caustics of few photons: dense light next to sparse light.

use glam::Vec3;
use photoncard_driver::pack::{CardImage, PackedScene};
use photoncard_driver::photon_map::{MappedImage, PhotonLayout, PhotonSettings, map_photons};
use photoncard_driver::render::{
    CardAddress, CardSet, Integrator, PhotonMaps, Picture, Radiance, RenderSettings,
};
use photoncard_driver::scene::{
    LightAxes, Material, Projection, PunctualKind, PunctualLight, Reflection, Scene, Transmission,
};
use photoncard_firmware::light_groups::LightGroups;
use photoncard_firmware::memory::Counted;
use photoncard_firmware::photon::{CausticSearch, Caustics, LitBy, MIN_NORMAL_COSINE, reflected_caustics};
use photoncard_firmware::scene::{PartialReflection, Surface};
use photoncard_shared::address::Structure;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{Photon, PhotonLeaf, PhotonNode, decode_normal, kernel_share};
use photoncard_tests::shapes::{add_ball, cuboid};
use photoncard_tests::{camera, lambertian, mean, radiances, render_or_panic, room, scene};

fn smooth(name: &str, metallic: f32, transmission: Option<Transmission>) -> Material {
    let reflection = Reflection::MetallicRoughness {
        base_colour: Vec3::ONE,
        metallic,
        roughness: 0.0,
        dielectric: Vec3::splat(0.04),
        grazing: 1.0,
        transmission,
    };
    Material::new(name, reflection)
}

/// Room with a light above two balls: a glass ball that focuses the light on the floor, and a metal ball that
/// scatters it over walls and ceiling. The camera sees a part of the ceiling.
fn two_balls() -> Scene {
    let glass = Transmission { factor: 1.0, ior: 1.5, is_volume: true, absorption: Vec3::ZERO };
    let materials =
        vec![lambertian("wall", 0.5), smooth("glass", 0.0, Some(glass)), smooth("metal", 1.0, None)];
    let mut view = camera(Vec3::new(0.1, -0.7, 0.1), Vec3::new(0.3, 1.0, 0.2));
    view.projection = Projection::perspective(0.6);
    let mut scene = scene(room([0; 6]), materials, view);
    add_ball(&mut scene, Vec3::new(-0.5, -0.6, 0.0), 0.3, 24, 1);
    add_ball(&mut scene, Vec3::new(0.55, -0.75, 0.1), 0.15, 24, 2);
    let kind = PunctualKind::Point { position: Vec3::new(0.0, 0.6, 0.0) };
    scene.lights.push(PunctualLight {
        name: "light".into(),
        kind,
        intensity: Vec3::ONE,
        axes: LightAxes::default(),
    });
    scene
}

/// Radiance of each pixel, by caustics alone.
fn caustics(scene: &Scene, photons: usize, seed: u32) -> Vec<[f32; 3]> {
    let settings = RenderSettings {
        picture: Picture { width: 24, height: 24, ..Picture::default() },
        photons: PhotonMaps { count: 1000, caustic_photons: Some(photons), ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 0, shadow_rays: 0, samples: 4, seed, ..Integrator::default() },
        cards: CardSet {
            addresses: vec!["emulated:2".parse::<CardAddress>().unwrap()],
            ..CardSet::default()
        },
        ..RenderSettings::default()
    };
    radiances(&render_or_panic(scene, &settings).film)
}

#[test]
fn sparse_light_beside_a_focus_is_smooth_with_the_mean_of_many_photons() {
    let scene = two_balls();
    let [first, second] = [1, 2].map(|seed| caustics(&scene, 20_000, seed));
    let expected = mean(&caustics(&scene, 250_000, 3));
    assert!(expected > 0.0);
    let found = 0.5 * (mean(&first) + mean(&second));
    assert!((found / expected - 1.0).abs() < 0.06, "{found} instead of {expected}");
    let squares =
        first.as_flattened().iter().zip(second.as_flattened()).map(|(a, b)| f64::from(a - b).powi(2));
    let deviation = (0.5 * squares.sum::<f64>() / (3 * first.len()) as f64).sqrt() / expected;
    assert!(deviation < 0.25, "a deviation of {deviation}");
}

/// Room with a light above a mirror at the foot of a wall. If `has_board`, a board stands before wall and
/// mirror. The camera sees the board or, without it, the wall.
fn mirror_behind_a_board(has_board: bool) -> Scene {
    let materials = vec![lambertian("wall", 0.5), smooth("metal", 1.0, None)];
    let mut triangles = room([0; 6]);
    triangles.extend(cuboid(Vec3::new(-0.93, -0.95, 0.0), Vec3::new(0.05, 0.02, 0.9), 1));
    if has_board {
        triangles.extend(cuboid(Vec3::new(-0.85, 0.0, 0.0), Vec3::new(0.02, 0.9, 0.95), 0));
    }
    let mut view = camera(Vec3::new(0.5, 0.0, 0.0), Vec3::NEG_X);
    view.projection = Projection::perspective(0.6);
    let mut scene = scene(triangles, materials, view);
    let kind = PunctualKind::Point { position: Vec3::new(-0.93, 0.96, 0.2) };
    scene.lights.push(PunctualLight {
        name: "lamp".into(),
        kind,
        intensity: Vec3::ONE,
        axes: LightAxes::default(),
    });
    scene
}

#[test]
fn a_board_is_not_lit_by_a_caustic_on_the_wall_behind_it() {
    let [on_board, on_wall] =
        [true, false].map(|has_board| mean(&caustics(&mirror_behind_a_board(has_board), 2_000, 1)));
    assert!(on_wall > 0.0);
    assert!(on_board < 0.01 * on_wall, "{on_board} beside {on_wall}");
}

/// The caustic map of [`two_balls`], and the maximum radius of its discs, metres.
fn caustic_map() -> (CardImage, f32) {
    let settings = PhotonSettings {
        camera: None,
        caustic_photons: 20_000,
        caustic_neighbors: 50,
        seed: 1,
        photons: 1000,
        neighbors: 50,
        max_distance: None,
        layout: PhotonLayout::Lines,
        radiance: Radiance::Density,
    };
    let packed = PackedScene::new(&two_balls()).expect("packs");
    let MappedImage { image, gathers, .. } = map_photons(packed, &settings, &|_| true).expect("maps");
    (image, gathers.caustics.expect("there are caustics").max_distance)
}

/// Caustics on a white surface at `position`, and the number of lines that the search has read.
fn searched(image: &CardImage, max_radius: f32, position: Vec3, normal: Vec3) -> (Caustics, u64) {
    let (scene, memory) = image.view();
    let mut memory = Counted::new(memory);
    let surface = Surface::white(position, normal, 1.0);
    let (reflection, lobe) = PartialReflection::encode_present(&surface.reflector(), Vec3::ONE, 1 << 31);
    let caustics = reflected_caustics(CausticSearch {
        scene: &scene,
        memory: &mut memory,
        position,
        max_radius,
        reflection: &reflection,
        lobe,
        lit_by: LitBy::All,
        normals: [normal; 2],
        groups: LightGroups::ONE,
    });
    let of_map = [Structure::CausticNodes, Structure::CausticPhotons];
    let reads = memory.traffic().sum(|_, structure| of_map.contains(&structure));
    (caustics.expect("the image is valid"), reads.requests)
}

/// Number of photons with `normal` whose discs contain `position`, found in all leaves.
fn within_discs(image: &CardImage, max_radius: f32, position: Vec3, normal: Vec3) -> u32 {
    let grid = image.view().0.header.photon_grid;
    let mut count = 0;
    for line in image.section(SectionKind::CausticLeaves) {
        let leaf = PhotonLeaf::read(&line.0);
        for index in 0..leaf.photons() {
            let [.., low, high] = leaf.content(index);
            let flags = u16::from_le_bytes([low, high]);
            let way = position - Vec3::from_array(grid.position(leaf.point(index)));
            let share = kernel_share(Photon::disc_of_flags(flags));
            let of_photon = Vec3::from_array(decode_normal(Photon::normal_of_flags(flags))).normalize();
            let is_of_wall = of_photon.dot(normal) >= MIN_NORMAL_COSINE && way.dot(normal).abs() < 1e-3;
            count += u32::from(is_of_wall && way.length_squared() < max_radius * max_radius * share);
        }
    }
    count
}

#[test]
fn a_search_finds_all_caustics_of_a_wall_and_skips_those_of_others() {
    let (image, max_radius) = caustic_map();
    let mut of_any_normal = image.lines().to_vec();
    let nodes = image.view().0.header.section(SectionKind::CausticNodes);
    for line in &mut of_any_normal[nodes.first_line as usize..][..nodes.records as usize] {
        PhotonNode::set_classes(&mut line.0, []);
    }
    let of_any_normal = CardImage::of_lines(of_any_normal).expect("a valid image");
    let mut sums = [0; 3];
    for (axis, side) in [0, 1, 2].into_iter().flat_map(|axis| [(axis, -1.0), (axis, 1.0)]) {
        for place in 0..100_u8 {
            let [u, v] = [place % 10, place / 10].map(|step| f32::from(step) * 0.2 - 0.9);
            let mut position = [u, v, v];
            position[axis] = side;
            position[(axis + 1) % 3] = u;
            let normal = Vec3::AXES[axis] * -side;
            let [(found, reads), (all, more_reads)] =
                [&image, &of_any_normal].map(|image| searched(image, max_radius, position.into(), normal));
            let of_any = (all.photons, all.radiance);
            assert_eq!((found.photons, found.radiance), of_any, "{position:?}");
            assert_eq!(
                found.photons,
                within_discs(&image, max_radius, position.into(), normal),
                "{position:?}"
            );
            sums[0] += u64::from(found.photons);
            sums[1] += reads;
            sums[2] += more_reads;
        }
    }
    let [photons, reads, more_reads] = sums;
    println!("{photons} photons, {reads} lines read, {more_reads} of any normal");
    assert!(photons > 1000, "{photons}");
    assert!(reads < more_reads, "{reads} {more_reads}");
}
