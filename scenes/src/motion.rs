//! Builder methods for animations, cameras and lights on moving nodes, skins, and morph targets.

use glam::{Mat4, Quat, Vec3};

use crate::builder::{Camera, Geometry, SceneBuilder};
use crate::document::{
    AnimationEntry, Channel, ChannelTarget, KeyframeSampler, LightIndex, Lights, MorphTarget, Node,
    NodeExtensions, PointLight, RootExtensions, Skin,
};

/// Interpolation between keyframes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Between {
    /// Value of the previous keyframe (`STEP`).
    Step,
    /// Linear interpolation between the keyframes.
    Linear,
    /// Cubic spline whose tangent at a keyframe is the slope of the chord between its neighbours.
    Smooth,
}

/// Animated property of a node: its values at all keyframes.
pub(crate) enum Values {
    Translations(Vec<Vec3>),
    Rotations(Vec<Quat>),
    /// Weight of a mesh's only morph target.
    Weights(Vec<f32>),
}

/// Animation of one property of a node, with equidistant keyframes from time 0.
pub(crate) struct Track {
    pub(crate) node: usize,
    pub(crate) values: Values,
    /// Time between two keyframes, seconds.
    pub(crate) interval: f32,
    pub(crate) between: Between,
}

impl Values {
    fn path(&self) -> &'static str {
        match self {
            Self::Translations(_) => "translation",
            Self::Rotations(_) => "rotation",
            Self::Weights(_) => "weights",
        }
    }

    fn kind(&self) -> &'static str {
        match self {
            Self::Translations(_) => "VEC3",
            Self::Rotations(_) => "VEC4",
            Self::Weights(_) => "SCALAR",
        }
    }

    fn components(&self) -> Vec<Vec<f32>> {
        match self {
            Self::Translations(values) => values.iter().map(|value| value.to_array().to_vec()).collect(),
            Self::Rotations(values) => on_one_side(values).map(|value| value.to_array().to_vec()).collect(),
            Self::Weights(values) => values.iter().map(|value| vec![*value]).collect(),
        }
    }
}

/// Returns the rotations, with the quaternions' signs chosen so that consecutive quaternions are close.
fn on_one_side(rotations: &[Quat]) -> impl Iterator<Item = Quat> {
    rotations.iter().scan(None, |before: &mut Option<Quat>, &rotation| {
        let is_opposite = before.is_some_and(|before| before.dot(rotation) < 0.0);
        *before = Some(if is_opposite { -rotation } else { rotation });
        *before
    })
}

/// Returns in-tangent, value and out-tangent of each keyframe, as `CUBICSPLINE` needs them.
fn with_tangents(values: &[Vec<f32>], interval: f32) -> Vec<f32> {
    let last = values.len() - 1;
    let keyframe = |index: usize| {
        let (from, to) = (index.saturating_sub(1), (index + 1).min(last));
        let time = interval * (to - from).max(1) as f32;
        let tangent: Vec<_> = values[from].iter().zip(&values[to]).map(|(a, b)| (b - a) / time).collect();
        [tangent.clone(), values[index].clone(), tangent].concat()
    };
    (0..=last).flat_map(keyframe).collect()
}

impl SceneBuilder {
    /// Adds an animation.
    pub(crate) fn animation(&mut self, name: &str, tracks: &[Track]) {
        let mut entry = AnimationEntry { name: name.into(), channels: Vec::new(), samplers: Vec::new() };
        for track in tracks {
            let target = ChannelTarget { node: track.node, path: track.values.path() };
            entry.channels.push(Channel { sampler: entry.samplers.len(), target });
            let sampler = self.keyframes(track);
            entry.samplers.push(sampler);
        }
        self.document.animations.push(entry);
    }

    fn keyframes(&mut self, track: &Track) -> KeyframeSampler {
        let Track { values, interval, between, .. } = track;
        let (kind, values) = (values.kind(), values.components());
        let times: Vec<f32> = (0..values.len()).map(|index| index as f32 * interval).collect();
        let input = self.numbers(&times, times.len(), "SCALAR");
        let accessor = &mut self.document.accessors[input];
        accessor.min = times.first().map(|time| vec![*time]);
        accessor.max = times.last().map(|time| vec![*time]);
        let (interpolation, numbers, of_each) = match between {
            Between::Step => ("STEP", values.concat(), 1),
            Between::Linear => ("LINEAR", values.concat(), 1),
            Between::Smooth => ("CUBICSPLINE", with_tangents(&values, *interval), 3),
        };
        KeyframeSampler { input, output: self.numbers(&numbers, of_each * values.len(), kind), interpolation }
    }

    /// Adds a camera whose node can be animated; returns the node.
    pub(crate) fn moving_camera(&mut self, name: &str, camera: &Camera) -> usize {
        let (lens, rotation) = (self.lens(name, camera), camera.rotation().to_array());
        self.root(Node {
            name: name.into(),
            camera: Some(lens),
            translation: Some(camera.eye.to_array()),
            rotation: Some(rotation),
            ..Node::default()
        })
    }

    /// Adds a point light with `intensity` in W/sr. Returns the extension that places the light at a node.
    pub(crate) fn point_light(&mut self, name: &str, color: [f64; 3], intensity: f64) -> NodeExtensions {
        let extensions = &mut self.document.extensions;
        let lights =
            &mut extensions.get_or_insert(RootExtensions { lights: Lights::default() }).lights.lights;
        lights.push(PointLight { kind: "point", name: name.into(), color, intensity });
        NodeExtensions { light: LightIndex { light: lights.len() - 1 } }
    }

    /// Adds a skin and returns its index. `joints` holds the index of each joint's node, and the joint's
    /// position in the bind pose, metres.
    pub(crate) fn skin(&mut self, joints: &[(usize, Vec3)]) -> usize {
        let inverse = joints.iter().flat_map(|(_, place)| Mat4::from_translation(-*place).to_cols_array());
        let inverse: Vec<f32> = inverse.map(|number| number + 0.0).collect();
        let inverse_bind_matrices = self.numbers(&inverse, joints.len(), "MAT4");
        let joints = joints.iter().map(|(node, _)| *node).collect();
        self.document.skins.push(Skin { joints, inverse_bind_matrices });
        self.document.skins.len() - 1
    }

    /// Binds vertices to the first two joints of a skin. `shares` holds, for each vertex, the weight `w` of
    /// the second joint; the first joint has `1 - w`.
    pub(crate) fn hung(&mut self, mut geometry: Geometry, shares: &[f32]) -> Geometry {
        geometry.attributes.joints_0 = Some(self.joints(&vec![[0, 1, 0, 0]; shares.len()]));
        let weights = shares.iter().map(|share| [1.0 - share, *share, 0.0, 0.0]);
        geometry.attributes.weights_0 = Some(self.vectors(weights, "VEC4"));
        geometry
    }

    /// Adds a morph target to the only primitive of a mesh.
    pub(crate) fn morph_target(&mut self, mesh: usize, displacements: &[Vec3]) {
        let position = self.vectors(displacements.iter().map(Vec3::to_array), "VEC3");
        let extent = |fold: fn(Vec3, Vec3) -> Vec3, from: Vec3| {
            displacements.iter().copied().fold(from, fold).to_array().to_vec()
        };
        let accessor = &mut self.document.accessors[position];
        accessor.min = Some(extent(Vec3::min, Vec3::INFINITY));
        accessor.max = Some(extent(Vec3::max, Vec3::NEG_INFINITY));
        self.document.meshes[mesh].primitives[0].targets = Some(vec![MorphTarget { position }]);
    }
}
