//! Cameras of known pictures: lens shift, orthographic, panorama, thin lens.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::Vec3;
use photoncard_driver::film::Film;
use photoncard_driver::render::{Integrator, PhotonMaps, Picture, RenderSettings};
use photoncard_driver::scene::{Aperture, Camera, Lens, Material, Projection, Scene, gltf};
use photoncard_tests::{camera, lambertian, mean, quad, radiances, render_or_panic, room, scene};

fn settings(width: u32, height: u32, samples: u32) -> RenderSettings {
    RenderSettings {
        picture: Picture { width, height, ..Picture::default() },
        photons: PhotonMaps { count: 1000, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 0, shadow_rays: 1, samples, ..Integrator::default() },
        ..RenderSettings::default()
    }
}

/// Material that emits this radiance, W/(sr m^2), and reflects nothing.
fn lamp(radiance: f32) -> Material {
    Material { emission: Vec3::splat(radiance), double_sided: true, ..lambertian("lamp", 0.0) }
}

/// A square in the plane `z = 0` that emits radiance 1, seen along -z.
fn square(half: f32, view: Camera) -> Scene {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let corners = corners.map(|[x, y]: [f32; 2]| Vec3::new(half * x, half * y, 0.0));
    scene(quad(corners, 0).to_vec(), vec![lamp(1.0)], view)
}

/// Camera at distance `distance` from the plane `z = 0`, before its origin.
fn before(distance: f32, projection: Projection) -> Camera {
    Camera { projection, ..camera(Vec3::Z * distance, Vec3::NEG_Z) }
}

fn film(scene: &Scene, settings: &RenderSettings) -> Film {
    render_or_panic(scene, settings).film
}

/// Room whose walls emit 1, 2, 4, 8, 16 and 32, in the order -x, +x, -y, +y, -z, +z.
fn coloured_room(view: Camera) -> Scene {
    let lamps = (0..6).map(|wall| lamp((1 << wall) as f32)).collect();
    scene(room([0, 1, 2, 3, 4, 5]), lamps, view)
}

/// Radiance and distance of the wall of [`coloured_room`] in a direction from its middle.
fn wall(direction: Vec3) -> (f32, f32) {
    let axis = direction.abs().max_position();
    let side = usize::from(direction[axis] > 0.0);
    ((1 << (2 * axis + side)) as f32, 1.0 / direction[axis].abs())
}

#[test]
fn an_orthographic_picture_shows_its_height_at_every_distance() {
    for distance in [0.5, 3.0, 40.0] {
        let view = before(distance, Projection::Orthographic { half_height: 2.0 });
        let film = film(&square(0.5, view), &settings(64, 32, 1));
        for (index, pixel) in film.pixels().enumerate() {
            let [column, row] = [index as i32 % 64, index as i32 / 32 / 2];
            // The square is 8 of 32 pixels high, in the middle.
            let is_seen = (28..36).contains(&column) && (12..20).contains(&row);
            assert_eq!(pixel.radiance, [f32::from(u8::from(is_seen)); 3], "{column} {row}");
            assert_eq!(pixel.depth.is_finite(), is_seen);
            assert!(!is_seen || (pixel.depth / distance - 1.0).abs() < 1e-4, "{}", pixel.depth);
        }
    }
}

#[test]
fn a_panorama_shows_every_direction_with_its_distance() {
    let right = Vec3::new(0.6, 0.0, 0.8);
    let (forward, up) = (Vec3::Y.cross(right), Vec3::Y);
    for angles in [[2.0 * PI, PI], [PI, PI], [1.0, 0.5]] {
        let view = Camera::perspective("eye", Vec3::ZERO, [right, up, forward], 1.0, None);
        let view = Camera { projection: Projection::Panorama { angles }, ..view };
        let (width, height) = (64, 32);
        let film = film(&coloured_room(view), &settings(width, height, 1));
        let mut on_edges = 0;
        for (index, pixel) in film.pixels().enumerate() {
            let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| {
                let place = |number: u32, side: u32| number as f32 / side as f32 - 0.5;
                let [x, y] =
                    [place(index as u32 % width + dx, width), place(index as u32 / width + dy, height)];
                let (longitude, latitude) = (angles[0] * x, -angles[1] * y);
                let around = longitude.cos() * forward + longitude.sin() * right;
                wall(latitude.cos() * around + latitude.sin() * up)
            });
            let [(radiance, _), ..] = corners;
            if corners.iter().any(|corner| corner.0 != radiance) {
                on_edges += 1;
                continue;
            }
            assert_eq!(pixel.radiance, [radiance; 3], "pixel {index} of {angles:?}");
            let (least, most) = corners
                .iter()
                .fold((f32::MAX, 0.0_f32), |(least, most), corner| (least.min(corner.1), most.max(corner.1)));
            let tolerance = 0.02 * most;
            assert!((least - tolerance..most + tolerance).contains(&pixel.depth), "{index}: {}", pixel.depth);
        }
        assert!(on_edges < 400, "{on_edges} pixels show two walls");
    }
}

