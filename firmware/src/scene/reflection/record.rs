//! Reflection function in the compact form that the gather queue stores, and its evaluation for photons.

use glam::Vec3;
use photoncard_shared::layout::{Rgbe, decode_direction, encode_direction, encode_normal};

use super::Reflector;
use super::ggx::GgxLobe;
use super::ggx_kernel::Kernel;
use super::lobe::Lobe;
use super::phong::{self, PhongLobe};
use crate::fixed_point::ColourSum;
use crate::vector::{from_upper_half, max, mirror, unit, upper_half};

/// Reflection function in 13 bytes. All terms that do not depend on a photon are already evaluated (`S_B` in
/// Steinhurst's dissertation, 2007, section 7.4).
///
/// [`Self::encode`] is called once per gather: it combines albedos, weight, units and the lobe's constant
/// factor into two colours. [`Self::lobe_factor`] is called once per photon.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartialReflection {
    diffuse: Rgbe,
    lobe: Rgbe,
    shape: Shape,
    normal: u8,
}

const _: () = assert!(size_of::<PartialReflection>() == 13);

impl PartialReflection {
    /// Reflection of a black surface.
    pub const NONE: Self =
        Self { diffuse: Rgbe([0; 4]), lobe: Rgbe([0; 4]), shape: Shape([0; 4]), normal: 0 };

    /// Encodes the reflection function.
    pub fn to_bytes(self) -> [u8; 13] {
        let ([a, b, c, d], [e, f, g, h], [i, j, k, l]) = (self.diffuse.0, self.lobe.0, self.shape.0);
        [a, b, c, d, e, f, g, h, i, j, k, l, self.normal]
    }

    /// Reflection function of the bytes that [`Self::to_bytes`] returned.
    pub fn from_bytes([a, b, c, d, e, f, g, h, i, j, k, l, normal]: &[u8; 13]) -> Self {
        let [diffuse, lobe, shape] =
            [[a, b, c, d], [e, f, g, h], [i, j, k, l]].map(|bytes| bytes.map(|byte| *byte));
        Self { diffuse: Rgbe(diffuse), lobe: Rgbe(lobe), shape: Shape(shape), normal: *normal }
    }

    /// Encodes a reflection function without a lobe; `None` if it has one, even a black one.
    pub fn to_lambertian_bytes(self) -> Option<[u8; 5]> {
        let Self { diffuse: Rgbe([a, b, c, d]), lobe, shape, normal } = self;
        (lobe == Self::NONE.lobe && shape == Self::NONE.shape).then_some([a, b, c, d, normal])
    }

    /// Reflection function of the bytes that [`Self::to_lambertian_bytes`] returned.
    pub fn from_lambertian_bytes([a, b, c, d, normal]: [u8; 5]) -> Self {
        Self { diffuse: Rgbe([a, b, c, d]), normal, ..Self::NONE }
    }

    /// Encodes `weight` times a reflector's `f` towards its outgoing direction. Colours are rounded to a
    /// shared exponent, at random by the bits of `dither`, so that the rounding is unbiased.
    // One copy for final gathers and caustics: code is memory on a chip.
    #[inline(never)]
    pub fn encode(reflector: &Reflector, weight: Vec3, dither: u32) -> Self {
        let (shape, colour, factor) = match &reflector.reflection.lobe {
            Lobe::Phong(lobe) => {
                let shape = Shape::phong(reflector, lobe);
                (shape, lobe.albedo, PhongLobe::factor(shape.exponent()))
            }
            Lobe::Ggx(lobe) => {
                let shape = Shape::ggx(reflector, lobe);
                (shape, lobe.colour(), shape.kernel().bound())
            }
            // Rays follow the sheen lobe: no photon is gathered for it.
            Lobe::Sheen(_) => (Shape([0; 4]), Vec3::ZERO, 0.0),
        };
        let record = Self {
            diffuse: Rgbe::encode((reflector.lambertian() * weight).to_array(), dither),
            lobe: Rgbe::encode((colour * weight * factor).to_array(), dither),
            shape,
            normal: encode_normal(reflector.normal.to_array()),
        };
        // A Phong lobe of no colour has no shape, so that the record is that of a Lambertian surface.
        let is_plain = record.is_lambertian() && !record.is_of_microfacets();
        if is_plain { Self { shape: Self::NONE.shape, ..record } } else { record }
    }

