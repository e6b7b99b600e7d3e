//! Light tree: samples have the stated density, no light is left out, and many lights add little noise.

use std::ops::Range;

use glam::Vec3;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::scene::{
    Environment, LightAxes, Material, PunctualKind, PunctualLight, Scene, Triangle,
};
use photoncard_firmware::memory::{Lines, MemoryPort};
use photoncard_firmware::sampler::hash;
use photoncard_firmware::scene::SceneImage;
use photoncard_firmware::scene::light::{
    Fraction, LightChoices, Receiver, environment_density, sample_light, select_emitter,
    selection_probability,
};
use photoncard_shared::address::{Line, LineAddress, Structure};
use photoncard_shared::image::SectionKind;
use photoncard_shared::message::{Fault, FaultCode};
use photoncard_tests::{camera, lambertian, scene};

fn random(index: u32, dimension: u32) -> f32 {
    (hash(hash(index).wrapping_add(dimension)) >> 8) as f32 / 16_777_216.0
}

fn place(index: u32, dimension: u32) -> Vec3 {
    Vec3::new(random(index, dimension), random(index, dimension + 1), random(index, dimension + 2)) - 0.5
}

/// Hall, some ten metres wide, of small emissive triangles in all orientations, with 40 point and spot
/// lights.
fn hall(triangles: u32) -> Scene {
    let triangle = |i: u32| {
        let middle = place(i, 0) * 10.0;
        Triangle::new([3, 6, 9].map(|k| middle + 0.05 * place(i, k)), i % 3)
    };
    let lamp = |emission: f32, double_sided: bool| Material {
        emission: Vec3::splat(emission),
        double_sided,
        ..lambertian("lamp", 0.0)
    };
    let light = |i: u32| PunctualLight {
        name: "light".into(),
        kind: if i.is_multiple_of(2) {
            PunctualKind::Point { position: place(i, 20) * 10.0 }
        } else {
            let direction = place(i, 23).normalize();
            PunctualKind::Spot {
                position: place(i, 20) * 10.0,
                direction,
                inner_cosine: 0.9,
                outer_cosine: 0.7,
            }
        },
        intensity: Vec3::splat(0.01),
        axes: LightAxes::default(),
    };
    let mut hall = scene(
        (0..triangles).map(triangle).collect(),
        vec![lamp(1.0, false), lamp(3.0, false), lamp(2.0, true)],
        camera(Vec3::ZERO, Vec3::NEG_Z),
    );
    hall.lights = (0..40).map(light).collect();
    hall
}

fn receiver(index: u32) -> Receiver {
    let position = place(index, 40) * 8.0;
    let normal = place(index, 43).normalize();
    Receiver { position, normal, origin: position + normal * 1e-5 }
}

/// Memory that counts the lines read.
struct Counting<'a> {
    lines: Lines<'a>,
    reads: u64,
}

impl MemoryPort for Counting<'_> {
    fn read(&mut self, structure: Structure, address: LineAddress, used: Range<u32>) -> Result<&Line, Fault> {
        self.reads += 1;
        self.lines.read(structure, address, used)
    }
}

#[test]
fn sampling_and_its_probability_agree_to_the_bit() {
    for triangles in [1, 2, 3, 50, 2000] {
        let packed = PackedScene::new(&hall(triangles)).unwrap();
        let (image, mut memory) = packed.view();
        let mut found = 0;
        for index in 0..200 {
            let receiver = receiver(index);
            let mut choices = LightChoices::new(receiver);
            for sample in 0..20 {
                let fraction = Fraction::new(random(sample, index), index ^ sample << 20);
                let selected = select_emitter(&image, &mut memory, &mut choices, fraction).unwrap();
                let anew = &mut LightChoices::new(receiver);
                assert_eq!(select_emitter(&image, &mut memory, anew, fraction).unwrap(), selected);
                let Some(selected) = selected else { continue };
                let told = selection_probability(&image, &mut memory, &receiver, selected.emitter).unwrap();
                assert_eq!(told.to_bits(), selected.probability.to_bits());
                assert!((0.0..1.0).contains(&selected.rest.value()));
                found += 1;
            }
        }
        assert!(found > 3000, "{found}");
    }
}

