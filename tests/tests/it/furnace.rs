//! White furnace: in a closed room whose walls have albedo rho and emit L, the radiance is L / (1 - rho)
//! everywhere.

use glam::Vec3;
use photoncard_driver::render::{
    CardAddress, CardSet, Integrator, PhotonMaps, Picture, Radiance, RenderSettings,
};
use photoncard_driver::scene::{Material, Projection, Scene};
use photoncard_tests::{camera, lambertian, mean, radiances, render_or_panic, room, scene};

const EMISSION: f32 = 1.0;

fn furnace(material: Material) -> Scene {
    let emitting = Material { emission: Vec3::splat(EMISSION), ..material };
    scene(room([0; 6]), vec![emitting], camera(Vec3::new(0.1, 0.05, 0.6), Vec3::new(-0.3, -0.2, -1.0)))
}

fn settings() -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 48, height: 48, ..Picture::default() },
        photons: PhotonMaps { count: 100_000, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 64, samples: 2, ..Integrator::default() },
        cards: CardSet {
            addresses: vec!["emulated:2".parse::<CardAddress>().unwrap()],
            ..CardSet::default()
        },
        ..RenderSettings::default()
    }
}

/// Checks the mean of the picture, and that of each block of 8x8 pixels.
fn check(scene: &Scene, expected: f64, tolerance: f64) {
    check_with(scene, &settings(), expected, tolerance);
}

fn check_with(scene: &Scene, settings: &RenderSettings, expected: f64, tolerance: f64) {
    let film = render_or_panic(scene, settings).film;
    let all = radiances(&film);
    let error = mean(&all) / expected - 1.0;
    assert!(error.abs() < 0.5 * tolerance, "mean is off by {error}");
    for block_y in 0..settings.picture.height / 8 {
        for block_x in 0..settings.picture.width / 8 {
            let pixel =
                |i: u32| all[((block_y * 8 + i / 8) * settings.picture.width + block_x * 8 + i % 8) as usize];
            let block: Vec<[f32; 3]> = (0..64).map(pixel).collect();
            let error = mean(&block) / expected - 1.0;
            assert!(error.abs() < tolerance, "block {block_x}, {block_y} is off by {error}");
        }
    }
}

#[test]
fn a_diffuse_furnace_has_uniform_radiance() {
    for albedo in [0.2, 0.5, 0.8] {
        check(&furnace(lambertian("wall", albedo)), EMISSION as f64 / (1.0 - albedo as f64), 0.02);
    }
}

#[test]
fn a_diffuse_furnace_has_uniform_radiance_by_precomputed_irradiance() {
    let settings = settings().with(|s| s.photons.radiance = Radiance::Precomputed);
    for albedo in [0.2, 0.8] {
        let expected = EMISSION as f64 / (1.0 - albedo as f64);
        check_with(&furnace(lambertian("wall", albedo)), &settings, expected, 0.02);
    }
}

/// A Phong lobe reflects less at grazing angles: in uniform radiance, a small wall with a lobe shows its
/// directional albedo.
#[test]
fn a_phong_wall_in_a_diffuse_furnace_shows_its_directional_albedo() {
    let (diffuse, specular, exponent) = (0.3, 0.4, 16.0);
    // The wall is so small that the room's radiance stays that of the diffuse furnace.
    let mut triangles = room([0; 6]);
    let size = 0.05;
    let corner = |x: f32, y: f32| Vec3::new(x * size, y * size, 0.0);
    triangles.extend(photoncard_tests::quad(
        [corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)],
        1,
    ));
    let walls = Material { emission: Vec3::splat(EMISSION), ..lambertian("wall", 0.5) };
    let phong = Material::phong("phong", Vec3::splat(diffuse), Vec3::splat(specular), exponent);
    for angle in [0.0_f32, 0.6, 1.1] {
        let origin = Vec3::new(0.5 * angle.sin(), 0.0, 0.5 * angle.cos());
        let mut view = camera(origin, -origin);
        view.projection = Projection::perspective(0.02);
        let scene = scene(triangles.clone(), vec![walls.clone(), phong.clone()], view);
        let film = render_or_panic(
            &scene,
            &settings().with(|s| {
                s.picture.width = 16;
                s.picture.height = 16;
            }),
        )
        .film;
        let expected = EMISSION as f64 / 0.5
            * (diffuse as f64 + lobe_albedo(specular as f64, exponent as f64, angle as f64));
        let error = mean(&radiances(&film)) / expected - 1.0;
        assert!(error.abs() < 0.02, "at {angle} the wall is off by {error}");
    }
}

