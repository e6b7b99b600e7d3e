//! Lights in a file of Blender's exporter are as bright as Cycles renders them.

use std::path::Path;

use photoncard_driver::render::{Filter, Integrator, PhotonMaps, Picture, RenderSettings};
use photoncard_driver::scene::{Scene, gltf};
use photoncard_tests::{radiances, render_or_panic};
use serde_json::Value;

fn fixture(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/blender").join(name)
}

/// Mean radiance of the picture by the file's camera, per channel.
fn seen(scene: &Scene) -> [f64; 3] {
    let settings = RenderSettings {
        picture: Picture { width: 64, height: 64, filter: Filter::Box, ..Picture::default() },
        photons: PhotonMaps { count: 2000, neighbors: 20, ..PhotonMaps::default() },
        integrator: Integrator { samples: 4, gather_rays: 4, ..Integrator::default() },
        ..RenderSettings::default()
    };
    let pixels = radiances(&render_or_panic(scene, &settings).film);
    let mean = |channel: usize| pixels.iter().map(|pixel| f64::from(pixel[channel])).sum::<f64>();
    [0, 1, 2].map(|channel| mean(channel) / pixels.len() as f64)
}

/// Scene with the light `name` alone.
fn lit_by(scene: &Scene, name: &str) -> Scene {
    let mut scene = scene.clone();
    scene.lights.retain(|light| light.name == name);
    if name != "panel" {
        scene.apply("panel.emission=0").unwrap();
    }
    scene
}

#[test]
fn lamps_and_panels_are_as_bright_as_in_cycles() {
    let scene = gltf::load(&fixture("lights.glb")).unwrap();
    let of_cycles: Value = serde_json::from_slice(&std::fs::read(fixture("lights.json")).unwrap()).unwrap();
    let lights = of_cycles.as_object().unwrap();
    assert_eq!(lights.len(), 4);
    for (name, expected) in lights {
        let found = seen(&lit_by(&scene, name));
        for (channel, expected) in
            expected.as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).enumerate()
        {
            let error = found[channel] / expected - 1.0;
            assert!(error.abs() < 0.005, "{name}: {found:?} is off by {error} from {expected}");
        }
    }
}
