//! Normal maps of known appearance: plates with tilted normals under lights and skies, and their adjoint for
//! photons.

mod adjoint;

use std::f64::consts::PI;

use glam::{DVec3, Vec3, Vec4};
use photoncard_driver::film::{Film, Window};
use photoncard_driver::render::{CardAddress, CardSet, Integrator, PhotonMaps, Picture, RenderSettings};
use photoncard_driver::scene::{
    Camera, Encoding, Environment, Image, Layers, LightAxes, Material, NormalMap, Projection, PunctualKind,
    PunctualLight, Reflection, Scene, Sheen, Texture,
};
use photoncard_tests::shapes::{add_ball, add_tangents, add_textured_quad};
use photoncard_tests::{camera, lambertian, mean, radiances, render_or_panic, scene};

const ALBEDO: f32 = 0.8;

fn settings(gather_rays: u32, samples: u32) -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 16, height: 16, ..Picture::default() },
        photons: PhotonMaps { count: 2000, neighbors: 20, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays, shadow_rays: 1, samples, ..Integrator::default() },
        cards: CardSet {
            addresses: vec!["emulated:1".parse::<CardAddress>().unwrap()],
            ..CardSet::default()
        },
        ..RenderSettings::default()
    }
}

fn film(scene: &Scene, settings: &RenderSettings) -> Film {
    render_or_panic(scene, settings).film
}

/// Adds a normal texture with a texel for each of these normals, side by side, without interpolation.
fn normal_texture(scene: &mut Scene, normals: &[DVec3]) {
    let texel = |normal: &DVec3| {
        let [red, green, blue] = ((*normal * 0.5 + 0.5) * 255.0).round().to_array().map(|value| value as u8);
        [red, green, blue, 255]
    };
    scene.images = vec![Image {
        name: "normals".into(),
        width: normals.len() as u32,
        height: 1,
        texels: normals.iter().map(texel).collect(),
        encoding: Encoding::Linear,
    }];
    scene.textures = vec![Texture { nearest: normals.len() > 1, ..Texture::new(0) }];
}

/// Unit normal that a normal texture of 8 bits a channel gives for `normal`.
fn rounded(normal: DVec3, scale: f64) -> DVec3 {
    let texel = ((normal * 0.5 + 0.5) * 255.0).round() / 255.0 * 2.0 - 1.0;
    (texel * DVec3::new(scale, scale, 1.0)).normalize()
}

fn tilted(degrees: f64, azimuth: f64) -> DVec3 {
    let ((sine, cosine), (y, x)) = (degrees.to_radians().sin_cos(), azimuth.to_radians().sin_cos());
    DVec3::new(sine * x, sine * y, cosine)
}

fn mapped(material: Material, scale: f32) -> Material {
    let normal = Some(NormalMap { texture: 0, scale });
    Material { layers: Some(Box::new(Layers { normal, ..Layers::none(Vec3::splat(0.04)) })), ..material }
}

fn metal(roughness: f32) -> Material {
    let reflection = Reflection::MetallicRoughness {
        base_colour: Vec3::splat(ALBEDO),
        metallic: 1.0,
        roughness,
        dielectric: Vec3::splat(0.04),
        grazing: 1.0,
        transmission: None,
    };
    Material::new("metal", reflection)
}

/// Square of side 2 in the plane z = 0 that faces +z. From its upper left corner, u is 0 to 1 to the right
/// and v 0 to 1 downwards.
fn plate(material: Material, normals: &[DVec3], tangent: Vec4, view: Camera) -> Scene {
    let mut scene = scene(Vec::new(), vec![material], view);
    let corners = [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.]].map(|[x, y]| Vec3::new(x, y, 0.0));
    add_textured_quad(&mut scene, corners, [[0., 1.], [1., 1.], [1., 0.], [0., 0.]], 0);
    add_tangents(&mut scene, 0, tangent);
    normal_texture(&mut scene, normals);
    scene
}

/// Camera 50 m from the origin that sees a square of 1.8 m there.
fn far_camera(direction: Vec3) -> Camera {
    let origin = direction.normalize() * 50.0;
    // Seen from straight above, +y is upwards in the picture.
    let aside = if direction.x == 0.0 && direction.y == 0.0 { Vec3::new(0.0, 1e-4, 0.0) } else { Vec3::ZERO };
    Camera {
        projection: Projection::perspective(2.0 * (0.9_f32 / 50.0).atan()),
        ..camera(origin, aside - origin)
    }
}

