//! Metallic-roughness surfaces of known radiance: plates, balls and grooves under a uniform sky.

use glam::Vec3;
use photoncard_driver::render::{Integrator, PhotonMaps, Picture, RenderSettings};
use photoncard_driver::scene::{
    Camera, Environment, LightAxes, Material, Projection, PunctualKind, PunctualLight, Reflection, Scene,
};
use photoncard_tests::{camera, mean, quad, radiances, render_or_panic, scene};

fn settings() -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 16, height: 16, ..Picture::default() },
        photons: PhotonMaps { count: 20_000, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 64, samples: 16, ..Integrator::default() },
        ..RenderSettings::default()
    }
}

fn surface(base: f32, metallic: f32, roughness: f32) -> Material {
    let reflection = Reflection::MetallicRoughness {
        base_colour: Vec3::splat(base),
        metallic,
        roughness,
        dielectric: Vec3::splat(0.04),
        grazing: 1.0,
        transmission: None,
    };
    Material::new("surface", reflection)
}

/// Camera 20 m from the origin, at which it looks with a field of view of 2 degrees.
fn far_camera(direction: Vec3) -> Camera {
    let origin = direction.normalize() * 20.0;
    Camera { projection: Projection::perspective(2.0_f32.to_radians()), ..camera(origin, -origin) }
}

fn under_a_white_sky(scene: Scene) -> Scene {
    scene.with(|scene| scene.environment = Some(Environment::constant(Vec3::ONE)))
}

/// Horizontal plate under a white sky, seen at this cosine to its normal.
fn plate(material: Material, cosine: f32) -> Scene {
    let corner = |x: f32, z: f32| Vec3::new(40.0 * x, 0.0, 40.0 * z);
    let quad = quad([corner(-1., 1.), corner(1., 1.), corner(1., -1.), corner(-1., -1.)], 0);
    let sine = (1.0 - cosine * cosine).sqrt();
    under_a_white_sky(scene(quad.to_vec(), vec![material], far_camera(Vec3::new(sine, cosine, 0.01))))
}

/// Directional albedos by quadrature over half vectors: roughness, cosine, albedo of a metal of base colour
/// 0.8, albedo of a black dielectric.
const ALBEDOS: [(f32, f32, f64, f64); 10] = [
    (0.1, 0.15, 0.8854, 0.4608),
    (0.1, 0.98, 0.8, 0.04),
    (0.3, 0.15, 0.7714, 0.2991),
    (0.3, 0.98, 0.7924, 0.0396),
    (0.5, 0.15, 0.7148, 0.1477),
    (0.5, 0.98, 0.7314, 0.0366),
    (0.7, 0.15, 0.6688, 0.0825),
    (0.7, 0.98, 0.5574, 0.028),
    (1.0, 0.15, 0.5592, 0.0452),
    (1.0, 0.98, 0.2486, 0.0125),
];

#[test]
fn plates_in_a_white_furnace_show_their_albedo() {
    for (roughness, cosine, metal, dielectric) in ALBEDOS {
        for (material, albedo) in
            [(surface(0.8, 1.0, roughness), metal), (surface(0.0, 0.0, roughness), dielectric)]
        {
            let settings = settings().with(|s| s.integrator.samples = 8);
            let found = mean(&radiances(&render_or_panic(&plate(material, cosine), &settings).film));
            let error = found - albedo;
            assert!(error.abs() < 0.01 * albedo + 2e-4, "{roughness} at {cosine}: {found} of {albedo}");
        }
    }
}

/// Two metal plates at a right angle, which extend up to `far` from their common edge, seen from above.
fn groove(roughness: f32, far: f32) -> Scene {
    let side = |x: f32| {
        let corner = |s: f32, z: f32| Vec3::new(x * s * far, s * far, z * far);
        if x > 0.0 {
            quad([corner(0., 1.), corner(1., 1.), corner(1., -1.), corner(0., -1.)], 0)
        } else {
            quad([corner(0., -1.), corner(1., -1.), corner(1., 1.), corner(0., 1.)], 0)
        }
    };
    let triangles = [side(1.0), side(-1.0)].concat();
    scene(triangles, vec![surface(0.9, 1.0, roughness)], far_camera(Vec3::new(0.01, 1.0, 0.02)))
}

/// Two plates at a right angle reflect most light twice, F0^2 of it at low roughness. Expected values are
/// path-traced, with standard errors below 0.0002.
#[test]
fn a_groove_of_glossy_metal_is_not_black() {
    for (roughness, expected) in [(0.05, 0.8104), (0.1, 0.8102), (0.3, 0.7849)] {
        let pixels =
            radiances(&render_or_panic(&under_a_white_sky(groove(roughness, 40.0)), &settings()).film);
        let found = mean(&pixels);
        assert!((found / expected - 1.0).abs() < 0.02, "{roughness}: {found} of {expected}");
        let greatest = pixels.iter().flatten().fold(0.0_f32, |greatest, &value| greatest.max(value));
        assert!(f64::from(greatest) < 3.0 * found, "{roughness}: {greatest}");
    }
}

/// No ray hits a punctual light, so that the light which both plates reflect comes by the caustic map,
/// blurred at their common edge. Expected values are path-traced, with standard errors below 0.2 %.
#[test]
fn a_groove_of_glossy_metal_reflects_a_distant_light() {
    for (roughness, expected) in [(0.3, 1.4976), (0.45, 0.6705)] {
        let direction = -Vec3::new(0.2, 1.0, 0.1).normalize();
        let sun = PunctualLight {
            name: "sun".to_owned(),
            kind: PunctualKind::Directional { direction, angle: 0.0 },
            intensity: Vec3::ONE,
            axes: LightAxes::default(),
        };
        let lit = groove(roughness, 2.0).with(|scene| scene.lights = vec![sun]);
        let many = settings().with(|s| s.photons.caustic_photons = Some(500_000));
        let found = mean(&radiances(&render_or_panic(&lit, &many).film));
        assert!((found / expected - 1.0).abs() < 0.03, "{roughness}: {found} of {expected}");
        // Without the caustic map, gather rays that end on the second plate sample the light there.
        let without = settings().with(|s| s.photons.caustic_photons = Some(0));
        let found = mean(&radiances(&render_or_panic(&lit, &without).film));
        assert!((found / expected - 1.0).abs() < 0.02, "{roughness} without a map: {found} of {expected}");
    }
}
