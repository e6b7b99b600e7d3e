//! Messages to pages about the scene and the state of a view.

use glam::Vec3;
use photoncard_driver::choice::Choice;
use photoncard_driver::render::{RenderSettings, Statistics};
use photoncard_driver::scene::{
    Camera, Environment, Material, Projection, PunctualKind, PunctualLight, Reflection, Scene,
};
use serde_json::{Map, Value, json};

use super::canvas::{Gains, Shown};
use super::wish::Wish;
use crate::arguments::SceneOptions;
use crate::environment::EnvironmentOption;

/// Name and bounding box of a scene, for the first message to a page.
pub(super) struct SceneFacts {
    name: String,
    low: Vec3,
    high: Vec3,
}

impl SceneFacts {
    pub(super) fn new(name: String, scene: &Scene) -> Self {
        let (low, high) = scene.bounds();
        Self { name, low, high }
    }

    /// First message to a page. `scene` has the materials and lights before any change by a page. `out` is
    /// the folder of saved pictures, and `steers` whether the page controls the view.
    pub(super) fn hello(&self, scene: &Scene, out: Option<&str>, steers: bool) -> Value {
        let layers = Shown::all().map(Shown::name);
        let cameras = scene.cameras.iter().map(|camera| {
            let mut described = self.camera(camera, scene);
            described["name"] = json!(camera.name);
            described
        });
        json!({
            "type": "hello",
            "scene": {
                "name": self.name,
                "low": scene.in_file(self.low).to_array(),
                "high": scene.in_file(self.high).to_array(),
                "cameras": cameras.collect::<Vec<_>>(),
                "lights": scene.lights.iter().map(|found| light(found, scene)).collect::<Vec<_>>(),
                "materials": materials(scene),
                "environment": scene.environment.as_ref().map(|Environment { strength, .. }| json!({"strength": strength})),
            },
            "layers": layers.collect::<Vec<_>>(),
            "out": out,
            "steers": steers,
        })
    }

    /// Camera as JSON, with the point around which pages turn it: on its axis, at the depth of the centre of
    /// the scene's bounding box. It has the vertical field of view in degrees, the height in metres or the
    /// angles in degrees.
    pub(super) fn camera(&self, camera: &Camera, scene: &Scene) -> Value {
        let middle = 0.5 * (self.low + self.high);
        let size = (self.high - self.low).length().max(1e-3);
        let distance = (middle - camera.origin).dot(camera.forward).max(0.1 * size);
        let mut described = json!({
            "position": scene.in_file(camera.origin).to_array(),
            "look_at": scene.in_file(camera.origin + distance * camera.forward).to_array(),
        });
        match camera.projection {
            Projection::Perspective { vertical_fov } => described["fov"] = json!(vertical_fov.to_degrees()),
            Projection::Orthographic { half_height } => described["height"] = json!(2.0 * half_height),
            Projection::Panorama { angles } => described["angles"] = json!(angles.map(f32::to_degrees)),
        }
        described
    }
}

fn light(light: &PunctualLight, scene: &Scene) -> Value {
    let place = |position| Some(scene.in_file(position).to_array());
    let (colour, strength) = light.colour();
    let (kind, position) = match light.kind {
        PunctualKind::Point { position } => ("point", place(position)),
        PunctualKind::Spot { position, .. } => ("spot", place(position)),
        PunctualKind::Profile { position, .. } => ("profile", place(position)),
        PunctualKind::Directional { .. } => ("directional", None),
    };
    let unit = if position.is_some() { "W/sr" } else { "W/m^2" };
    json!({
        "name": light.name,
        "kind": kind,
        "colour": colour.to_array(),
        "strength": strength,
        "unit": unit,
        "position": position,
    })
}

/// Materials, one for each name, with the properties that a page can set.
fn materials(scene: &Scene) -> Vec<Value> {
    let is_first = |index: usize, material: &Material| {
        !scene.materials[..index].iter().any(|other| other.name == material.name)
    };
    let named = scene.materials.iter().enumerate().filter(|(index, material)| is_first(*index, material));
    named.map(|(_, material)| json!({"name": material.name, "properties": properties(material)})).collect()
}

