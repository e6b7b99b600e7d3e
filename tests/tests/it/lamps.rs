//! Lamps without substance, and surfaces that cameras do not see.

use glam::Vec3;
use photoncard_driver::render::measure::{Meter, Point, Reading};
use photoncard_driver::render::{RenderSettings, Unobserved};
use photoncard_driver::scene::{
    LightAxes, Material, PunctualKind, PunctualLight, Reflection, Scene, Visibility,
};
use photoncard_tests::{camera, lambertian, quad, radiances, render_or_panic, scene};

const FLOOR: u32 = 0;
const PANEL: u32 = 1;
const MIRROR: u32 = 2;
const EMISSION: f32 = 5.0;
/// Directions that define the right of a picture, as those of the axis do not.
const DOWN: Vec3 = Vec3::new(0.0, -1.0, 0.001);
const UP: Vec3 = Vec3::new(0.0, 1.0, 0.001);

const LAMP: Visibility = Visibility { camera: false, light: false };
const HIDDEN: Visibility = Visibility { camera: false, light: true };

/// Square of side 2 around `centre`, perpendicular to the y axis, whose front looks up or down.
fn level(centre: Vec3, looks_up: bool, material: u32) -> [photoncard_driver::scene::Triangle; 2] {
    let corner = |x: f32, z: f32| centre + Vec3::new(x, 0.0, z);
    let [a, b, c, d] = [corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)];
    quad(if looks_up { [a, b, c, d] } else { [d, c, b, a] }, material)
}

/// A floor at height 0, and a panel of a finish above it that looks down. The camera looks down from above
/// the panel.
fn below_panel(visibility: Visibility, emission: f32) -> Scene {
    let panel = Material { emission: Vec3::splat(emission), visibility, ..lambertian("panel", 0.0) };
    let smooth = Reflection::MetallicRoughness {
        base_colour: Vec3::ONE,
        metallic: 1.0,
        roughness: 0.0,
        dielectric: Vec3::splat(0.04),
        grazing: 1.0,
        transmission: None,
    };
    let materials = vec![lambertian("floor", 0.5), panel, Material::new("mirror", smooth)];
    let triangles = [level(Vec3::ZERO, true, FLOOR), level(Vec3::Y, false, PANEL)].concat();
    scene(triangles, materials, camera(Vec3::new(0.0, 2.0, 0.0), DOWN))
}

fn with_bulb(mut lit: Scene) -> Scene {
    let kind = PunctualKind::Point { position: Vec3::new(0.0, 3.0, 0.0) };
    let intensity = Vec3::splat(7.0);
    lit.lights = vec![PunctualLight { name: "bulb".into(), kind, intensity, axes: LightAxes::default() }];
    lit
}

fn settings() -> RenderSettings {
    RenderSettings::default().with(|s| {
        (s.picture.width, s.picture.height) = (8, 8);
        s.photons.count = 2000;
        (s.integrator.samples, s.integrator.gather_rays, s.integrator.shadow_rays) = (4, 16, 4);
    })
}

fn on_floor(scene: &Scene) -> Reading {
    let point = Point { position: [0.1, 0.0, 0.2], normal: [0.0, 1.0, 0.0] };
    let mut meter = Meter::new(scene, &settings(), [1.0 / 3.0; 3]);
    meter.measure(0, &[point], &Unobserved).expect("measures").remove(0)
}

#[test]
fn a_lamp_without_substance_lights_as_a_panel_of_its_radiance_does() {
    let [lamp, panel] = [LAMP, Visibility::default()].map(|of| on_floor(&below_panel(of, EMISSION)));
    assert!(lamp.direct[0] > 1.0);
    assert_eq!((lamp.direct, lamp.indirect), (panel.direct, panel.indirect));
}

#[test]
fn a_lamp_without_substance_casts_no_shadow_and_a_hidden_panel_does() {
    let direct = |of: Visibility| on_floor(&with_bulb(below_panel(of, 0.0))).direct[0];
    let mut bare = with_bulb(below_panel(LAMP, 0.0));
    bare.triangles.truncate(2);
    assert_eq!(direct(LAMP), on_floor(&bare).direct[0]);
    assert!(direct(LAMP) > 0.5);
    assert_eq!(direct(HIDDEN), 0.0);
}

/// Radiance of the centre of the picture.
fn centre(scene: &Scene) -> f32 {
    let film = render_or_panic(scene, &settings()).film;
    radiances(&film)[4 * 8 + 4][0]
}

#[test]
fn a_camera_looks_through_what_it_does_not_see_from_both_sides() {
    for visibility in [LAMP, HIDDEN] {
        let lit = below_panel(visibility, EMISSION);
        let floor = centre(&lit);
        assert!(floor > 0.3 && floor < 0.5 * EMISSION, "{visibility:?}: {floor}");
        // From below, the panel's front is before the sky, which is black.
        let mut from_below = lit.clone();
        from_below.cameras = vec![camera(Vec3::new(0.0, 0.5, 0.0), UP)];
        assert_eq!(centre(&from_below), 0.0, "{visibility:?}");
    }
    let mut seen = below_panel(Visibility { camera: true, ..LAMP }, EMISSION);
    assert!(centre(&seen) < 0.5 * EMISSION, "a lamp is open from behind");
    seen.cameras = vec![camera(Vec3::new(0.0, 0.5, 0.0), UP)];
    assert_eq!(centre(&seen), EMISSION);
}

#[test]
fn a_mirror_shows_a_lamp_that_the_camera_does_not_see() {
    for visibility in [LAMP, HIDDEN] {
        let mut lit = below_panel(visibility, EMISSION);
        lit.triangles
            .iter_mut()
            .filter(|triangle| triangle.material == FLOOR)
            .for_each(|t| t.material = MIRROR);
        lit.cameras = vec![camera(Vec3::new(0.0, 0.5, 0.0), DOWN)];
        assert!((centre(&lit) / EMISSION - 1.0).abs() < 1e-3, "{visibility:?}: {}", centre(&lit));
    }
}
