//! Radiance of the clear sky: the model of Hosek, Wilkie 2012 (*An analytic model for full spectral sky-dome
//! radiance*), with the authors' data for linear sRGB (3-clause BSD, `hosek_wilkie_license.txt`). The data
//! are in W/(sr m^2) by the luminous efficiency function: 683 times their luminance is in cd/m^2.

use std::f64::consts::{FRAC_PI_2, PI};

/// Data of the channels red, green, blue, as little-endian `f32`: for each of two albedos (0 and 1), ten
/// turbidities (1 to 10) and six control points of the sun's elevation, nine coefficients; then the factors
/// of radiance, one for each albedo, turbidity and control point.
const DATA: &[u8; 4 * CHANNEL * 3] = include_bytes!("hosek_wilkie.f32");

const COEFFICIENTS: usize = 9;
const POINTS: usize = 6;
const TURBIDITIES: usize = 10;
const RADIANCES: usize = 2 * TURBIDITIES * POINTS;
/// Numbers of a channel.
const CHANNEL: usize = RADIANCES * COEFFICIENTS + RADIANCES;

/// Maximum luminous efficacy, lm/W.
const EFFICACY: f64 = 683.0;

/// Clear sky with the sun at an elevation.
pub(super) struct ClearSky {
    channels: [Channel; 3],
}

struct Channel {
    coefficients: [f64; COEFFICIENTS],
    radiance: f64,
}

impl ClearSky {
    /// Sky at a turbidity of 1 to 10, above a ground with an albedo of 0 to 1, at an elevation of the sun of
    /// 0 to pi / 2.
    pub(super) fn new(turbidity: f64, albedo: f64, elevation: f64) -> Self {
        let curve = Curve::new(turbidity, albedo, elevation);
        let channels = std::array::from_fn(|channel| {
            let first = channel * CHANNEL;
            Channel {
                coefficients: std::array::from_fn(|index| curve.at(first + index, COEFFICIENTS)),
                radiance: curve.at(first + RADIANCES * COEFFICIENTS, 1),
            }
        });
        Self { channels }
    }

    /// Luminance per linear RGB channel, cd/m^2, in a direction above the horizon: `cosine` is that of its
    /// angle to the zenith, 0 to 1, and `gamma` its angle to the sun, radians.
    pub(super) fn luminance(&self, cosine: f64, gamma: f64) -> [f64; 3] {
        let cos_gamma = libm::cos(gamma);
        [0, 1, 2].map(|channel| {
            let Channel { coefficients: [a, b, c, d, e, f, g, i, h], radiance } = &self.channels[channel];
            let horizon = 1.0 + a * libm::exp(b / (cosine + 0.01));
            let base = (1.0 + h * h - 2.0 * h * cos_gamma).max(0.0);
            let mie = (1.0 + cos_gamma * cos_gamma) / (base * base.sqrt());
            let glow = c + d * libm::exp(e * gamma) + f * cos_gamma * cos_gamma + g * mie + i * cosine.sqrt();
            (EFFICACY * radiance * horizon * glow).max(0.0)
        })
    }
}

/// Interpolation of the data: linear in turbidity and albedo, and a Bezier curve of degree 5 in the cube root
/// of the elevation.
struct Curve {
    /// Offset of the control points of a turbidity and an albedo, in sets of [`POINTS`], and their weight.
    corners: [(usize, f64); 4],
    bernstein: [f64; POINTS],
}

impl Curve {
    fn new(turbidity: f64, albedo: f64, elevation: f64) -> Self {
        let above = (turbidity.clamp(1.0, TURBIDITIES as f64) - 1.0).min(TURBIDITIES as f64 - 1.0);
        let low = above.floor();
        let share = above - low;
        let [low, high] = [low as usize, (low as usize + 1).min(TURBIDITIES - 1)];
        let corners = [
            (low, (1.0 - albedo) * (1.0 - share)),
            (high, (1.0 - albedo) * share),
            (TURBIDITIES + low, albedo * (1.0 - share)),
            (TURBIDITIES + high, albedo * share),
        ];
        let t = libm::cbrt((elevation / FRAC_PI_2).clamp(0.0, 1.0));
        let mut bernstein = [1.0, 5.0, 10.0, 10.0, 5.0, 1.0];
        for (index, weight) in bernstein.iter_mut().enumerate() {
            (0..index).for_each(|_| *weight *= t);
            (index..POINTS - 1).for_each(|_| *weight *= 1.0 - t);
        }
        Self { corners, bernstein }
    }