fn properties(material: &Material) -> Map<String, Value> {
    let mut properties = Map::new();
    let mut add = |name: &str, value: Value| {
        properties.insert(name.to_owned(), value);
    };
    add("emission", json!(material.emission.to_array()));
    add("alpha", json!(material.alpha));
    match &material.reflection {
        Reflection::Phong { diffuse, specular, exponent } => {
            add("diffuse", json!(diffuse.to_array()));
            add("specular", json!(specular.to_array()));
            add("exponent", json!(exponent));
        }
        Reflection::MetallicRoughness { base_colour, metallic, roughness, transmission, .. } => {
            add("diffuse", json!(base_colour.to_array()));
            add("metallic", json!(metallic));
            add("roughness", json!(roughness));
            add("ior", json!(material.reflection.ior()));
            add("transmission", json!(transmission.map_or(0.0, |transmission| transmission.factor)));
            let is_solid = transmission.is_some_and(|transmission| transmission.is_volume);
            add("thickness", json!(u8::from(is_solid)));
        }
    }
    properties
}

/// Changes of materials and lights that pages have made, as part of a message to pages.
pub(super) fn changes(wish: &Wish) -> Value {
    let change = |(name, value): &(String, Vec<f64>)| match value[..] {
        [value] => json!({"name": name, "value": value}),
        _ => json!({"name": name, "value": value}),
    };
    wish.edits().iter().map(change).collect()
}

/// Environment map by its name, its rotation in degrees, and whether a page has sent it, as part of a message
/// to pages; null for a scene without a map.
pub(super) fn environment(options: &SceneOptions) -> Value {
    let map = options.environment.as_ref().filter(|map| map.is_map());
    map.map_or(Value::Null, |map| {
        json!({
            "name": map.name(),
            "rotation": options.environment_rotation.unwrap_or_default(),
            "dropped": matches!(map, EnvironmentOption::Dropped(_)),
        })
    })
}

/// Gains of the light groups by name, as part of a message to pages.
pub(super) fn gains(settings: &RenderSettings, gains: &Gains) -> Value {
    let groups = settings.picture.light_groups.iter().zip(gains);
    groups.map(|(name, gain)| (name.clone(), json!(gain))).collect::<Map<_, _>>().into()
}

/// Settings of the final picture, as part of a message to pages. Pages can change some of them.
pub(super) fn settings(settings: &RenderSettings) -> Value {
    let RenderSettings { photons, integrator, schedule, picture, .. } = settings;
    json!({
        "photons": photons.count,
        "neighbors": photons.neighbors,
        "spp": integrator.samples,
        "gather_rays": integrator.gather_rays,
        "shadow_rays": integrator.shadow_rays,
        "sampling": integrator.sampling.name(),
        "cache": integrator.irradiance_error.is_some(),
        "order": schedule.order.name(),
        "tile": schedule.tile.unwrap_or(0),
        "layers": picture.layers.to_string(),
    })
}

/// Cost of the newest card image and of the newest pass, for pages.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cost {
    /// Time of tracing photons, seconds; `pack`, `load` and `render` are the times of building the card
    /// image, of loading the cards and of rendering.
    photons: f64,
    pack: f64,
    load: f64,
    render: f64,
    image_bytes: u64,
    sent_bytes: u64,
}

impl Cost {
    /// Takes over the cost of a finished pass. The times of photons, packing and loading, and the bytes sent,
    /// are taken over only from a pass that traced photons.
    pub(super) fn add(&mut self, statistics: &Statistics) {
        let times = &statistics.time_s;
        if times.photons > 0.0 {
            (self.photons, self.pack, self.load) = (times.photons, times.pack, times.load);
            self.sent_bytes = statistics.link.image_bytes.iter().sum();
        }
        self.render = times.render;
        self.image_bytes = statistics.image_bytes;
    }

    pub(super) fn describe(&self) -> Value {
        json!({
            "seconds": {"photons": self.photons, "pack": self.pack, "load": self.load, "render": self.render},
            "bytes": {"image": self.image_bytes},
            "sent": self.sent_bytes,
        })
    }
}
