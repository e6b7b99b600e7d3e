//! Textures, vertex colours, vertex normals and cut-outs of known appearance.

use glam::Vec3;
use photoncard_driver::film::Film;
use photoncard_driver::render::{CardAddress, CardSet, Integrator, PhotonMaps, Picture, RenderSettings};
use photoncard_driver::scene::{Encoding, Image, Material, Projection, Reflection, Scene, Texture, Wrap};
use photoncard_tests::shapes::{add_ball, add_textured_quad};
use photoncard_tests::{camera, lambertian, mean, quad, radiances, render_or_panic, room, scene};

fn settings() -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 48, height: 48, ..Picture::default() },
        photons: PhotonMaps { count: 50_000, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 32, samples: 2, ..Integrator::default() },
        cards: CardSet {
            addresses: vec!["emulated:2".parse::<CardAddress>().unwrap()],
            ..CardSet::default()
        },
        ..RenderSettings::default()
    }
}

fn image(width: u32, encoding: Encoding, texels: Vec<[u8; 4]>) -> Image {
    let height = texels.len() as u32 / width;
    Image { name: "image".into(), width, height, texels, encoding }
}

fn with_texture(mut scene: Scene, image: Image, texture: Texture) -> Scene {
    scene.images.push(image);
    scene.textures.push(texture);
    scene
}

/// Square of side 2 in the plane z = 0 that fills the picture. Texture coordinates are 0 to 1 from its upper
/// left corner.
fn canvas(material: Material) -> Scene {
    let mut view = camera(Vec3::Z, Vec3::NEG_Z);
    view.projection = Projection::perspective(std::f32::consts::FRAC_PI_2);
    let mut scene = scene(Vec::new(), vec![material], view);
    let corners = [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.]].map(|[x, y]| Vec3::new(x, y, 0.0));
    add_textured_quad(&mut scene, corners, [[0., 1.], [1., 1.], [1., 0.], [0., 0.]], 0);
    scene
}

fn film(scene: &Scene) -> Film {
    render_or_panic(
        scene,
        &settings().with(|s| {
            s.integrator.gather_rays = 0;
            s.integrator.samples = 16;
        }),
    )
    .film
}

fn glowing(texture: u32) -> Material {
    let lamp = lambertian("screen", 0.0);
    Material { emission: Vec3::new(2.0, 4.0, 8.0), emissive_texture: Some(texture), ..lamp }
}

#[test]
fn an_emissive_texture_glows_texel_by_texel() {
    let texels = vec![[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [188, 188, 188, 255]];
    let nearest = Texture { nearest: true, ..Texture::new(0) };
    let scene = with_texture(canvas(glowing(0)), image(2, Encoding::Srgb, texels), nearest);
    let film = film(&scene);
    let at = |x: u32, y: u32| film.pixel(x, y).unwrap().radiance;
    let near = |found: [f32; 3], expected: [f32; 3]| {
        assert!(found.into_iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3), "{found:?} {expected:?}");
    };
    near(at(10, 10), [2.0, 0.0, 0.0]);
    near(at(37, 10), [0.0, 4.0, 0.0]);
    near(at(10, 37), [0.0, 0.0, 8.0]);
    // The sRGB code 188 is 0.5029.
    near(at(37, 37), [1.0058, 2.0116, 4.0232]);
}

#[test]
fn an_emissive_texture_is_interpolated_between_texels() {
    let texels = vec![[0, 0, 0, 255], [255, 255, 255, 255]];
    let clamped = Texture { wrap: [Wrap::Clamp; 2], ..Texture::new(0) };
    let scene = with_texture(canvas(glowing(0)), image(2, Encoding::Srgb, texels), clamped);
    let film = film(&scene);
    let row: Vec<f32> = (0..48).map(|x| film.pixel(x, 24).unwrap().radiance[0]).collect();
    for (x, &found) in row.iter().enumerate() {
        let expected = 2.0 * ((x as f32 + 0.5) / 24.0 - 0.5).clamp(0.0, 1.0);
        assert!((found - expected).abs() < 0.03, "{x}: {found} {expected}");
    }
    assert_eq!((row[0], row[47]), (0.0, 2.0));
}

/// Closed room whose walls have texture coordinates.
fn textured_room(wall: Material) -> Scene {
    let view = camera(Vec3::new(0.1, 0.05, 0.6), Vec3::new(-0.3, -0.2, -1.0));
    let mut scene = scene(Vec::new(), vec![wall], view);
    for pair in room([0; 6]).as_chunks::<2>().0 {
        let [[a, b, c], [_, _, d]] = pair.map(|triangle| triangle.vertices);
        add_textured_quad(&mut scene, [a, b, c, d], [[-1., 2.], [3., 2.], [3., -2.], [-1., -2.]], 0);
    }
    scene
}

