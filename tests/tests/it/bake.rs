//! Lightmaps: light of known value, solids on floors, thin walls, charts and gutters, and the glb file.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

use glam::{DVec2, Vec2, Vec3};
use photoncard_driver::render::bake::{
    Atlas, BakeSettings, Baked, MaterialForm, Page, Plan, Surfaces, Texel, write,
};
use photoncard_driver::render::measure::{Meter, Reading};
use photoncard_driver::render::{Integrator, PhotonMaps, RenderSettings, Unobserved};
use photoncard_driver::scene::{Material, Scene, Triangle, VertexAttributes, gltf};
use photoncard_tests::everything::everything;
use photoncard_tests::shapes::{add_ball, cuboid};
use photoncard_tests::{camera, lambertian, quad, room, scene};

/// Texels that must lie between two charts.
const GUTTER: i64 = 2;

fn settings() -> RenderSettings {
    RenderSettings {
        photons: PhotonMaps { count: 20_000, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 32, samples: 2, ..Integrator::default() },
        ..RenderSettings::default()
    }
}

/// Settings with few rays, for surfaces with many texels.
fn fewer() -> RenderSettings {
    settings().with(|settings| (settings.integrator.gather_rays, settings.integrator.samples) = (16, 1))
}

fn plan(scene: &Scene, density: f64) -> Plan {
    let settings = BakeSettings { density: Some(density), ..BakeSettings::default() };
    Plan::new(scene, &settings).unwrap_or_else(|error| panic!("{error}"))
}

fn bake(scene: &Scene, density: f64, settings: &RenderSettings) -> (Plan, Baked) {
    let plan = plan(scene, density);
    let mut meter = Meter::new(scene, settings, [0.0; 3]);
    let readings = meter.measure(0, &plan.points(), &Unobserved).unwrap_or_else(|error| panic!("{error}"));
    let light: Vec<[f64; 3]> = readings.iter().map(Reading::irradiance).collect();
    let baked = Baked::of(&plan, Baked::irradiance(&plan, &light));
    (plan, baked)
}

fn value(pages: &[Page], texel: &Texel) -> Vec3 {
    let page = &pages[texel.page as usize];
    page.values[(texel.place[1] * page.size + texel.place[0]) as usize]
}

/// Place of the point of a surface that is nearest to a texel's centre, without the moves out of solids.
fn place(plan: &Plan, texel: &Texel) -> Vec3 {
    let (triangle, weights) = texel.nearest;
    let corners = plan.surfaces().triangle(triangle).vertices;
    corners.iter().zip(weights).fold(Vec3::ZERO, |sum, (corner, weight)| sum + *corner * weight as f32)
}

fn normal(plan: &Plan, texel: &Texel) -> Vec3 {
    plan.surfaces().triangle(texel.nearest.0).scaled_normal().normalize()
}

/// Horizontal square of a half side, at a height, which faces up or down.
fn square(half: f32, height: f32, up: bool, material: u32) -> [Triangle; 2] {
    let corner = |x: f32, z: f32| Vec3::new(x * half, height, z * half);
    let corners = [corner(-1., -1.), corner(-1., 1.), corner(1., 1.), corner(1., -1.)];
    let [a, b, c, d] = corners;
    quad(if up { corners } else { [d, c, b, a] }, material)
}

fn lit(name: &str, albedo: f32, emission: f32) -> Material {
    Material { emission: Vec3::splat(emission), ..lambertian(name, albedo) }
}

/// Form factor from a horizontal point to a parallel rectangle `a` by `b`, whose corner lies straight above
/// at distance `c` (Howell, A Catalog of Radiation Heat Transfer Configuration Factors, B-4).
fn corner_factor(a: f64, b: f64, c: f64) -> f64 {
    let (x, y) = (a / c, b / c);
    let part = |x: f64, y: f64| x / (1.0 + x * x).sqrt() * (y / (1.0 + x * x).sqrt()).atan();
    (part(x, y) + part(y, x)) / (2.0 * PI)
}