fn directional(direction: DVec3, irradiance: f32) -> PunctualLight {
    PunctualLight {
        name: "light".into(),
        kind: PunctualKind::Directional { direction: -direction.as_vec3(), angle: 0.0 },
        intensity: Vec3::splat(irradiance),
        axes: LightAxes::default(),
    }
}

/// A lone plate does not light itself: whatever the map's normals, gather rays of irradiance records stay
/// above the triangle.
#[test]
fn irradiance_records_of_a_lone_bumpy_plate_gather_nothing() {
    for normals in [vec![tilted(15.0, 40.0)], vec![tilted(25.0, 10.0), tilted(30.0, 200.0)]] {
        let view = far_camera(Vec3::Z);
        let mut scene = plate(mapped(lambertian("plate", ALBEDO), 1.0), &normals, Vec4::X, view);
        scene.lights = vec![directional(DVec3::new(0.2, 0.1, 0.9).normalize(), 3.0)];
        let [with, without] = [(32, Some(0.1)), (0, None)].map(|(gather_rays, irradiance_error)| {
            let settings =
                settings(gather_rays, 1).with(|s| s.integrator.irradiance_error = irradiance_error);
            radiances(&film(&scene, &settings))
        });
        assert!(mean(&without) > 0.1);
        assert_eq!(with, without);
    }
}

#[test]
fn a_tilted_plate_is_lit_by_the_cosine_to_its_mapped_normal() {
    let light = DVec3::new(0.3, 0.5, 0.8).normalize();
    for (normal, scale) in [
        (tilted(0.0, 0.0), 1.0),
        (tilted(20.0, 0.0), 1.0),
        (tilted(35.0, 120.0), 1.0),
        (tilted(35.0, 250.0), -0.5),
        (tilted(60.0, 80.0), 2.0),
    ] {
        let texel = rounded(normal, f64::from(scale));
        for (tangent, sign) in [(DVec3::X, 1.0), (DVec3::NEG_X, -1.0), (DVec3::Y, 1.0), (DVec3::NEG_Y, -1.0)]
        {
            let bitangent = DVec3::Z.cross(tangent) * sign;
            let world = tangent * texel.x + bitangent * texel.y + DVec3::Z * texel.z;
            let material = Material { double_sided: true, ..mapped(lambertian("plate", ALBEDO), scale) };
            // From the back, the normals are the opposite ones.
            for side in [1.0, -1.0] {
                let view = far_camera(Vec3::Z * side as f32);
                let tangent = tangent.extend(sign).as_vec4();
                let mut scene = plate(material.clone(), &[normal], tangent, view);
                scene.lights = vec![directional(light * side, 3.0)];
                let film = film(&scene, &settings(0, 1));
                let facing = world * side;
                let expected = f64::from(ALBEDO) / PI * 3.0 * facing.dot(light * side).max(0.0);
                let found = mean(&radiances(&film));
                let lit = f64::from(ALBEDO) / PI * 3.0;
                let error = (found - expected).abs();
                assert!(error < 0.005 * lit, "{normal} {tangent} {side}: {found} {expected}");
                for pixel in film.pixels() {
                    let error = Vec3::from(pixel.normal).as_dvec3().distance(facing);
                    assert!(error < 2e-3, "{normal} {tangent} {side}: {:?}", pixel.normal);
                }
            }
        }
    }
}

#[test]
fn a_scale_or_tangent_of_zero_disables_the_map() {
    let light = directional(DVec3::new(0.3, 0.5, 0.8).normalize(), 3.0);
    let seen = |scale: f32, tangent: Vec4| {
        let material = mapped(lambertian("plate", ALBEDO), scale);
        let mut scene = plate(material, &[tilted(40.0, 30.0)], tangent, far_camera(Vec3::Z));
        scene.lights = vec![light.clone()];
        mean(&radiances(&film(&scene, &settings(0, 1))))
    };
    let plain = f64::from(ALBEDO) / PI * 3.0 * 0.8 / 0.98_f64.sqrt();
    for found in [seen(0.0, Vec4::new(1.0, 0.0, 0.0, 1.0)), seen(1.0, Vec4::new(0.0, 0.0, 0.0, 1.0))] {
        assert!((found / plain - 1.0).abs() < 1e-5, "{found} {plain}");
    }
    let tilted = seen(1.0, Vec4::new(1.0, 0.0, 0.0, 1.0));
    assert!((tilted / plain - 1.0).abs() > 0.1, "{tilted} {plain}");
}