#[test]
fn the_probabilities_of_all_emitters_sum_to_that_of_any() {
    let packed = PackedScene::new(&hall(300)).unwrap();
    let (image, mut memory) = packed.view();
    for index in 0..30 {
        let receiver = receiver(index);
        let mut probability =
            |emitter| f64::from(selection_probability(&image, &mut memory, &receiver, emitter).unwrap());
        let sum: f64 = (0..340).map(&mut probability).sum();
        let samples = 4000;
        let finds = |sample: &u32| {
            let fraction =
                Fraction::new((*sample as f32 + random(*sample, 7)) / samples as f32, hash(*sample));
            select_emitter(&image, &mut packed.view().1, &mut LightChoices::new(receiver), fraction)
                .unwrap()
                .is_some()
        };
        let found = (0..samples).filter(finds).count() as f64 / f64::from(samples);
        // No light is found if all children of a node are behind the receiver: the node's own bounds may be
        // in front.
        assert!((found - sum).abs() < 0.02 && sum < 1.0 + 1e-5, "{found} are found of {sum}");
        assert!(sum > 0.3, "{sum}");
    }
}

/// Irradiance of a receiver without shadows, by one light sample, W/m^2.
fn estimate(image: &SceneImage, memory: &mut impl MemoryPort, receiver: &Receiver, index: u32) -> f64 {
    let point = [random(index, 50), random(index, 51)];
    let mut choices = LightChoices::new(*receiver);
    let light = sample_light(image, memory, &mut choices, point, hash(index)).unwrap();
    light.map_or(0.0, |light| f64::from(light.irradiance.x * light.direction.dot(receiver.normal).max(0.0)))
}

/// Irradiance of a receiver without shadows by each emissive triangle, W/m^2.
fn by_each(scene: &Scene, receiver: &Receiver) -> Vec<f64> {
    scene
        .triangles
        .iter()
        .map(|triangle| {
            let [a, b, c] = triangle.vertices;
            let way = (a + b + c) / 3.0 - receiver.origin;
            let direction = way.normalize();
            let normal = triangle.scaled_normal().normalize();
            let material = &scene.materials[triangle.material as usize];
            let cosine = -normal.dot(direction);
            let cosine = if material.double_sided { cosine.abs() } else { cosine.max(0.0) };
            let received = direction.dot(receiver.normal).max(0.0);
            f64::from(material.emission.x * cosine * received * triangle.area() / way.length_squared())
        })
        .collect()
}

#[test]
fn the_tree_samples_ten_thousand_emitters_with_less_noise_than_by_power() {
    let mut scene = hall(10_000);
    scene.lights.clear();
    let packed = PackedScene::new(&scene).unwrap();
    let (image, lines) = packed.view();
    let mut memory = Counting { lines, reads: 0 };
    let power = |triangle: &Triangle| {
        let material = &scene.materials[triangle.material as usize];
        let sides = if material.double_sided { 2.0 } else { 1.0 };
        f64::from(material.emission.x * triangle.area() * sides)
    };
    let total: f64 = scene.triangles.iter().map(power).sum();
    let samples = 2000;
    let mut better = 0;
    for index in 0..20 {
        let receiver = receiver(index);
        let light = by_each(&scene, &receiver);
        let expected: f64 = light.iter().sum();
        let of_power = light.iter().zip(&scene.triangles).map(|(light, t)| light * light * total / power(t));
        let variance_by_power = of_power.sum::<f64>() - expected * expected;
        let estimates: Vec<f64> = (0..samples)
            .map(|sample| estimate(&image, &mut memory, &receiver, sample + index * samples))
            .collect();
        let mean = estimates.iter().sum::<f64>() / f64::from(samples);
        let squares = estimates.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>();
        let variance = squares / f64::from(samples - 1);
        let error = (mean - expected).abs() / (variance / f64::from(samples)).sqrt();
        assert!(error < 5.0, "receiver {index}: {mean} instead of {expected}, {error} standard errors");
        better += u32::from(variance < 0.25 * variance_by_power);
    }
    assert!(better >= 18, "at {better} of 20 receivers the tree has less than a quarter of the variance");
    // A sample reads seven levels at least, and the line of the emitter.
    let reads = memory.reads as f64 / f64::from(20 * samples);
    assert!(reads < 14.0, "{reads} lines a sample");
}

