//! Energy balance of the photon pass: photons store the emitted power, and that of every reflection.

use glam::Vec3;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::photon::{PhotonPass, trace};
use photoncard_driver::scene::{Material, Scene};
use photoncard_tests::{camera, lambertian, quad, room, scene};

const PHOTONS: usize = 400_000;

fn pass(scene: &Scene, seed: u32) -> PhotonPass {
    let packed = PackedScene::new(scene).unwrap();
    trace(&packed, seed, PHOTONS, &|_| true).unwrap()
}

/// Power of all stored photons per channel, W.
fn stored_power(pass: &PhotonPass) -> [f64; 3] {
    let unit = f64::from(pass.photons.power_unit());
    std::array::from_fn(|channel| {
        pass.photons.iter().map(|photon| f64::from(photon.power.decode()[channel]) * unit).sum()
    })
}

/// Closed room around a square lamp that emits upwards and downwards.
fn lit_room(walls: Material, emission: Vec3) -> Scene {
    let lamp = Material { emission, double_sided: true, ..walls.clone() };
    let mut triangles = room([0; 6]);
    let corner = |x: f32, z: f32| Vec3::new(0.4 * x, 0.3, 0.4 * z);
    triangles.extend(quad([corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)], 1));
    scene(triangles, vec![walls, lamp], camera(Vec3::ZERO, Vec3::NEG_Z))
}

/// Power of the lamp for a radiance of 1, W: pi times the area of both sides.
const LAMP: f64 = std::f64::consts::PI * 0.64 * 2.0;

#[test]
fn a_closed_room_stores_the_emitted_power_over_one_minus_the_albedo() {
    let emission = Vec3::new(3.0, 2.0, 0.5);
    // An albedo of 0.001 is used instead of 0, because surfaces without reflection store no photons.
    for albedo in [[0.001; 3], [0.2; 3], [0.5; 3], [0.8; 3], [0.7, 0.3, 0.1]] {
        let walls = Material::lambertian("wall", albedo.into());
        let stored = stored_power(&pass(&lit_room(walls, emission), 3));
        for channel in 0..3 {
            let expected = LAMP * emission[channel] as f64 / (1.0 - albedo[channel] as f64);
            let error = stored[channel] / expected - 1.0;
            assert!(error.abs() < 0.005, "albedo {albedo:?}, channel {channel}: off by {error}");
        }
    }
}

#[test]
fn a_room_with_one_reflecting_wall_stores_its_share() {
    // The expected share of the power that the lamp emits upwards is the form factor from the lamp, a square
    // of side 0.8, to the ceiling, a square of side 2 at a distance of 0.7.
    let mut scene = lit_room(lambertian("black", 0.0), Vec3::ONE);
    scene.materials.push(lambertian("floor", 0.001));
    for triangle in &mut scene.triangles {
        if triangle.vertices.iter().all(|vertex| vertex.y == 1.0) {
            triangle.material = 2;
        }
    }
    let stored = stored_power(&pass(&scene, 5))[0];
    let expected = LAMP / 2.0 * form_factor(0.4, 1.0, 0.7);
    let error = stored / expected - 1.0;
    assert!(error.abs() < 0.005, "off by {error}");
}

/// Form factor from a square of half side `a` to a parallel, centred square of half side `b` at `distance`,
/// by the integral over both areas.
fn form_factor(a: f64, b: f64, distance: f64) -> f64 {
    let steps = 40;
    let at = |i: usize, half: f64| ((i as f64 + 0.5) / steps as f64 * 2.0 - 1.0) * half;
    let mut sum = 0.0;
    for (i, j) in (0..steps).flat_map(|i| (0..steps).map(move |j| (i, j))) {
        for (k, l) in (0..steps).flat_map(|k| (0..steps).map(move |l| (k, l))) {
            let (dx, dy) = (at(i, a) - at(k, b), at(j, a) - at(l, b));
            let squared = dx * dx + dy * dy + distance * distance;
            sum += distance * distance / (std::f64::consts::PI * squared * squared);
        }
    }
    let cell = (2.0 * b / steps as f64).powi(2);
    sum * cell / (steps * steps) as f64
}

#[test]
fn the_requested_number_of_photons_is_stored_equally_on_any_threads() {
    let scene = lit_room(lambertian("wall", 0.5), Vec3::ONE);
    let packed = PackedScene::new(&scene).unwrap();
    for count in [1, 17, 10_001] {
        let passes: Vec<PhotonPass> = [1, 2, 5]
            .into_iter()
            .map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| trace(&packed, 9, count, &|_| true).unwrap())
            })
            .collect();
        assert!(passes.iter().all(|pass| pass.photons.len() == count));
        assert!(
            passes.iter().all(|pass| pass.photons.iter().eq(passes[0].photons.iter()) && pass.paths == passes[0].paths)
        );
    }
}
