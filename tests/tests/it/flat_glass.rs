//! Flat glass (thin walls, slabs and panes): light that it transmits is direct light, light that it reflects
//! a caustic.

use std::f64::consts::PI;

use glam::Vec3;
use photoncard_driver::film::PixelLayers;
use photoncard_driver::layer;
use photoncard_driver::render::{Integrator, PhotonMaps, Picture, RenderSettings};
use photoncard_driver::scene::{
    Coat, Encoding, Environment, Image, Layers, LightAxes, Material, Projection, PunctualKind, PunctualLight,
    Reflection, Scene, Texture, Triangle,
};
use photoncard_tests::shapes::{add_textured_quad, cuboid};
use photoncard_tests::{camera, glass, lambertian, mean, quad, radiances, render_or_panic, room, scene};

const ALBEDO: f32 = 0.02;
const FLOOR: u32 = 0;
const LAMP: u32 = 1;
const PANE: u32 = 2;
/// Height of the panes above the floor, metres.
const HEIGHT: f32 = 0.5;
/// Half the thickness of slabs, metres.
const HALF: f32 = 0.002;

fn settings() -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 8, height: 8, layers: layer::Layers::all(), ..Picture::default() },
        photons: PhotonMaps { count: 20_000, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 0, shadow_rays: 8, samples: 64, ..Integrator::default() },
        ..RenderSettings::default()
    }
}

/// Settings for direct light, to which photons contribute nothing: there are few.
fn settings_of_direct_light() -> RenderSettings {
    settings().with(|s| s.photons.count = 1000)
}

/// Horizontal square that faces up, or down if `sign` is -1.
fn square(half: f32, y: f32, sign: f32, material: u32) -> [Triangle; 2] {
    let corner = |x: f32, z: f32| Vec3::new(x * half, y, -z * half * sign);
    quad([corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)], material)
}

/// Floor below panes. The camera is below them too, and sees the floor at the origin.
fn floor(pane: Material, panes: &[Triangle]) -> Scene {
    let mut view = camera(Vec3::new(0.0, 0.3, 0.4), Vec3::new(0.0, -0.3, -0.4));
    view.projection = Projection::perspective(0.02);
    let lamp = Material { emission: Vec3::ONE, ..lambertian("lamp", 0.0) };
    let triangles = [&square(60.0, 0.0, 1.0, FLOOR), panes].concat();
    scene(triangles, vec![lambertian("floor", ALBEDO), lamp, pane], view)
}

/// Horizontal pane without thickness.
fn sheet() -> Vec<Triangle> {
    square(40.0, HEIGHT, 1.0, PANE).to_vec()
}

fn slab(y: f32) -> Vec<Triangle> {
    cuboid(Vec3::Y * y, Vec3::new(40.0, HALF, 40.0), PANE)
}

/// Irradiance of the floor for each layer (direct, indirect, caustic) and channel, from the mean of the
/// picture.
fn irradiances(scene: &Scene, settings: &RenderSettings) -> [[f64; 3]; 3] {
    let rendering = render_or_panic(scene, settings);
    let layers: Vec<PixelLayers> = rendering.film.all().map(|all| all.layers).collect();
    let mean = |of: fn(&PixelLayers) -> [f32; 3]| {
        [0, 1, 2].map(|channel| {
            let sum: f64 = layers.iter().map(|layers| f64::from(of(layers)[channel])).sum();
            sum / layers.len() as f64 * PI / f64::from(ALBEDO)
        })
    };
    [mean(|layers| layers.direct), mean(|layers| layers.indirect), mean(|layers| layers.caustic)]
}

/// Fresnel reflectance of a face of glass of index 1.5, by the cosine of incidence, and the cosine inside.
fn face(cosine: f64) -> (f64, f64) {
    let inside = (1.0 - (1.0 - cosine * cosine) / 2.25).sqrt();
    let [parallel, perpendicular] = [
        (1.5 * cosine - inside) / (1.5 * cosine + inside),
        (cosine - 1.5 * inside) / (cosine + 1.5 * inside),
    ];
    (0.5 * (parallel * parallel + perpendicular * perpendicular), inside)
}

/// Transmittance of a clear pane, with interreflection of its faces, by the cosine of incidence.
fn clear(cosine: f64) -> f64 {
    let (reflectance, _) = face(cosine);
    (1.0 - reflectance) / (1.0 + reflectance)
}