#[test]
fn a_plate_under_a_square_lamp_has_the_light_of_the_form_factor() {
    let triangles = [square(1.0, 0.0, true, 0), square(0.5, 1.0, false, 1)].concat();
    let materials = vec![lambertian("plate", 0.5), lit("lamp", 0.0, 4.0)];
    let scene = scene(triangles, materials, camera(Vec3::new(0.0, 0.5, 3.0), Vec3::NEG_Z));
    let more = settings().with(|settings| settings.integrator.shadow_rays = 64);
    let (plan, baked) = bake(&scene, 8.0, &more);
    let mut errors = Vec::new();
    for texel in plan.texels().iter().filter(|texel| normal(&plan, texel).y > 0.5) {
        let factor = |place: Vec3| -> f64 {
            let [x, z] = [place.x, place.z].map(f64::from);
            let side = |x: f64| [0.5 - x, 0.5 + x];
            side(x).iter().flat_map(|a| side(z).map(|b| corner_factor(*a, b, 1.0))).sum()
        };
        let of_samples: f64 = texel.samples.iter().map(|sample| factor(sample.position)).sum();
        let expected = 4.0 * PI * of_samples / texel.samples.len() as f64;
        errors.push(f64::from(value(&baked.irradiance, texel).y) / expected - 1.0);
    }
    assert_eq!(errors.len(), 256);
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let greatest = errors.iter().fold(0.0_f64, |greatest, error| greatest.max(error.abs()));
    assert!(mean.abs() < 0.005 && greatest < 0.06, "mean {mean}, greatest {greatest}");
}

#[test]
fn a_furnace_has_equal_light_at_all_texels_and_shows_its_radiance() {
    let scene = scene(room([0; 6]), vec![lit("wall", 0.5, 1.0)], camera(Vec3::ZERO, Vec3::NEG_Z));
    let (plan, baked) = bake(&scene, 4.0, &settings());
    let expected = PI / 0.5;
    let mut sum = 0.0;
    for texel in plan.texels() {
        let light = f64::from(value(&baked.irradiance, texel).x) / expected;
        assert!((light - 1.0).abs() < 0.12, "{light} at {}", place(&plan, texel));
        sum += f64::from(value(&baked.radiance, texel).x) / 2.0;
    }
    let mean = sum / plan.texels().len() as f64;
    assert!((mean - 1.0).abs() < 0.01, "{mean}");
}

#[test]
fn a_ceiling_is_dark_behind_a_lamp() {
    let triangles = [room([0; 6]), square(0.5, 0.95, false, 1).to_vec()].concat();
    let materials = vec![lambertian("wall", 0.5), lit("lamp", 0.0, 10.0)];
    let scene = scene(triangles, materials, camera(Vec3::ZERO, Vec3::NEG_Z));
    let (plan, baked) = bake(&scene, 10.0, &fewer());
    let light = |texel: &Texel| value(&baked.irradiance, texel).x;
    let is_behind = |texel: &&Texel| {
        let at = place(&plan, texel);
        at.y > 0.99 && normal(&plan, texel).y < -0.5 && at.x.abs() < 0.3 && at.z.abs() < 0.3
    };
    let behind: Vec<f32> = plan.texels().iter().filter(is_behind).map(light).collect();
    let floor = plan.texels().iter().filter(|texel| normal(&plan, texel).y > 0.5);
    let brightest = floor.map(light).fold(0.0, f32::max);
    assert!(behind.len() >= 25 && behind.iter().all(|light| *light < 0.02 * brightest), "{behind:?}");
}

