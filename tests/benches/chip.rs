//! Benchmarks of the chip's inner loops: photon gathers, rays, and one whole tile.
//!
//! Run `cargo bench -p photoncard-tests`; the item counts are gathers, rays and pixels.

use std::sync::LazyLock;

use divan::Bencher;
use divan::counter::ItemsCount;
use glam::Vec3;
use photoncard_driver::emulator::EmulatedKind;
use photoncard_driver::emulator::direct::render_tiles;
use photoncard_driver::emulator::memory_model::CacheSettings;
use photoncard_driver::pack::{CardImage, PackedScene};
use photoncard_driver::photon_map::{
    GatherParameters, MappedImage, PhotonLayout, PhotonSettings, map_photons,
};
use photoncard_driver::render::{RenderSettings, Schedule};
use photoncard_driver::scene::{Scene, gltf};
use photoncard_driver::scheduler::GatherOrder;
use photoncard_firmware::memory::MemoryPort;
use photoncard_firmware::photon::{CandidateBuffer, NearestPhotons, PhotonMap, gather};
use photoncard_firmware::render::RenderJob;
use photoncard_firmware::sampler::hash;
use photoncard_firmware::scene::{Ray, RayKind, Surface, closest_hit, read_surface, transmittance};
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::Photon;
use photoncard_shared::message::{Radiance, Tile};

fn main() {
    divan::main();
}

const NEIGHBORS: u32 = 100;
const PHOTONS: usize = 500_000;

/// Scene with its card image, and the parameters of gathers.
struct Prepared {
    scene: Scene,
    image: CardImage,
    gathers: GatherParameters,
}

static CORNELL: LazyLock<Prepared> = LazyLock::new(|| prepare("cornell.gltf", PhotonLayout::Jensen));
static CORNELL_IN_LEAVES: LazyLock<CardImage> =
    LazyLock::new(|| prepare("cornell.gltf", PhotonLayout::Lines).image);
static ATRIUM: LazyLock<Prepared> = LazyLock::new(|| prepare("atrium.glb", PhotonLayout::Jensen));

fn load(name: &str) -> Scene {
    let path = format!("{}/../scenes/{name}", env!("CARGO_MANIFEST_DIR"));
    gltf::load(path.as_ref()).expect("a shipped scene loads")
}

fn prepare(name: &str, layout: PhotonLayout) -> Prepared {
    let scene = load(name);
    let MappedImage { image, gathers, .. } = map(&scene, PHOTONS, layout);
    Prepared { scene, image, gathers }
}

fn map(scene: &Scene, photons: usize, layout: PhotonLayout) -> MappedImage {
    let packed = PackedScene::new(scene).expect("packs");
    let settings = PhotonSettings {
        camera: None,
        caustic_photons: 0,
        caustic_neighbors: 50,
        seed: 0,
        photons,
        neighbors: NEIGHBORS,
        max_distance: None,
        layout,
        radiance: Radiance::Density,
    };
    map_photons(packed, &settings, &|_| true).expect("maps")
}

impl Prepared {
    /// Positions of `count` photons of the kd-tree: random photons if `shuffled`, otherwise consecutive
    /// photons of the lowest level.
    fn queries(&self, count: u32, shuffled: bool) -> Vec<Vec3> {
        let (scene, mut memory) = self.image.view();
        let photons = scene.header.section(SectionKind::Photons).records;
        (0..count)
            .map(|index| if shuffled { hash(index) % photons } else { photons / 2 + index })
            .map(|index| {
                let record = scene.record::<20, 6>(&mut memory, SectionKind::Photons, index).expect("sound");
                Photon::position(record).into()
            })
            .collect()
    }

    /// Incoherent rays from surfaces that the camera sees, in cosine-weighted directions.
    fn rays(&self, count: u32) -> Vec<Ray> {
        let (scene, mut memory) = self.image.view();
        let camera = self.scene.camera(None).expect("a camera");
        let random = |i: u32, k: u32| (hash(hash(i).wrapping_add(k)) >> 8) as f32 / 16_777_216.0;
        (0..)
            .filter_map(|i| {
                let [x, y] = [random(i, 1) - 0.5, random(i, 2) - 0.5];
                let direction = (camera.forward + camera.right * x + camera.up * y).normalize();
                let eye = Ray::new(RayKind::Radiance, camera.origin, direction);
                let hit = closest_hit(&scene, &mut memory, &eye).expect("sound")?;
                let mut surface = Surface::NOWHERE;
                read_surface(&scene, &mut memory, &eye, &hit, &|_| 0.0, &mut surface).expect("sound");
                let sampled = surface.reflector().sample([random(i, 3), random(i, 4)])?;
                Some(Ray::new(RayKind::Radiance, surface.offset_origin(), sampled.direction))
            })
            .take(count as usize)
            .collect()
    }
}

