//! Lights with photometric files: `EXT_lights_ies`, and `ies` in the `extras` of a light's node.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{DMat4, Vec3};
use gltf::json;
use serde::Deserialize;

use super::accessor::Source;
use super::extensions::IES;
use super::light::axes;
use super::uri::{INSIDE_FOLDER, decode_data, is_data, locate};
use crate::error::SceneError;
use crate::limits::EMISSION;
use crate::{LightProfile, PunctualKind, PunctualLight, Scene};

const REMEDY: &str = "state a light of the file's extensions.EXT_lights_ies.lights";

/// The extension at the root of the file.
#[derive(Deserialize)]
struct OfFile {
    lights: Vec<File>,
}

/// A photometric file.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct File {
    name: Option<String>,
    uri: Option<String>,
    buffer_view: Option<usize>,
}

/// The extension at a node.
#[derive(Deserialize)]
struct OfNode {
    light: usize,
    #[serde(default = "one")]
    multiplier: f32,
    #[serde(default = "white")]
    color: [f32; 3],
}

fn one() -> f32 {
    1.0
}

fn white() -> [f32; 3] {
    [1.0; 3]
}

/// Photometric files of a scene, each of which is read once.
pub(super) struct Profiles<'a> {
    source: &'a Source<'a>,
    /// Profiles by their URI or, in a buffer, by their JSON path.
    read: BTreeMap<String, LightProfile>,
}

impl<'a> Profiles<'a> {
    pub(super) fn new(source: &'a Source<'a>) -> Self {
        Self { source, read: BTreeMap::new() }
    }

    /// Adds the light that `EXT_lights_ies` states at a node, if there is one.
    pub(super) fn place(&mut self, index: usize, world: &DMat4, scene: &mut Scene) -> Result<(), SceneError> {
        let document = self.source.document;
        let node = &document.root.nodes[index];
        let Some(value) = of_node(node) else { return Ok(()) };
        let item = format!("nodes[{index}].extensions.{IES}");
        let fault = |reason: String| document.invalid(&item, reason, REMEDY);
        let stated = OfNode::deserialize(value).map_err(|error| fault(error.to_string()))?;
        let file = self.file(stated.light, &item)?;
        let name = file.name.clone().or(node.name.clone()).unwrap_or_else(|| format!("profile {index}"));
        let profile = self.of_file(&file, stated.light)?;
        let color = Vec3::from(stated.color).clamp(Vec3::ZERO, Vec3::ONE);
        let peak = profile.peak / f64::from(scene.lumens_per_watt());
        let intensity = color * (stated.multiplier * peak as f32);
        if !intensity.to_array().into_iter().all(|value| value == 0.0 || EMISSION.contains(&value)) {
            let reason = format!("the light's intensity is {intensity}, its colour and multiplier included");
            let remedy = "state a multiplier of 0 or more, by which no intensity is above 1e20 candela";
            return Err(document.invalid(item, reason, remedy));
        }
        let position = world.w_axis.truncate().as_vec3();
        let (Some(axes), true) = (axes(world), position.is_finite()) else {
            return Err(fault("the node gives the light no finite position or no direction".to_owned()));
        };
        let kind = PunctualKind::Profile { position, texture: scene.profile_texture(profile) };
        scene.lights.push(PunctualLight { name, kind, intensity, axes });
        Ok(())
    }

    /// Gives the light `light` of the scene the photometric file beside the scene that a node's `extras`
    /// state.
    pub(super) fn assign(
        &mut self,
        (uri, node): (&str, usize),
        light: usize,
        scene: &mut Scene,
    ) -> Result<(), SceneError> {
        let item = format!("nodes[{node}].extras.photoncard.ies");
        let profile = self.of_uri(uri, &item)?;
        let set = scene.set_profile(light, profile);
        set.map_err(|(reason, remedy)| self.source.document.invalid(item, reason, remedy))
    }

    fn file(&self, index: usize, item: &str) -> Result<File, SceneError> {
        let document = self.source.document;
        let extensions = document.root.extensions.as_ref();
        let Some(value) = extensions.and_then(|extensions| extensions.others.get(IES)) else {
            return Err(document.invalid(item, "the file has no such lights", REMEDY));
        };
        let of_file = OfFile::deserialize(value);
        let OfFile { lights } = of_file
            .map_err(|error| document.invalid(format!("extensions.{IES}"), error.to_string(), REMEDY))?;
        let count = lights.len();
        let file = lights.into_iter().nth(index);
        file.ok_or_else(|| {
            document.invalid(item, format!("there is no light {index}, there are {count}"), REMEDY)
        })
    }

    fn of_file(&mut self, file: &File, index: usize) -> Result<&LightProfile, SceneError> {
        let item = format!("extensions.{IES}.lights[{index}]");
        match (&file.uri, file.buffer_view) {
            (Some(uri), _) => self.of_uri(uri, &item),
            (None, Some(view)) => {
                let bytes = self.source.bytes(view, &item)?;
                let path = PathBuf::from(self.source.document.location(&item).to_string());
                self.parsed(item, bytes, &path)
            }
            (None, None) => {
                let reason = "the light has neither a uri nor a bufferView";
                Err(self.source.document.invalid(item, reason, "export the scene again, with its IES files"))
            }
        }
    }

    fn of_uri(&mut self, uri: &str, item: &str) -> Result<&LightProfile, SceneError> {
        let document = self.source.document;
        let fault = |reason| document.invalid(item, reason, INSIDE_FOLDER);
        if is_data(uri) {
            let (_, bytes) = decode_data(uri).map_err(fault)?;
            let path = PathBuf::from(document.location(item).to_string());
            return self.parsed(uri.to_owned(), &bytes, &path);
        }
        let path = locate(&document.path, uri).map_err(fault)?;
        let bytes = document.files.read(&path).map_err(|error| fault(format!("{uri:?}: {error}")))?;
        self.parsed(uri.to_owned(), &bytes, &path)
    }

    fn parsed(&mut self, key: String, bytes: &[u8], path: &Path) -> Result<&LightProfile, SceneError> {
        use std::collections::btree_map::Entry;
        Ok(match self.read.entry(key) {
            Entry::Occupied(entry) => entry.into_mut(),
            Entry::Vacant(entry) => entry.insert(LightProfile::parse(bytes, path)?),
        })
    }
}

/// Value of the extension at a node.
pub(super) fn of_node(node: &json::Node) -> Option<&serde_json::Value> {
    node.extensions.as_ref()?.others.get(IES)
}