#[test]
fn a_box_on_a_floor_leaves_no_black_texel_and_no_light_below_it() {
    for double_sided in [false, true] {
        let solid = Material { double_sided, ..lambertian("box", 0.5) };
        let mut triangles = room([0, 0, 0, 1, 0, 0]);
        triangles.extend(cuboid(Vec3::new(0.13, -0.7, 0.06), Vec3::splat(0.3), 2));
        let materials = vec![lambertian("wall", 0.5), lit("lamp", 0.5, 2.0), solid];
        let scene = scene(triangles, materials, camera(Vec3::ZERO, Vec3::NEG_Z));
        let (plan, baked) = bake(&scene, 10.0, &fewer());
        let is_floor = |texel: &&Texel| normal(&plan, texel).y > 0.5 && place(&plan, texel).y < -0.99;
        let floor: Vec<&Texel> = plan.texels().iter().filter(is_floor).collect();
        let light = |texel: &Texel| value(&baked.irradiance, texel).x;
        let measured = || floor.iter().filter(|texel| !texel.samples.is_empty()).map(|texel| light(texel));
        let [low, high] = [measured().fold(f32::INFINITY, f32::min), measured().fold(0.0, f32::max)];
        // The foot of the box sees half of the room.
        assert!(low > 0.15 * high, "{low} of {high}");
        let is_deep = |texel: &&&Texel| {
            let off = place(&plan, texel) - Vec3::new(0.13, -1.0, 0.06);
            off.x.abs() < 0.24 && off.z.abs() < 0.24
        };
        let below: Vec<f32> = floor.iter().filter(is_deep).map(|texel| light(texel)).collect();
        assert!(below.len() >= 16, "{}", below.len());
        assert!(below.iter().all(|light| (low..=high).contains(light)), "{below:?} in {low} to {high}");
        let deep = floor.iter().filter(is_deep);
        assert!(deep.into_iter().all(|texel| texel.samples.is_empty()), "inside the box");
    }
}

#[test]
fn a_thin_wall_between_a_lit_and_a_dark_room_leaks_no_light() {
    // The floor and the ceiling go through below and above the wall; a texel is as wide as the wall is thick.
    let mut triangles = room([0, 0, 0, 0, 0, 0]);
    triangles.extend(cuboid(Vec3::new(0.02, 0.0, 0.0), Vec3::new(0.04, 1.0, 1.0), 1));
    let lamp = square(0.2, 0.9, false, 2).map(|triangle| Triangle {
        vertices: triangle.vertices.map(|vertex| vertex - Vec3::X * 0.5),
        ..triangle
    });
    triangles.extend(lamp);
    let materials = vec![lambertian("wall", 0.5), lambertian("partition", 0.5), lit("lamp", 0.0, 10.0)];
    let scene = scene(triangles, materials, camera(Vec3::ZERO, Vec3::NEG_Z));
    let (plan, baked) = bake(&scene, 12.5, &fewer());
    let mut sides = [Vec::new(), Vec::new()];
    for texel in plan.texels() {
        let at = place(&plan, texel);
        if at.x < -0.02 || at.x > 0.06 {
            sides[usize::from(at.x > 0.0)].push(value(&baked.irradiance, texel).x);
        }
    }
    let [bright, dark] = sides;
    let mean = bright.iter().sum::<f32>() / bright.len() as f32;
    let greatest = dark.iter().copied().fold(0.0, f32::max);
    assert!(mean > 0.1 && greatest < 1e-3 * mean, "{greatest} in the dark room, {mean} in the lit one");
}

/// Scenes with many shapes of surfaces.
fn shapes() -> Vec<Scene> {
    let eye = camera(Vec3::new(0.0, 0.0, 5.0), Vec3::NEG_Z);
    let mut ball = scene(Vec::new(), vec![lit("ball", 0.5, 1.0)], eye.clone());
    add_ball(&mut ball, Vec3::ZERO, 1.0, 12, 0);
    let mut spiral = scene(Vec::new(), vec![lit("spiral", 0.5, 1.0)], eye.clone());
    // A ramp that winds twice around an axis: its projection overlaps itself.
    let point = |step: u32, radius: f32| {
        let turn = step as f32 * 0.3;
        Vec3::new(radius * turn.cos(), step as f32 * 0.02, -radius * turn.sin())
    };
    for step in 0..42 {
        let corners = [point(step, 0.5), point(step, 1.0), point(step + 1, 1.0), point(step + 1, 0.5)];
        spiral.triangles.extend(quad(corners, 0));
    }
    let boxes = cuboid(Vec3::ZERO, Vec3::new(0.3, 0.02, 1.0), 0);
    vec![ball, spiral, scene(boxes, vec![lit("box", 0.5, 1.0)], eye), everything()]
}

