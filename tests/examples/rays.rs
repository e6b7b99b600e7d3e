//! Measures the ray caster alone, with cosine-weighted rays from surfaces that a camera sees.
//!
//! `cargo run --release -p photoncard-tests --example rays -- SCENE [--bundle 16] [--write FOLDER] [--rays N]
//! [--repeat N]`
//!
//! Prints, for closest-hit and any-hit queries: rays per second of one thread, number of hits, sum of the hit
//! distances, and lines that a ray reads. By default each ray has its own origin. With `--bundle 16`, sixteen
//! rays share their origin and one of 32 cells of the hemisphere, and are cast both singly and in bundles.
//! `--write` stores triangles and rays as little-endian `f32`, so that other libraries can cast the same rays
//! (`tests/peers/rays.sh`).

use std::error::Error;
use std::path::{Path, PathBuf};

use glam::Vec3;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::scene::{Scene, gltf};
use photoncard_firmware::memory::{Counted, Lines, MemoryPort};
use photoncard_firmware::sampler::hash;
use photoncard_firmware::scene::{
    BUNDLE_RAYS, Ray, RayKind, SceneImage, Surface, closest_hit, closest_hits, read_surface, transmittance,
    transmittances,
};
use photoncard_shared::address::Structure;
use photoncard_shared::image::SectionKind;
use rustix::time::{ClockId, clock_gettime};

/// Processor time of this thread, seconds.
fn cpu_seconds() -> f64 {
    let taken = clock_gettime(ClockId::ThreadCPUTime);
    taken.tv_sec as f64 + taken.tv_nsec as f64 * 1e-9
}

fn random(index: u32, dimension: u32) -> f32 {
    (hash(hash(index).wrapping_add(dimension)) >> 8) as f32 / (1 << 24) as f32
}

/// Number of cells along each axis of the unit square from which directions are mapped. The rays of a bundle
/// are in one cell.
const CELLS: [f32; 2] = [8.0, 4.0];

/// Rays from surfaces that the camera sees, in directions sampled by the reflection: `bundle` rays from each
/// origin, in one cell.
fn bounces(scene: &Scene, packed: &PackedScene, count: u32, bundle: u32) -> Vec<Ray> {
    let (image, mut memory) = packed.view();
    let camera = scene.camera(None).expect("a scene has a camera");
    let mut bounce = |i: u32| {
        let direction =
            camera.forward + camera.right * (random(i, 1) - 0.5) + camera.up * (random(i, 2) - 0.5);
        let eye = Ray::new(RayKind::Radiance, camera.origin, direction.normalize());
        let hit = closest_hit(&image, &mut memory, &eye).expect("sound")?;
        let mut surface = Surface::NOWHERE;
        read_surface(&image, &mut memory, &eye, &hit, &|_| 0.0, &mut surface).expect("sound");
        let cell = [0, 1].map(|axis| (random(i, 3 + axis as u32) * CELLS[axis]).floor());
        let ray = |ray: u32| {
            let within = [0, 1].map(|axis| (cell[axis] + random(i, 5 + 2 * ray + axis as u32)) / CELLS[axis]);
            let sampled = surface.reflector().sample(within)?;
            Some(Ray::new(RayKind::Radiance, surface.offset_origin(), sampled.direction))
        };
        (0..bundle).map(ray).collect::<Option<Vec<Ray>>>()
    };
    // The number of attempts is limited, as a camera that sees nothing gives no rays; in shipped scenes four
    // of five attempts give some.
    (0..count * 10).filter_map(&mut bounce).flatten().take(count as usize).collect()
}

/// Number of rays that hit a triangle, and the sum of their distances.
fn cast_all(
    image: &SceneImage,
    memory: &mut impl MemoryPort,
    rays: &[Ray],
    (is_any, is_bundled): (bool, bool),
) -> (usize, f64) {
    let (mut hits, mut sum) = (0, 0.0);
    let mut add = |distance: f32| {
        hits += 1;
        sum += f64::from(distance);
    };
    for bundle in rays.chunks(if is_bundled { BUNDLE_RAYS } else { 1 }) {
        match (is_any, bundle) {
            (true, [ray]) => {
                let share = transmittance(image, memory, ray).expect("sound");
                (share == Vec3::ZERO).then(|| add(0.0));
            }
            (true, rays) => {
                let passed = transmittances(image, memory, rays).expect("sound");
                passed.iter().filter(|passed| passed.0 == Vec3::ZERO).for_each(|_| add(0.0));
            }
            (false, [ray]) => {
                let hit = closest_hit(image, memory, ray).expect("sound");
                hit.iter().for_each(|hit| add(hit.intersection.distance));
            }
            (false, rays) => {
                let mut found = [None; BUNDLE_RAYS];
                closest_hits(image, memory, rays, &mut found).expect("sound");
                found.iter().flatten().for_each(|hit| add(hit.intersection.distance));
            }
        }
    }
    (hits, sum)
}

