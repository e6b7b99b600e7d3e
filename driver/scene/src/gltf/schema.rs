//! Amends JSON for the types of the `gltf` crate, which are stricter than glTF 2.0.
//!
//! glTF allows a scene without `nodes`, an animation target without `node` (an extension may state another
//! target), and `1.0` as an integer. Members that are `null` count as absent.

use std::collections::{BTreeMap, BTreeSet};

use gltf::json;
use gltf::json::validation::Checked;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};

/// Exclusive upper bound, 2^53, of the floating-point numbers that represent an integer exactly.
const MAX_INTEGER: f64 = 9_007_199_254_740_992.0;

/// Values that glTF allows for the `path` of an animation target.
const PATHS: [&str; 4] = ["translation", "rotation", "scale", "weights"];

/// Names of the lists in the root object of glTF.
const LISTS: [&str; 15] = [
    "accessors",
    "animations",
    "buffers",
    "bufferViews",
    "cameras",
    "extensionsRequired",
    "extensionsUsed",
    "images",
    "materials",
    "meshes",
    "nodes",
    "samplers",
    "scenes",
    "skins",
    "textures",
];

/// Returns whether a document is glTF 1.0, whose objects have names instead of indices.
pub(super) fn is_of_version_1(document: &Value) -> bool {
    ["accessors", "meshes", "nodes", "scenes"].iter().any(|list| document[list].is_object())
}

/// Animations from which channels without a target node were removed.
#[derive(Default)]
pub(super) struct Shortened {
    /// Indices of animations with channels whose target an extension defines.
    pub(super) by_extensions: BTreeSet<usize>,
    /// Indices of animations with channels that have no target at all.
    pub(super) without_target: BTreeSet<usize>,
}

/// Amends a document for the `gltf` crate's types. Returns the animations from which channels were removed.
pub(super) fn amend(document: &mut Value) -> Shortened {
    simplify(document);
    let mut shortened = Shortened::default();
    let Some(root) = document.as_object_mut() else { return shortened };
    for scene in list(root, "scenes").filter_map(Value::as_object_mut) {
        scene.entry("nodes").or_insert_with(|| json!([]));
    }
    for (index, animation) in list(root, "animations").enumerate() {
        let channels = animation.get_mut("channels").and_then(Value::as_array_mut);
        channels.into_iter().for_each(|channels| {
            channels.retain(|channel| {
                let Some(target) = target_without_node(channel) else { return true };
                let of_this_kind = match target.get("extensions") {
                    Some(Value::Object(extensions)) if !extensions.is_empty() => &mut shortened.by_extensions,
                    _ => &mut shortened.without_target,
                };
                of_this_kind.insert(index);
                false
            });
        });
    }
    shortened
}

/// Removes channels whose `path` is unknown to glTF. Returns the affected animations with the number of their
/// removed channels.
pub(super) fn remove_unknown_paths(root: &mut json::Root) -> BTreeMap<usize, usize> {
    let mut shortened = BTreeMap::new();
    for (index, animation) in root.animations.iter_mut().enumerate() {
        let count = animation.channels.len();
        animation.channels.retain(|channel| matches!(channel.target.path, Checked::Valid(_)));
        let removed = count - animation.channels.len();
        shortened.extend((removed > 0).then_some((index, removed)));
    }
    shortened
}

/// Channel whose path neither glTF nor an extension of the channel defines.
pub(super) struct UnknownPath {
    pub(super) animation: usize,
    pub(super) channel: usize,
    pub(super) node: usize,
    pub(super) path: String,
}

/// Finds channels in a document's text whose `path` neither glTF nor an extension defines. The `gltf` crate
/// does not keep an unknown path.
pub(super) fn unknown_paths(text: &str) -> Vec<UnknownPath> {
    #[derive(Deserialize)]
    struct Animations {
        animations: Vec<Value>,
    }
    let Ok(Animations { animations }) = serde_json::from_str(text) else { return Vec::new() };
    let channels = animations.iter().enumerate().flat_map(|(animation, clip)| {
        let channels = clip["channels"].as_array().into_iter().flatten().enumerate();
        channels.map(move |(channel, contents)| (animation, channel, &contents["target"]))
    });
    let unknown = channels.filter_map(|(animation, channel, target)| {
        let (node, path) = (target["node"].as_f64()? as usize, target["path"].as_str()?.to_owned());
        let is_unknown = !PATHS.contains(&&*path) && !target["extensions"].is_object();
        is_unknown.then_some(UnknownPath { animation, channel, node, path })
    });
    unknown.collect()
}