#[test]
fn charts_are_apart_and_every_triangle_lies_in_its_chart() {
    for (number, scene) in shapes().iter().enumerate() {
        for density in [3.0, 17.0] {
            let plan = plan(scene, density);
            let mut owners: BTreeMap<(u32, i64, i64), u32> = BTreeMap::new();
            for texel in plan.texels() {
                let [x, y] = texel.place.map(i64::from);
                let other = owners.insert((texel.page, x, y), texel.chart);
                assert_eq!(other, None, "scene {number}: texel {x}, {y} belongs to two charts");
            }
            for (&(page, x, y), owner) in &owners {
                let around = (-GUTTER..=GUTTER).flat_map(|dy| (-GUTTER..=GUTTER).map(move |dx| [dx, dy]));
                for [dx, dy] in around {
                    let other = owners.get(&(page, x + dx, y + dy));
                    assert!(other.is_none_or(|other| other == owner), "scene {number}: {x}, {y}");
                }
            }
            let atlas = plan.atlas();
            let placed: usize = atlas.charts.iter().map(|chart| chart.triangles.len()).sum();
            let baked: usize = plan.surfaces().baked().map(|(_, primitive)| primitive.triangles.len()).sum();
            assert_eq!(placed, baked, "scene {number}");
            for chart in &atlas.charts {
                let [low, high] = chart.rectangle.map(|corner| corner.map(f64::from));
                let places = chart.places.as_flattened().iter();
                let is_inside = |axis: usize, at: f64| (low[axis]..=high[axis]).contains(&at);
                assert!(places.into_iter().all(|place| is_inside(0, place.x) && is_inside(1, place.y)));
                assert!(
                    high.iter().all(|side| *side < f64::from(atlas.size)),
                    "a texel to the page's border"
                );
            }
        }
    }
}

/// Square with a second set of coordinates.
fn mapped(corners: [[f32; 2]; 4]) -> Scene {
    let mut scene = scene(Vec::new(), vec![lit("plate", 0.5, 1.0)], camera(Vec3::Y, Vec3::NEG_Z));
    let [a, b, c, d] = corners.map(Vec2::from);
    for (triangle, set) in square(1.0, 0.0, true, 0).into_iter().zip([[a, b, c], [a, c, d]]) {
        let attributes = scene.attributes.len() as u32;
        let coordinates = [[Vec2::ZERO; 3], set];
        scene.attributes.push(VertexAttributes { coordinates, ..VertexAttributes::NONE });
        scene.triangles.push(Triangle { attributes, ..triangle });
    }
    scene
}

#[test]
fn layouts_of_the_file_are_kept_if_they_are_proper() {
    let proper = [[0.1, 0.1], [0.1, 0.9], [0.9, 0.9], [0.9, 0.1]];
    let folded = [[0.1, 0.1], [0.1, 0.9], [0.9, 0.9], [0.12, 0.88]];
    let beyond = [[0.1, 0.1], [0.1, 0.9], [1.2, 0.9], [1.2, 0.1]];
    for (corners, stated) in [(proper, 1), (folded, 0), (beyond, 0), ([[0.0, 0.0]; 4], 0)] {
        let surfaces = Surfaces::new(&mapped(corners), &[]).unwrap();
        let atlas = Atlas::new(&surfaces, Some(16.0), 256).unwrap();
        assert_eq!(atlas.stated, stated, "{corners:?}");
        if stated == 1 {
            // As in the file, up to a scale and a shift: u is the first axis.
            let [a, b, ..] = atlas.charts[0].places[0];
            assert!(a.x == b.x && (b.y - a.y - 32.0).abs() < 1e-3, "{a}, {b}");
        }
    }
}

