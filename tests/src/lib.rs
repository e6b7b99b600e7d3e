//! Helpers of integration tests: small scenes, renders of them, and a card on a link.
#![forbid(unsafe_code)]

/// The kind of chip in `docs/bring-up.md` compiles.
#[cfg(doctest)]
#[doc = include_str!("../../docs/bring-up.md")]
struct BringUp;

pub mod everything;
pub mod fuzz;
pub mod hostile;
pub mod lru;
pub mod mapped;
pub mod operations;
pub mod shapes;
pub mod wire;

use std::io::Write;

use glam::Vec3;
use photoncard_driver::film::Film;
use photoncard_driver::render::{RenderSettings, Rendering, Unobserved, render};
use photoncard_driver::scene::{Camera, Material, Reflection, Scene, SceneContents, Transmission, Triangle};

/// Prints `what`, which says what is not tested, even if the test passes.
///
/// # Panics
/// In continuous integration, where all tools are installed.
pub fn skip(what: &str) {
    assert!(std::env::var_os("CI").is_none(), "{what}");
    // A closed standard error does not end the test.
    let _ = writeln!(std::io::stderr(), "SKIPPED: {what}");
}

/// Creates a grey, one-sided Lambertian material that does not emit.
pub fn lambertian(name: &str, albedo: f32) -> Material {
    Material::lambertian(name, Vec3::splat(albedo))
}

/// Creates smooth clear glass with this base colour and index of refraction 1.5, as a solid or a thin wall.
pub fn glass(name: &str, base_colour: Vec3, is_volume: bool) -> Material {
    let transmission = Transmission { factor: 1.0, ior: 1.5, is_volume, absorption: Vec3::ZERO };
    let reflection = Reflection::MetallicRoughness {
        base_colour,
        metallic: 0.0,
        roughness: 0.0,
        dielectric: Vec3::splat(0.04),
        grazing: 1.0,
        transmission: Some(transmission),
    };
    Material::new(name, reflection)
}

/// Two triangles of a quadrilateral. `corners` are counter-clockwise seen from its front.
pub fn quad(corners: [Vec3; 4], material: u32) -> [Triangle; 2] {
    let [a, b, c, d] = corners;
    [Triangle::new([a, b, c], material), Triangle::new([a, c, d], material)]
}

/// Creates the six walls of the cube from -1 to 1, which face inwards, in the order -x, +x, -y, +y, -z, +z.
pub fn room(materials: [u32; 6]) -> Vec<Triangle> {
    let axes = [Vec3::X, Vec3::Y, Vec3::Z];
    let mut triangles = Vec::new();
    for (axis, pair) in materials.as_chunks::<2>().0.iter().enumerate() {
        for (side, &material) in [-1.0, 1.0].into_iter().zip(pair) {
            let (n, u) = (axes[axis] * side, axes[(axis + 1) % 3]);
            // The front faces inwards: u, v and -n are a right-handed frame.
            let v = (-n).cross(u);
            triangles.extend(quad([n - u - v, n + u - v, n + u + v, n - u + v], material));
        }
    }
    triangles
}

/// Creates a camera with a vertical field of view of 90 degrees, upright along +y.
pub fn camera(origin: Vec3, forward: Vec3) -> Camera {
    let forward = forward.normalize();
    let right = forward.cross(Vec3::Y).normalize();
    let axes = [right, right.cross(forward), forward];
    Camera::perspective("camera", origin, axes, std::f32::consts::FRAC_PI_2, None)
}

/// Creates a scene of triangles, materials and one camera.
pub fn scene(triangles: Vec<Triangle>, materials: Vec<Material>, camera: Camera) -> Scene {
    Scene::from(SceneContents { triangles, materials, cameras: vec![camera], ..SceneContents::default() })
}

/// Renders a scene.
///
/// # Panics
/// If the render fails, with the reason.
pub fn render_or_panic(scene: &Scene, settings: &RenderSettings) -> Rendering {
    render(scene, settings, &Unobserved).unwrap_or_else(|error| panic!("{error}"))
}

/// Radiance of each pixel of a film, row by row, W/(sr m^2).
pub fn radiances(film: &Film) -> Vec<[f32; 3]> {
    film.pixels().map(|pixel| pixel.radiance).collect()
}

/// Mean over all pixels and channels, W/(sr m^2).
pub fn mean(radiances: &[[f32; 3]]) -> f64 {
    let sum: f64 = radiances.as_flattened().iter().map(|&channel| channel as f64).sum();
    sum / (3 * radiances.len()) as f64
}

/// Runs `work` on a thread with 16 MiB of stack, on which the buffers of a card are built.
///
/// # Panics
/// If the work panics, or the thread cannot be started.
pub fn with_room_for_a_card(work: impl FnOnce() + Send) {
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().stack_size(16 << 20).spawn_scoped(scope, work);
        let result = thread.expect("the system has a thread").join();
        result.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
    });
}