#[test]
fn samples_of_the_environment_have_its_stated_density() {
    let mut texels = vec![[0.1; 3]; 64 * 32];
    texels[5 * 64 + 7] = [500.0; 3];
    let environment = Some(Environment { width: 64, height: 32, texels, strength: 1.0 });
    let scene = hall(3).with(|scene| (scene.environment, scene.lights) = (environment, Vec::new()));
    let packed = PackedScene::new(&scene).unwrap();
    let (image, mut memory) = packed.view();
    let share = image.header.lights.environment;
    assert!(share > 0.2 && share < 1.0);
    let mut agreeing = 0;
    let mut all = 0;
    let mut inverse = 0.0;
    for index in 0..20_000 {
        let point = [random(index, 50), random(index, 51)];
        let mut choices = LightChoices::new(receiver(0));
        let Some(light) = sample_light(&image, &mut memory, &mut choices, point, hash(index)).unwrap() else {
            continue;
        };
        if light.distance.is_finite() {
            continue;
        }
        let told = environment_density(&image, &mut memory, light.direction).unwrap();
        let density = light.density.expect("it has extent");
        all += 1;
        agreeing += u32::from((told / density - 1.0).abs() < 1e-5);
        inverse += 1.0 / f64::from(density);
    }
    // By rounding, a direction at a cell's border may be looked up in the next cell.
    assert!(agreeing * 1000 > all * 998, "{agreeing} of {all}");
    // The mean of 1 / density is the solid angle of the sphere.
    let sphere = inverse / 20_000.0;
    assert!((sphere / (4.0 * std::f64::consts::PI) - 1.0).abs() < 0.05, "{sphere}");
}

#[test]
fn an_invalid_tree_is_a_fault_and_never_a_panic() {
    let packed = PackedScene::new(&hall(100)).unwrap();
    let (image, Lines(sound)) = packed.view();
    let nodes = image.header.section(SectionKind::LightNodes);
    let of_tree = nodes.first_line as usize..(nodes.first_line + nodes.records) as usize;
    let faults = |lines: &[Line]| {
        let receiver = receiver(3);
        let selected = select_emitter(
            &image,
            &mut Lines(lines),
            &mut LightChoices::new(receiver),
            Fraction::new(0.4, 5),
        );
        let told = selection_probability(&image, &mut Lines(lines), &receiver, 70);
        [selected.map(drop).err(), told.map(drop).err()].map(|fault| fault.map(|fault| fault.code))
    };
    assert_eq!(faults(sound), [None; 2]);
    for (link, code) in [(0_u32, FaultCode::Depth), (0x7fff_fff0, FaultCode::Record)] {
        let mut lines = sound.to_vec();
        for line in &mut lines[of_tree.clone()] {
            for child in line.0.as_chunks_mut::<32>().0 {
                // The children's bounds contain all positions and directions.
                child[12..16].copy_from_slice(&1e9_f32.to_le_bytes());
                child[28..].copy_from_slice(&link.to_le_bytes());
            }
        }
        assert_eq!(faults(&lines), [Some(code); 2]);
    }
    for seed in 0..2000 {
        let mut lines = sound.to_vec();
        for (index, line) in (0..).zip(&mut lines[of_tree.clone()]) {
            for (place, byte) in (0..).zip(&mut line.0) {
                let bits = hash(hash(seed * 64 + index).wrapping_add(place));
                if bits.is_multiple_of(16) {
                    *byte = (bits >> 8) as u8;
                }
            }
        }
        faults(&lines);
    }
}