/// Square islands of a layout, in rows, each with the rectangle of its own texels.
#[test]
fn many_islands_of_a_layout_take_their_own_texels_alone() {
    let mut islands = scene(Vec::new(), vec![lit("plate", 0.5, 1.0)], camera(Vec3::Y, Vec3::NEG_Z));
    for index in 0..100_u16 {
        let [x, y] = [index % 10, index / 10].map(|place| 0.1 * f32::from(place));
        let [near, far] = [Vec2::new(x + 0.03, y + 0.03), Vec2::new(x + 0.07, y + 0.07)];
        let island = [near, Vec2::new(near.x, far.y), far, Vec2::new(far.x, near.y)];
        let [a, b, c, d] = island;
        let apart = Vec3::new(f32::from(index), 0.0, 0.0);
        for (triangle, set) in square(0.2, 0.0, true, 0).into_iter().zip([[a, b, c], [a, c, d]]) {
            let attributes = islands.attributes.len() as u32;
            let coordinates = [[Vec2::ZERO; 3], set];
            islands.attributes.push(VertexAttributes { coordinates, ..VertexAttributes::NONE });
            let vertices = triangle.vertices.map(|vertex| vertex + apart);
            islands.triangles.push(Triangle { attributes, vertices, ..triangle });
        }
    }
    let surfaces = Surfaces::new(&islands, &[]).unwrap();
    let atlas = Atlas::new(&surfaces, Some(20.0), 512).unwrap();
    assert_eq!((atlas.stated, atlas.charts.len()), (1, 100));
    for chart in &atlas.charts {
        let [[x0, y0], [x1, y1]] = chart.rectangle;
        assert!((8..=10).contains(&(x1 - x0)) && (8..=10).contains(&(y1 - y0)), "{:?}", chart.rectangle);
        let [low, high] = [[x0, y0], [x1, y1]].map(|corner| DVec2::from_array(corner.map(f64::from)));
        let is_inside = |place: &DVec2| place.cmpge(low).all() && place.cmple(high).all();
        assert!(chart.places.as_flattened().iter().all(is_inside));
    }
}

/// Thousands of triangles around one edge, and a triangle a million times as long as wide.
#[test]
fn unusual_meshes_are_unwrapped_without_trouble() {
    let mut odd = scene(Vec::new(), vec![lit("plate", 0.5, 1.0)], camera(Vec3::Y, Vec3::NEG_Z));
    for index in 0..3000_u16 {
        let (sine, cosine) = (f32::from(index) * 0.002).sin_cos();
        odd.triangles.push(Triangle::new([Vec3::ZERO, Vec3::Y, Vec3::new(cosine, 0.5, sine)], 0));
    }
    odd.triangles
        .push(Triangle::new([Vec3::Z, Vec3::new(100.0, 0.0, 101.0), Vec3::new(100.0, 1e-4, 101.0)], 0));
    let surfaces = Surfaces::new(&odd, &[]).unwrap();
    let atlas = Atlas::new(&surfaces, Some(1.0), 2048).unwrap();
    let placed: usize = atlas.charts.iter().map(|chart| chart.triangles.len()).sum();
    assert_eq!(placed, odd.triangles.len());
    for density in [1e19, 1e300] {
        assert!(Atlas::new(&surfaces, Some(density), 2048).is_err(), "{density}");
    }
}

