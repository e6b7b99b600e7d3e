//! Lights with photometric files: what reaches surfaces, by shadow rays and by photons.

use std::f64::consts::PI;
use std::fmt::Write;
use std::path::Path;

use glam::{DVec3, Vec3};
use photoncard_driver::pack::PackedScene;
use photoncard_driver::photon::trace;
use photoncard_driver::render::measure::{Meter, Point, Reading};
use photoncard_driver::render::{Integrator, PhotonMaps, RenderSettings, Unobserved};
use photoncard_driver::scene::{LightAxes, LightProfile, PunctualKind, PunctualLight, Scene};
use photoncard_tests::{camera, lambertian, room, scene};

/// Weights of equal parts, with which a grey irradiance is its own luminance.
const GREY: [f64; 3] = [1.0 / 3.0; 3];
const POSITION: Vec3 = Vec3::new(0.1, 0.3, -0.2);

/// File of type C with a table of intensities, cd, by C and gamma in steps of `step` degrees.
fn profile(step: u32, candelas: impl Fn(f64, f64) -> f64) -> LightProfile {
    let angles = |last: u32| (0..=last / step).map(move |index| f64::from(index * step));
    let (rows, planes) = (180 / step + 1, 360 / step + 1);
    let mut text = format!("IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 {rows} {planes} 1 2 0 0 0\n1 1 10\n");
    angles(180).chain(angles(360)).for_each(|angle| write!(text, "{angle} ").unwrap());
    for c in angles(360) {
        angles(180).for_each(|gamma| write!(text, "\n{:.6}", candelas(c, gamma)).unwrap());
    }
    LightProfile::parse(text.as_bytes(), Path::new("lamp.ies")).unwrap()
}

/// Closed room of side 2 with walls of albedo `albedo` and a light of the profile.
fn lit(profile: &LightProfile, axes: LightAxes, albedo: f32) -> Scene {
    let mut closed = scene(room([0; 6]), vec![lambertian("wall", albedo)], camera(Vec3::ZERO, Vec3::NEG_Z));
    closed.images.push(profile.image.clone());
    closed.textures.push(profile.texture);
    let kind = PunctualKind::Profile { position: POSITION, texture: 0 };
    let intensity = Vec3::splat(profile.peak as f32);
    closed.lights = vec![PunctualLight { name: "lamp".into(), kind, intensity, axes }];
    closed
}

fn spot(direction: Vec3, intensity: f32, albedo: f32) -> Scene {
    let mut closed = scene(room([0; 6]), vec![lambertian("wall", albedo)], camera(Vec3::ZERO, Vec3::NEG_Z));
    let kind = PunctualKind::Spot { position: POSITION, direction, inner_cosine: 0.8, outer_cosine: 0.3 };
    let intensity = Vec3::splat(intensity);
    closed.lights = vec![PunctualLight { name: "lamp".into(), kind, intensity, axes: LightAxes::default() }];
    closed
}

fn measured(scene: &Scene, samples: u32, points: &[Point]) -> Vec<Reading> {
    let settings = RenderSettings {
        photons: PhotonMaps { count: 200_000, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 64, shadow_rays: 1, samples, ..Integrator::default() },
        ..RenderSettings::default()
    };
    Meter::new(scene, &settings, GREY).measure(0, points, &Unobserved).unwrap()
}

/// Points on the walls of the room, which face inwards.
fn on_walls() -> Vec<Point> {
    let places = [[-0.6, -0.5], [0.1, 0.2], [0.7, -0.3], [0.45, 0.75]];
    let sides = (0..3).flat_map(|axis| [-1.0, 1.0].map(|side| (axis, side)));
    let at = |(axis, side): (usize, f64), [u, v]: [f64; 2]| {
        let (mut position, mut normal) = ([0.0; 3], [0.0; 3]);
        (position[axis], normal[axis]) = (side * 0.999_9, -side);
        (position[(axis + 1) % 3], position[(axis + 2) % 3]) = (u, v);
        Point { position, normal }
    };
    sides.flat_map(|side| places.map(|place| at(side, place))).collect()
}

