//! Precomputed irradiance: it equals the chip's density estimate at a photon, searches find the same points
//! as brute force, and its mean over positions is unbiased.

use core::f32::consts::PI;

use glam::Vec3;
use photoncard_driver::pack::{CardImage, PackedScene};
use photoncard_driver::photon::Photons;
use photoncard_driver::photon_map::{precompute_irradiance, store_photons, to_kd_tree};
use photoncard_firmware::photon::{
    Candidate, CandidateBuffer, FoundIrradiance, MIN_NORMAL_COSINE, NearestPhotons, PhotonMap, PointSearch,
    gather,
};
use photoncard_firmware::sampler::hash;
use photoncard_firmware::simd::Level;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{
    FULL_DISC, IrradiancePoint, PHOTON_CONTENT_BYTES, Photon, PhotonLeaf, Rgbe, decode_normal, encode_normal,
};
use photoncard_tests::{camera, lambertian, room, scene};
use proptest::prelude::*;

/// Position of a photon, and the code of its normal.
type Placed = ([f32; 3], u8);

/// Card images of a room with photons of power (1, 0.5, 0.25) and irradiance points, in both layouts.
fn images(photons: &[Placed], neighbors: u32, max_distance: f32) -> [CardImage; 2] {
    let scene = scene(room([0; 6]), vec![lambertian("wall", 0.5)], camera(Vec3::ZERO, Vec3::NEG_Z));
    let photons = photons.iter().map(|&(position, normal)| Photon {
        position,
        power: Rgbe::encode([1.0, 0.5, 0.25], 0),
        direction: [0; 2],
        axis_or_group: 0,
        normal,
        disc: FULL_DISC,
        direct: false,
    });
    let packed = || PackedScene::new(&scene).unwrap();
    let photons = Photons::new(packed().photon_grid(), 1.0, photons);
    let image = || store_photons(packed(), photons.clone(), neighbors).unwrap();
    [to_kd_tree(image()).unwrap(), image()]
        .map(|image| precompute_irradiance(image, neighbors, max_distance, &|| true).unwrap())
}

/// Positions and contents of all irradiance points.
fn points(image: &CardImage) -> Vec<(Vec3, [u8; PHOTON_CONTENT_BYTES])> {
    let (scene, mut memory) = image.view();
    let kind = SectionKind::IrradianceLeaves;
    let mut points = Vec::new();
    for index in 0..scene.header.section(kind).records {
        let leaf = PhotonLeaf::read(scene.line(&mut memory, kind, index, 0..LINE_BYTES as u32).unwrap());
        let point = |i| (scene.header.photon_grid.position(leaf.point(i)).into(), leaf.content(i));
        points.extend((0..leaf.photons()).map(point));
    }
    points
}

/// Irradiance by the chip's search for the nearest point. All instruction sets must agree.
fn found(image: &CardImage, position: Vec3, normal: u8, max_distance: f32) -> Vec3 {
    let mut results = Level::ALL.iter().filter_map(|level| {
        let (scene, mut memory) = image.view();
        let search = PointSearch { scene: &scene, memory: &mut memory, position, normal, max_distance };
        level.run(search).map(Result::unwrap)
    });
    let first: FoundIrradiance = results.next().expect("what every processor has");
    assert!(results.all(|result| result == first), "position {position}");
    first.irradiance
}

/// Irradiance that [`found`] must return, by brute force.
fn expected(image: &CardImage, position: Vec3, normal: u8, max_distance: f32) -> Vec3 {
    let unit = |code: u8| Vec3::from(decode_normal(code)).normalize();
    let nearest = points(image)
        .into_iter()
        .map(|(place, content)| {
            let [x, y, z] = (position - place).to_array();
            (Candidate::new(x * x + y * y + z * z, content), IrradiancePoint::read(content))
        })
        .filter(|(candidate, _)| candidate.distance_squared() <= max_distance * max_distance)
        .filter(|(_, point)| {
            point.normal == normal || unit(point.normal).dot(unit(normal)) >= MIN_NORMAL_COSINE
        })
        .min_by_key(|(candidate, _)| candidate.order());
    nearest.map_or(Vec3::ZERO, |(_, point)| point.irradiance.into())
}

