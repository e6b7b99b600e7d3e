//! Skins: joint matrices in the pose of the scene (glTF 2.0, 3.7.3.3).

use glam::DMat4;
use gltf::json::accessor::{ComponentType, Type};

use super::accessor::{Elements, Format, Integers, Source};
use super::primitive::Primitive;
use crate::error::SceneError;

const REMEDY: &str = "export the rigged mesh again, or apply its pose in the modelling tool";

const MATRICES: Format =
    Format { types: &[Type::Mat4], components: &[ComponentType::F32], integers: Integers::Whole };

pub(super) struct Skin {
    index: usize,
    joints: Vec<DMat4>,
}

impl Skin {
    /// Computes the joint matrices of skin `index`, which exists, from the world transforms of all nodes. The
    /// transforms of nodes outside the scene are `None`.
    pub(super) fn new(
        source: &Source<'_>,
        index: usize,
        worlds: &[Option<DMat4>],
    ) -> Result<Self, SceneError> {
        let document = source.document;
        let skin = &document.root.skins[index];
        let item = format!("skins[{index}].inverseBindMatrices");
        let inverse = skin.inverse_bind_matrices;
        let inverse =
            inverse.map(|accessor| Elements::new(source, accessor.value(), &item, &MATRICES)).transpose()?;
        if inverse.as_ref().is_some_and(|inverse| inverse.count < skin.joints.len() as u64) {
            let reason = format!("there are fewer matrices than the {} joints", skin.joints.len());
            return Err(document.invalid(item, reason, REMEDY));
        }
        let mut joints = Vec::with_capacity(skin.joints.len());
        for (place, joint) in skin.joints.iter().enumerate() {
            let item = || format!("skins[{index}].joints[{place}]");
            let world = worlds.get(joint.value()).copied().flatten().ok_or_else(|| {
                document.invalid(item(), format!("nodes[{joint}] is not part of the scene"), REMEDY)
            })?;
            let inverse = inverse.as_ref().map_or(DMat4::IDENTITY, |inverse| {
                let columns = inverse.floats(place as u64, [0.0; 16]);
                DMat4::from_cols_array(&columns.map(f64::from))
            });
            let matrix = world * inverse;
            if !matrix.is_finite() {
                let reason = "the joint's transform with its inverse bind matrix is not finite";
                return Err(document.invalid(item(), reason, REMEDY));
            }
            joints.push(matrix);
        }
        Ok(Self { index, joints })
    }

    pub(super) fn joints(&self) -> &[DMat4] {
        &self.joints
    }

    /// Joint matrix of a vertex: the weighted mean of its joints' matrices. A vertex without weights follows
    /// its first joint.
    pub(super) fn matrix(&self, primitive: &Primitive<'_>, vertex: u64) -> Result<DMat4, String> {
        let mut first = None;
        let (mut sum, mut total) = (DMat4::ZERO, 0.0);
        for (joints, weights) in &primitive.influences {
            let weights = weights.floats(vertex, [0.0; 4]);
            for (joint, weight) in joints.unsigned4(vertex).into_iter().zip(weights) {
                if !(weight >= 0.0 && weight.is_finite()) {
                    return Err(format!("has a weight of {weight}: neither 0 nor above"));
                }
                let matrix = usize::try_from(joint).ok().and_then(|joint| self.joints.get(joint));
                let Some(matrix) = matrix else {
                    let count = self.joints.len();
                    return Err(format!("follows joint {joint} of skins[{}], which has {count}", self.index));
                };
                first = first.or(Some(*matrix));
                sum += *matrix * f64::from(weight);
                total += f64::from(weight);
            }
        }
        let mean = if total > 0.0 { sum * total.recip() } else { first.unwrap_or(DMat4::IDENTITY) };
        Ok(mean)
    }
}
