//! Notices on contents of the file that the renderer ignores or interprets in another way: one sentence for
//! each feature, with the names of the objects.

use std::collections::{BTreeMap, BTreeSet};

use gltf::json;
use gltf::json::validation::Checked;

use super::animation;
use super::document::Document;
use super::extensions::SUPPORTED_EXTENSIONS;
use super::inside::Framed;
use super::material::has_dark_texture;
use super::names::{mesh_name, node_name};
use super::not_finite::NotFinite;
use super::schema::{Shortened, UnknownPath};
use super::solid_glass::Resolved;
use super::topology::{Topology, has_positions};
use crate::{Concern, LightUnits, blender};

/// Maximum number of names in a notice. Further ones are counted.
const LISTED: usize = 8;

/// Facts for notices that are collected during loading. Other notices follow from the JSON alone.
#[derive(Default)]
pub(super) struct Notices {
    /// Names of glass materials that were made solid or thin-walled contrary to what the file states.
    pub(super) glass: Resolved,
    /// Names of solid glass materials with coinciding faces that cannot be joined.
    pub(super) touching_glass: Vec<String>,
    /// Units of the lights that follow from Blender's name in `asset.generator`; `None` if the settings state
    /// them.
    pub(super) blender_units: Option<LightUnits>,
    /// Names of Blender's spot lights with a penumbra.
    pub(super) blender_spots: Vec<String>,
    /// Names of spot lights whose angles were clamped.
    pub(super) clamped_spots: Vec<String>,
    /// Names of spot lights that are left out, because their outer cone angle is not above 0.
    pub(super) closed_spots: Vec<String>,
    /// Names of lights other than point lights for which the file states a radius.
    pub(super) lights_without_size: Vec<String>,
    /// Images that cannot be read, each with its reason.
    pub(super) unreadable: Vec<String>,
    /// Kind of the default camera, in a file without cameras.
    pub(super) framed: Option<Framed>,
    /// Indices of meshes with attributes that are not finite.
    pub(super) not_finite: NotFinite<BTreeSet<usize>>,
    /// Indices of meshes with a primitive whose last vertices form no whole triangle.
    pub(super) incomplete: BTreeSet<usize>,
}

/// Formats `kind 'a', 'b' and 3 more`.
fn list(kind: &str, names: &[String]) -> String {
    let quoted: Vec<_> = names.iter().map(|name| format!("'{name}'")).collect();
    format!("{kind} {}", several(&quoted))
}

/// Formats `a, b and 3 more`. Equal items are listed once.
fn several(items: &[String]) -> String {
    let mut seen = BTreeSet::new();
    let unique: Vec<_> = items.iter().filter(|item| seen.insert(*item)).map(String::as_str).collect();
    let (listed, rest) = unique.split_at(unique.len().min(LISTED));
    let more = if rest.is_empty() { String::new() } else { format!(" and {} more", rest.len()) };
    format!("{}{more}", listed.join(", "))
}