/// Mean numbers of nodes and of leaves that a ray reads. `way` states whether queries are for any hit, and
/// whether rays are cast in bundles.
fn lines_of_a_ray(image: &SceneImage, memory: Lines, rays: &[Ray], way: (bool, bool)) -> [f64; 2] {
    let mut counted = Counted::new(memory);
    cast_all(image, &mut counted, rays, way);
    [Structure::Nodes, Structure::Triangles].map(|structure| {
        counted.traffic().sum(|_, of| of == structure).requests as f64 / rays.len().max(1) as f64
    })
}

fn write(folder: &Path, scene: &Scene, rays: &[Ray]) -> std::io::Result<()> {
    let write = |name: &str, vectors: &mut dyn Iterator<Item = [f32; 3]>| {
        let bytes: Vec<u8> = vectors.flatten().flat_map(f32::to_le_bytes).collect();
        std::fs::write(folder.join(name), bytes)
    };
    let corners = scene.triangles.iter().flat_map(|triangle| triangle.vertices);
    write("triangles", &mut corners.map(|corner| corner.to_array()))?;
    write("rays", &mut rays.iter().flat_map(|ray| [ray.origin.to_array(), ray.direction.to_array()]))
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let path =
        arguments.next().ok_or("usage: rays SCENE [--bundle N] [--write FOLDER] [--rays N] [--repeat N]")?;
    let (mut folder, mut count, mut bundle, mut repeat): (Option<PathBuf>, u32, u32, usize) =
        (None, 200_000, 1, 5);
    while let Some(argument) = arguments.next() {
        let value = arguments.next().ok_or_else(|| format!("{argument} needs a value"))?;
        match argument.as_str() {
            "--write" => folder = Some(value.into()),
            "--rays" => count = value.parse()?,
            "--bundle" => bundle = value.parse()?,
            "--repeat" => repeat = value.parse()?,
            other => return Err(format!("{other} is not known").into()),
        }
    }
    if bundle != 1 && bundle as usize != BUNDLE_RAYS {
        return Err(format!("--bundle is 1 or {BUNDLE_RAYS}").into());
    }
    let scene = gltf::load(path.as_ref())?;
    let packed = PackedScene::new(&scene)?;
    let rays = bounces(&scene, &packed, count, bundle);
    if let Some(folder) = folder {
        write(&folder, &scene, &rays)?;
    }
    let (image, mut memory) = packed.view();
    println!(
        "photoncard {path}: {} triangles in {} leaves, {} nodes",
        scene.triangles.len(),
        image.header.section(SectionKind::Triangles).records,
        image.header.section(SectionKind::Nodes).records
    );
    let bundled = [("closest", (false, true)), ("any", (true, true))];
    let alone = [("closest", (false, false)), ("any", (true, false))];
    for (name, way) in alone.into_iter().chain(bundled.into_iter().filter(|_| bundle > 1)) {
        let (_, is_bundled) = way;
        let program = if is_bundled { "photoncard-bundles" } else { "photoncard" };
        let mut seconds = Vec::new();
        let mut met = (0, 0.0);
        for _ in 0..repeat {
            let start = cpu_seconds();
            met = cast_all(&image, &mut memory, &rays, way);
            seconds.push(cpu_seconds() - start);
        }
        seconds.sort_by(f64::total_cmp);
        let [nodes, leaves] = lines_of_a_ray(&image, memory, &rays, way);
        println!(
            "{program} {name}: {:.0} rays a second; {} of {} meet a triangle, sum {:.3}; {nodes:.2} nodes, {leaves:.2} leaves",
            rays.len() as f64 / seconds.get(repeat / 2).ok_or("nothing to repeat")?,
            met.0,
            rays.len(),
            met.1
        );
    }
    Ok(())
}