/// The mean of a full panorama over latitudes, weighted by their cosine, is the mean over the sphere. A cube
/// shows each of its six walls in the same solid angle.
#[test]
fn solid_angles_of_a_panorama_are_those_of_the_sphere() {
    let view = Camera {
        projection: Projection::Panorama { angles: [2.0 * PI, PI] },
        ..camera(Vec3::ZERO, Vec3::NEG_Z)
    };
    let (width, height) = (128, 64);
    let film = film(&coloured_room(view), &settings(width, height, 4));
    let (mut light, mut weights) = (0.0, 0.0);
    for (index, pixel) in film.pixels().enumerate() {
        let latitude = PI * ((index as u32 / width) as f32 + 0.5 - height as f32 / 2.0) / height as f32;
        let weight = f64::from(latitude.cos());
        light += weight * f64::from(pixel.radiance[0]);
        weights += weight;
    }
    assert!((light / weights / (63.0 / 6.0) - 1.0).abs() < 3e-3, "{}", light / weights);
}

#[test]
fn a_shifted_picture_is_a_part_of_a_larger_one() {
    let wide = camera(Vec3::new(0.2, -0.1, 0.3), Vec3::new(0.3, 0.2, -1.0));
    // The right half of the wide picture, and its upper right quarter.
    let half = Camera { shift: [0.5, 0.0], ..wide.clone() };
    let quarter = Camera {
        shift: [0.5, 0.25],
        projection: Projection::perspective(2.0 * (0.5 * 1.0_f32).atan()),
        ..wide.clone()
    };
    let depths = |view: &Camera, width, height| {
        let film = film(&coloured_room(view.clone()), &settings(width, height, 16));
        film.pixels().map(|pixel| pixel.depth).collect::<Vec<_>>()
    };
    let whole = depths(&wide, 128, 64);
    for (view, width, height, [left, above]) in [(half, 64, 64, [64, 0]), (quarter, 64, 32, [64, 0])] {
        let part = depths(&view, width, height);
        let errors = part.iter().enumerate().map(|(index, depth)| {
            let [column, row] = [index as u32 % width + left, index as u32 / width + above];
            (depth / whole[(row * 128 + column) as usize] - 1.0).abs()
        });
        let (sum, most) = errors.fold((0.0, 0.0_f32), |(sum, most), error| (sum + error, most.max(error)));
        let mean = sum / part.len() as f32;
        // Samples of a pixel lie elsewhere in it, by other random numbers.
        assert!(mean < 0.003 && most < 0.1, "{mean} {most}");
    }
}

/// The picture of a small lamp out of focus is a disc. With the lens radius r, the plane in focus at f and
/// the lamp at d, its radius at distance 1 is `r |1/f - 1/d|`.
#[test]
fn a_lens_spreads_a_lamp_over_its_circle_of_confusion() {
    let (distance, radius) = (4.0, 0.25);
    let side = 64;
    let per_pixel = 2.0 * (0.5 * 0.4_f32).tan() / side as f32;
    let sharp =
        film(&square(0.02, before(distance, Projection::perspective(0.4))), &settings(side, side, 512));
    for focus in [2.0, 4.0, 8.0, 100.0] {
        let view =
            Camera { lens: Some(Lens { radius, focus }), ..before(distance, Projection::perspective(0.4)) };
        let blurred = film(&square(0.02, view), &settings(side, side, 512));
        let [light, before] = [&blurred, &sharp].map(|film| mean(&radiances(film)));
        assert!(
            (light / before - 1.0).abs() < 0.03,
            "focus {focus}: the light changes by {}",
            light / before
        );
        let disc = radius * (1.0 / focus - 1.0 / distance).abs();
        let [spread, own] = [&blurred, &sharp].map(|film| mean_square_radius(film) * per_pixel * per_pixel);
        // A disc has the mean square radius R^2 / 2.
        let found = (2.0 * (spread - own).max(0.0)).sqrt();
        assert!((found - disc).abs() < 0.025 * disc + 2e-4, "focus {focus}: {found}, not {disc}");
    }
}

