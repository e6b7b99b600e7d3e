//! Pixels depend on the settings in a picture's provenance, and on no other settings.

use std::path::Path;

use photoncard_driver::display::DisplaySettings;
use photoncard_driver::emulator::trace::{TraceFormat, TraceSettings};
use photoncard_driver::film::{Film, Window};
use photoncard_driver::layer::Layers;
use photoncard_driver::partial::PartialSettings;
use photoncard_driver::parts::Part;
use photoncard_driver::photon_map::{PhotonLayout, PhotonsFor};
use photoncard_driver::render::{
    CardAddress, CardSet, Filter, Integrator, PhotonMaps, Picture, Radiance, RenderSettings, Sampling,
    Schedule, Setting, TileOutputs,
};
use photoncard_driver::scene::{Aperture, Lens, Projection, Scene};
use photoncard_driver::scheduler::GatherOrder;
use photoncard_driver::study::{Point, Scale};
use photoncard_tests::everything::everything;
use photoncard_tests::{camera, lambertian, quad, render_or_panic, scene};

/// Settings of a small picture, of which [`changes`] replaces one field at a time.
fn settings() -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 12, height: 10, ..Picture::default() },
        photons: PhotonMaps {
            count: 2000,
            neighbors: 20,
            caustic_photons: Some(1000),
            caustic_neighbors: 20,
            ..PhotonMaps::default()
        },
        integrator: Integrator { gather_rays: 8, shadow_rays: 2, ..Integrator::default() },
        cards: CardSet { addresses: cards("emulated:1"), ..CardSet::default() },
        ..RenderSettings::default()
    }
}

fn cards(text: &str) -> Vec<CardAddress> {
    vec![text.parse().expect("an address")]
}

/// Results that depend on a setting.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Dependence {
    /// Pixels and card image.
    Image,
    /// Pixels only.
    Pixels,
    /// Card image, but no pixel.
    Layout,
    /// Work of a chip, but no pixel.
    Work,
    /// Neither pixels nor work.
    Nothing,
}

/// Lists a change for each field, as (name, what depends on it, settings). It does not compile if a field is
/// missing.
macro_rules! changes {
    ($($group:ident: $type:ident { $($field:ident: $dependence:ident = $value:expr),+ $(,)? })+) => {{
        let RenderSettings { $($group: $type { $($field: _),+ }),+ } = settings();
        vec![$($((
            concat!(stringify!($group), ".", stringify!($field)),
            Dependence::$dependence,
            settings().with(|s| s.$group.$field = $value),
        )),+),+]
    }};
}

fn changes(folder: &Path) -> Vec<(&'static str, Dependence, RenderSettings)> {
    let mut changes = changes! {
        picture: Picture {
            width: Pixels = 13,
            height: Pixels = 11,
            crop: Pixels = Some(Window { x0: 2, x1: 9, y0: 1, y1: 8 }),
            camera: Pixels = Some("second".to_owned()),
            camera_at: Pixels = Some([0.1, 0.2, 2.0]),
            look_at: Pixels = Some([0.1, 0.2, -0.3]),
            up: Pixels = Some([0.1, 1.0, 0.0]),
            fov: Pixels = Some(20.0),
            orthographic: Pixels = Some(1.0),
            panorama: Pixels = Some([90.0, 60.0]),
            shift: Pixels = Some([0.1, -0.2]),
            aperture: Pixels = Some(Aperture::Diameter(0.3)),
            focus: Pixels = Some(0.7),
            layers: Pixels = Layers::all(),
            light_groups: Pixels = vec!["rest".to_owned()],
            filter: Pixels = Filter::Gaussian,
            transparent: Pixels = true,
            irradiance: Pixels = true,
            lumens_per_watt: Nothing = Some(683.0),
        }
        photons: PhotonMaps {
            count: Image = 2001,
            photons_for: Image = PhotonsFor::Camera,
            layout: Layout = PhotonLayout::Jensen,
            neighbors: Image = 19,
            max_distance: Image = Some(0.2),
            caustic_photons: Image = Some(900),
            caustic_neighbors: Image = 19,
            radiance: Image = Radiance::Precomputed,
        }
        integrator: Integrator {
            seed: Image = 1,
            samples: Pixels = 2,
            // Without the irradiance cache, planned samples have no effect.
            planned_samples: Nothing = Some(5),
            gather_rays: Pixels = 9,
            shadow_rays: Pixels = 3,
            sampling: Pixels = Sampling::Reflection,
            irradiance_error: Pixels = Some(0.5),
            adaptive_threshold: Pixels = Some(0.1),
            near_distance: Pixels = Some(0.3),
        }
        schedule: Schedule {
            tile: Work = Some(5),
            order: Work = GatherOrder::Naive,
            bins: Work = Some(7),
            queue: Work = Some(9),
            in_flight: Work = Some(1),
            focus: Nothing = Some([3, 4]),
            // The only part is the whole picture.
            part: Nothing = Part::new(1, 1),
            // Without the irradiance cache, there are no records to keep.
            keep_records: Nothing = true,
        }
        cards: CardSet {
            addresses: Nothing = cards("emulated-micro:2"),
            faults: Nothing = Some("flips=1e-5,seed=1".parse().expect("faults")),
            verify: Nothing = Some(0.5),
            caches: Nothing = Some("unified=8K/128/2".parse().expect("caches")),
            trace: Nothing = Some(TraceSettings {
                path: folder.join("reads.din.gz"),
                format: TraceFormat::Dinero,
                has_labels: true,
            }),
        }
        outputs: TileOutputs {
            partial: Nothing = Some(PartialSettings { path: folder.join("a.exr.partial"), resume: false }),
            // No display server listens at this address.
            display: Nothing = Some(DisplaySettings {
                address: "127.0.0.1:1".parse().expect("an address"),
                image: "a.exr".to_owned(),
            }),
        }
    };
    for (.., settings) in &mut changes {
        if settings.cards.verify.is_some() {
            settings.cards.addresses = cards("emulated:2");
        }
    }
    changes
}