/// Normals are tilted in all directions; light from behind the plate reaches none of them.
#[test]
fn a_bumpy_plate_leaks_no_light_from_behind() {
    let normals: Vec<_> = (0..16).map(|k| tilted(70.0, 22.5 * f64::from(k))).collect();
    for material in [lambertian("plate", ALBEDO), metal(0.2), metal(0.6), metal(0.0)] {
        let material = Material { double_sided: true, ..mapped(material, 1.0) };
        let view = far_camera(Vec3::new(0.5, 0.2, 1.0));
        let mut scene = plate(material, &normals, Vec4::new(1.0, 0.0, 0.0, 1.0), view);
        scene.lights = [DVec3::new(0.9, 0.1, -0.2), DVec3::new(-0.2, 0.9, -0.4)]
            .map(|behind| directional(behind.normalize(), 3.0))
            .to_vec();
        let dark = film(&scene, &settings(16, 1));
        assert!(dark.pixels().all(|pixel| pixel.radiance == [0.0; 3]));
    }
}

/// GGX reflection `f cos` of a metal, with height-correlated Smith masking and Schlick's Fresnel reflectance.
fn metal_times_cosine(normal: DVec3, outgoing: DVec3, incident: DVec3, roughness: f64) -> f64 {
    let squared = roughness.powi(4);
    let half = (outgoing + incident).normalize();
    let [o, i, h] = [outgoing, incident, half].map(|direction| normal.dot(direction));
    if o <= 0.0 || i <= 0.0 {
        return 0.0;
    }
    let distribution = squared / (PI * (h * h * (squared - 1.0) + 1.0).powi(2));
    let length = |cosine: f64| (squared + (1.0 - squared) * cosine * cosine).sqrt();
    let visibility = 0.5 / (i * length(o) + o * length(i));
    let base = f64::from(ALBEDO);
    let fresnel = base + (1.0 - base) * (1.0 - half.dot(outgoing)).powi(5);
    distribution * visibility * fresnel * i
}

/// Normal between `normal` and z that is nearest to `normal` and whose mirror direction is above the plate,
/// by bisection.
fn bent(normal: DVec3, outgoing: DVec3) -> DVec3 {
    let least = (0.9 * outgoing.z).min(0.01);
    let is_above = |n: DVec3| (n * (2.0 * n.dot(outgoing)) - outgoing).z >= least;
    if is_above(normal) {
        return normal;
    }
    let (mut bad, mut good) = (normal, DVec3::Z);
    for _ in 0..60 {
        let middle = (bad + good).normalize();
        if is_above(middle) { good = middle } else { bad = middle }
    }
    good
}

/// Integral of a function over the directions above the plate, by the midpoint rule in cosine and azimuth.
fn over_the_sky(value: impl Fn(DVec3) -> f64) -> f64 {
    const SIDE: u32 = 250;
    let mut sum = 0.0;
    for row in 0..SIDE {
        let z = (f64::from(row) + 0.5) / f64::from(SIDE);
        let sine = (1.0 - z * z).sqrt();
        for column in 0..2 * SIDE {
            let (y, x) = (PI * (f64::from(column) + 0.5) / f64::from(SIDE)).sin_cos();
            sum += value(DVec3::new(sine * x, sine * y, z));
        }
    }
    sum * 2.0 * PI / f64::from(2 * SIDE * SIDE)
}

/// Sixteen normals that are tilted by 10 to 40 degrees.
fn bumps() -> Vec<DVec3> {
    (0..16).map(|k| tilted(f64::from(k % 4 + 1) * 10.0, 97.0 * f64::from(k))).collect()
}

/// Mirror image of a direction in the plate: the part of a lobe below the plate is added to that above.
fn below(direction: DVec3) -> DVec3 {
    DVec3::new(direction.x, direction.y, -direction.z)
}

/// Mean albedos over the texels of a bumpy plate: with [`bent`] normals and the lobe's lower part mirrored
/// up; with unbent normals; and with unbent normals over each texel's own hemisphere.
fn albedos(outgoing: DVec3, roughness: Option<f64>) -> [f64; 3] {
    let count = bumps().len() as f64;
    let mut sums = [0.0; 3];
    for normal in bumps() {
        let normal = rounded(normal, 1.0);
        let value = |normal: DVec3, direction: DVec3| match roughness {
            Some(roughness) => metal_times_cosine(normal, outgoing, direction, roughness),
            None => f64::from(ALBEDO) / PI * normal.dot(direction).max(0.0),
        };
        let mirrored = |direction: DVec3| match roughness {
            Some(_) => {
                value(bent(normal, outgoing), direction) + value(bent(normal, outgoing), below(direction))
            }
            None => value(normal, direction),
        };
        let own = glam::DQuat::from_rotation_arc(DVec3::Z, normal);
        sums[0] += over_the_sky(mirrored) / count;
        sums[1] += over_the_sky(|direction| value(normal, direction)) / count;
        sums[2] += over_the_sky(|direction| value(normal, own * direction)) / count;
    }
    sums
}

