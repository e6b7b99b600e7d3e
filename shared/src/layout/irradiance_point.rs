//! Content of an irradiance point: irradiance and surface normal in eight bytes. A photon's content has the
//! same size, so that [`super::PhotonLeaf`] stores either kind.

use super::PHOTON_CONTENT_BYTES;

/// Irradiance and surface normal at a point of a surface.
///
/// | bits | contents |
/// |---|---|
/// | 0..48 | mantissas of red, green and blue, 16 bits each |
/// | 48..56 | surface normal, [`super::encode_normal`], on the lit side |
/// | 56..64 | shared exponent `e`: a component is `mantissa * 2^(e - 143)` |
///
/// The mantissa of the largest component is at least 2^15, so that the error of every component is at most
/// 2^-16 of the largest component. The 8-bit mantissas of [`super::Rgbe`] are too coarse: their errors
/// average out in a sum over many photons, but not in a single point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IrradiancePoint {
    /// Irradiance, photon power units/m^2.
    pub irradiance: [f32; 3],
    /// Octahedral code of the surface normal.
    pub normal: u8,
}

const MANTISSA_BITS: u32 = 16;
const MAX_MANTISSA: u32 = (1 << MANTISSA_BITS) - 1;
const NORMAL_SHIFT: u32 = 3 * MANTISSA_BITS;
const EXPONENT_SHIFT: u32 = NORMAL_SHIFT + 8;
/// Bias of the stored exponent `e`: a step of a mantissa is `2^(e - 143)`.
const EXPONENT_BIAS: i32 = 143;

impl IrradiancePoint {
    /// Encodes the point, rounded to nearest. Negative and NaN components are stored as 0, components above
    /// `f32::MAX` as `f32::MAX`.
    #[inline]
    pub fn to_content(&self) -> [u8; PHOTON_CONTENT_BYTES] {
        let irradiance = self.irradiance.map(|c| if c > 0.0 { c.min(f32::MAX) } else { 0.0 });
        let largest = irradiance.into_iter().fold(0.0, f32::max);
        let mut bits = u64::from(self.normal) << NORMAL_SHIFT;
        if largest >= f32::MIN_POSITIVE {
            // largest = m 2^e with m in [1, 2); its mantissa is in [2^15, 2^16), and is not rounded up to
            // 2^16.
            let unit = (largest.to_bits() >> 23) as i32 - 127 - 15;
            let mantissa = |c: f32| ((scaled(c, -unit) + 0.5) as u32).min(MAX_MANTISSA);
            for (shift, component) in (0..).step_by(MANTISSA_BITS as usize).zip(irradiance) {
                bits |= u64::from(mantissa(component)) << shift;
            }
            bits |= ((unit + EXPONENT_BIAS).clamp(0, 255) as u64) << EXPONENT_SHIFT;
        }
        bits.to_le_bytes()
    }

    /// Reads a point. The irradiance is finite and not negative for any bytes.
    #[inline(always)]
    pub fn read(content: [u8; PHOTON_CONTENT_BYTES]) -> Self {
        let bits = u64::from_le_bytes(content);
        let unit = (bits >> EXPONENT_SHIFT) as i32 - EXPONENT_BIAS;
        let component =
            |index: u32| scaled((bits >> (index * MANTISSA_BITS) & u64::from(MAX_MANTISSA)) as f32, unit);
        Self { irradiance: [component(0), component(1), component(2)], normal: Self::normal_of(bits) }
    }

    /// Returns the normal code of a point, given its eight bytes as the little-endian number `bits`.
    #[inline(always)]
    pub fn normal_of(bits: u64) -> u8 {
        (bits >> NORMAL_SHIFT) as u8
    }
}

/// `value * 2^exponent`, at most `f32::MAX`, for exponents of -252 to 254.
#[inline(always)]
fn scaled(value: f32, exponent: i32) -> f32 {
    // Two factors, because 2^exponent alone can be out of the range of `f32` when the product is not.
    let half = exponent / 2;
    let product = value * power_of_two(half) * power_of_two(exponent - half);
    if product < f32::MAX { product } else { f32::MAX }
}

/// `2^exponent`, for exponents of -126 to 127.
#[inline(always)]
fn power_of_two(exponent: i32) -> f32 {
    f32::from_bits(((exponent + 127) as u32) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::tests::random;

    fn stored(irradiance: [f32; 3]) -> [f32; 3] {
        let point = IrradiancePoint { irradiance, normal: 0xa5 };
        let read = IrradiancePoint::read(point.to_content());
        assert_eq!(read.normal, point.normal);
        assert_eq!(IrradiancePoint::normal_of(u64::from_le_bytes(point.to_content())), point.normal);
        read.irradiance
    }

    #[test]
    fn every_component_is_accurate_to_a_65536th_of_the_greatest() {
        let mut next = random(5);
        for _ in 0..100_000 {
            let mut component = || f32::from_bits((next() as u32 >> 1).clamp(40 << 23, 250 << 23));
            let first = component();
            let share = |bits: u64| (bits as u32 >> 8) as f32 / 16_777_216.0;
            let colour = [first, first * share(next()), first * share(next())];
            for (a, b) in colour.into_iter().zip(stored(colour)) {
                assert!((a - b).abs() <= first / 65_535.0, "{colour:?} {a} {b}");
            }
        }
    }

    #[test]
    fn extreme_irradiance_is_kept_or_clamped() {
        assert_eq!(stored([0.0; 3]), [0.0; 3]);
        assert_eq!(stored([-1.0, f32::NAN, f32::NEG_INFINITY]), [0.0; 3]);
        assert_eq!(stored([1.0, 0.5, 0.25]), [1.0, 0.5, 0.25]);
        for huge in [f32::MAX, f32::INFINITY] {
            let [r, g, b] = stored([huge, 1.0, 0.0]);
            assert!(r >= 0.9999 * f32::MAX && r.is_finite() && g == 0.0 && b == 0.0, "{r}");
        }
        let [r, ..] = stored([f32::MIN_POSITIVE; 3]);
        assert!((r / f32::MIN_POSITIVE - 1.0).abs() < 0.01, "{r}");
    }

    #[test]
    fn irradiance_of_arbitrary_bytes_is_finite() {
        let mut next = random(9);
        for _ in 0..100_000 {
            let point = IrradiancePoint::read(next().to_le_bytes());
            assert!(point.irradiance.into_iter().all(|c| c.is_finite() && c >= 0.0), "{point:?}");
        }
    }
}
