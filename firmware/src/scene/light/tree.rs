//! Light tree: selection of the emitter of a shadow ray (Conty Estevez, Kulla 2018, *Importance sampling of
//! many lights with adaptive tree splitting*; bounds as in Pharr, Jakob, Humphreys 2023, *Physically Based
//! Rendering*, section 12.6.3).
//!
//! At each node, one of up to four children is chosen with a probability proportional to an estimate of its
//! light at the receiver. The estimate is power times the cosines at receiver and emitter, divided by
//! `max(d^2, r^2)`. Here `r` is the radius of the child's bounding sphere, and `d` the distance to its
//! centre. Each cosine is a weighted mean of the cosine at the centre and of the greatest cosine that the
//! sphere and the cone of normals allow. The papers use the greatest cosine alone. It overestimates a large
//! lamp, which reaches this cosine at few points, and so takes rays from emitters that contribute more. A
//! fraction [`EVEN`] of the choices is uniform, so that emitters with a low estimate are still sampled. A
//! child whose greatest cosine is negative cannot light the receiver and is excluded.

use glam::Vec3;
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::image::SectionKind;
use photoncard_shared::layout::{
    Emitter, LIGHT_CHILDREN, LIGHT_TREE_LEVELS, LightChild, LightLink, LightNode, Record,
};
use photoncard_shared::message::{Fault, FaultCode};

use super::choice::Fraction;
use super::sample::Receiver;
use crate::memory::MemoryPort;
use crate::scene::SceneImage;
use crate::vector::{max, sqrt, unit};

const EMITTERS_PER_LINE: u32 = Emitter::PER_LINE as u32;
const TRAIL_BITS: usize = 2;
const _: () = assert!(1 << TRAIL_BITS == LIGHT_CHILDREN && TRAIL_BITS * LIGHT_TREE_LEVELS <= 32);

/// Probability with which the choice at a node is uniform among the children that are not excluded.
const EVEN: f32 = 1.0 / 64.0;
/// Weight of the greatest cosine in [`mean_cosine`] for a child that is a single emitter. This value gives
/// the least noise in the scenes `atrium` and `room`.
const EMITTER_BOUND: f32 = 1.0 / 8.0;
/// Weight of the greatest cosine in [`mean_cosine`] for a child that is a node, whose emitters can be
/// anywhere in its bounding sphere. This value gives the least noise with 10,000 emitters.
const NODE_BOUND: f32 = 1.0 / 2.0;
/// Limit of the greatest cosine, below which a child is excluded. It lies below 0 by more than the rounding
/// error of the cones' axes.
const BELOW_HORIZON: f32 = -1e-3;

/// Emitter that [`select_emitter`] has selected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Selection {
    /// Index of the emitter.
    pub emitter: u32,
    /// Probability with which the emitter was selected.
    pub probability: f32,
    /// Random number, rescaled after the selection, for the choice of a point on the emitter.
    pub rest: Fraction,
}

/// Selects an emitter for the receiver of `choices`; `None` if no emitter can light the receiver.
///
/// # Errors
/// If the card image is invalid.
pub fn select_emitter(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    choices: &mut LightChoices,
    mut fraction: Fraction,
) -> Result<Option<Selection>, Fault> {
    let (mut node, mut probability) = (0, 1.0);
    for _ in 0..LIGHT_TREE_LEVELS {
        let Some((child, lower)) = choices.at(scene, memory, node)?.choose(fraction) else {
            return Ok(None);
        };
        fraction = fraction.within(lower, child.probability);
        probability *= child.probability;
        match child.link {
            LightLink::Node(next) => node = next,
            LightLink::Emitter(emitter) => {
                return Ok(Some(Selection { emitter, probability, rest: fraction }));
            }
        }
    }
    Err(Fault { code: FaultCode::Depth, detail: node })
}

