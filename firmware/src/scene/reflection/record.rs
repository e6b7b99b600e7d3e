//! The reflection in the record of a waiting gather, and its sums over photons.

use glam::Vec3;
use photoncard_shared::layout::{Rgbe, decode_direction, encode_direction, encode_normal};

use super::Reflector;
use super::phong::{self, PhongLobe};
use crate::fixed_point::ColourSum;
use crate::vector::{from_upper_half, mirror, unit, upper_half};

/// A reflection function, evaluated but for what depends on a photon: 13 bytes, the dissertation's `S_B` (section 7.4).
///
/// Stage one, [`Self::encode`], is done once a query: albedos, weight, units and the lobe's factor become two colours.
/// Stage two is done once a photon: [`Self::lobe_factor`]. Colours are rounded to a shared exponent, directions to
/// two bytes, the lobe's exponent to eight bits of mantissa: in every order alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartialReflection {
    diffuse: Rgbe,
    lobe: Rgbe,
    mirror: [u8; 2],
    exponent: [u8; 2],
    normal: u8,
}

const _: () = assert!(size_of::<PartialReflection>() == 13);

impl PartialReflection {
    /// The record of a reflector's `f` towards its outgoing direction, times `weight`. Random bits in `dither` make the rounding
    /// unbiased.
    // One copy for final gathers and caustics: code is memory on a chip.
    #[inline(never)]
    pub fn encode(reflector: &Reflector, weight: Vec3, dither: u32) -> Self {
        let Reflector { normal, outgoing, reflection } = reflector;
        let mirror = mirror(*outgoing, *normal);
        let exponent = upper_half(reflection.lobe.exponent).to_be_bytes();
        let factor = PhongLobe::factor(decode_exponent(exponent));
        Self {
            diffuse: Rgbe::encode((reflector.lambertian() * weight).to_array(), dither),
            lobe: Rgbe::encode((reflection.lobe.albedo * weight * factor).to_array(), dither),
            mirror: encode_direction(mirror.to_array()),
            exponent,
            normal: encode_normal(normal.to_array()),
        }
    }

    /// The record for photons of another surface normal, of this code.
    #[must_use]
    pub fn among(self, normal: u8) -> Self {
        Self { normal, ..self }
    }

    /// The record of a white diffuser of factor 1, which reflects the irradiance itself. `normal` is its surface normal's code.
    pub fn diffuser(normal: u8) -> Self {
        // 1 is a power of two: nothing is rounded.
        let diffuse = Rgbe::encode([1.0; 3], 0);
        Self { diffuse, lobe: Rgbe::default(), mirror: [0; 2], exponent: [0; 2], normal }
    }

    /// `true` without a lobe: irradiance is enough, whatever the photons' directions.
    #[inline(always)]
    pub fn is_lambertian(&self) -> bool {
        self.lobe == Rgbe::default()
    }

    /// The Lambertian part's factor of the photons' power.
    #[inline(always)]
    pub fn lambertian(&self) -> Vec3 {
        self.diffuse.decode().into()
    }

    /// Decodes the lobe, once for all photons of a gather.
    #[inline(always)]
    pub fn decode_lobe(&self) -> DecodedLobe {
        let mirror =
            if self.is_lambertian() { Vec3::ZERO } else { unit(decode_direction(self.mirror).into()) };
        DecodedLobe { mirror }
    }

    /// The factor of a photon's power in the lobe's sum, for the code of the direction that it came from.
    #[inline(always)]
    pub fn lobe_factor(&self, lobe: &DecodedLobe, direction: [u8; 2]) -> Vec3 {
        let cosine = lobe.mirror.dot(unit(decode_direction(direction).into()));
        Vec3::splat(phong::power(cosine, decode_exponent(self.exponent)))
    }

    /// The reflected power of photons, in the units of `weight`, from the sum of their powers and the lobe's sum.
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

/// The lobe of a [`PartialReflection`], decoded.
#[derive(Clone, Copy, Debug)]
pub struct DecodedLobe {
    /// Unit mirror direction; zero without a lobe.
    mirror: Vec3,
}

#[inline(always)]
fn decode_exponent(bytes: [u8; 2]) -> f32 {
    from_upper_half(u16::from_be_bytes(bytes))
}