/// Scene with every feature, and half of the wall before the camera open to the sky, seen by two cameras.
fn with_two_cameras() -> Scene {
    let mut scene = everything();
    scene.cameras[0].lens = Some(Lens { radius: 0.05, focus: 1.5 });
    scene.triangles.remove(8);
    let mut second = scene.cameras[0].clone();
    second.name = "second".into();
    second.projection = Projection::perspective(0.9 * second.vertical_fov().unwrap());
    scene.cameras.push(second);
    scene
}

/// The scene with the light groups of the settings, the first of which has the sky.
fn with_groups(scene: &Scene, settings: &RenderSettings) -> Scene {
    let mut scene = scene.clone();
    let requests: Vec<_> =
        settings.picture.light_groups.iter().map(|name| format!("{name}=environment")).collect();
    scene.set_light_groups(&requests).expect("there is a sky");
    scene
}

/// Size, window, and `f32::to_bits` of all pixels and layers of a film.
fn bits(film: &Film) -> Vec<u32> {
    let window = film.window();
    let size = [film.width(), film.height(), window.x0, window.x1, window.y0, window.y1];
    let pixels = film.all().flat_map(|film| {
        let pixel = [film.pixel.radiance, film.pixel.albedo, film.pixel.normal];
        let layers = [film.layers.direct, film.layers.indirect, film.layers.caustic];
        let single = [film.pixel.depth, film.layers.gathers, film.alpha];
        pixel
            .into_iter()
            .chain(layers)
            .chain([film.position])
            .chain(film.light_groups)
            .flatten()
            .chain(single)
            .map(f32::to_bits)
            .collect::<Vec<_>>()
    });
    size.into_iter().chain(pixels).collect()
}

fn point(settings: &RenderSettings) -> Point {
    Scale::QUICK.whole("cornell.gltf", settings.clone())
}

#[test]
fn a_setting_is_in_the_identity_of_a_picture_exactly_if_pixels_depend_on_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = with_two_cameras();
    let expected = bits(&render_or_panic(&scene, &settings()).film);
    let mut differing = 0;
    for (name, dependence, changed) in changes(folder.path()) {
        assert!(changed != settings(), "{name} is not changed");
        let is_of_pixels = matches!(dependence, Dependence::Image | Dependence::Pixels);
        let found = bits(&render_or_panic(&with_groups(&scene, &changed), &changed).film);
        assert_eq!(found != expected, is_of_pixels, "the pixels by {name}");
        assert_eq!(changed.of_pixels() != settings().of_pixels(), is_of_pixels, "{name}");
        assert_eq!(changed.identity(&scene) != settings().identity(&scene), is_of_pixels, "{name}");
        differing += usize::from(is_of_pixels);
    }
    // Width and height are two fields, and one option. Transparency, irradiance and light groups are stated
    // only where there are any.
    assert_eq!(settings().of_pixels().len(), differing - 4);
}

#[test]
fn options_name_the_fields_that_they_state() {
    let folder = tempfile::tempdir().expect("a folder");
    let fields: Vec<_> = changes(folder.path()).into_iter().map(|(field, ..)| field).collect();
    for Setting { field, option, .. } in settings().options() {
        let is_it = |name: &&str| {
            field.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        };
        assert!(fields.iter().any(is_it), "--{option} states {field}");
    }
}

#[test]
fn a_setting_is_in_the_key_of_a_point_exactly_if_its_result_depends_on_it() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, dependence, changed) in changes(folder.path()) {
        let [old, new] = [settings(), changed].map(|settings| point(&settings));
        assert_eq!(old.key("") != new.key(""), dependence != Dependence::Nothing, "the key by {name}");
        let is_of_image = matches!(dependence, Dependence::Image | Dependence::Layout);
        assert_eq!(old.image_key() != new.image_key(), is_of_image, "the image by {name}");
    }
}

#[test]
fn settings_of_the_caustic_map_are_not_in_the_identity_of_a_scene_without() {
    let view = camera(glam::Vec3::Z, -glam::Vec3::Z);
    let corners = [[-1., -1.], [1., -1.], [1., 1.], [-1., 1.]].map(|[x, y]| glam::Vec3::new(x, y, 0.0));
    let dull = scene(quad(corners, 0).into(), vec![lambertian("wall", 0.5)], view);
    let identity = |scene: &Scene, photons, neighbors| {
        let settings = settings().with(|s| {
            s.photons.caustic_photons = photons;
            s.photons.caustic_neighbors = neighbors;
        });
        settings.identity(scene)
    };
    for (photons, neighbors) in [(Some(0), 50), (Some(9), 50), (None, 60)] {
        assert_eq!(identity(&dull, photons, neighbors), identity(&dull, None, 50));
    }
    let specular = everything();
    assert_eq!(identity(&specular, Some(0), 60), identity(&specular, Some(0), 50));
    assert_ne!(identity(&specular, Some(9), 60), identity(&specular, Some(9), 50));
    assert_ne!(identity(&specular, Some(9), 50), identity(&specular, None, 50));
}