/// Probability with which [`select_emitter`] selects `emitter`; 0 if the emitter cannot light the receiver.
///
/// # Errors
/// If the card image is invalid.
pub fn selection_probability(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    receiver: &Receiver,
    emitter: u32,
) -> Result<f32, Fault> {
    let kind = SectionKind::Emitters;
    let bytes = scene.record::<{ Emitter::BYTES }, EMITTERS_PER_LINE>(memory, kind, emitter)?;
    let mut trail = Emitter::trail(bytes);
    let (mut node, mut probability) = (0, 1.0);
    for _ in 0..LIGHT_TREE_LEVELS {
        let children = read_node(scene, memory, node)?;
        let next = trail as usize % LIGHT_CHILDREN;
        trail >>= TRAIL_BITS;
        let link = children.get(next).and_then(|child| child.map(|child| child.link));
        let Some(child) = Choice::new(&children, receiver).option(next) else {
            // The child is excluded, or does not exist, because the trail is unsound.
            return link.map(|_| 0.0).ok_or(Fault { code: FaultCode::Record, detail: emitter });
        };
        probability *= child.probability;
        match child.link {
            LightLink::Node(next) => node = next,
            LightLink::Emitter(found) if found == emitter => return Ok(probability),
            LightLink::Emitter(_) => break,
        }
    }
    Err(Fault { code: FaultCode::Depth, detail: node })
}

type Children = [Option<LightChild>; LIGHT_CHILDREN];

fn read_node(scene: &SceneImage, memory: &mut impl MemoryPort, index: u32) -> Result<Children, Fault> {
    let line = LightNode(scene.line(memory, SectionKind::LightNodes, index, 0..LINE_BYTES as u32)?);
    Ok(core::array::from_fn(|child| line.child(child)))
}

/// Node number of an empty cache entry; no tree contains this node.
const NO_NODE: u32 = u32::MAX;
/// Number of nodes whose `Choice`s are cached.
const KEPT_CHOICES: usize = 4;

/// A receiver, with a cache of the child probabilities (`Choice`) of a few nodes of the light tree. Most
/// shadow rays of a point use the same nodes.
pub struct LightChoices {
    pub(super) receiver: Receiver,
    /// Cached choices, each with the number of its node. Node `i` is stored at index `i` modulo
    /// `KEPT_CHOICES`.
    kept: [(u32, Choice); KEPT_CHOICES],
}

impl LightChoices {
    /// Creates the choices for a receiver, with an empty cache.
    pub fn new(receiver: Receiver) -> Self {
        Self { receiver, kept: [(NO_NODE, Choice::NONE); KEPT_CHOICES] }
    }

    /// Returns the child probabilities at a node. Reads the node if they are not in the cache.
    fn at(&mut self, scene: &SceneImage, memory: &mut impl MemoryPort, node: u32) -> Result<&Choice, Fault> {
        let [first, second, third, fourth] = &mut self.kept;
        let kept = match node as usize % KEPT_CHOICES {
            0 => first,
            1 => second,
            2 => third,
            _ => fourth,
        };
        if kept.0 != node {
            *kept = (node, Choice::new(&read_node(scene, memory, node)?, &self.receiver));
        }
        Ok(&kept.1)
    }
}

/// Children of a node with their probabilities; `None` for a child that cannot light the receiver.
#[derive(Clone, Copy)]
struct Choice {
    options: [Option<Weighted>; LIGHT_CHILDREN],
}

/// Child of a node, and the probability with which it is chosen.
#[derive(Clone, Copy)]
struct Weighted {
    link: LightLink,
    probability: f32,
}

impl Choice {
    const NONE: Self = Self { options: [None; LIGHT_CHILDREN] };