/// Transmittance of a slab of optical thickness `depth`, by the cosine of incidence.
fn absorbing(cosine: f64, depth: f64) -> f64 {
    let (reflectance, inside) = face(cosine);
    let once = (-depth / inside).exp();
    (1.0 - reflectance).powi(2) * once / (1.0 - (reflectance * once).powi(2))
}

/// Irradiance of the floor below glass, W/m^2, for a transmittance that is a function of the cosine of
/// incidence.
type Irradiance = Box<dyn Fn(&dyn Fn(f64) -> f64) -> f64>;

/// Light: name, function that adds it to a scene, and irradiance of the floor.
type Light = (&'static str, fn(&mut Scene), Irradiance);

/// Lights whose transmission is tested: from one direction, from a point, from a lamp and from a sky.
fn lights() -> Vec<Light> {
    vec![
        (
            "sun",
            |scene| {
                let kind = PunctualKind::Directional { direction: Vec3::new(0.8, -0.6, 0.0), angle: 0.0 };
                scene.lights.push(PunctualLight {
                    name: "sun".into(),
                    kind,
                    intensity: Vec3::splat(3.0),
                    axes: LightAxes::default(),
                });
            },
            Box::new(|through| 3.0 * 0.6 * through(0.6)),
        ),
        (
            "point",
            |scene| {
                let kind = PunctualKind::Point { position: Vec3::new(-1.2, 1.6, 0.0) };
                scene.lights.push(PunctualLight {
                    name: "bulb".into(),
                    kind,
                    intensity: Vec3::splat(3.0),
                    axes: LightAxes::default(),
                });
            },
            Box::new(|through| 3.0 / 4.0 * 0.8 * through(0.8)),
        ),
        (
            "lamp",
            |scene| scene.triangles.extend(square(1.0, 1.2, -1.0, LAMP)),
            Box::new(|through| {
                let steps = 200;
                let of = |index: i32| {
                    let [x, z] = [index % steps, index / steps]
                        .map(|step| (f64::from(step) + 0.5) / f64::from(steps) * 2.0 - 1.0);
                    let squared = x * x + 1.44 + z * z;
                    let cosine = 1.2 / squared.sqrt();
                    cosine * cosine / squared * through(cosine)
                };
                (0..steps * steps).map(of).sum::<f64>() * 4.0 / f64::from(steps * steps)
            }),
        ),
        (
            "sky",
            |scene| scene.environment = Some(Environment::constant(Vec3::ONE)),
            Box::new(|through| {
                let cosines = (0..2000).map(|step| (f64::from(step) + 0.5) / 2000.0);
                cosines.map(|cosine| 2.0 * PI * cosine * through(cosine)).sum::<f64>() / 2000.0
            }),
        ),
    ]
}

/// Checks the direct light below glass under each light, for the transmittance of each channel, and that
/// there are no caustics.
#[track_caller]
fn check(name: &str, pane: &Material, panes: &[Triangle], through: [&dyn Fn(f64) -> f64; 3]) {
    for (light, add, irradiance) in lights() {
        let mut scene = floor(pane.clone(), panes);
        add(&mut scene);
        let [direct, _, caustic] = irradiances(&scene, &settings_of_direct_light());
        for channel in 0..3 {
            let expected = irradiance(through[channel]);
            let error = direct[channel] / expected - 1.0;
            assert!(error.abs() < 0.01, "{name}, {light}: {} instead of {expected}", direct[channel]);
        }
        assert_eq!(caustic, [0.0; 3], "{name}, {light}");
    }
}

#[test]
fn light_through_a_sheet_is_direct_light() {
    check("clear", &glass("clear", Vec3::ONE, false), &sheet(), [&clear; 3]);
    let tint = Vec3::new(0.9, 0.5, 0.1);
    let tinted = [0.9, 0.5, 0.1].map(|tint| move |cosine: f64| tint * clear(cosine));
    check("tinted", &glass("tinted", tint, false), &sheet(), [&tinted[0], &tinted[1], &tinted[2]]);
}

#[test]
fn light_through_a_slab_is_direct_light() {
    check("clear", &glass("clear", Vec3::ONE, true), &slab(HEIGHT), [&clear; 3]);
    let coefficients = [0.0_f32, 100.0, 500.0];
    let mut material = glass("tinted", Vec3::new(0.8, 1.0, 1.0), true);
    set_absorption(&mut material, coefficients.into());
    let depths = coefficients.map(|coefficient| f64::from(coefficient * 2.0 * HALF));
    let [red, green, blue] = [(0.8, depths[0]), (1.0, depths[1]), (1.0, depths[2])]
        .map(|(tint, depth)| move |cosine: f64| tint * absorbing(cosine, depth));
    check("tinted", &material, &slab(HEIGHT), [&red, &green, &blue]);
}

fn set_absorption(material: &mut Material, coefficient: Vec3) {
    if let Reflection::MetallicRoughness { transmission: Some(transmission), .. } = &mut material.reflection {
        transmission.absorption = coefficient;
    }
}

/// The expected direct light passes both panes once: light that they reflect between them is a caustic.
#[test]
fn light_through_double_glazing_is_direct_light() {
    let panes = [slab(HEIGHT), slab(HEIGHT + 0.02)].concat();
    for (name, material, panes) in [
        ("slabs", glass("clear", Vec3::ONE, true), panes),
        (
            "sheets",
            glass("clear", Vec3::ONE, false),
            [sheet(), square(40.0, HEIGHT + 0.02, 1.0, PANE).to_vec()].concat(),
        ),
    ] {
        for (light, add, irradiance) in lights() {
            let mut scene = floor(material.clone(), &panes);
            add(&mut scene);
            let [direct, _, caustic] = irradiances(&scene, &settings());
            let expected = irradiance(&|cosine| clear(cosine).powi(2));
            assert!(
                (direct[0] / expected - 1.0).abs() < 0.01,
                "{name}, {light}: {} of {expected}",
                direct[0]
            );
            let between = irradiance(&|cosine| {
                let reflected = 1.0 - clear(cosine);
                clear(cosine).powi(2) / (1.0 - reflected * reflected) - clear(cosine).powi(2)
            });
            assert!(caustic[0] < 2.0 * between, "{name}, {light}: {} of {between}", caustic[0]);
        }
    }
}

#[test]
fn textures_layers_and_coverage_dim_the_light_through_a_sheet() {
    let covered = Material { blends: true, alpha: 0.5, ..glass("covered", Vec3::ONE, false) };
    check("covered", &covered, &sheet(), [&|cosine| 0.5 + 0.5 * clear(cosine); 3]);
    let mut milky = glass("milky", Vec3::ONE, false);
    if let Reflection::MetallicRoughness { transmission: Some(transmission), .. } = &mut milky.reflection {
        transmission.factor = 0.6;
    }
    check("milky", &milky, &sheet(), [&|cosine| 0.6 * clear(cosine); 3]);
    let coat =
        Coat { factor: 1.0, roughness: 0.0, factor_texture: None, roughness_texture: None, normal: None };
    let layers = Layers { coat: Some(coat), ..Layers::none(Vec3::splat(0.04)) };
    let coated = Material { layers: Some(Box::new(layers)), ..glass("coated", Vec3::ONE, false) };
    let schlick = |cosine: f64| 0.04 + 0.96 * (1.0 - cosine).powi(5);
    check("coated", &coated, &sheet(), [&|cosine| (1.0 - schlick(cosine)) * clear(cosine); 3]);
}

#[test]
fn a_texture_of_a_sheet_tints_the_light() {
    let stained = Material { base_texture: Some(0), ..glass("stained", Vec3::ONE, false) };
    let mut scene = floor(stained, &[]);
    let corner = |x: f32, z: f32| Vec3::new(x * 40.0, HEIGHT, -z * 40.0);
    let corners = [corner(-1., -1.), corner(1., -1.), corner(1., 1.), corner(-1., 1.)];
    add_textured_quad(&mut scene, corners, [[0.; 2], [1., 0.], [1.; 2], [0., 1.]], PANE);
    let (texels, encoding) = (vec![[51, 102, 204, 255]], Encoding::Linear);
    scene.images.push(Image { name: "stain".into(), width: 1, height: 1, texels, encoding });
    scene.textures.push(Texture::new(0));
    let (_, add, irradiance) = lights().swap_remove(0);
    add(&mut scene);
    let [direct, _, caustic] = irradiances(&scene, &settings());
    for (found, tint) in direct.into_iter().zip([0.2, 0.4, 0.8]) {
        let expected = irradiance(&|cosine| tint * clear(cosine));
        assert!((found / expected - 1.0).abs() < 0.01, "{found} instead of {expected}");
    }
    assert_eq!(caustic, [0.0; 3]);
}

/// Gather rays and shadow rays share the light of a lamp or a sky, with weights that add up to 1, with and
/// without irradiance records.
#[test]
fn gather_rays_and_shadow_rays_agree_on_light_through_panes() {
    for panes in [sheet(), slab(HEIGHT)] {
        let material = glass("pane", Vec3::ONE, panes.len() > 2);
        for (light, add, irradiance) in lights().split_off(2) {
            let expected = irradiance(&clear);
            for (gather_rays, shadow_rays, irradiance_error) in
                [(1, 8, None), (8, 1, None), (64, 0, None), (8, 2, Some(0.1)), (256, 1, Some(0.1))]
            {
                let settings = settings_of_direct_light().with(|s| {
                    (s.integrator.gather_rays, s.integrator.shadow_rays) = (gather_rays, shadow_rays);
                    s.integrator.irradiance_error = irradiance_error;
                });
                let mut scene = floor(material.clone(), &panes);
                add(&mut scene);
                let [direct, indirect, caustic] = irradiances(&scene, &settings);
                // With irradiance records, light by gather rays is indirect light. What the pane reflects of
                // the dark floor is little.
                let found = direct[0] + if irradiance_error.is_some() { indirect[0] } else { 0.0 };
                let error = found / expected - 1.0;
                let rays = (gather_rays, shadow_rays, irradiance_error);
                assert!(error.abs() < 0.02, "{light}, {rays:?}: {found} instead of {expected}");
                assert_eq!(caustic, [0.0; 3]);
            }
        }
    }
}

/// A glass wall beside the floor reflects sunlight to the floor.
#[test]
fn light_reflected_by_a_pane_is_a_caustic() {
    for thickness in [0.0, 0.02] {
        let wall =
            cuboid(Vec3::new(1.0 + 0.5 * thickness, 1.0, 0.0), Vec3::new(0.5 * thickness, 1.0, 1.0), PANE);
        let wall = if thickness > 0.0 {
            wall
        } else {
            wall.into_iter().filter(|wall| wall.area() > 0.0).take(2).collect()
        };
        let mut scene = floor(glass("wall", Vec3::ONE, thickness > 0.0), &wall);
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let kind = PunctualKind::Directional { direction: Vec3::new(half, -half, 0.0), angle: 0.0 };
        scene.lights.push(PunctualLight {
            name: "sun".into(),
            kind,
            intensity: Vec3::splat(3.0),
            axes: LightAxes::default(),
        });
        // In a wider field of view the caustic is gathered at many positions.
        scene.cameras[0].projection = Projection::perspective(0.6);
        let [direct, _, caustic] = irradiances(&scene, &settings());
        let [sun, cosine] = [3.0 * f64::from(half), f64::from(half)];
        assert!((direct[0] / sun - 1.0).abs() < 0.01, "{}", direct[0]);
        let expected = sun * (1.0 - clear(cosine));
        assert!((caustic[0] / expected - 1.0).abs() < 0.06, "{} instead of {expected}", caustic[0]);
    }
}

/// Panes without loss are invisible in a room of uniform radiance.
#[test]
fn panes_are_invisible_in_a_furnace() {
    let view = camera(Vec3::new(0.1, 0.05, 0.9), Vec3::new(-0.1, -0.05, -1.0));
    let wall = Material { emission: Vec3::splat(0.5), ..lambertian("wall", 0.5) };
    let materials = vec![wall, glass("solid", Vec3::ONE, true), glass("sheet", Vec3::ONE, false)];
    let mut scene = scene(room([0; 6]), materials, view);
    scene.triangles.extend(cuboid(Vec3::new(0.0, 0.3, 0.0), Vec3::new(0.8, 0.01, 0.7), 1));
    scene.triangles.extend(cuboid(Vec3::new(-0.5, -0.2, 0.0), Vec3::new(0.01, 0.6, 0.5), 1));
    scene.triangles.extend(square(0.9, -0.5, 1.0, 2));
    for caustic_photons in [None, Some(0)] {
        let settings = settings().with(|s| {
            (s.picture.width, s.picture.height) = (32, 32);
            (s.photons.count, s.photons.caustic_photons) = (200_000, caustic_photons);
            (s.integrator.gather_rays, s.integrator.samples) = (16, 8);
        });
        let all = radiances(&render_or_panic(&scene, &settings).film);
        assert!((mean(&all) - 1.0).abs() < 0.012, "the mean is {}", mean(&all));
        for block in 0..16 {
            let corner = block / 4 * 8 * 32 + block % 4 * 8;
            let pixels: Vec<[f32; 3]> =
                (0..64).map(|i| all[(corner + i / 8 * 32 + i % 8) as usize]).collect();
            assert!((mean(&pixels) - 1.0).abs() < 0.03, "block {block} is {}", mean(&pixels));
        }
    }
}
