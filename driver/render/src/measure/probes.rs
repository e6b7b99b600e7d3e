//! Irradiance probes: the irradiance at a point as a function of the normal, in real spherical harmonics of
//! order 2 (Ramamoorthi, Hanrahan 2001, *An efficient representation for irradiance environment maps*).

use std::f64::consts::PI;

use super::reading::{Point, Reading};

/// Number of directions whose irradiance makes a probe.
pub const PROBE_DIRECTIONS: usize = 32;
/// Number of coefficients of a probe.
pub const PROBE_COEFFICIENTS: usize = 9;
/// Degree and order of each coefficient: the order of `LightProbe` of three.js.
pub const PROBE_ORDERS: [[i32; 2]; PROBE_COEFFICIENTS] =
    [[0, 0], [1, -1], [1, 0], [1, 1], [2, -2], [2, -1], [2, 0], [2, 1], [2, 2]];

const GOLDEN: f64 = 1.618_033_988_749_895;
/// Weights of the vertices of the icosahedron and of the dodecahedron. They add up to 1.
const WEIGHTS: [f64; 2] = [5.0 / 168.0, 9.0 / 280.0];

/// Real spherical harmonics of a unit vector, in the order of [`PROBE_ORDERS`]: products of 1, y, z, x, xy,
/// yz, 3z^2 - 1, xz and x^2 - y^2, orthonormal over the sphere.
pub fn harmonics([x, y, z]: [f64; 3]) -> [f64; PROBE_COEFFICIENTS] {
    let [zeroth, first, second] = [0.25 / PI, 0.75 / PI, 3.75 / PI].map(f64::sqrt);
    let third = (1.25 / PI).sqrt();
    [
        zeroth,
        first * y,
        first * z,
        first * x,
        second * x * y,
        second * y * z,
        0.5 * third * (3.0 * z * z - 1.0),
        second * x * z,
        0.5 * second * (x * x - y * y),
    ]
}

/// Directions of a quadrature over the sphere with their weights, exact to degree 9: the
/// vertices of an icosahedron and of its dual dodecahedron.
fn quadrature() -> [([f64; 3], f64); PROBE_DIRECTIONS] {
    let turned = |[x, y, z]: [f64; 3], turns: usize| match turns {
        0 => [x, y, z],
        1 => [z, x, y],
        _ => [y, z, x],
    };
    let sign = |index: usize, bit: usize| if index >> bit & 1 == 0 { 1.0 } else { -1.0 };
    std::array::from_fn(|index| {
        let (signs, turns) = (index % 4, index / 4 % 3);
        let (place, weight) = match index {
            0..12 => (turned([0.0, sign(signs, 0), GOLDEN * sign(signs, 1)], turns), WEIGHTS[0]),
            12..24 => {
                let place = [0.0, GOLDEN * sign(signs, 0), sign(signs, 1) / GOLDEN];
                (turned(place, turns), WEIGHTS[1])
            }
            _ => ([0, 1, 2].map(|bit| sign(index, bit)), WEIGHTS[1]),
        };
        let length = place.iter().map(|value| value * value).sum::<f64>().sqrt();
        (place.map(|value| value / length), weight)
    })
}

/// Points, one for each direction, whose readings make the probe at a position.
pub fn probe_points(position: [f64; 3]) -> impl Iterator<Item = Point> {
    quadrature().into_iter().map(move |(normal, _)| Point { position, normal })
}