/// Closed room whose albedo is the product of a factor, a texture and vertex colours.
fn furnace(albedo: f32, texel: u8, colour: f32) -> Scene {
    let wall = Material {
        emission: Vec3::ONE,
        base_texture: Some(0),
        ..Material::lambertian("wall", Vec3::splat(albedo))
    };
    let mut scene = textured_room(wall);
    for attributes in &mut scene.attributes {
        attributes.colours = [[colour, colour, colour, 1.0]; 3];
    }
    // Repeated along one axis, mirrored along the other, the texture has one value everywhere.
    let repeated = Texture { wrap: [Wrap::Mirror, Wrap::Repeat], ..Texture::new(0) };
    with_texture(scene, image(3, Encoding::Linear, vec![[texel; 4]; 6]), repeated)
}

#[test]
fn a_textured_furnace_has_uniform_radiance() {
    for (albedo, texel, colour) in [(1.0, 128, 1.0), (0.8, 255, 0.5), (0.9, 204, 0.75)] {
        let scene = furnace(albedo, texel, colour);
        let reflected = f64::from(albedo) * f64::from(texel) / 255.0 * f64::from(colour);
        let found = mean(&radiances(&render_or_panic(&scene, &settings()).film));
        assert!((found * (1.0 - reflected) - 1.0).abs() < 0.01, "{found} with an albedo of {reflected}");
    }
}

/// Green and blue of the texture are roughness and metalness: one half is metal of roughness 0.3, the other a
/// rough dielectric.
#[test]
fn roughness_and_metalness_follow_their_texture() {
    let reflection = Reflection::MetallicRoughness {
        base_colour: Vec3::new(0.8, 0.4, 0.2),
        metallic: 1.0,
        roughness: 1.0,
        dielectric: Vec3::splat(0.04),
        grazing: 1.0,
        transmission: None,
    };
    let material = Material { metallic_roughness_texture: Some(0), ..Material::new("plate", reflection) };
    let nearest = Texture { nearest: true, ..Texture::new(0) };
    let texels = vec![[0, 77, 255, 255], [0, 255, 0, 255]];
    let mut scene = with_texture(canvas(material), image(2, Encoding::Linear, texels), nearest);
    scene.materials.push(Material { emission: Vec3::ONE, ..lambertian("lamp", 0.0) });
    let corner = |x: f32, y: f32| Vec3::new(-x, y, 3.0);
    scene.triangles.extend(quad([corner(-9., -9.), corner(9., -9.), corner(9., 9.), corner(-9., 9.)], 1));
    let film = film(&scene);
    let albedo = |x: u32| Vec3::from(film.pixel(x, 24).unwrap().albedo);
    // Directional albedos at a cosine of 0.95, by quadrature of the GGX lobe.
    let metal = Vec3::new(0.792, 0.396, 0.198);
    assert!((albedo(10) - metal).abs().max_element() < 0.005, "{}", albedo(10));
    let (coat, fresnel) = (0.013, 0.04);
    let dull = Vec3::new(0.8, 0.4, 0.2) * (1.0 - fresnel) + coat;
    assert!((albedo(37) - dull).abs().max_element() < 0.005, "{}", albedo(37));
}

/// With a texture of metalness 0, a material with the factors of a mirror is a dielectric: photons are stored
/// on it, and their disc fractions are measured. With a texture of metalness 1 it stays a mirror.
#[test]
fn a_texture_decides_where_a_material_is_a_mirror() {
    let film = |metallic, texture: Option<u8>| {
        let reflection = Reflection::MetallicRoughness {
            base_colour: Vec3::splat(0.8),
            metallic,
            roughness: 0.0,
            dielectric: Vec3::ZERO,
            grazing: 0.0,
            transmission: None,
        };
        let wall = Material {
            emission: Vec3::ONE,
            metallic_roughness_texture: texture.map(|_| 0),
            ..Material::new("wall", reflection)
        };
        let image = image(2, Encoding::Linear, vec![[0, 255, texture.unwrap_or(0), 255]; 2]);
        let nearest = Texture { nearest: true, ..Texture::new(0) };
        let mut scene = with_texture(textured_room(wall), image, nearest);
        scene.materials.push(lambertian("floor", 0.5));
        let floor = scene.triangles.iter_mut().filter(|triangle| triangle.vertices.iter().all(|v| v.y < 0.0));
        floor.for_each(|triangle| triangle.material = 1);
        radiances(&render_or_panic(&scene, &settings().with(|s| s.integrator.samples = 1)).film)
    };
    assert_eq!(film(1.0, Some(0)), film(0.0, None), "no metal is left");
    assert_eq!(film(1.0, Some(255)), film(1.0, None), "all metal is left");
}

