//! The k nearest photons in both layouts equal those of a brute-force search, for several distributions of
//! photons.

use glam::Vec3;
use photoncard_driver::pack::{CardImage, PackedScene};
use photoncard_driver::photon::Photons;
use photoncard_driver::photon_map::{store_photons, to_kd_tree};
use photoncard_firmware::photon::{Candidate, CandidateBuffer, NearestPhotons, PhotonMap, Search};
use photoncard_firmware::simd::Level;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{FULL_DISC, Photon, Rgbe};
use photoncard_tests::{camera, lambertian, room, scene};
use proptest::prelude::*;

/// Card images of a room with a photon at each position, in both layouts. Photons at equal positions differ
/// in their contents.
fn images(places: &[[f32; 3]]) -> [CardImage; 2] {
    let scene = scene(room([0; 6]), vec![lambertian("wall", 0.5)], camera(Vec3::ZERO, Vec3::NEG_Z));
    let photons = (0_u16..).zip(places).map(|(index, &position)| Photon {
        position,
        power: Rgbe::encode([1.0; 3], u32::from(index)),
        direction: (index / 3).to_le_bytes(),
        axis_or_group: 0,
        normal: 0,
        disc: FULL_DISC,
        direct: false,
    });
    let packed = || PackedScene::new(&scene).unwrap();
    let photons = Photons::new(packed().photon_grid(), 1.0, photons);
    let image = || store_photons(packed(), photons.clone(), 100).unwrap();
    [to_kd_tree(image()).unwrap(), image()]
}

/// Key that distinguishes photons here: `f32::to_bits` of the squared distance, and the direction code.
type Found = (u32, [u8; 2]);

/// Photons that the chip's search finds, in order of distance. All instruction sets must agree.
fn found(image: &CardImage, query: Vec3, neighbors: u32, max_distance: f32) -> Vec<Found> {
    let mut results = Level::ALL.iter().filter_map(|level| {
        let (scene, mut memory) = image.view();
        let mut buffer = CandidateBuffer::<512>::new();
        let mut nearest = NearestPhotons::new(buffer.view(), neighbors, max_distance);
        let search = Search {
            scene: &scene,
            memory: &mut memory,
            map: PhotonMap::Indirect,
            position: query,
            nearest: &mut nearest,
        };
        let tested = level.run(search)?.unwrap();
        let mut all: Vec<Candidate> = nearest.candidates().collect();
        all.sort_unstable_by_key(Candidate::order);
        let all: Vec<Found> =
            all.into_iter().map(|c| (c.distance_squared().to_bits(), c.direction())).collect();
        Some((tested, all))
    });
    let first = results.next().expect("what every processor has");
    assert!(results.all(|result| result == first), "query {query}");
    first.1
}

/// Photons that [`found`] must return, by brute force.
fn expected(image: &CardImage, query: Vec3, neighbors: u32, max_distance: f32) -> Vec<Found> {
    let (scene, mut memory) = image.view();
    let photons = scene.header.section(SectionKind::Photons).records;
    let mut all: Vec<Candidate> = (0..photons)
        .map(|index| {
            let record = scene.record::<20, 6>(&mut memory, SectionKind::Photons, index).unwrap();
            let [x, y, z] = Photon::position(record);
            let [x, y, z] = [query.x - x, query.y - y, query.z - z];
            Candidate::new(x * x + y * y + z * z, Photon::content_without_axis(record))
        })
        .filter(|candidate| candidate.distance_squared() <= max_distance * max_distance)
        .collect();
    all.sort_unstable_by_key(Candidate::order);
    all.truncate(neighbors as usize);
    all.into_iter().map(|c| (c.distance_squared().to_bits(), c.direction())).collect()
}

fn check(places: &[[f32; 3]], queries: &[[f32; 3]], neighbors: u32, max_distance: f32) {
    let [jensen, lines] = images(places);
    for &query in queries {
        let query = Vec3::from(query);
        let expected = expected(&jensen, query, neighbors, max_distance);
        for (layout, image) in [("jensen", &jensen), ("lines", &lines)] {
            assert_eq!(
                found(image, query, neighbors, max_distance),
                expected,
                "query {query}, {neighbors} neighbours within {max_distance} of {} photons in {layout}",
                places.len()
            );
        }
    }
}

fn place(range: f32) -> impl Strategy<Value = [f32; 3]> {
    [-range..range, -range..range, -range..range]
}

/// Positions of one distribution: random, clustered, on a coarse grid (many coincide or are equidistant), or
/// in a plane.
fn places() -> impl Strategy<Value = Vec<[f32; 3]>> {
    let random = proptest::collection::vec(place(1.0), 1..400);
    let clustered =
        (proptest::collection::vec(place(1.0), 1..5), proptest::collection::vec(place(0.01), 1..400))
            .prop_map(|(centres, offsets)| {
                let cluster = |(i, offset): (usize, &[f32; 3])| {
                    let centre = centres[i % centres.len()];
                    [centre[0] + offset[0], centre[1] + offset[1], centre[2] + offset[2]]
                };
                offsets.iter().enumerate().map(cluster).collect()
            });
    let coincident = proptest::collection::vec([-2_i8..3, -2_i8..3, -2_i8..3], 1..400)
        .prop_map(|grid| grid.into_iter().map(|cell| cell.map(|c| f32::from(c) * 0.25)).collect());
    let coplanar = proptest::collection::vec([-1.0_f32..1.0, -1.0_f32..1.0], 1..400)
        .prop_map(|plane| plane.into_iter().map(|[x, y]| [x, 0.5, y]).collect());
    prop_oneof![random, clustered, coincident, coplanar]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]
    #[test]
    fn both_layouts_find_what_brute_force_finds(
        places in places(),
        mut queries in proptest::collection::vec(place(1.2), 4),
        neighbors in 1_u32..200,
        max_distance in prop_oneof![0.02_f32..0.2, 0.2_f32..3.0],
    ) {
        // One query is at a photon, which occurs in scenes.
        queries.push(places[0]);
        check(&places, &queries, neighbors, max_distance);
    }
}

#[test]
fn photons_at_one_position_are_ordered_by_their_contents() {
    check(&[[0.5; 3]; 300], &[[0.5; 3], [0.6, 0.5, 0.5]], 100, 1.0);
}

#[test]
fn an_empty_map_has_no_neighbours() {
    for image in images(&[]) {
        assert_eq!(found(&image, Vec3::ZERO, 10, 1.0), []);
    }
}
