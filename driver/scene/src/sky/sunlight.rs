//! Direct light of the sun through the atmosphere: the spectral transmittances of Preetham, Shirley, Smits
//! 1999 (*A practical analytic model for daylight*, appendix), which are those of Iqbal 1983 (*An
//! introduction to solar radiation*), as linear Rec. 709 by the colour matching functions of Wyman, Sloan,
//! Shirley 2013. Absorption by water vapour and oxygen, which lies above 680 nm, is left out: it takes less
//! than 0.1 % of the light that eyes see.

use std::f64::consts::PI;

/// Illuminance of a surface that faces the sun above the atmosphere at the mean distance, lx (Darula,
/// Kittler, Gueymard 2005, *Reference luminous solar constant and solar luminance for illuminance
/// calculations*). The distance of the earth varies it by 3 %, which is left out.
const ABOVE_THE_AIR: f64 = 133_100.0;

const FIRST_NM: f64 = 380.0;
const STEP_NM: f64 = 10.0;

/// Spectral radiance of the sun above the atmosphere, 380 to 750 nm, relative.
const SUN: [f64; 38] = [
    165.5, 162.3, 211.2, 258.8, 258.2, 242.3, 267.6, 296.6, 305.4, 300.6, 306.6, 288.3, 287.1, 278.2, 271.0,
    272.3, 263.6, 255.0, 250.6, 253.1, 253.5, 251.3, 246.3, 241.7, 236.8, 232.1, 228.2, 223.4, 219.7, 215.3,
    211.0, 207.3, 202.4, 198.7, 194.3, 190.7, 186.3, 182.6,
];

/// Absorption coefficients of ozone, 380 to 750 nm, 1/cm.
const OZONE: [f64; 38] = [
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.003, 0.003, 0.006, 0.009, 0.014, 0.021, 0.030, 0.040, 0.048, 0.063,
    0.075, 0.085, 0.103, 0.120, 0.120, 0.115, 0.125, 0.120, 0.105, 0.090, 0.079, 0.067, 0.057, 0.048, 0.036,
    0.028, 0.023, 0.018, 0.014, 0.011, 0.010, 0.009,
];

/// Depth of ozone at 0 degrees C and a standard atmosphere, cm.
const OZONE_CM: f64 = 0.35;

/// Rows of the matrix from CIE XYZ to linear Rec. 709, white point D65.
const REC_709: [[f64; 3]; 3] = [
    [3.240_454_2, -1.537_138_5, -0.498_531_4],
    [-0.969_266_0, 1.876_010_8, 0.041_556_0],
    [0.055_643_4, -0.204_025_9, 1.057_225_2],
];

/// Illuminance per linear RGB channel of a surface that faces the sun, lx, under a turbidity and at an
/// elevation of 0 or more, radians.
pub(super) fn illuminance(turbidity: f64, elevation: f64) -> [f64; 3] {
    let air = air_mass(elevation);
    let haze = 0.046_083_658_220_50 * turbidity - 0.045_860_259_285_22;
    let (mut above, mut below) = (0.0, [0.0; 3]);
    for (index, (radiance, ozone)) in SUN.iter().zip(OZONE).enumerate() {
        let nanometres = FIRST_NM + STEP_NM * index as f64;
        let micrometres = nanometres / 1000.0;
        let depth = 0.008_735 * libm::pow(micrometres, -4.08)
            + haze * libm::pow(micrometres, -1.3)
            + ozone * OZONE_CM;
        let [x, y, z] = colour_matching(nanometres).map(|weight| weight * radiance);
        above += y;
        let transmitted = libm::exp(-air * depth);
        for (sum, value) in below.iter_mut().zip([x, y, z]) {
            *sum += value * transmitted;
        }
    }
    // A red sun lies outside the gamut: its blue is below 0.
    REC_709.map(|row| {
        let channel: f64 = row.iter().zip(below).map(|(weight, value)| weight * value).sum();
        (channel * ABOVE_THE_AIR / above).max(0.0)
    })
}

/// Relative optical mass of the air (Kasten 1966).
fn air_mass(elevation: f64) -> f64 {
    let degrees = elevation * (180.0 / PI);
    1.0 / (libm::sin(elevation) + 0.15 * libm::pow(degrees + 3.885, -1.253))
}

/// CIE 1931 colour matching functions at a wavelength, nm: the multi-lobe fit.
fn colour_matching(nanometres: f64) -> [f64; 3] {
    let lobe = |height: f64, centre: f64, below: f64, above: f64| {
        let offset = (nanometres - centre) * if nanometres < centre { below } else { above };
        height * libm::exp(-0.5 * offset * offset)
    };
    [
        lobe(0.362, 442.0, 0.0624, 0.0374) + lobe(1.056, 599.8, 0.0264, 0.0323)
            - lobe(0.065, 501.1, 0.0490, 0.0382),
        lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322),
        lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lux(turbidity: f64, degrees: f64) -> f64 {
        let [red, green, blue] = illuminance(turbidity, degrees.to_radians());
        0.2126 * red + 0.7152 * green + 0.0722 * blue
    }

    /// At 550 nm the optical depth of clear air is 0.1 of the molecules and 0.03 of ozone, and that of haze
    /// is `T - 1` times that of the molecules, by the definition of turbidity.
    #[test]
    fn the_sun_is_as_bright_as_the_optical_depth_at_550_nm_says() {
        for (turbidity, degrees, air) in
            [(2.0, 90.0, 1.0), (3.0, 90.0, 1.0), (3.0, 30.0, 2.0), (6.0, 60.0, 1.155)]
        {
            let expected = ABOVE_THE_AIR * libm::exp(-air * (0.1 * turbidity + 0.03));
            let found = lux(turbidity, degrees);
            assert!((found / expected - 1.0).abs() < 0.04, "{turbidity} {degrees}: {found} {expected}");
        }
        assert!((80e3..100e3).contains(&lux(3.0, 60.0)));
    }

    #[test]
    fn the_sun_reddens_and_darkens_towards_the_horizon() {
        let mut last = [f64::INFINITY; 2];
        for degrees in [60.0, 30.0, 10.0, 5.0, 2.0, 0.0] {
            let [red, _, blue] = illuminance(3.0, f64::to_radians(degrees));
            let next = [red, blue / red];
            assert!(
                next[0] < last[0] && next[1] <= last[1] && blue >= 0.0,
                "{degrees}: {next:?} after {last:?}"
            );
            last = next;
        }
        assert!((air_mass(f64::to_radians(30.0)) - 2.0).abs() < 0.01);
        assert!((air_mass(0.0) - 36.5).abs() < 0.5);
    }
}