/// A lattice with cut-outs is before a lamp: eye, shadow and gather rays and photons pass its holes.
#[test]
fn cut_outs_let_light_through() {
    let lamp = Material { emission: Vec3::ONE, ..lambertian("lamp", 0.0) };
    let lattice = Material {
        alpha_cutoff: Some(0.5),
        base_texture: Some(0),
        double_sided: true,
        ..lambertian("lattice", 0.0)
    };
    let sky = |alpha: [u8; 4]| {
        let view = camera(Vec3::new(0.0, 0.5, 0.9), Vec3::new(0.0, -0.5, -0.9));
        let materials = vec![lamp.clone(), lambertian("floor", 0.8), lattice.clone()];
        let mut scene = scene(room([1, 1, 1, 0, 1, 1]), materials, view);
        let corners = [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.]].map(|[x, z]| Vec3::new(x, 0.7, z));
        add_textured_quad(&mut scene, corners, [[0., 0.], [8., 0.], [8., 8.], [0., 8.]], 2);
        let texels = alpha.map(|alpha| [255, 255, 255, alpha]).to_vec();
        let nearest = Texture { nearest: true, ..Texture::new(0) };
        let scene = with_texture(scene, image(2, Encoding::Srgb, texels), nearest);
        mean(&radiances(&render_or_panic(&scene, &settings().with(|s| s.integrator.samples = 1)).film))
    };
    let [closed, open] = [[255; 4], [0; 4]].map(sky);
    // A gather close below the lattice may still find photons of the walls above it.
    assert!(closed < 0.01 * open, "{closed} of {open}");
    let half = sky([0, 255, 255, 0]);
    let bare = {
        let view = camera(Vec3::new(0.0, 0.5, 0.9), Vec3::new(0.0, -0.5, -0.9));
        let scene = scene(room([1, 1, 1, 0, 1, 1]), vec![lamp.clone(), lambertian("floor", 0.8)], view);
        mean(&radiances(&render_or_panic(&scene, &settings().with(|s| s.integrator.samples = 1)).film))
    };
    assert!((open / bare - 1.0).abs() < 0.01, "{open} {bare}");
    assert!(half > 0.15 * open && half < 0.5 * open, "{half} of {open}");
}

/// A share 1 - alpha of eye, shadow and gather rays and of photons passes a sheet of partial coverage.
#[test]
fn an_alpha_of_a_half_lets_half_of_the_light_through() {
    let lamp = Material { emission: Vec3::ONE, ..lambertian("lamp", 0.0) };
    let sheet = |alpha| Material { blends: true, alpha, double_sided: true, ..lambertian("sheet", 0.0) };
    let light = |alpha: f32| {
        let view = camera(Vec3::new(0.0, 0.5, 0.9), Vec3::new(0.0, -0.5, -0.9));
        let materials = vec![lamp.clone(), lambertian("floor", 0.8), sheet(alpha)];
        let mut scene = scene(room([1, 1, 1, 0, 1, 1]), materials, view);
        let corners = [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.]].map(|[x, z]| Vec3::new(x, 0.7, z));
        add_textured_quad(&mut scene, corners, [[0., 0.], [8., 0.], [8., 8.], [0., 8.]], 2);
        mean(&radiances(&render_or_panic(&scene, &settings()).film))
    };
    let open = light(0.0);
    // The sheet absorbs light on both sides, and each path from below to the lamp passes it at least once.
    for alpha in [0.25_f32, 0.75] {
        let found = light(alpha) / open;
        let most = f64::from(1.0 - alpha);
        assert!(found < most && found > 0.7 * most, "{alpha}: {found}");
    }
}

