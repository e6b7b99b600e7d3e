//! Numbers and vectors in sixteen lanes, and arithmetic on the vector in one lane.

use glam::Vec3;
use photoncard_firmware::simd::LANES;

pub(super) type Lane = [f32; LANES];

/// Components of sixteen vectors.
pub(super) type LaneVector = [Lane; 3];

pub(super) fn set(lanes: &mut LaneVector, lane: usize, vector: Vec3) {
    for (lanes, component) in lanes.iter_mut().zip(vector.to_array()) {
        lanes[lane] = component;
    }
}

#[inline(always)]
pub(super) fn at(vector: &LaneVector, lane: usize) -> [f32; 3] {
    [vector[0][lane], vector[1][lane], vector[2][lane]]
}

#[inline(always)]
pub(super) fn minus([a, b, c]: [f32; 3], [x, y, z]: [f32; 3]) -> [f32; 3] {
    [a - x, b - y, c - z]
}

#[inline(always)]
pub(super) fn dot([a, b, c]: [f32; 3], [x, y, z]: [f32; 3]) -> f32 {
    a * x + b * y + c * z
}

#[inline(always)]
pub(super) fn cross([a, b, c]: [f32; 3], [x, y, z]: [f32; 3]) -> [f32; 3] {
    [b * z - c * y, c * x - a * z, a * y - b * x]
}

#[inline(always)]
pub(super) fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
pub(super) fn greatest(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
