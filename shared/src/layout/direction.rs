//! Unit vectors in one or two bytes, by the octahedral map (Meyer et al. 2010, *On floating-point normal
//! vectors*). The sphere is projected onto the octahedron `|x| + |y| + |z| = 1`, which is unfolded to a
//! square.
//!
//! Each coordinate of the square has an odd number of codes. Zero, and with it the six axes, are therefore
//! exact.

/// Number of quantisation steps from 0 to 1 in a coordinate of a direction, stored in 8 bits.
const DIRECTION_STEPS: f32 = 127.0;
/// Number of quantisation steps from 0 to 1 in a coordinate of a normal, stored in 4 bits.
const NORMAL_STEPS: f32 = 7.0;

/// Encodes a unit vector as an octahedral code of two bytes. The error is at most 1 degree.
#[inline]
pub fn encode_direction(vector: [f32; 3]) -> [u8; 2] {
    let [u, v] = unfold(vector);
    [quantise(u, DIRECTION_STEPS), quantise(v, DIRECTION_STEPS)]
}

/// Decodes a two-byte octahedral code to a vector with `|x| + |y| + |z| = 1`, not normalised.
#[inline(always)]
pub fn decode_direction(bytes: [u8; 2]) -> [f32; 3] {
    let [u, v] = bytes.map(|byte| (byte as f32 - DIRECTION_STEPS) / DIRECTION_STEPS);
    fold(u, v)
}

/// Encodes a unit normal as an octahedral code of one byte. The error is at most 16 degrees, small enough to
/// distinguish adjacent surfaces.
#[inline]
pub fn encode_normal(vector: [f32; 3]) -> u8 {
    let [u, v] = unfold(vector);
    quantise(u, NORMAL_STEPS) << 4 | quantise(v, NORMAL_STEPS)
}

/// Decodes a one-byte octahedral code to a vector with `|x| + |y| + |z| = 1`, not normalised.
#[inline(always)]
pub const fn decode_normal(byte: u8) -> [f32; 3] {
    let [high, low] = [byte >> 4, byte & 15];
    fold((high as f32 - NORMAL_STEPS) / NORMAL_STEPS, (low as f32 - NORMAL_STEPS) / NORMAL_STEPS)
}

/// Returns the class of directions, 0 to 15, of a normal's octahedral code: the upper two bits of each
/// coordinate. 4x4 adjacent codes share a class.
#[inline(always)]
pub const fn normal_class(byte: u8) -> u32 {
    (byte as u32 >> 6) << 2 | (byte as u32 >> 2) & 3
}

const fn magnitude(x: f32) -> f32 {
    if x < 0.0 { -x } else { x }
}

fn unfold([x, y, z]: [f32; 3]) -> [f32; 2] {
    let sum = magnitude(x) + magnitude(y) + magnitude(z);
    // A zero vector has no direction: any finite result will do.
    let scale = if sum > 0.0 { 1.0 / sum } else { 0.0 };
    let [u, v] = [x * scale, y * scale];
    if z >= 0.0 {
        return [u, v];
    }
    let sign = |a: f32| if a < 0.0 { -1.0 } else { 1.0 };
    [(1.0 - magnitude(v)) * sign(u), (1.0 - magnitude(u)) * sign(v)]
}

#[inline(always)]
const fn fold(u: f32, v: f32) -> [f32; 3] {
    let z = 1.0 - magnitude(u) - magnitude(v);
    let overhang = if z < 0.0 { -z } else { 0.0 };
    [inward(u, overhang), inward(v, overhang), z]
}

#[inline(always)]
const fn inward(a: f32, overhang: f32) -> f32 {
    if a < 0.0 { a + overhang } else { a - overhang }
}

/// Quantises a value in [-1, 1] to the nearest code, 0 to `2 steps`. The code of zero is `steps`.
fn quantise(value: f32, steps: f32) -> u8 {
    (value * steps + steps + 0.5) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    const AXES: [[f32; 3]; 6] =
        [[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];

    fn cosine(a: [f32; 3], b: [f32; 3]) -> f64 {
        let dot = |a: [f32; 3], b: [f32; 3]| (0..3).map(|i| a[i] as f64 * b[i] as f64).sum::<f64>();
        dot(a, b) / libm_sqrt(dot(a, a) * dot(b, b))
    }

    /// Square root by Newton's method, since tests of a `no_std` crate have none.
    fn libm_sqrt(x: f64) -> f64 {
        (0..60).fold(1.0, |root, _| 0.5 * (root + x / root))
    }

    fn sphere() -> impl Iterator<Item = [f32; 3]> {
        (0..40_i32).flat_map(|i| (0..40_i32).map(move |j| (i, j))).filter_map(|(i, j)| {
            let [x, y] = [(i - 20) as f32 / 20.0, (j - 20) as f32 / 20.0];
            let z = 1.0 - x * x - y * y;
            (z.abs() > 0.0).then_some([x, y, z])
        })
    }

    #[test]
    fn axes_are_exact() {
        for axis in AXES {
            assert_eq!(decode_direction(encode_direction(axis)), axis);
            assert_eq!(decode_normal(encode_normal(axis)), axis);
        }
    }

    #[test]
    fn directions_are_within_one_degree_and_normals_within_sixteen() {
        for vector in sphere() {
            assert!(cosine(vector, decode_direction(encode_direction(vector))) > 0.99985);
            assert!(cosine(vector, decode_normal(encode_normal(vector))) > 0.96);
        }
    }
}