/// Radiance of a plate with [`bumps`] under a white sky, seen from `direction`.
fn in_a_furnace(material: Material, direction: DVec3) -> f64 {
    let view = far_camera(direction.as_vec3());
    let mut scene = plate(mapped(material, 1.0), &bumps(), Vec4::new(1.0, 0.0, 0.0, 1.0), view);
    // The plate and its repeated texture extend beyond the picture.
    for triangle in &mut scene.triangles {
        triangle.vertices.iter_mut().for_each(|vertex| *vertex *= 16.0);
    }
    for attributes in &mut scene.attributes {
        attributes.coordinates[0].iter_mut().for_each(|place| *place *= 16.0);
    }
    scene.environment = Some(Environment::constant(Vec3::ONE));
    mean(&radiances(&film(&scene, &settings(64, 32))))
}

#[test]
fn bumpy_plates_in_a_white_furnace_lose_little() {
    for (degrees, roughness, largest_loss) in [
        (0.0, None, 0.06),
        (60.0, None, 0.06),
        (0.0, Some(0.3), 0.005),
        (45.0, Some(0.3), 0.005),
        (70.0, Some(0.3), 0.005),
        (70.0, Some(0.6), 0.005),
    ] {
        let direction = tilted(degrees, 20.0);
        let [expected, unbent, whole] = albedos(direction, roughness);
        let material = match roughness {
            Some(roughness) => metal(roughness as f32),
            None => lambertian("plate", ALBEDO),
        };
        let found = in_a_furnace(material, direction);
        println!(
            "{degrees} {roughness:?}: {found:.4}, expected {expected:.4}, unbent {unbent:.4}, whole {whole:.4}"
        );
        assert!((found / expected - 1.0).abs() < 0.005, "{degrees} {roughness:?}: {found} {expected}");
        assert!(found >= unbent * 0.995, "{degrees} {roughness:?}: {found} {unbent}");
        assert!(found > whole * (1.0 - largest_loss), "{degrees} {roughness:?}: {found} {whole}");
    }
}

/// Cosine-weighted mean of Schlick's reflectance over incident directions, for a dielectric of F0 0.04.
fn mean_fresnel(outgoing: DVec3) -> f64 {
    over_the_sky(|direction| schlick(0.04, outgoing, direction) * direction.z / PI)
}

fn schlick(f0: f64, outgoing: DVec3, incident: DVec3) -> f64 {
    f0 + (1.0 - f0) * (1.0 - (outgoing + incident).normalize().dot(outgoing)).powi(5)
}

/// Mean albedo over the texels of a bumpy plastic plate. The lobe has the [`bent`] normal, and its part below
/// the plate is mirrored up. The Lambertian base has the texel's own normal, and reflects light that the lobe
/// does not.
fn plastic_albedo(outgoing: DVec3, roughness: f64) -> f64 {
    let base = f64::from(ALBEDO);
    let value = |normal: DVec3, outgoing: DVec3, direction: DVec3| {
        let metal = schlick(base, outgoing, direction);
        metal_times_cosine(normal, outgoing, direction, roughness) / metal
            * schlick(0.04, outgoing, direction)
    };
    let lobe = |normal: DVec3, outgoing: DVec3| {
        over_the_sky(|direction| {
            value(normal, outgoing, direction) + value(normal, outgoing, below(direction))
        })
    };
    let of_texel = |normal: DVec3| {
        let glossy = bent(normal, outgoing);
        let cosine = glossy.dot(outgoing);
        let along = DVec3::new((1.0 - cosine * cosine).sqrt(), 0.0, cosine);
        let coat = lobe(DVec3::Z, along).max(mean_fresnel(along));
        let lit = over_the_sky(|direction| normal.dot(direction).max(0.0) / PI);
        lobe(glossy, outgoing) + base * (1.0 - coat) * lit
    };
    let count = bumps().len() as f64;
    bumps().into_iter().map(|normal| of_texel(rounded(normal, 1.0)) / count).sum()
}

fn plastic(roughness: f32) -> Material {
    let reflection = Reflection::MetallicRoughness {
        base_colour: Vec3::splat(ALBEDO),
        metallic: 0.0,
        roughness,
        dielectric: Vec3::splat(0.04),
        grazing: 1.0,
        transmission: None,
    };
    Material::new("plastic", reflection)
}

