//! Animations: poses of nodes at a time (glTF 2.0, 3.11 and appendix C).

use std::collections::BTreeMap;

use glam::{DQuat, DVec3, DVec4, Vec4Swizzles as _};
use gltf::json;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::animation::{Interpolation, Property};
use gltf::json::validation::Checked;

use super::accessor::{Elements, Format, Integers, Source};
use super::document::Document;
use super::keyframes::{Keyframes, Place};
use super::names::listed;
use crate::error::SceneError;

const FRACTIONS: &[ComponentType] =
    &[ComponentType::F32, ComponentType::I8, ComponentType::U8, ComponentType::I16, ComponentType::U16];
const VECTORS: Format =
    Format { types: &[Type::Vec3], components: &[ComponentType::F32], integers: Integers::Whole };
const ROTATIONS: Format =
    Format { types: &[Type::Vec4], components: FRACTIONS, integers: Integers::Normalized };
const WEIGHTS: Format =
    Format { types: &[Type::Scalar], components: FRACTIONS, integers: Integers::Normalized };

const REMEDY: &str = "export the animation again; its channels and samplers do not fit";

/// Animations that play, and the time at which they are evaluated.
#[derive(Clone, Debug, PartialEq)]
pub struct Moment {
    /// Names of the animations that play; an empty list plays all animations of the file.
    pub animations: Vec<String>,
    /// Time since the start of the animations, seconds.
    pub seconds: f64,
}

/// An animation of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Animation {
    /// Name in the file, or `animation N`.
    pub name: String,
    /// Times of the first and the last keyframe, seconds.
    pub seconds: [f64; 2],
    /// True if the animation moves cameras alone, and neither meshes nor lights.
    pub moves_only_cameras: bool,
}

/// Translation, rotation, scale and weights that animations set for a node; `None` keeps the node's own
/// value.
#[derive(Clone, Debug, Default)]
pub(super) struct NodePose {
    pub(super) translation: Option<DVec3>,
    pub(super) rotation: Option<DQuat>,
    pub(super) scale: Option<DVec3>,
    /// Weights of morph targets.
    pub(super) weights: Option<Vec<f32>>,
}

/// Poses of the animated nodes, by node index.
pub(super) type Poses = BTreeMap<usize, NodePose>;

pub(super) fn name(index: usize, animation: &json::Animation) -> String {
    animation.name.clone().unwrap_or_else(|| format!("animation {index}"))
}

/// Indices of the animations with these names; of all if `names` is empty.
///
/// # Errors
/// If `names` has a name that no animation has; the error lists the animations' names.
pub(super) fn playing(document: &Document, names: &[String]) -> Result<Vec<usize>, SceneError> {
    let all: Vec<_> = document.root.animations.iter().enumerate().map(|(i, clip)| name(i, clip)).collect();
    if let Some(unknown) = names.iter().find(|name| !all.contains(name)) {
        return Err(SceneError::UnknownAnimation { name: unknown.clone(), animations: listed(&all) });
    }
    let plays = |index: &usize| names.is_empty() || names.contains(&all[*index]);
    Ok((0..all.len()).filter(plays).collect())
}

/// Evaluates the poses of all animated nodes at a moment.
///
/// # Errors
/// If an animation is invalid, or two of the moment's animations move the same property of a node.
pub(super) fn poses(source: &Source<'_>, moment: &Moment) -> Result<Poses, SceneError> {
    let mut poses = Poses::new();
    for index in playing(source.document, &moment.animations)? {
        for channel in 0..source.document.root.animations[index].channels.len() {
            let channel = Channel::new(source, index, channel)?;
            channel.apply(moment.seconds, &mut poses)?;
        }
    }
    Ok(poses)
}

/// Times of an animation's first and last keyframe, seconds; both zero without channels.
pub(super) fn extent(source: &Source<'_>, index: usize) -> Result<[f64; 2], SceneError> {
    let mut extent: Option<[f64; 2]> = None;
    for channel in 0..source.document.root.animations[index].channels.len() {
        let [first, last] = Channel::new(source, index, channel)?.keyframes.extent();
        let [begin, end] = extent.unwrap_or([first, last]);
        extent = Some([begin.min(first), end.max(last)]);
    }
    Ok(extent.unwrap_or_default())
}

/// Indices of the nodes that an animation moves.
pub(super) fn targets(animation: &json::Animation) -> impl Iterator<Item = usize> {
    animation.channels.iter().map(|channel| channel.target.node.value())
}

/// Channel of an animation, with the contents of its sampler. Channel and sampler were checked.
struct Channel<'a> {
    source: &'a Source<'a>,
    /// JSON path of the channel.
    item: String,
    node: usize,
    property: Property,
    keyframes: Keyframes<'a>,
    values: Elements<'a>,
    /// Number of elements of a keyframe's value: the number of morph targets for weights, else 1.
    elements: u64,
}