/// Coefficients of a probe per channel, W/m^2, by the readings of its [`probe_points`]: the irradiance of a
/// surface with the normal `n` is the sum of coefficient times harmonic ([`harmonics`]) of `n`.
///
/// The irradiance has no harmonics of degree 3, and those of degree 4 have a sixth of the weight of degree 2.
/// The quadrature confuses those of degree 10 with others. Under a directional light the sum is off by up to
/// 11.7 % of the light, 3.7 % in the root mean square over normals; under light from many sides by far less.
pub fn probe(readings: &[Reading]) -> [[f64; 3]; PROBE_COEFFICIENTS] {
    let mut sums = [[0.0; 3]; PROBE_COEFFICIENTS];
    for (reading, (normal, weight)) in readings.iter().zip(quadrature()) {
        let irradiance = reading.irradiance();
        for (sum, harmonic) in sums.iter_mut().zip(harmonics(normal)) {
            let factor = 4.0 * PI * weight * harmonic;
            sum.iter_mut().zip(irradiance).for_each(|(sum, value)| *sum += factor * value);
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean of a monomial over the sphere: `(a-1)!! (b-1)!! (c-1)!! / (a+b+c+1)!!` for even exponents.
    fn mean(exponents: [i32; 3]) -> f64 {
        let double_factorial = |n: i32| (1..=n).rev().step_by(2).map(f64::from).product::<f64>();
        if exponents.iter().any(|exponent| exponent % 2 == 1) {
            return 0.0;
        }
        let above: f64 = exponents.iter().map(|exponent| double_factorial(exponent - 1)).product();
        above / double_factorial(exponents.iter().sum::<i32>() + 1)
    }

    #[test]
    fn the_quadrature_is_exact_to_degree_nine() {
        for degree in 0..=9 {
            for a in 0..=degree {
                for b in 0..=degree - a {
                    let exponents = [a, b, degree - a - b];
                    let term = |(place, weight): ([f64; 3], f64)| {
                        weight * place.iter().zip(exponents).map(|(x, e)| x.powi(e)).product::<f64>()
                    };
                    let sum: f64 = quadrature().into_iter().map(term).sum();
                    assert!((sum - mean(exponents)).abs() < 1e-14, "{exponents:?}: {sum}");
                }
            }
        }
    }

    #[test]
    fn the_harmonics_are_orthonormal() {
        for i in 0..PROBE_COEFFICIENTS {
            for j in 0..PROBE_COEFFICIENTS {
                let term = |(place, weight)| 4.0 * PI * weight * harmonics(place)[i] * harmonics(place)[j];
                let sum: f64 = quadrature().into_iter().map(term).sum();
                assert!((sum - f64::from(u8::from(i == j))).abs() < 1e-14, "{i} {j}: {sum}");
            }
        }
    }

    fn readings(irradiance: impl Fn([f64; 3]) -> f64) -> Vec<Reading> {
        let points = probe_points([1.0, 2.0, 3.0]);
        points.map(|point| Reading { direct: [irradiance(point.normal); 3], ..Reading::default() }).collect()
    }

    /// The cosine lobe has the factors pi, 2 pi / 3 and pi / 4 of degrees 0 to 2. Its harmonics of degree 10
    /// disturb the quadrature by 0.047 at most, and not that of degree 1.
    #[test]
    fn a_light_from_above_has_the_coefficients_of_the_cosine_lobe() {
        let found = probe(&readings(|normal| normal[1].max(0.0)));
        let up = harmonics([0.0, 1.0, 0.0]);
        for ((coefficient, harmonic), [degree, order]) in found.iter().zip(up).zip(&PROBE_ORDERS) {
            let factor = [PI, 2.0 * PI / 3.0, PI / 4.0][*degree as usize];
            let tolerance = if *degree == 1 { 1e-12 } else { 0.05 };
            assert!(
                (coefficient[0] - factor * harmonic).abs() < tolerance,
                "{degree} {order}: {coefficient:?}"
            );
        }
    }

    #[test]
    fn irradiance_of_order_two_is_reconstructed_exactly() {
        let irradiance =
            |[x, y, z]: [f64; 3]| 5.0 + x - 2.0 * y + 0.5 * z + x * y - 0.7 * z * z + 0.3 * y * z;
        let coefficients = probe(&readings(irradiance));
        for normal in [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.48, 0.6, -0.64]] {
            let found: f64 = coefficients.iter().zip(harmonics(normal)).map(|(c, y)| c[1] * y).sum();
            assert!((found - irradiance(normal)).abs() < 1e-12, "{normal:?}: {found}");
        }
    }
}