#[test]
fn the_file_is_valid_and_loads_with_its_surfaces_and_its_light() {
    let mut triangles = room([0, 0, 0, 1, 0, 0]);
    triangles.extend(cuboid(Vec3::new(0.1, -0.7, 0.0), Vec3::splat(0.3), 2));
    let materials = vec![lambertian("wall", 0.6), lit("lamp", 0.5, 3.0), lambertian("box", 0.4)];
    let original = scene(triangles, materials, camera(Vec3::ZERO, Vec3::NEG_Z));
    let (plan, baked) = bake(&original, 4.0, &settings());
    let folder = tempfile::tempdir().unwrap();
    for form in [MaterialForm::Baked, MaterialForm::Kept] {
        let bytes = write(&plan, &baked, form, &[]).unwrap();
        assert!(bytes == write(&plan, &baked, form, &[]).unwrap());
        let path = folder.path().join("baked.glb");
        std::fs::write(&path, &bytes).unwrap();
        let loaded = gltf::load(&path).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(loaded.triangles.len(), original.triangles.len());
        assert!((loaded.area() - original.area()).abs() < 1e-5 * original.area());
        // Dim charts of an object have materials of their own.
        let emissive = loaded.materials.iter().filter(|material| material.is_emissive());
        let emissive = emissive.map(|material| &material.name).collect::<BTreeSet<_>>().len();
        let albedo = |material: &Material| format!("{:?}", material.reflection).contains("0.6");
        match form {
            MaterialForm::Baked => {
                assert_eq!(emissive, 3);
                let images: Vec<_> = loaded.images.iter().map(|image| image.width).collect();
                assert_eq!(images, [plan.atlas().size]);
            }
            MaterialForm::Kept => {
                assert_eq!(emissive, 1);
                assert!(loaded.materials.iter().any(albedo));
            }
        }
    }
}

#[test]
fn a_dim_surface_keeps_its_light_beside_a_bright_one_of_its_object() {
    let mut triangles = square(0.5, 0.0, true, 0).to_vec();
    triangles.extend(square(0.5, 1.0, false, 0));
    let original = scene(triangles, vec![lit("shade", 0.5, 1.0)], camera(Vec3::ZERO, Vec3::NEG_Z));
    let (plan, mut baked) = bake(&original, 4.0, &fewer());
    let light =
        |is_high: bool| if is_high { Vec3::new(0.7, 0.5, 0.3) } else { Vec3::new(500.0, 300.0, 100.0) };
    let charts = &plan.atlas().charts;
    let is_high = |chart: usize| plan.surfaces().triangle(charts[chart].triangles[0]).vertices[0].y > 0.5;
    assert_eq!((charts.len(), baked.radiance.len()), (2, 1));
    let page = &mut baked.radiance[0];
    for (value, &chart) in page.values.iter_mut().zip(&page.charts).filter(|(_, chart)| **chart < 2) {
        *value = light(is_high(chart as usize));
    }
    let bytes = write(&plan, &baked, MaterialForm::Baked, &[]).unwrap();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("baked.glb"), bytes).unwrap();
    let loaded = gltf::load(&folder.path().join("baked.glb")).unwrap();
    let shown = |triangle: &Triangle| {
        let material = &loaded.materials[triangle.material as usize];
        let texture = &loaded.textures[material.emissive_texture.unwrap() as usize];
        let image = &loaded.images[texture.image as usize];
        let corners = loaded.attributes[triangle.attributes as usize].coordinates[texture.set as usize];
        let place = corners.iter().sum::<Vec2>() * (image.width as f32 / 3.0);
        let texel = image.texels[place.y as usize * image.width as usize + place.x as usize];
        let linear = |code: u8| ((f32::from(code) / 255.0 + 0.055) / 1.055).powf(2.4);
        material.emission * Vec3::new(linear(texel[0]), linear(texel[1]), linear(texel[2]))
    };
    assert_eq!(loaded.triangles.len(), original.triangles.len());
    for triangle in &loaded.triangles {
        let expected = light(triangle.vertices[0].y > 0.5);
        let error = shown(triangle) / expected - Vec3::ONE;
        assert!(error.abs().max_element() < 0.03, "{error} of {expected}");
    }
}
