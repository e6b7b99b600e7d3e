//! Keyframes of an animation's sampler.

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::animation::Interpolation;

use super::accessor::{Elements, Format, Integers, Source};
use crate::error::SceneError;

const TIMES: Format =
    Format { types: &[Type::Scalar], components: &[ComponentType::F32], integers: Integers::Whole };

const REMEDY: &str = "export the animation again, with increasing times of 0 or more";

/// Increasing times of keyframes, seconds.
pub(super) struct Keyframes<'a> {
    times: Elements<'a>,
    pub(super) interpolation: Interpolation,
}

/// Position of a time among the keyframes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Index of the last keyframe at or before the time; 0 if the time precedes all keyframes.
    pub(super) keyframe: u64,
    /// Fraction of the time to the next keyframe that has passed, 0 to 1. It is 0 before the first keyframe
    /// and after the last.
    pub(super) share: f64,
    /// Time from that keyframe to the next one, seconds; 0 if `share` is 0.
    pub(super) interval: f64,
}

impl<'a> Keyframes<'a> {
    /// Reads keyframe times from accessor `index`. `item` is the JSON path that refers to it.
    pub(super) fn new(
        source: &Source<'a>,
        index: usize,
        item: &str,
        interpolation: Interpolation,
    ) -> Result<Self, SceneError> {
        let times = Elements::new(source, index, item, &TIMES)?;
        let found = Self { times, interpolation };
        let fault = |reason: &str| Err(source.document.invalid(item, reason, REMEDY));
        if found.count() == 0 {
            return fault("there are no keyframes");
        }
        let mut before = f64::NEG_INFINITY;
        for keyframe in 0..found.count() {
            let time = found.time(keyframe);
            if !time.is_finite() || time <= before {
                return fault("its times are not finite, or do not increase");
            }
            before = time;
        }
        Ok(found)
    }

    /// Number of keyframes, at least 1.
    pub(super) fn count(&self) -> u64 {
        self.times.count
    }

    /// Number of elements per keyframe: 3 for a cubic spline, which has tangents, else 1.
    pub(super) fn values_of_each(&self) -> u64 {
        if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 }
    }

    fn time(&self, keyframe: u64) -> f64 {
        let [time] = self.times.floats(keyframe, [0.0]);
        time.into()
    }

    /// Times of the first and the last keyframe, seconds.
    pub(super) fn extent(&self) -> [f64; 2] {
        [0, self.count().saturating_sub(1)].map(|keyframe| self.time(keyframe))
    }

    /// Finds the keyframes around a time.
    pub(super) fn at(&self, seconds: f64) -> Place {
        let last = self.count().saturating_sub(1);
        let (mut low, mut high) = (0, last);
        // The last keyframe at or before `seconds` lies within `low..=high`; if there is none, the first
        // does.
        while low < high {
            let middle = high - (high - low) / 2;
            if self.time(middle) <= seconds {
                low = middle;
            } else {
                high = middle - 1;
            }
        }
        let begin = self.time(low);
        if low == last || seconds <= begin {
            return Place { keyframe: low, share: 0.0, interval: 0.0 };
        }
        let interval = self.time(low + 1) - begin;
        Place { keyframe: low, share: (seconds - begin) / interval, interval }
    }
}