/// The picture shows alpha times the sheet's emission plus 1 - alpha times the emission of the lamp behind
/// it.
#[test]
fn a_sheet_shows_alpha_of_itself_and_the_rest_of_the_background() {
    let sheet = Material {
        blends: true,
        alpha: 0.3,
        base_texture: Some(0),
        emission: Vec3::splat(4.0),
        double_sided: true,
        ..lambertian("sheet", 0.0)
    };
    let lamp = Material { emission: Vec3::ONE, ..lambertian("lamp", 0.0) };
    let view = camera(Vec3::new(0.0, 0.0, 0.5), Vec3::NEG_Z);
    let mut scene = scene(room([0; 6]), vec![lamp, sheet], view);
    let corners = [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.]].map(|[x, y]| Vec3::new(x, y, 0.0));
    add_textured_quad(&mut scene, corners, [[0., 0.], [8., 0.], [8., 8.], [0., 8.]], 1);
    let scene = with_texture(scene, image(1, Encoding::Srgb, vec![[255, 255, 255, 128]]), Texture::new(0));
    let found =
        mean(&radiances(&render_or_panic(&scene, &settings().with(|s| s.integrator.samples = 64)).film));
    let alpha = 0.3 * 128.0 / 255.0;
    let expected = alpha * 4.0 + (1.0 - alpha);
    assert!((found / expected - 1.0).abs() < 0.01, "{found}, not {expected}");
}

/// As glTF culls back faces, rays and photons pass the back of a one-sided sheet.
#[test]
fn the_back_of_a_one_sided_sheet_of_partial_coverage_is_culled() {
    let sheet = Material { blends: true, alpha: 0.9, ..lambertian("sheet", 0.0) };
    let lamp = Material { emission: Vec3::ONE, ..lambertian("lamp", 0.0) };
    for (sign, expected) in [(1.0, 0.1), (-1.0, 1.0)] {
        let view = camera(Vec3::new(0.0, 0.0, 0.5), Vec3::NEG_Z);
        let mut scene = scene(room([0; 6]), vec![lamp.clone(), sheet.clone()], view);
        let corners = [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.]].map(|[x, y]| Vec3::new(x * sign, y, 0.0));
        scene.triangles.extend(quad(corners, 1));
        let settings = settings().with(|s| s.integrator.samples = 64);
        let found = mean(&radiances(&render_or_panic(&scene, &settings).film));
        assert!((found - expected).abs() < 0.01, "{found}, not {expected}");
    }
}

/// A sheet without loss is invisible in a furnace: photons are stored on it with the probability with which
/// gathers look for them.
#[test]
fn a_sheet_of_partial_coverage_is_invisible_in_a_furnace() {
    let wall = Material { emission: Vec3::splat(0.5), ..lambertian("wall", 0.5) };
    let sheet = Material { blends: true, alpha: 0.4, double_sided: true, ..lambertian("sheet", 1.0) };
    let view = camera(Vec3::new(0.1, 0.05, 0.9), Vec3::new(-0.1, -0.05, -1.0));
    let mut scene = scene(room([0; 6]), vec![wall, sheet], view);
    let corners =
        [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.]].map(|[x, y]| Vec3::new(0.6 * x, 0.6 * y, 0.1 * x));
    scene.triangles.extend(quad(corners, 1));
    let found = radiances(&render_or_panic(&scene, &settings().with(|s| s.photons.count = 200_000)).film);
    let error = mean(&found) - 1.0;
    assert!(error.abs() < 0.012, "{error}");
}

/// Interpolated normals are those of the ball, however few facets it has.
#[test]
fn smooth_normals_are_interpolated_between_corners() {
    let mut ball = scene(Vec::new(), vec![Material { emission: Vec3::ONE, ..lambertian("ball", 0.0) }], {
        let mut view = camera(Vec3::new(0.0, 0.0, 4.0), Vec3::NEG_Z);
        view.projection = Projection::perspective(0.4);
        view
    });
    add_ball(&mut ball, Vec3::ZERO, 1.0, 12, 0);
    let mut worst = 0.0_f32;
    let mut places = 0;
    for (index, pixel) in film(&ball).pixels().enumerate() {
        let [x, y] = [index % 48, index / 48].map(|i| (i as f32 + 0.5) / 24.0 - 1.0);
        // At the silhouette, facets lie far inside the ball.
        if x * x + y * y > 0.4 {
            continue;
        }
        places += 1;
        let direction = Vec3::new(x * 0.2_f32.tan(), -y * 0.2_f32.tan(), -1.0).normalize();
        // Point of the unit ball on the pixel's ray.
        let along = 4.0 * -direction.z;
        let position =
            Vec3::new(0.0, 0.0, 4.0) + direction * (along - (along * along - 15.0).max(0.0).sqrt());
        worst = worst.max((Vec3::from(pixel.normal).normalize() - position).length());
    }
    // The geometric normal of a facet differs from the ball's by up to 0.13.
    assert!(worst < 0.03 && places > 600, "{worst} at {places} places");
}