/// At grazing angles the lobe of many texels has a bent normal; the base must receive all other light.
#[test]
fn bumpy_plastic_plates_lose_no_light_where_normals_are_bent() {
    for (degrees, roughness) in [(0.0, 0.3), (60.0, 0.3), (75.0, 0.3), (75.0, 0.45)] {
        let direction = tilted(degrees, 20.0);
        let expected = plastic_albedo(direction, roughness);
        let found = in_a_furnace(plastic(roughness as f32), direction);
        println!("{degrees} {roughness}: {found:.4}, expected {expected:.4}");
        assert!((found / expected - 1.0).abs() < 0.005, "{degrees} {roughness}: {found} {expected}");
    }
}

/// A sheen has no mirror direction: only its layer's normal counts, and every sample shows the sheen.
#[test]
fn a_sheen_over_a_tilted_normal_is_uniform() {
    let sheen = Sheen { colour: Vec3::ONE, roughness: 0.5, colour_texture: None, roughness_texture: None };
    let normal = Some(NormalMap { texture: 0, scale: 1.0 });
    let layers = Layers { normal, sheen: Some(sheen), ..Layers::none(Vec3::ZERO) };
    let velvet = Material { layers: Some(Box::new(layers)), ..lambertian("velvet", 0.0) };
    let view = far_camera(Vec3::new(60_f32.to_radians().sin(), 0.0, 0.5));
    let mut scene = plate(velvet, &[tilted(30.0, 180.0)], Vec4::new(1.0, 0.0, 0.0, 1.0), view);
    scene.environment = Some(Environment::constant(Vec3::ONE));
    let settings = settings(16, 16).with(|s| s.picture.crop = Some(Window { x0: 6, x1: 10, y0: 6, y1: 10 }));
    let all = radiances(&film(&scene, &settings));
    let middle = mean(&all);
    assert!(middle > 0.6, "{middle}");
    for [red, ..] in all {
        assert!((f64::from(red) / middle - 1.0).abs() < 0.3, "{red} {middle}");
    }
}

/// The middle of a fine ball, where no normal is bent, is as bright as a plate.
#[test]
fn a_smooth_ball_of_plastic_is_as_bright_as_a_plate() {
    let sky = |mut scene: Scene| {
        scene.environment = Some(Environment::constant(Vec3::ONE));
        mean(&radiances(&film(&scene, &settings(32, 16))))
    };
    let view = far_camera(Vec3::Z);
    let flat = sky(plate(plastic(0.3), &[DVec3::Z], Vec4::new(1.0, 0.0, 0.0, 1.0), view.clone()));
    let mut ball = scene(Vec::new(), vec![plastic(0.3)], view);
    add_ball(&mut ball, Vec3::ZERO, 10.0, 64, 0);
    let round = sky(ball);
    println!("{round} on the ball, {flat} on the plate");
    assert!((round / flat - 1.0).abs() < 0.005, "{round} {flat}");
}

/// A coarse ball, whose smooth normals deviate from its facets and have bumps, reflects a white sky even at
/// its silhouette.
#[test]
fn glossy_bumpy_balls_have_neither_black_nor_bright_fringes() {
    for roughness in [0.0, 0.1, 0.3] {
        for scale in [0.0, 0.5] {
            let view = camera(Vec3::new(0.0, 0.0, 5.0), Vec3::NEG_Z);
            let mut scene = scene(Vec::new(), vec![mapped(metal(roughness), scale)], view);
            scene.cameras[0].projection = Projection::perspective(2.0 * 0.24_f32.atan());
            add_ball(&mut scene, Vec3::ZERO, 1.2, 8, 0);
            add_tangents(&mut scene, 0, Vec4::new(0.0, 1.0, 0.0, 1.0));
            for (index, attributes) in scene.attributes.iter_mut().enumerate() {
                attributes.coordinates[0].iter_mut().for_each(|place| place.x = index as f32 / 16.0 + 0.01);
            }
            normal_texture(&mut scene, &bumps());
            scene.environment = Some(Environment::constant(Vec3::ONE));
            let settings = settings(16, 16).with(|s| {
                s.picture.width = 32;
                s.picture.height = 32;
            });
            let film = film(&scene, &settings);
            let ball: Vec<f32> = film.pixels().map(|pixel| pixel.radiance[0]).collect();
            let least = ball.iter().copied().fold(f32::INFINITY, f32::min);
            let most = ball.iter().copied().fold(0.0, f32::max);
            let mean = ball.iter().sum::<f32>() / ball.len() as f32;
            println!("{roughness} {scale}: {least} {mean} {most}");
            assert!(least > 0.7 && mean < 0.95 && most < 1.01, "{roughness} {scale}: {least} {mean} {most}");
        }
    }
}