    /// Encodes a reflection that is evaluated at once instead of being put into the gather queue. Also
    /// returns its lobe: a GGX lobe unrounded, a Phong lobe decoded from the record.
    pub fn encode_present(reflector: &Reflector, weight: Vec3, dither: u32) -> (Self, DecodedLobe) {
        let record = Self::encode(reflector, weight, dither);
        let Lobe::Ggx(lobe) = &reflector.reflection.lobe else { return (record, record.decode_lobe()) };
        let kernel = Kernel::new(reflector.normal, reflector.outgoing, lobe.roughness());
        let colour = lobe.colour() * weight * kernel.bound();
        let lobe = Rgbe::encode(colour.to_array(), dither);
        (Self { lobe, ..record }, DecodedLobe::Ggx(kernel))
    }

    /// Replaces the code of the surface normal, by which a gather recognises photons of the surface.
    #[must_use]
    pub fn among(self, normal: u8) -> Self {
        Self { normal, ..self }
    }

    /// Encodes `f = 1`, for which the reflected radiance equals the irradiance. `normal` is the code of the
    /// surface normal.
    pub fn diffuser(normal: u8) -> Self {
        // 1 is a power of two: nothing is rounded.
        let diffuse = Rgbe::encode([1.0; 3], 0);
        Self { diffuse, lobe: Rgbe::default(), shape: Shape([0; 4]), normal }
    }

    /// Returns true if there is no lobe. The reflected radiance then does not depend on the directions of
    /// photons.
    #[inline(always)]
    pub fn is_lambertian(&self) -> bool {
        self.lobe == Rgbe::default()
    }

    /// Returns true if the record has a GGX lobe, even a black one.
    #[inline(always)]
    pub fn is_of_microfacets(&self) -> bool {
        let Shape([_, _, third, _]) = self.shape;
        third & GGX != 0
    }

    /// Lambertian `f` times the weight: the factor by which photon power is multiplied.
    #[inline(always)]
    pub fn lambertian(&self) -> Vec3 {
        self.diffuse.decode().into()
    }

    /// Decodes the lobe, once for all photons of a gather.
    #[inline(always)]
    pub fn decode_lobe(&self) -> DecodedLobe {
        if self.is_lambertian() {
            return DecodedLobe::Phong { mirror: Vec3::ZERO, exponent: 0.0 };
        }
        self.shape.decode()
    }

    /// Value of the lobe for a photon, without the record's colour: a gather sums power times this factor.
    /// `direction` is the code of the direction from which the photon came.
    #[inline(always)]
    pub fn lobe_factor(lobe: &DecodedLobe, direction: [u8; 2]) -> Vec3 {
        let incident = unit(decode_direction(direction).into());
        Vec3::splat(match lobe {
            DecodedLobe::Phong { mirror, exponent } => phong::power(mirror.dot(incident), *exponent),
            DecodedLobe::Ggx(kernel) => kernel.factor(incident),
        })
    }

    /// Sum of the photons' reflected power, times the weight given to [`Self::encode`]. `power` is the sum of
    /// their powers; `lobe` is the sum of power times [`Self::lobe_factor`].
    #[inline(always)]
    pub fn reflected(&self, power: &ColourSum, lobe: &ColourSum) -> Vec3 {
        self.lambertian() * power.value() + Vec3::from_array(self.lobe.decode()) * lobe.value()
    }