impl<'a> Channel<'a> {
    fn new(source: &'a Source<'a>, animation: usize, channel: usize) -> Result<Self, SceneError> {
        let document = source.document;
        let clip = &document.root.animations[animation];
        let json::animation::Channel { sampler, target, .. } = &clip.channels[channel];
        let item = format!("animations[{animation}].channels[{channel}]");
        let sampler_item = format!("animations[{animation}].samplers[{sampler}]");
        let sampler = &clip.samplers[sampler.value()];
        let fault = |reason: String| document.invalid(&item, reason, REMEDY);
        let (Checked::Valid(property), Checked::Valid(interpolation)) = (target.path, sampler.interpolation)
        else {
            return Err(fault("its path or interpolation is not one that glTF knows".to_owned()));
        };
        let node = target.node.value();
        let elements = match property {
            Property::MorphTargetWeights => morph_targets(document, node) as u64,
            _ => 1,
        };
        let format = match property {
            Property::Translation | Property::Scale => &VECTORS,
            Property::Rotation => &ROTATIONS,
            Property::MorphTargetWeights => &WEIGHTS,
        };
        let keyframes =
            Keyframes::new(source, sampler.input.value(), &format!("{sampler_item}.input"), interpolation)?;
        let values =
            Elements::new(source, sampler.output.value(), &format!("{sampler_item}.output"), format)?;
        let needed = keyframes.values_of_each().saturating_mul(elements).saturating_mul(keyframes.count());
        if values.count < needed {
            let reason = format!("its sampler has {} values, and needs {needed}", values.count);
            return Err(fault(reason));
        }
        if property != Property::MorphTargetWeights && document.root.nodes[node].matrix.is_some() {
            let reason = format!("nodes[{node}], which it moves, has a matrix");
            return Err(document.invalid(&item, reason, "state translation, rotation and scale of the node"));
        }
        Ok(Self { source, item, node, property, keyframes, values, elements })
    }

    /// Evaluates the channel at a time and sets the property in the pose of its node.
    fn apply(&self, seconds: f64, poses: &mut Poses) -> Result<(), SceneError> {
        let pose = poses.entry(self.node).or_default();
        let place = self.keyframes.at(seconds);
        let is_stated = match self.property {
            Property::Translation => pose.translation.replace(self.value(place, 0).xyz()).is_some(),
            Property::Scale => pose.scale.replace(self.value(place, 0).xyz()).is_some(),
            Property::Rotation => pose.rotation.replace(self.rotation(place)).is_some(),
            Property::MorphTargetWeights => {
                let weights = (0..self.elements).map(|target| self.value(place, target).x as f32).collect();
                pose.weights.replace(weights).is_some()
            }
        };
        let is_sound = pose.translation.is_none_or(DVec3::is_finite)
            && pose.scale.is_none_or(DVec3::is_finite)
            && pose.rotation.is_none_or(DQuat::is_finite)
            && pose.weights.iter().flatten().all(|weight| weight.is_finite());
        if is_stated {
            let reason = format!("two channels that play move nodes[{}] alike", self.node);
            return Err(
                self.fault(reason, "choose animations that do not contradict each other, by --animation")
            );
        }
        if !is_sound {
            return Err(self.fault(format!("at {seconds} s its value is not finite"), REMEDY));
        }
        Ok(())
    }

    fn fault(&self, reason: String, remedy: &'static str) -> SceneError {
        self.source.document.invalid(&self.item, reason, remedy)
    }

    /// Reads element `element` of a keyframe's output: the weight of morph target `element`, or element 0,
    /// the only one, of other properties. `kind` selects the in-tangent (0), value (1) or out-tangent (2) of
    /// a cubic spline; it is 0 for other interpolations.
    fn key(&self, keyframe: u64, kind: u64, element: u64) -> DVec4 {
        let of_each = self.keyframes.values_of_each();
        let index = (keyframe * of_each + kind) * self.elements + element;
        DVec4::from_array(self.values.floats(index, [0.0; 4]).map(f64::from))
    }

    /// Interpolates an element component by component at `place`, a time between keyframes.
    fn value(&self, place: Place, element: u64) -> DVec4 {
        let Place { keyframe, share, interval } = place;
        match self.keyframes.interpolation {
            Interpolation::Step => self.key(keyframe, 0, element),
            Interpolation::Linear if share <= 0.0 => self.key(keyframe, 0, element),
            Interpolation::Linear => {
                let [from, to] = [keyframe, keyframe + 1].map(|keyframe| self.key(keyframe, 0, element));
                from * (1.0 - share) + to * share
            }
            Interpolation::CubicSpline if share <= 0.0 => self.key(keyframe, 1, element),
            Interpolation::CubicSpline => {
                let (from, to) = (keyframe, keyframe + 1);
                let (square, cube) = (share * share, share * share * share);
                self.key(from, 1, element) * (2.0 * cube - 3.0 * square + 1.0)
                    + self.key(from, 2, element) * (interval * (cube - 2.0 * square + share))
                    + self.key(to, 1, element) * (3.0 * square - 2.0 * cube)
                    + self.key(to, 0, element) * (interval * (cube - square))
            }
        }
    }

    /// Evaluates a rotation. `LINEAR` interpolation is spherical, along the shorter arc. The quaternion has
    /// length 1, or 0 if the file's quaternions are zero.
    fn rotation(&self, place: Place) -> DQuat {
        let unit = |value: DVec4| DQuat::from_vec4(value.normalize_or_zero());
        let Place { keyframe, share, .. } = place;
        if self.keyframes.interpolation == Interpolation::Linear && share > 0.0 {
            let [from, to] = [keyframe, keyframe + 1].map(|keyframe| unit(self.key(keyframe, 0, 0)));
            return from.slerp(to, share);
        }
        unit(self.value(place, 0))
    }
}

/// Number of morph targets of a node's mesh.
fn morph_targets(document: &Document, node: usize) -> usize {
    let mesh = document.root.nodes[node].mesh.map(|mesh| &document.root.meshes[mesh.value()]);
    let primitives = mesh.into_iter().flat_map(|mesh| &mesh.primitives);
    primitives.filter_map(|primitive| primitive.targets.as_ref()).map(Vec::len).max().unwrap_or(0)
}