/// Mean square of the distance from the picture's middle, weighted by radiance, pixels^2.
fn mean_square_radius(film: &Film) -> f32 {
    let side = (film.pixels().count() as f32).sqrt() as usize;
    let (mut moment, mut light) = (0.0, 0.0);
    for (index, pixel) in film.pixels().enumerate() {
        let place = |number: usize| number as f32 + 0.5 - side as f32 / 2.0;
        let (x, y) = (place(index % side), place(index / side));
        moment += pixel.radiance[0] * (x * x + y * y);
        light += pixel.radiance[0];
    }
    moment / light
}

/// In a room of constant radiance, every camera sees that radiance in each pixel.
#[test]
fn every_camera_sees_the_radiance_of_a_furnace() {
    let furnace = |view: Camera| {
        let wall = Material { emission: Vec3::splat(0.5), ..lambertian("wall", 0.5) };
        scene(room([0; 6]), vec![wall], view)
    };
    let middle = || camera(Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.3, -0.2, -1.0));
    for view in [
        Camera { shift: [0.3, -0.4], lens: Some(Lens { radius: 0.05, focus: 0.4 }), ..middle() },
        Camera { projection: Projection::Orthographic { half_height: 0.3 }, ..middle() },
        Camera { projection: Projection::Panorama { angles: [2.0 * PI, PI] }, ..middle() },
        Camera { projection: Projection::Panorama { angles: [FRAC_PI_2, 0.3] }, ..middle() },
    ] {
        for irradiance_error in [None, Some(0.1)] {
            let settings = settings(24, 16, 4).with(|settings| {
                settings.photons.count = 60_000;
                settings.integrator.gather_rays = 64;
                settings.integrator.irradiance_error = irradiance_error;
            });
            let rendered = radiances(&film(&furnace(view.clone()), &settings));
            assert!((mean(&rendered) - 1.0).abs() < 0.02, "{view:?}: {}", mean(&rendered));
            for pixel in rendered {
                assert!((pixel[0] - 1.0).abs() < 0.15, "{view:?} {irradiance_error:?}: {pixel:?}");
            }
        }
    }
}

/// Surfaces in focus have irradiance records, blurred ones have gather rays of their own: neither changes the
/// light.
#[test]
fn the_irradiance_cache_holds_behind_a_lens() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell.gltf");
    let scene = gltf::load(path.as_ref()).expect("a shipped scene loads");
    for adaptive_threshold in [None, Some(0.3)] {
        let picture = |irradiance_error| {
            let settings = settings(32, 32, 8).with(|settings| {
                settings.picture.aperture = Some(Aperture::Diameter(0.3));
                settings.picture.focus = Some(3.0);
                settings.photons.count = 20_000;
                settings.photons.neighbors = 30;
                settings.integrator.gather_rays = 64;
                settings.integrator.shadow_rays = 2;
                settings.integrator.irradiance_error = irradiance_error;
                settings.integrator.adaptive_threshold = adaptive_threshold;
            });
            render_or_panic(&scene, &settings)
        };
        let [cached, gathered] = [Some(0.05), None].map(picture);
        let share = cached.statistics.interpolated_share;
        assert!((0.05..0.98).contains(&share), "{share} of the samples are interpolated");
        let [light, expected] = [&cached, &gathered].map(|rendering| mean(&radiances(&rendering.film)));
        assert!((light / expected - 1.0).abs() < 0.015, "{light} {expected}");
    }
}