    /// Code of the surface normal.
    #[inline(always)]
    pub fn normal(&self) -> u8 {
        self.normal
    }
}

/// Decoded lobe of a [`PartialReflection`].
#[derive(Clone, Copy, Debug)]
pub enum DecodedLobe {
    /// A Phong lobe, or no lobe.
    Phong {
        /// Unit mirror direction; zero without a lobe.
        mirror: Vec3,
        /// Exponent of the lobe.
        exponent: f32,
    },
    /// A GGX lobe.
    Ggx(Kernel),
}

/// Parameters of a lobe without its colour. The highest bit of the third byte selects the model.
///
/// - Phong, if the bit is clear: two bytes of the mirror direction, and a bfloat16 of the exponent, which is
///   not negative.
/// - GGX, if the bit is set: 12 bits of the outgoing direction, 12 of the normal, 7 of the roughness. Narrow
///   lobes are not encoded ([`super::Reflection::has_narrow_lobe`]); the others are at least ten times as
///   wide as the rounding steps of the directions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Shape([u8; 4]);

/// Bit in the third byte that marks a GGX lobe.
const GGX: u8 = 0x80;
const ROUGHNESS_STEPS: f32 = 127.0;

impl Shape {
    #[inline(always)]
    fn phong(reflector: &Reflector, lobe: &PhongLobe) -> Self {
        let [u, v] = encode_direction(mirror(reflector.outgoing, reflector.normal).to_array());
        let [upper, lower] = upper_half(max(lobe.exponent, 0.0)).to_be_bytes();
        Self([u, v, upper, lower])
    }

    fn ggx(reflector: &Reflector, lobe: &GgxLobe) -> Self {
        let [a, b] = encode_direction(reflector.outgoing.to_array()).map(coarse);
        let [c, d] = encode_direction(reflector.normal.to_array()).map(coarse);
        // The third byte holds the bit [`GGX`] and the roughness. Each other byte holds a coordinate of six
        // bits and two bits of the fourth coordinate.
        let roughness = (lobe.roughness() * ROUGHNESS_STEPS + 0.5) as u8;
        Self([a | d >> 4 << 6, b | (d >> 2 & 3) << 6, GGX | roughness, c | (d & 3) << 6])
    }

    #[inline(always)]
    fn exponent(self) -> f32 {
        let [_, _, upper, lower] = self.0;
        from_upper_half(u16::from_be_bytes([upper, lower]))
    }

    fn kernel(self) -> Kernel {
        let [first, second, third, fourth] = self.0;
        let low = |byte: u8| byte & 0x3f;
        let last = first >> 6 << 4 | second >> 6 << 2 | fourth >> 6;
        let direction = |u, v| unit(decode_direction([fine(u), fine(v)]).into());
        let roughness = f32::from(third & !GGX) / ROUGHNESS_STEPS;
        Kernel::new(direction(low(fourth), last), direction(low(first), low(second)), roughness)
    }

    #[inline(always)]
    fn decode(self) -> DecodedLobe {
        let [u, v, third, _] = self.0;
        if third & GGX == 0 {
            let mirror = unit(decode_direction([u, v]).into());
            return DecodedLobe::Phong { mirror, exponent: self.exponent() };
        }
        DecodedLobe::Ggx(self.kernel())
    }
}

/// Greatest code of a direction's octahedral coordinate: in a byte, and in six bits.
const STEPS: [u32; 2] = [254, 62];

/// Rounds the code of an octahedral coordinate from a byte to six bits.
fn coarse(byte: u8) -> u8 {
    let [fine, coarse] = STEPS;
    ((u32::from(byte).min(fine) * coarse + fine / 2) / fine) as u8
}

/// Extends the code of an octahedral coordinate from six bits to a byte.
fn fine(bits: u8) -> u8 {
    let [fine, coarse] = STEPS;
    ((u32::from(bits).min(coarse) * fine + coarse / 2) / coarse) as u8
}