fn check(photons: &[Placed], queries: &[Placed], neighbors: u32, max_distance: f32) {
    let [jensen, lines] = images(photons, neighbors, max_distance);
    assert_eq!(points(&jensen), points(&lines), "the layout of the photons does not matter");
    for &(place, normal) in queries {
        let place = Vec3::from(place);
        let expected = expected(&lines, place, normal, max_distance);
        for image in [&jensen, &lines] {
            let found = found(image, place, normal, max_distance);
            assert_eq!(found, expected, "query {place} {normal:x} of {} photons", photons.len());
        }
    }
}

fn place(range: f32) -> impl Strategy<Value = [f32; 3]> {
    [-range..range, -range..range, -range..range]
}

/// Photons of one distribution: random, on a coarse grid (many coincide or are equidistant), or in a plane.
/// They have up to three different normals.
fn photons() -> impl Strategy<Value = Vec<Placed>> {
    let random = proptest::collection::vec(place(1.0), 1..400);
    let coincident = proptest::collection::vec([-2_i8..3, -2_i8..3, -2_i8..3], 1..400)
        .prop_map(|grid| grid.into_iter().map(|cell| cell.map(|c| f32::from(c) * 0.25)).collect());
    let coplanar = proptest::collection::vec([-1.0_f32..1.0, -1.0_f32..1.0], 1..400)
        .prop_map(|plane| plane.into_iter().map(|[x, y]| [x, 0.5, y]).collect());
    let places = prop_oneof![random, coincident, coplanar].prop_map(|places: Vec<[f32; 3]>| places);
    (places, proptest::collection::vec(any::<u8>(), 1..4)).prop_map(|(places, normals)| {
        places.into_iter().enumerate().map(|(i, place)| (place, normals[i % normals.len()])).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]
    #[test]
    fn the_nearest_point_of_a_surface_equals_that_of_brute_force(
        photons in photons(),
        queries in proptest::collection::vec(place(1.2), 6),
        other in any::<u8>(),
        neighbors in 2_u32..100,
        max_distance in prop_oneof![0.02_f32..0.2, 0.2_f32..3.0],
    ) {
        let normal = |i: usize| if i == 0 { other } else { photons[i % photons.len()].1 };
        let mut queries: Vec<Placed> =
            queries.into_iter().enumerate().map(|(i, place)| (place, normal(i))).collect();
        // One query is at a photon, which occurs in scenes.
        queries.push(photons[0]);
        check(&photons, &queries, neighbors, max_distance);
    }
}

fn up() -> u8 {
    encode_normal([0.0, 1.0, 0.0])
}

#[test]
fn photons_at_one_position_have_one_point() {
    let place = [0.5, -1.0, 0.25];
    check(&[], &[(place, up())], 10, 1.0);
    check(&[(place, up())], &[(place, up()), ([0.9, -1.0, 0.25], up()), (place, !up())], 10, 0.5);
    for (photons, count) in [(0, 0), (1, 1), (500, 1)] {
        let [image, _] = images(&vec![(place, up()); photons], 10, 0.5);
        assert_eq!(points(&image).len(), count);
    }
    let [image, _] = images(&[(place, up())], 10, 0.5);
    let lit = found(&image, Vec3::new(0.9, -1.0, 0.25), up(), 0.5);
    let unit = image.view().0.header.photon_power_unit;
    let expected = 1.0 / (PI * 0.25);
    assert!((lit.x * unit / expected - 1.0).abs() < 0.01, "{lit} {expected}");
    assert_eq!(found(&image, Vec3::new(-0.1, -1.0, 0.25), up(), 0.5), Vec3::ZERO);
}

/// Pseudo-random positions on the floor, at most `half_side` from its middle along x and z.
fn floor(count: u32, seed: u32, half_side: f32) -> Vec<[f32; 3]> {
    let coordinate = |i: u32| (hash(hash(seed) ^ i) >> 8) as f32 / 8_388_608.0 - 1.0;
    (0..count).map(|i| [half_side * coordinate(2 * i), -1.0, half_side * coordinate(2 * i + 1)]).collect()
}

/// At a photon's own position, an estimate from k - 1 photons is too high by a share of about 1 / (k - 2). At
/// the photon nearest to a random position it is not.
#[test]
fn the_mean_over_positions_is_unbiased_unlike_that_over_photons() {
    let neighbors = 12;
    let (mut over_places, mut over_points, mut queries) = (0.0, 0.0, 0.0);
    for seed in 0..8 {
        let photons: Vec<Placed> = floor(10_000, seed, 1.0).into_iter().map(|place| (place, up())).collect();
        let [_, image] = images(&photons, neighbors, 0.5);
        // Power of all photons over the 4 m^2 of the floor: the expected irradiance away from its edges.
        let unit = f64::from(image.view().0.header.photon_power_unit) * 4.0 / f64::from(photons.len() as u32);
        for place in floor(4000, 100 + seed, 0.8) {
            over_places += f64::from(found(&image, place.into(), up(), 0.5).x) * unit;
            queries += 1.0;
        }
        let inner: Vec<f64> = points(&image)
            .into_iter()
            .filter(|(place, _)| place.x.abs().max(place.z.abs()) < 0.8)
            .map(|(_, content)| f64::from(IrradiancePoint::read(content).irradiance[0]) * unit)
            .collect();
        over_points += inner.iter().sum::<f64>() / inner.len() as f64 / 8.0;
    }
    let over_places = over_places / queries;
    println!("over places {over_places:.4}, over photons {over_points:.4}");
    assert!((over_places - 1.0).abs() < 0.015, "{over_places}");
    let too_high = f64::from(neighbors - 1) / f64::from(neighbors - 2);
    assert!((over_points / too_high - 1.0).abs() < 0.015, "{over_points}");
}

/// Where a gather finds at most two or three photons, the mean irradiance must be right too.
#[test]
fn little_light_is_lost_or_gained_where_photons_are_few() {
    for (count, max_distance) in [(500, 0.05), (500, 0.08), (2000, 0.06)] {
        let (mut sum, mut queries) = (0.0, 0.0);
        for seed in 0..12 {
            let photons: Vec<Placed> =
                floor(count, seed, 1.0).into_iter().map(|place| (place, up())).collect();
            let [_, image] = images(&photons, 100, max_distance);
            let unit = f64::from(image.view().0.header.photon_power_unit) * 4.0 / f64::from(count);
            for place in floor(4000, 100 + seed, 0.8) {
                sum += f64::from(found(&image, place.into(), up(), max_distance).x) * unit;
                queries += 1.0;
            }
        }
        let within = f64::from(count) / 4.0 * std::f64::consts::PI * f64::from(max_distance).powi(2);
        println!("{within:.1} photons within a gather: {:.3} of the light", sum / queries);
        assert!((sum / queries - 1.0).abs() < 0.12, "{within} photons: {}", sum / queries);
    }
}

/// Up to its 16-bit mantissa, an irradiance point has the estimate that a gather makes at its position from
/// all photons on its surface.
#[test]
fn a_point_has_the_density_of_the_photons_around_it() {
    let neighbors = 30;
    let photons: Vec<Placed> = floor(3000, 3, 1.0).into_iter().map(|place| (place, up())).collect();
    let [_, image] = images(&photons, neighbors, 0.3);
    let (scene, mut memory) = image.view();
    for (place, content) in points(&image).into_iter().step_by(7) {
        let mut buffer = CandidateBuffer::<128>::new();
        let mut nearest = NearestPhotons::new(buffer.view(), neighbors, 0.3);
        gather(&scene, &mut memory, PhotonMap::Indirect, place, &mut nearest).unwrap();
        let mut all: Vec<Candidate> = nearest.candidates().collect();
        all.sort_unstable_by_key(Candidate::order);
        let farthest = all.pop().expect("there are thirty");
        let power: f32 = all.iter().map(|candidate| candidate.power().decode()[0]).sum();
        let density = power / (PI * farthest.distance_squared());
        let stored = IrradiancePoint::read(content).irradiance[0];
        assert!((stored / density - 1.0).abs() < 1e-4, "{stored} {density}");
    }
}