    fn new(children: &Children, receiver: &Receiver) -> Self {
        let mut estimates = [None; LIGHT_CHILDREN];
        for (estimate, child) in estimates.iter_mut().zip(children) {
            *estimate = child.as_ref().and_then(|child| Estimate::new(child, receiver));
        }
        // Weights are relative to the nearest child, because reciprocals of squared distances may overflow or
        // underflow.
        let nearest = estimates.iter().flatten().map(|estimate| estimate.distance_squared);
        let nearest = nearest.fold(f32::INFINITY, crate::vector::min);
        let mut weights = [0.0; LIGHT_CHILDREN];
        for (weight, estimate) in weights.iter_mut().zip(&estimates) {
            *weight = estimate.as_ref().map_or(0.0, |estimate| estimate.weight(nearest));
        }
        let total: f32 = weights.iter().sum();
        let count = estimates.iter().flatten().count() as f32;
        let mut options = [None; LIGHT_CHILDREN];
        for ((option, child), (estimate, weight)) in
            options.iter_mut().zip(children).zip(estimates.iter().zip(weights))
        {
            // A node may have fewer children, and a child that cannot light the receiver has no estimate.
            let (Some(child), Some(_)) = (child, estimate) else { continue };
            let even = 1.0 / count;
            // Not `<= 0`: in an unsound card image the sum may be NaN.
            let probability = if total > 0.0 { weight / total * (1.0 - EVEN) + even * EVEN } else { even };
            *option = Some(Weighted { link: child.link, probability });
        }
        Self { options }
    }

    fn option(&self, index: usize) -> Option<Weighted> {
        self.options.get(index).copied().flatten()
    }

    /// Returns the child chosen by the random number `fraction`, and the lower end of the child's interval in
    /// [0, 1); `None` if no child can light the receiver.
    fn choose(&self, fraction: Fraction) -> Option<(Weighted, f32)> {
        let mut chosen = None;
        let mut lower = 0.0;
        for &option in self.options.iter().flatten() {
            chosen = Some((option, lower));
            lower += option.probability;
            if fraction.value() < lower {
                break;
            }
        }
        chosen
    }
}

/// Estimate of the light from a child that arrives at a receiver: `strength / distance_squared`.
#[derive(Clone, Copy)]
struct Estimate {
    /// Power times the cosines at receiver and emitter.
    strength: f32,
    /// `max(d^2, r^2)`, m^2, for the child's bounding sphere (see the module).
    distance_squared: f32,
}

impl Estimate {
    /// Computes the estimate; `None` if the child cannot light the receiver.
    fn new(child: &LightChild, receiver: &Receiver) -> Option<Self> {
        let way = Vec3::from_array(child.centre) - receiver.position;
        let towards = unit(way);
        let received = receiver.normal.dot(towards);
        let shines_everywhere = child.cosine <= -1.0;
        let emitted = if shines_everywhere { 1.0 } else { -unit(child.axis.into()).dot(towards) };
        let (squared, radius_squared) = (way.length_squared(), child.radius * child.radius);
        let (mut greatest_received, mut greatest_emitted) = (1.0, 1.0);
        // Inside the bounding sphere, emitters may lie in any direction.
        if squared > radius_squared {
            let sphere = Angle::of_sine_squared(radius_squared / squared);
            greatest_received = Angle::of_cosine(received).less(sphere).cosine;
            if !shines_everywhere {
                let cone = Angle::of_cosine(child.cosine);
                greatest_emitted = Angle::of_cosine(emitted).less(cone).less(sphere).cosine;
            }
        }
        if greatest_received < BELOW_HORIZON || greatest_emitted < BELOW_HORIZON {
            return None;
        }
        let bound = match child.link {
            LightLink::Node(_) => NODE_BOUND,
            LightLink::Emitter(_) => EMITTER_BOUND,
        };
        let cosines =
            mean_cosine(received, greatest_received, bound) * mean_cosine(emitted, greatest_emitted, bound);
        let strength = max(child.share, 0.0) * cosines;
        Some(Self { strength, distance_squared: max(squared, radius_squared) })
    }

    fn weight(&self, nearest: f32) -> f32 {
        let nearness = if self.distance_squared > nearest { nearest / self.distance_squared } else { 1.0 };
        self.strength * nearness
    }
}

/// `(1 - bound) centre + bound greatest`, where negative cosines count as 0.
fn mean_cosine(centre: f32, greatest: f32, bound: f32) -> f32 {
    (1.0 - bound) * max(centre, 0.0) + bound * max(greatest, 0.0)
}

/// An angle from 0 to pi, given by its cosine and sine.
#[derive(Clone, Copy)]
struct Angle {
    cosine: f32,
    sine: f32,
}

impl Angle {
    const ZERO: Self = Self { cosine: 1.0, sine: 0.0 };

