//! Measures the search for the k nearest photons alone, among a million on the faces of a cube.
//!
//! `cargo run --release -p photoncard-tests --example nearest -- [--write FOLDER] [--repeat N]`
//!
//! Prints the searches per second of one thread, for queries in random order and along a Hilbert curve, and
//! the sum of all squared distances found. `--write` stores points and queries as little-endian `f32`, so
//! that other libraries can run the same searches (`tests/peers/nearest.sh`).

use std::error::Error;
use std::path::PathBuf;

use glam::Vec3;
use photoncard_driver::pack::{CardImage, PackedScene};
use photoncard_driver::photon::Photons;
use photoncard_driver::photon_map::store_photons;
use photoncard_firmware::gather::HilbertCode;
use photoncard_firmware::photon::{CandidateBuffer, NearestPhotons, PhotonMap, gather};
use photoncard_firmware::sampler::hash;
use photoncard_shared::layout::{FULL_DISC, Photon, Rgbe};
use photoncard_tests::{camera, lambertian, room, scene};
use rustix::time::{ClockId, clock_gettime};

const POINTS: u32 = 1_000_000;
const QUERIES: u32 = 100_000;
const NEIGHBORS: u32 = 100;
const MAX_DISTANCE: f32 = 0.025;
/// Of this number of points, one is in a cluster.
const CLUSTER_SHARE: u32 = 5;
const CLUSTER_RADIUS: f32 = 0.05;

/// Processor time of this thread, seconds.
fn cpu_seconds() -> f64 {
    let taken = clock_gettime(ClockId::ThreadCPUTime);
    taken.tv_sec as f64 + taken.tv_nsec as f64 * 1e-9
}

fn random(index: u32, dimension: u32) -> f32 {
    (hash(hash(index).wrapping_add(dimension)) >> 8) as f32 / (1 << 24) as f32
}

/// Point on a face of the cube of side 1 around the origin. Points in a cluster are in the middle of one of
/// two faces.
fn point(index: u32) -> [f32; 3] {
    let in_cluster = index.is_multiple_of(CLUSTER_SHARE);
    let face = hash(index ^ 0x5555) % if in_cluster { 2 } else { 6 };
    let [u, v] = if in_cluster {
        let (radius, angle) =
            (CLUSTER_RADIUS * random(index, 1).sqrt(), random(index, 2) * std::f32::consts::TAU);
        [0.5 + radius * angle.cos(), 0.5 + radius * angle.sin()]
    } else {
        [random(index, 1), random(index, 2)]
    };
    let side = if face.is_multiple_of(2) { 0.0 } else { 1.0 };
    let place = match face / 2 {
        0 => [side, u, v],
        1 => [u, side, v],
        _ => [u, v, side],
    };
    place.map(|coordinate| coordinate - 0.5)
}

fn image(points: impl Iterator<Item = [f32; 3]>) -> (CardImage, Vec<[f32; 3]>) {
    let scene = scene(room([0; 6]), vec![lambertian("wall", 0.5)], camera(Vec3::ZERO, Vec3::NEG_Z));
    let photons = (0..).zip(points).map(|(index, position)| Photon {
        position,
        power: Rgbe::encode([1.0; 3], hash(index)),
        direction: (hash(index) as u16).to_le_bytes(),
        axis_or_group: 0,
        normal: 0,
        disc: FULL_DISC,
        direct: false,
    });
    let packed = PackedScene::new(&scene).expect("packs");
    let photons = Photons::new(packed.photon_grid(), 1.0, photons);
    let positions = photons.iter().map(|photon| photon.position).collect();
    (store_photons(packed, photons, NEIGHBORS).expect("fits"), positions)
}

fn search_all(image: &CardImage, queries: &[[f32; 3]]) -> (u64, f64) {
    let (scene, mut memory) = image.view();
    let mut buffer = CandidateBuffer::<528>::new();
    let (mut tested, mut sum) = (0, 0.0);
    for &query in queries {
        let mut nearest = NearestPhotons::new(buffer.view(), NEIGHBORS, MAX_DISTANCE);
        tested += u64::from(
            gather(&scene, &mut memory, PhotonMap::Indirect, query.into(), &mut nearest).expect("sound"),
        );
        sum += nearest.candidates().map(|candidate| f64::from(candidate.distance_squared())).sum::<f64>();
    }
    (tested, sum)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut folder: Option<PathBuf> = None;
    let mut repeat = 5;
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let value = arguments.next().ok_or_else(|| format!("{argument} needs a value"))?;
        match argument.as_str() {
            "--write" => folder = Some(value.into()),
            "--repeat" => repeat = value.parse()?,
            other => return Err(format!("{other} is not known").into()),
        }
    }
    let (image, points) = image((0..POINTS).map(point));
    let random: Vec<[f32; 3]> = (0..QUERIES).map(|i| points[(hash(i) % POINTS) as usize]).collect();
    let mut along_curve = random.clone();
    // The second order of queries is that along the Hilbert curve.
    let grid = image.view().0.header.photon_grid;
    along_curve.sort_by_key(|&query| HilbertCode::new(&grid, query));
    if let Some(folder) = folder {
        let write = |name: &str, places: &[[f32; 3]]| {
            let bytes: Vec<u8> = places.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
            std::fs::write(folder.join(name), bytes)
        };
        write("points", &points)?;
        write("random", &random)?;
        write("hilbert", &along_curve)?;
    }
    for (name, queries) in [("random", &random), ("hilbert", &along_curve)] {
        let mut seconds = Vec::new();
        let mut found = (0, 0.0);
        for _ in 0..repeat {
            let start = cpu_seconds();
            found = search_all(&image, queries);
            seconds.push(cpu_seconds() - start);
        }
        seconds.sort_by(f64::total_cmp);
        let median = seconds[seconds.len() / 2];
        println!(
            "photoncard {name}: {:.0} searches a second, {:.0} photons tested each; sum {:.9}",
            f64::from(QUERIES) / median,
            found.0 as f64 / f64::from(QUERIES),
            found.1
        );
    }
    Ok(())
}