/// Names of the items for which `holds` is true; `KIND N` for item N without a name.
fn names<'a, T: 'a>(
    kind: &str,
    items: &'a [T],
    name: impl Fn(&'a T) -> Option<&'a String>,
    holds: impl Fn(&'a T) -> bool,
) -> Vec<String> {
    let selected = items.iter().enumerate().filter(|(_, item)| holds(item));
    selected.map(|(i, item)| name(item).cloned().unwrap_or_else(|| format!("{kind} {i}"))).collect()
}

fn materials(root: &json::Root, holds: impl Fn(&json::Material) -> bool) -> Vec<String> {
    names("material", &root.materials, |material| material.name.as_ref(), holds)
}

fn meshes(root: &json::Root, holds: impl Fn(&json::mesh::Primitive) -> bool) -> Vec<String> {
    names("mesh", &root.meshes, |mesh| mesh.name.as_ref(), |mesh| mesh.primitives.iter().any(&holds))
}

/// Notices and remarks, each in a fixed order.
#[derive(Default)]
pub(super) struct Sentences {
    /// Notices on contents that are ignored or missing.
    pub(super) ignored: Vec<String>,
    /// Indices in `ignored` of notices that matter only to some pictures, with their subjects.
    pub(super) concerns: Vec<(usize, Concern)>,
    /// Remarks on contents that are interpreted in another way than they are stated.
    pub(super) remarks: Vec<String>,
}

/// Adds `SENTENCE: KIND 'a', 'b'` if there are names.
fn note(sentences: &mut Vec<String>, sentence: &str, kind: &str, names: &[String]) {
    if !names.is_empty() {
        sentences.push(format!("{sentence}: {}", list(kind, names)));
    }
}

impl Notices {
    /// Returns all sentences about a document.
    pub(super) fn finish(&self, document: &Document) -> Sentences {
        let mut ignored = self.ignored(document);
        let mut concerns = Vec::new();
        for (concern, sentence) in self.of_some_pictures(document) {
            concerns.extend(concern.map(|concern| (ignored.len(), concern)));
            ignored.push(sentence);
        }
        Sentences { ignored, concerns, remarks: self.remarks() }
    }

    fn ignored(&self, document: &Document) -> Vec<String> {
        let root = &document.root;
        let mut sentences = Vec::new();
        if !self.unreadable.is_empty() {
            let images = several(&self.unreadable);
            sentences.push(format!(
                "textures are left out whose image cannot be read, the factors alone count: image {images}"
            ));
        }
        note_materials(root, &mut sentences);
        let mut note = |sentence: &str, kind: &str, names: &[String]| {
            note(&mut sentences, sentence, kind, names);
        };
        let mismatched = &document.conversions.mismatched;
        let name = |&index: &usize| {
            root.materials[index].name.clone().unwrap_or_else(|| format!("material {index}"))
        };
        let mismatched: Vec<_> = mismatched.iter().map(name).collect();
        let sentence = "specular-glossiness textures that are mapped in another way than the diffuse ones are ignored, their factors alone count";
        note(sentence, "material", &mismatched);
        let other_modes = meshes(root, |primitive| Topology::of(primitive).is_none());
        note("points and lines are ignored, only triangles are rendered", "mesh", &other_modes);
        let shapeless =
            meshes(root, |primitive| Topology::of(primitive).is_some() && !has_positions(primitive));
        note("primitives without positions are ignored", "mesh", &shapeless);
        let unnamed = meshes(root, |primitive| primitive.attributes.contains_key(&Checked::Invalid));
        note("vertex attributes whose names glTF does not know are ignored", "mesh", &unnamed);
        let meshes_of = |indices: &BTreeSet<usize>| -> Vec<String> {
            indices.iter().map(|&index| mesh_name(root, index)).collect()
        };
        let incomplete = "the last vertices of primitives are ignored, which make no whole triangle";
        note(incomplete, "mesh", &meshes_of(&self.incomplete));
        let NotFinite { normals, colours, tangents } = &self.not_finite;
        note(
            "normals that are not finite are ignored, the triangles' own count",
            "mesh",
            &meshes_of(normals),
        );
        note("vertex colours that are not finite are 0, or 1 if infinite", "mesh", &meshes_of(colours));
        note(
            "tangents that are zero or not finite are ignored, the mesh's are computed",
            "mesh",
            &meshes_of(tangents),
        );
        let lights = document.lights();
        let limited = names("light", lights, |light| light.name.as_ref(), |light| light.range.is_some());
        note("the range of lights is ignored, their light reaches everywhere", "light", &limited);
        let closed = "spot lights whose outer cone has no angle are left out";
        note(closed, "light", &self.closed_spots);
        let points = "the radius of lights is ignored that are no point lights, or have a photometric file";
        note(points, "light", &self.lights_without_size);
        sentences
    }

    /// Notices that matter only to some pictures, with their subjects. The subject of a notice on an
    /// extension is `None` if the notice matters to every picture.
    fn of_some_pictures(&self, document: &Document) -> Vec<(Option<Concern>, String)> {
        let root = &document.root;
        let Shortened { by_extensions, without_target } = &document.shortened;
        let [by_extensions, without_target] = [by_extensions, without_target].map(|animations| {
            let name = |&index: &usize| animation::name(index, &root.animations[index]);
            Vec::from_iter(animations.iter().map(name))
        });
        let mut sentences = Vec::new();
        for (concern, sentence, kind, names) in [
            (
                Concern::Animations,
                "channels of animations that extensions define are ignored",
                "animation",
                &by_extensions,
            ),
            (
                Concern::Animations,
                "channels of animations whose target is no node are ignored",
                "animation",
                &without_target,
            ),
        ] {
            if !names.is_empty() {
                sentences.push((Some(concern), format!("{sentence}: {}", list(kind, names))));
            }
        }
        if !document.unknown_paths.is_empty() {
            let channel = |unknown: &UnknownPath| {
                let UnknownPath { animation, channel, node, path } = unknown;
                format!(
                    "'{path}' of {} (animations[{animation}].channels[{channel}])",
                    node_name(root, *node)
                )
            };
            let channels: Vec<_> = document.unknown_paths.iter().map(channel).collect();
            sentences.push((
                Some(Concern::Animations),
                format!(
                    "channels of animations are ignored whose path is none of glTF 2.0 (translation, rotation, scale, weights): {}",
                    several(&channels)
                ),
            ));
        }
        for (extension, places) in other_extensions(root) {
            let places = if places.is_empty() { String::new() } else { format!(": {}", places.join(", ")) };
            sentences.push((concern_of(&extension), format!("the extension {extension} is ignored{places}")));
        }
        if let Some(view) = self.framed {
            let framed = match view {
                Framed::FromFront => "the scene has no camera: it is framed from the front (+z)",
                Framed::FromInside => "the scene has no camera: it is a closed room, framed from inside",
            };
            let export =
                document.is_of_blender().then(|| format!(" (to export one: {})", blender::NO_CAMERA));
            sentences.push((Some(Concern::View), format!("{framed}{}", export.unwrap_or_default())));
        }
        sentences
    }

    fn remarks(&self) -> Vec<String> {
        let mut sentences = Vec::from_iter(self.blender_units.and_then(of_units).map(str::to_owned));
        let mut note = |sentence: &str, kind: &str, names: &[String]| {
            note(&mut sentences, sentence, kind, names);
        };
        let clamped = "the angles of spot lights are clamped to 0 <= inner <= outer <= 90 degrees";
        note(clamped, "light", &self.clamped_spots);
        let penumbra = "inner cones of Blender's spot lights are widened to the flux that Blender renders";
        note(penumbra, "light", &self.blender_spots);
        let solid = "closed meshes of glass without a thickness are taken as solid, as in Blender (as a thin wall by --set MATERIAL.thickness=0)";
        note(solid, "material", &self.glass.solid);
        let walls =
            "flat sheets of glass with a thickness bound no solid: they are thin walls of that thickness";
        note(walls, "material", &self.glass.walls);
        let open = "open meshes of glass with a thickness bound no solid: light that enters by one stays in \
                    the glass until it meets another face";
        note(open, "material", &self.glass.open);
        let apart = "faces of solids of glass are in one place, and light meets one of them alone: leave a \
                     gap of air between them";
        note(apart, "material", &self.touching_glass);
        sentences
    }
}

/// Subject of a notice on an unsupported extension; `None` if it matters to every picture.
fn concern_of(extension: &str) -> Option<Concern> {
    match extension {
        "KHR_animation_pointer" => Some(Concern::Animations),
        "EXT_lights_image_based" => Some(Concern::Environment),
        _ => None,
    }
}

/// Remark that a file's animations do not play; `None` if it has none.
pub(super) fn of_animations(root: &json::Root) -> Option<String> {
    let moving = names("animation", &root.animations, |animation| animation.name.as_ref(), |_| true);
    let sentence = "the scene is rendered as it stands, its animations by --frames";
    (!moving.is_empty()).then(|| format!("{sentence}: {}", list("animation", &moving)))
}

/// Remark on the units of lights, if the exporter's name determined them.
fn of_units(units: LightUnits) -> Option<&'static str> {
    match units {
        LightUnits::Auto | LightUnits::Radiometric => None,
        LightUnits::Photometric => Some(
            "the factor of 683 lm/W in the lights of Blender's exporter is taken off, since its emissive surfaces lack it (kept by \
             --light-units radiometric)",
        ),
        LightUnits::Watts => Some(
            "point and spot lights are read in watts, which Blender's exporter wrote before 3.4 (as W/sr by --light-units radiometric)",
        ),
    }
}

/// Adds notices on features of materials that are ignored.
fn note_materials(root: &json::Root, sentences: &mut Vec<String>) {
    let mut note = |sentence: &str, kind: &str, names: &[String]| note(sentences, sentence, kind, names);
    let occluded = materials(root, |material| material.occlusion_texture.is_some());
    note("occlusion textures are ignored, occlusion is computed", "material", &occluded);
    let dark = materials(root, has_dark_texture);
    note("emissive textures are ignored where the emissive factor or strength is 0", "material", &dark);
    let unlit = materials(root, |material| {
        material.extensions.as_ref().is_some_and(|extensions| extensions.unlit.is_some())
    });
    note("unlit materials are rendered as lit ones", "material", &unlit);
}

/// Unsupported extensions in use, with the materials, meshes and nodes that use them.
fn other_extensions(root: &json::Root) -> BTreeMap<String, Vec<String>> {
    let mut users: BTreeMap<String, BTreeMap<&str, Vec<String>>> = BTreeMap::new();
    let is_ignored = |name: &str| !SUPPORTED_EXTENSIONS.contains(&name);
    for name in root.extensions_used.iter().filter(|name| is_ignored(name)) {
        users.entry(name.clone()).or_default();
    }
    let mut add = |kind: &'static str, index: usize, name: Option<&String>, extension: &String| {
        if is_ignored(extension) {
            let name = name.cloned().unwrap_or_else(|| format!("{kind} {index}"));
            users.entry(extension.clone()).or_default().entry(kind).or_default().push(name);
        }
    };
    for (i, material) in root.materials.iter().enumerate() {
        for extension in material.extensions.iter().flat_map(|extensions| extensions.others.keys()) {
            add("material", i, material.name.as_ref(), extension);
        }
    }
    for (i, mesh) in root.meshes.iter().enumerate() {
        let own = mesh.extensions.iter().flat_map(|extensions| extensions.others.keys());
        let primitives = mesh.primitives.iter().filter_map(|primitive| primitive.extensions.as_ref());
        for extension in own.chain(primitives.flat_map(|extensions| extensions.others.keys())) {
            add("mesh", i, mesh.name.as_ref(), extension);
        }
    }
    for (i, node) in root.nodes.iter().enumerate() {
        for extension in node.extensions.iter().flat_map(|extensions| extensions.others.keys()) {
            add("node", i, node.name.as_ref(), extension);
        }
    }
    let places = |kinds: BTreeMap<&str, Vec<String>>| {
        kinds.into_iter().map(|(kind, names)| list(kind, &names)).collect::<Vec<_>>()
    };
    users.into_iter().map(|(extension, kinds)| (extension, places(kinds))).collect()
}