/// JSON path and description of a document's first violation of glTF's schema.
pub(super) fn violation(document: &Value) -> (String, String) {
    let Some(root) = document.as_object() else {
        return (String::new(), "its JSON is no object, which a glTF file is".to_owned());
    };
    for (name, value) in root {
        let Some(elements) = value.as_array() else {
            match fault_of_member(name, value) {
                Some(fault) => return (name.clone(), fault),
                None => continue,
            }
        };
        let mut faults = elements.iter().map(|element| fault_of(name, element)).enumerate();
        if let Some((index, fault)) = faults.find_map(|(index, fault)| Some((index, fault?))) {
            return (format!("{name}[{index}]"), fault);
        }
    }
    (String::new(), fault::<json::Root>(document).unwrap_or_default())
}

fn list<'a>(root: &'a mut Map<String, Value>, name: &str) -> impl Iterator<Item = &'a mut Value> {
    root.get_mut(name).and_then(Value::as_array_mut).into_iter().flatten()
}

/// Target of a channel that has no `node`.
fn target_without_node(channel: &Value) -> Option<&Map<String, Value>> {
    channel.get("target").and_then(Value::as_object).filter(|target| !target.contains_key("node"))
}

/// Removes members that are `null`, and converts integral floating-point numbers to integers, except in
/// `extras`.
fn simplify(value: &mut Value) {
    match value {
        Value::Object(members) => {
            members.retain(|_, member| !member.is_null());
            let members = members.iter_mut().filter(|(name, _)| *name != "extras");
            members.for_each(|(_, member)| simplify(member));
        }
        Value::Array(elements) => elements.iter_mut().for_each(simplify),
        Value::Number(number) => {
            let whole = number.as_f64().filter(|_| number.is_f64());
            let whole = whole.filter(|value| value.fract() == 0.0 && !value.is_sign_negative());
            if let Some(value) = whole.filter(|value| *value < MAX_INTEGER) {
                *number = (value as u64).into();
            }
        }
        _ => {}
    }
}

/// Reason why `value` cannot be parsed as `T`. It is parsed as text, because another input format would
/// compile the types of the `gltf` crate a second time.
fn fault<T: DeserializeOwned>(value: &Value) -> Option<String> {
    let error = serde_json::from_str::<T>(&value.to_string()).err()?.to_string();
    let end = error.rfind(" at line ").unwrap_or(error.len());
    Some(error[..end].to_owned())
}

/// Fault of a member of the root that is not a list; `None` if there is none.
fn fault_of_member(name: &str, value: &Value) -> Option<String> {
    match name {
        "asset" => fault::<json::Asset>(value),
        "scene" => fault::<json::Index<json::Scene>>(value),
        "extensions" => fault::<json::extensions::root::Root>(value),
        _ if LISTS.contains(&name) => Some("it is no list".to_owned()),
        _ => None,
    }
}

/// Fault of an element of a list of the root; `None` if there is none.
fn fault_of(list: &str, element: &Value) -> Option<String> {
    match list {
        "accessors" => fault::<json::Accessor>(element),
        "animations" => fault::<json::Animation>(element),
        "buffers" => fault::<json::Buffer>(element),
        "bufferViews" => fault::<json::buffer::View>(element),
        "cameras" => fault::<json::Camera>(element),
        "images" => fault::<json::Image>(element),
        "materials" => fault::<json::Material>(element),
        "meshes" => fault::<json::Mesh>(element),
        "nodes" => fault::<json::Node>(element),
        "samplers" => fault::<json::texture::Sampler>(element),
        "scenes" => fault::<json::Scene>(element),
        "skins" => fault::<json::Skin>(element),
        "textures" => fault::<json::Texture>(element),
        "extensionsUsed" | "extensionsRequired" => fault::<String>(element),
        _ => None,
    }
}