/// Directional albedo of Phong's lobe `ks (n + 2) / (2 pi) cos(alpha)^n`, seen at `angle` to the normal.
fn lobe_albedo(specular: f64, exponent: f64, angle: f64) -> f64 {
    let steps = 1000;
    let (sin, cos) = angle.sin_cos();
    let mut sum = 0.0;
    for i in 0..steps {
        let z = (i as f64 + 0.5) / steps as f64;
        let radius = (1.0 - z * z).sqrt();
        for j in 0..steps {
            let phi = (j as f64 + 0.5) / steps as f64 * std::f64::consts::TAU;
            let alpha = (cos * z - sin * radius * phi.cos()).max(0.0);
            sum += alpha.powf(exponent) * z;
        }
    }
    specular * (exponent + 2.0) / std::f64::consts::TAU * sum * std::f64::consts::TAU / (steps * steps) as f64
}

/// The radiance of a room is not uniform if all walls have a lobe: the expected one is that of a path tracer
/// in double precision.
#[test]
fn the_radiance_of_a_phong_furnace_equals_that_of_a_path_tracer() {
    let (diffuse, specular, exponent) = (0.25, 0.35, 12.0);
    let material = Material::phong("wall", Vec3::splat(diffuse), Vec3::splat(specular), exponent);
    let scene = furnace(material);
    let film = render_or_panic(&scene, &settings()).film;
    let oracle =
        oracle::PhongRoom { diffuse: diffuse as f64, specular: specular as f64, exponent: exponent as f64 };
    let expected = oracle.mean_radiance(&scene.cameras[0], 400_000);
    let error = mean(&radiances(&film)) / expected - 1.0;
    assert!(error.abs() < 0.01, "mean is off by {error}: {expected} expected");
}

mod oracle {
    //! Path tracer of the cube from -1 to 1, whose walls have one reflection and emit 1. It samples
    //! directions uniformly over the hemisphere, without light sampling or photons.

    use glam::DVec3;
    use photoncard_driver::scene::Camera;

    pub(super) struct PhongRoom {
        pub(super) diffuse: f64,
        pub(super) specular: f64,
        pub(super) exponent: f64,
    }

    /// Pseudo-random generator `SplitMix64` (Steele, Lea, Flood 2014).
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    impl PhongRoom {
        /// Mean radiance of a square picture with a field of view of 90 degrees.
        pub(super) fn mean_radiance(&self, camera: &Camera, paths: u32) -> f64 {
            let mut random = Random(7);
            let [forward, right, up] = [camera.forward, camera.right, camera.up].map(glam::Vec3::as_dvec3);
            let mut sum = 0.0;
            for _ in 0..paths {
                let (u, v) = (2.0 * random.next() - 1.0, 2.0 * random.next() - 1.0);
                sum += self.radiance(
                    camera.origin.as_dvec3(),
                    (forward + right * u + up * v).normalize(),
                    &mut random,
                );
            }
            sum / paths as f64
        }

        fn radiance(&self, mut origin: DVec3, mut direction: DVec3, random: &mut Random) -> f64 {
            let mut throughput = 1.0;
            let mut radiance = 0.0;
            loop {
                let (position, normal) = wall(origin, direction);
                radiance += throughput;
                let incoming = hemisphere(normal, random);
                let mirror = direction - normal * (2.0 * direction.dot(normal));
                let lobe =
                    self.specular * (self.exponent + 2.0) * mirror.dot(incoming).max(0.0).powf(self.exponent);
                // The weight of a direction is f cos, divided by its density of 1 / (2 pi).
                throughput *= (2.0 * self.diffuse + lobe) * normal.dot(incoming);
                if throughput < 0.2 {
                    if random.next() < 0.5 {
                        return radiance;
                    }
                    throughput *= 2.0;
                }
                (origin, direction) = (position, incoming);
            }
        }
    }

    /// First point of a wall of the cube on a ray from inside, with the wall's inward normal.
    fn wall(origin: DVec3, direction: DVec3) -> (DVec3, DVec3) {
        let distance = |axis: usize| (direction[axis].signum() - origin[axis]) / direction[axis];
        let axis = (0..3).min_by(|&a, &b| distance(a).total_cmp(&distance(b))).unwrap_or(0);
        let mut position = origin + direction * distance(axis);
        position[axis] = direction[axis].signum();
        let mut normal = DVec3::ZERO;
        normal[axis] = -direction[axis].signum();
        (position, normal)
    }

    fn hemisphere(normal: DVec3, random: &mut Random) -> DVec3 {
        let z = 2.0 * random.next() - 1.0;
        let radius = (1.0 - z * z).sqrt();
        let (sin, cos) = (random.next() * std::f64::consts::TAU).sin_cos();
        let direction = DVec3::new(radius * cos, radius * sin, z);
        if direction.dot(normal) < 0.0 { -direction } else { direction }
    }
}
