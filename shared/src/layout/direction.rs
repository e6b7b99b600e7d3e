//! Unit vectors in two bytes and in one, by the octahedral map (Meyer et al. 2010, *On floating-point normal
//! vectors*): the sphere is projected on the octahedron `|x| + |y| + |z| = 1` and unfolded to a square.
//!
//! Quantised with an odd number of steps, so that the six axes are exact.

/// Steps each side of zero in a direction's byte.
const DIRECTION_STEPS: f32 = 127.0;
/// Steps each side of zero in a normal's half byte.
const NORMAL_STEPS: f32 = 7.0;

/// A unit vector in two bytes, to within one degree.
pub fn encode_direction(vector: [f32; 3]) -> [u8; 2] {
    let [u, v] = unfold(vector);
    [quantise(u, DIRECTION_STEPS), quantise(v, DIRECTION_STEPS)]
}

/// A vector along the direction in `bytes`, with `|x| + |y| + |z| = 1`: not of unit length.
#[inline(always)]
pub fn decode_direction(bytes: [u8; 2]) -> [f32; 3] {
    let [u, v] = bytes.map(|byte| (byte as f32 - DIRECTION_STEPS) / DIRECTION_STEPS);
    fold(u, v)
}

/// A unit normal in one byte, to within sixteen degrees: enough to tell one surface from its neighbour.
pub fn encode_normal(vector: [f32; 3]) -> u8 {
    let [u, v] = unfold(vector);
    quantise(u, NORMAL_STEPS) << 4 | quantise(v, NORMAL_STEPS)
}

/// A vector along the normal in `byte`, with `|x| + |y| + |z| = 1`: not of unit length.
#[inline(always)]
pub fn decode_normal(byte: u8) -> [f32; 3] {
    let [u, v] = [byte >> 4, byte & 15].map(|half| (half as f32 - NORMAL_STEPS) / NORMAL_STEPS);
    fold(u, v)
}

fn magnitude(x: f32) -> f32 {
    if x < 0.0 { -x } else { x }
}

fn unfold([x, y, z]: [f32; 3]) -> [f32; 2] {
    let sum = magnitude(x) + magnitude(y) + magnitude(z);
    // A zero vector has no direction; any will do, as long as it is a number.
    let scale = if sum > 0.0 { 1.0 / sum } else { 0.0 };
    let [u, v] = [x * scale, y * scale];
    if z >= 0.0 {
        return [u, v];
    }
    let sign = |a: f32| if a < 0.0 { -1.0 } else { 1.0 };
    [(1.0 - magnitude(v)) * sign(u), (1.0 - magnitude(u)) * sign(v)]
}

#[inline(always)]
fn fold(u: f32, v: f32) -> [f32; 3] {
    let z = 1.0 - magnitude(u) - magnitude(v);
    let overhang = if z < 0.0 { -z } else { 0.0 };
    let inward = |a: f32| if a < 0.0 { a + overhang } else { a - overhang };
    [inward(u), inward(v), z]
}

/// `value` in [-1, 1] to the nearest of `2 steps + 1` codes, `steps` standing for zero.
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

    /// Newton's square root: tests of a `no_std` crate have none.
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
