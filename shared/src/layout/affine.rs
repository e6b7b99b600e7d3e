//! Affine transforms.

/// Rows of an affine transform: `x' = rows[0] . (x, y, z, 1)`, and so on.
pub type Rows = [[f32; 4]; 3];

/// Image of a point under an affine transform.
#[inline(always)]
pub fn placed_point(rows: &Rows, [x, y, z]: [f32; 3]) -> [f32; 3] {
    let [a, b, c] = rows;
    let coordinate = |[i, j, k, l]: &[f32; 4]| i * x + j * y + k * z + l;
    [coordinate(a), coordinate(b), coordinate(c)]
}

/// Image of a vector under the linear part of an affine transform.
#[inline(always)]
pub fn placed_vector(rows: &Rows, [x, y, z]: [f32; 3]) -> [f32; 3] {
    let [a, b, c] = rows;
    let component = |[i, j, k, _]: &[f32; 4]| i * x + j * y + k * z;
    [component(a), component(b), component(c)]
}

/// Image of a normal under an affine transform, given the inverse of the transform: the transposed linear
/// part of `inverse` times the normal. The result is not normalised.
#[inline(always)]
pub fn placed_normal(inverse: &Rows, [x, y, z]: [f32; 3]) -> [f32; 3] {
    let [[a, b, c, _], [d, e, f, _], [g, h, i, _]] = *inverse;
    [a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + i * z]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_normal_stays_perpendicular_to_its_plane() {
        let sheared = [[1.0, 2.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        let inverse = [[1.0, -2.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        let along = placed_vector(&sheared, [0.0, 1.0, 0.0]);
        let normal = placed_normal(&inverse, [1.0, 0.0, 0.0]);
        assert_eq!(along.iter().zip(normal).map(|(a, b)| a * b).sum::<f32>(), 0.0);
    }
}
