//! A gather that waits: its place, what of its reflection is known before any photon is, and its pixel.

use core::f32::consts::FRAC_1_PI;

use glam::Vec3;
use photoncard_shared::layout::{Rgbe, decode_direction, encode_direction, encode_normal};

use super::Place;
use crate::scene::{Surface, lobe_power, mirror};
use crate::vector::{from_upper_half, unit, upper_half};

/// A reflection function with all evaluated that does not depend on a photon: 13 bytes, the dissertation's `S_B`
/// (section 7.4).
///
/// Stage one, [`Self::new`], is done once a query: albedos, weight, units and the lobe's factor become two colours.
/// Stage two is done once a photon: [`Self::lobe_share`]. Colours are rounded to a shared exponent, directions to two
/// bytes, the exponent to eight bits of mantissa: in every order alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartialReflection {
    diffuse: Rgbe,
    lobe: Rgbe,
    mirror: [u8; 2],
    exponent: [u8; 2],
    normal: u8,
}

impl PartialReflection {
    /// The reflection of a surface towards its outgoing direction, times `weight`. Random bits in `dither` make the
    /// rounding right on average.
    #[inline(always)]
    pub fn new(surface: &Surface, weight: Vec3, dither: u32) -> Self {
        let reflection = &surface.reflection;
        let mirror = mirror(surface.outgoing, surface.normal);
        let exponent = upper_half(reflection.exponent).to_be_bytes();
        let factor = (decode_exponent(exponent) + 2.0) * 0.5 * FRAC_1_PI;
        Self {
            diffuse: Rgbe::encode((reflection.lambertian() * weight).to_array(), dither),
            lobe: Rgbe::encode((reflection.specular * weight * factor).to_array(), dither),
            mirror: encode_direction(mirror.to_array()),
            exponent,
            normal: encode_normal(surface.normal.to_array()),
        }
    }

    /// The same among photons of another surface normal, of this code.
    pub fn among(self, normal: u8) -> Self {
        Self { normal, ..self }
    }

    /// A white diffuser that tells irradiance: what it is multiplied with is one. `normal` is its surface normal's code.
    pub fn diffuser(normal: u8) -> Self {
        // One is a power of two: nothing is rounded.
        let diffuse = Rgbe::encode([1.0; 3], 0);
        Self { diffuse, lobe: Rgbe::default(), mirror: [0; 2], exponent: [0; 2], normal }
    }

    /// What the photons' power is multiplied with, whatever their directions.
    #[inline(always)]
    pub fn diffuse(&self) -> Vec3 {
        self.diffuse.decode().into()
    }

    /// What the lobe's share of the photons' power is multiplied with.
    #[inline(always)]
    pub fn lobe(&self) -> Vec3 {
        self.lobe.decode().into()
    }

    /// Whether there is a lobe.
    #[inline(always)]
    pub fn has_lobe(&self) -> bool {
        self.lobe != Rgbe::default()
    }

    /// The unit mirror direction.
    #[inline(always)]
    pub fn mirror(&self) -> Vec3 {
        unit(decode_direction(self.mirror).into())
    }

    /// `max(0, cos alpha)^n` for a photon that came from the direction of this code.
    #[inline(always)]
    pub fn lobe_share(&self, mirror: Vec3, direction: [u8; 2]) -> f32 {
        lobe_power(mirror.dot(unit(decode_direction(direction).into())), decode_exponent(self.exponent))
    }

    /// Code of the surface normal.
    #[inline(always)]
    pub fn normal(&self) -> u8 {
        self.normal
    }
}

#[inline(always)]
fn decode_exponent(bytes: [u8; 2]) -> f32 {
    from_upper_half(u16::from_be_bytes(bytes))
}

/// A gather: where, how the photons found there are reflected, and whose sum the result goes to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GatherRequest {
    /// The place.
    pub place: Place,
    /// The reflection, times the gather ray's weight, from photon power units to radiance units.
    pub reflection: PartialReflection,
    /// Whose sum it is: the number of a gather point on the chip.
    pub target: u16,
    /// The cell of the hemisphere above the gather point that the ray went through.
    pub cell: u8,
}

const _: () = assert!(size_of::<PartialReflection>() == 13);
const _: () = assert!(size_of::<GatherRequest>() == 24);