fn sum(light: [f64; 3]) -> f64 {
    light.iter().sum::<f64>() / 3.0
}

fn axes() -> LightAxes {
    let aim = Vec3::new(0.3, -0.8, 0.2).normalize();
    LightAxes { aim, across: aim.any_orthonormal_vector() }
}

/// Intensity that depends on both angles, on every side.
fn uneven(c: f64, gamma: f64) -> f64 {
    let (c, gamma) = (c.to_radians(), gamma.to_radians());
    100.0 * (2.2 + (2.0 * c).cos() * gamma.sin() + gamma.cos() * (c + 0.7).sin() * gamma.sin())
}

#[test]
fn walls_show_the_candelas_of_the_file() {
    let profile = profile(5, uneven);
    let axes = axes();
    let points = on_walls();
    let readings = measured(&lit(&profile, axes, 0.0), 4, &points);
    let [aim, across] = [axes.aim, axes.across].map(Vec3::as_dvec3);
    let upright = across.cross(aim);
    for (point, reading) in points.iter().zip(&readings) {
        let way = DVec3::from(point.position) - POSITION.as_dvec3();
        let direction = way.normalize();
        let gamma = direction.dot(aim).clamp(-1.0, 1.0).acos().to_degrees();
        let c = direction.dot(upright).atan2(direction.dot(across)).to_degrees().rem_euclid(360.0);
        let cosine = -direction.dot(DVec3::from(point.normal));
        let expected = uneven(c, gamma) * cosine / way.length_squared();
        let error = sum(reading.direct) / expected - 1.0;
        // Between angles of 5 degrees the file's intensity is linear.
        assert!(error.abs() < 6e-3, "C {c}, gamma {gamma}: off by {error}");
    }
}

#[test]
fn photons_carry_the_flux_of_the_file() {
    for (step, profile) in
        [(5, profile(5, uneven)), (45, profile(45, |c, _| if c == 90.0 { 10.0 } else { 0.0 }))]
    {
        let packed = PackedScene::new(&lit(&profile, axes(), 0.001)).unwrap();
        let photons = trace(&packed, 11, 200_000, &|_| true).unwrap().photons;
        let unit = f64::from(photons.power_unit());
        let stored: f64 = photons.iter().map(|photon| sum(photon.power.decode().map(f64::from)) * unit).sum();
        let error = stored * 0.999 / profile.lumens - 1.0;
        assert!(error.abs() < 0.006, "steps of {step}: {stored} of {} lm", profile.lumens);
    }
}

#[test]
fn a_file_of_a_spots_falloff_lights_a_room_as_the_spot_does() {
    // `KHR_lights_punctual`: ((cos - outer) / (inner - outer))^2.
    let falloff =
        |_: f64, gamma: f64| 100.0 * ((gamma.to_radians().cos() - 0.3) / 0.5).clamp(0.0, 1.0).powi(2);
    let profile = profile(1, falloff);
    let axes = axes();
    let points = on_walls();
    let by_file = measured(&lit(&profile, axes, 0.5), 16, &points);
    let by_cone = measured(&spot(axes.aim, 100.0, 0.5), 16, &points);
    let mean = |readings: &[Reading], part: fn(&Reading) -> [f64; 3]| {
        readings.iter().map(|reading| sum(part(reading))).sum::<f64>() / readings.len() as f64
    };
    let direct = mean(&by_file, |reading| reading.direct) / mean(&by_cone, |reading| reading.direct) - 1.0;
    let indirect =
        mean(&by_file, |reading| reading.indirect) / mean(&by_cone, |reading| reading.indirect) - 1.0;
    assert!(direct.abs() < 1e-3 && indirect.abs() < 0.01, "{direct}, {indirect}");
    // Light that the walls reflect, with its mean of infinitely many bounces as its scale.
    let scale = 2.0 * PI * 100.0 / 24.0 * 0.5;
    for (index, (file, cone)) in by_file.iter().zip(&by_cone).enumerate() {
        let error = (sum(file.indirect) - sum(cone.indirect)) / scale;
        assert!(error.abs() < 0.03, "point {index}: {error}");
    }
}