fn gather_all(bencher: Bencher, image: &CardImage, shuffled: bool) {
    let queries = CORNELL.queries(2000, shuffled);
    let (scene, mut memory) = image.view();
    let mut buffer = CandidateBuffer::<512>::new();
    bencher.counter(ItemsCount::new(queries.len())).bench_local(|| {
        let mut found = 0;
        for &query in &queries {
            let mut nearest = NearestPhotons::new(buffer.view(), NEIGHBORS, CORNELL.gathers.max_distance);
            gather(&scene, &mut memory, PhotonMap::Indirect, query, &mut nearest).expect("sound");
            found += nearest.len();
        }
        found
    });
}

#[divan::bench(args = [false, true])]
fn gather_100_of_500000_photons(bencher: Bencher, shuffled: bool) {
    gather_all(bencher, &CORNELL.image, shuffled);
}

#[divan::bench(args = [false, true])]
fn gather_100_of_500000_photons_in_leaves(bencher: Bencher, shuffled: bool) {
    gather_all(bencher, &CORNELL_IN_LEAVES, shuffled);
}

fn cast(bencher: Bencher, prepared: &Prepared, any_hit: bool) {
    let rays = prepared.rays(10_000);
    let (scene, mut memory) = prepared.image.view();
    bencher.counter(ItemsCount::new(rays.len())).bench_local(|| {
        let is_hit = |ray: &&Ray| match any_hit {
            true => transmittance(&scene, &mut memory, ray).expect("sound") == Vec3::ZERO,
            false => closest_hit(&scene, &mut memory, ray).expect("sound").is_some(),
        };
        rays.iter().filter(is_hit).count()
    });
}

#[divan::bench(args = [false, true])]
fn ray_in_cornell(bencher: Bencher, any_hit: bool) {
    cast(bencher, &CORNELL, any_hit);
}

#[divan::bench(args = [false, true])]
fn ray_in_atrium(bencher: Bencher, any_hit: bool) {
    cast(bencher, &ATRIUM, any_hit);
}

#[divan::bench(sample_count = 10, args = ["tiled", "dirbin", "hash", "sort"])]
fn tile_of_cornell(bencher: Bencher, order: &str) {
    render_tile(bencher, order, CORNELL.image.view().1);
}

/// Renders the tile with a memory model: reads are counted before and after the dissertation's caches.
#[divan::bench(sample_count = 10, args = ["tiled", "dirbin", "hash", "sort"])]
fn tile_of_cornell_counted(bencher: Bencher, order: &str) {
    render_tile(bencher, order, CacheSettings::default().over(CORNELL.image.view().1));
}

fn render_tile(bencher: Bencher, order: &str, mut memory: impl MemoryPort) {
    let order = match order {
        "tiled" => GatherOrder::Tiled,
        "dirbin" => GatherOrder::DirectionBins,
        "hash" => GatherOrder::Hash,
        _ => GatherOrder::Sort,
    };
    let settings =
        RenderSettings { schedule: Schedule { order, ..Schedule::default() }, ..RenderSettings::default() };
    let frame = settings.frame(CORNELL.scene.camera(None).expect("a camera"), &CORNELL.gathers);
    let (scene, _) = CORNELL.image.view();
    let mut job = RenderJob { scene: &scene, memory: &mut memory, frame: &frame, outlet: None };
    let mut chip = EmulatedKind::Reference.emulated().chip();
    let tile = Tile { id: 0, x: 256, y: 256, width: 16, height: 16 };
    bencher.counter(ItemsCount::new(256_usize)).bench_local(|| {
        render_tiles(&mut chip, &mut job, &[tile], |_, _| true).expect("sound");
    });
}

/// Traces a million photons and builds their map, on all threads.
#[divan::bench(sample_count = 3)]
fn map_of_a_million_photons(bencher: Bencher) {
    let scene = load("cornell.gltf");
    bencher
        .counter(ItemsCount::new(1_000_000_usize))
        .bench_local(|| map(&scene, 1_000_000, PhotonLayout::Lines).image.bytes());
}