    /// Interpolated number whose control points begin at number `first` of the data and lie `stride` numbers
    /// apart.
    fn at(&self, first: usize, stride: usize) -> f64 {
        let of_corner = |&(set, weight): &(usize, f64)| {
            let points = self.bernstein.iter().enumerate();
            let sum: f64 = points
                .map(|(point, bernstein)| bernstein * number(first + (set * POINTS + point) * stride))
                .sum();
            weight * sum
        };
        self.corners.iter().map(of_corner).sum()
    }
}

fn number(index: usize) -> f64 {
    let bytes = DATA.get(4 * index..).and_then(<[u8]>::first_chunk);
    bytes.map_or(0.0, |bytes| f64::from(f32::from_le_bytes(*bytes)))
}

/// Angle between two directions with cosines `a` and `b` of their angles to the zenith, at azimuths that
/// differ by `azimuth`, radians.
pub(super) fn angle_between(a: f64, b: f64, azimuth: f64) -> f64 {
    let sine = |cosine: f64| (1.0 - cosine * cosine).max(0.0).sqrt();
    let cosine = a * b + sine(a) * sine(b) * libm::cos(azimuth);
    libm::acos(cosine.clamp(-1.0, 1.0)).min(PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of Mitsuba 3.9.1's `sunsky` without its sun, for an albedo of 0.2, over its factor from
    /// radiance to RGB, 0.0093677: turbidity, elevation of the sun, angle to the zenith, azimuth from the
    /// sun, degrees.
    #[test]
    fn luminances_are_those_of_another_implementation() {
        for ([turbidity, elevation, zenith, azimuth], expected) in [
            ([3.0, 60.0, 5.0, 0.0], [4.568_663, 6.605_894, 11.689_01]),
            ([3.0, 60.0, 30.0, 90.0], [3.250_192, 5.539_729, 10.993_37]),
            ([3.0, 60.0, 80.0, 120.0], [8.560_524, 13.813_08, 22.253_43]),
            ([3.0, 20.0, 30.0, 0.0], [2.475_748, 4.138_935, 6.870_892]),
            ([3.0, 20.0, 60.0, 180.0], [3.554_493, 6.196_289, 9.801_287]),
            ([2.0, 40.0, 60.0, 45.0], [5.209_306, 8.867_261, 15.331_33]),
            ([6.0, 30.0, 5.0, 0.0], [3.123_823, 4.620_832, 7.292_909]),
            ([6.0, 30.0, 85.0, 10.0], [71.986_21, 65.975_53, 49.441_32]),
        ] {
            let sky = ClearSky::new(turbidity, 0.2, elevation.to_radians());
            let cosine = zenith.to_radians().cos();
            let gamma = angle_between(cosine, elevation.to_radians().sin(), azimuth.to_radians());
            for (found, value) in sky.luminance(cosine, gamma).into_iter().zip(expected) {
                let error = found / (value * EFFICACY) - 1.0;
                assert!(error.abs() < 1e-4, "{turbidity} {elevation} {zenith} {azimuth}: {error}");
            }
        }
    }

    #[test]
    fn no_direction_of_any_sky_is_dark_or_infinite() {
        for turbidity in [1.7, 3.0, 5.5, 10.0] {
            for elevation in [0.0, 1.0, 10.0, 45.0, 90.0_f64] {
                let sky = ClearSky::new(turbidity, 0.2, elevation.to_radians());
                for step in 0..=50 {
                    let cosine = f64::from(step) / 50.0;
                    for azimuth in [0.0, 1.0, PI] {
                        let gamma = angle_between(cosine, elevation.to_radians().sin(), azimuth);
                        let [red, green, blue] = sky.luminance(cosine, gamma);
                        let sum = red + green + blue;
                        assert!(sum > 0.0 && sum < 1e7, "{turbidity} {elevation} {cosine} {azimuth}: {sum}");
                    }
                }
            }
        }
    }
}