    fn of_cosine(cosine: f32) -> Self {
        Self { cosine, sine: sqrt(max(1.0 - cosine * cosine, 0.0)) }
    }

    /// Angle from 0 to pi / 2 whose sine has the square `squared`.
    fn of_sine_squared(squared: f32) -> Self {
        Self { cosine: sqrt(max(1.0 - squared, 0.0)), sine: sqrt(squared) }
    }

    /// Difference of two angles; 0 if `other` is greater.
    fn less(self, other: Self) -> Self {
        if self.cosine >= other.cosine {
            return Self::ZERO;
        }
        Self {
            cosine: self.cosine * other.cosine + self.sine * other.sine,
            sine: self.sine * other.cosine - self.cosine * other.sine,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_subtracted_and_never_below_zero() {
        let angle = |radians: f32| Angle::of_cosine(libm::cosf(radians));
        for (a, b) in [(2.0, 0.5), (3.0, 2.9), (1.0, 1.5), (0.7, 0.0), (3.1, 0.2)] {
            let found = angle(a).less(angle(b));
            let expected = (a - b).max(0.0);
            assert!((found.cosine - libm::cosf(expected)).abs() < 1e-5, "{a} - {b}");
            assert!((found.sine - libm::sinf(expected)).abs() < 1e-5, "{a} - {b}");
        }
    }

    fn child(centre: Vec3, radius: f32, axis: Vec3, cosine: f32) -> LightChild {
        LightChild {
            centre: centre.to_array(),
            radius,
            share: 1.0,
            axis: axis.to_array(),
            cosine,
            link: LightLink::Emitter(0),
        }
    }

    const FLOOR: Receiver = Receiver { position: Vec3::ZERO, normal: Vec3::Y, origin: Vec3::ZERO };

    #[test]
    fn only_emitters_that_cannot_light_the_receiver_are_excluded() {
        let may_light = |child: LightChild| Estimate::new(&child, &FLOOR).is_some();
        let down = Vec3::NEG_Y;
        assert!(may_light(child(2.0 * Vec3::Y, 0.1, down, 1.0)));
        assert!(!may_light(child(2.0 * Vec3::Y, 0.1, Vec3::Y, 1.0)), "it shines away");
        assert!(may_light(child(2.0 * Vec3::Y, 0.1, Vec3::Y, -1.0)), "it shines to all sides");
        assert!(!may_light(child(-2.0 * Vec3::Y, 0.1, Vec3::Y, 1.0)), "it is below the horizon");
        assert!(may_light(child(-2.0 * Vec3::Y, 2.1, Vec3::Y, 1.0)), "part of it may be above");
        let level = Vec3::new(2.0, -0.05, 0.0);
        assert!(may_light(child(level, 0.1, down, -1.0)), "its upper part is above the horizon");
        assert!(!may_light(child(level, 0.01, down, -1.0)));
    }

    #[test]
    fn selection_probabilities_sum_to_one_and_match_the_selections() {
        let up =
            |share: f32, x: f32| LightChild { share, ..child(Vec3::new(x, 1.0, 0.0), 0.1, Vec3::NEG_Y, 0.9) };
        let children = [Some(up(0.25, 0.0)), None, Some(up(0.5, 40.0)), Some(up(1e-20, 3.0))];
        let choice = Choice::new(&children, &FLOOR);
        let options = [0, 1, 2, 3].map(|index| choice.option(index).map_or(0.0, |option| option.probability));
        assert!((options.iter().sum::<f32>() - 1.0).abs() < 1e-6, "{options:?}");
        assert!(options[0] > 0.9 && options[1] == 0.0 && options[2] > 0.005 && options[3] > 0.005);
        let mut counts = [0_u32; 4];
        for step in 0..100_000 {
            let fraction = Fraction::new((step as f32 + 0.5) / 100_000.0, step);
            let (chosen, _) = choice.choose(fraction).unwrap();
            let index = options.iter().position(|&option| option == chosen.probability).unwrap();
            counts[index] += 1;
        }
        assert!(
            options.iter().zip(counts).all(|(a, b)| (a - b as f32 / 100_000.0).abs() < 1e-4),
            "{options:?} {counts:?}"
        );
    }
}
