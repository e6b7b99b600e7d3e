//! Functions of vectors and floats that glam lacks. They give the same bits on every processor.

use glam::Vec3;

/// Minimum of two numbers; `b` if one of them is NaN (like SSE's `minss`).
#[inline(always)]
pub(crate) fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Maximum of two numbers; `b` if one of them is NaN (like SSE's `maxss`).
#[inline(always)]
pub(crate) fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Square root, rounded to nearest by IEEE 754. Arm with hardware floats and WebAssembly with vectors have
/// instructions that stable `libm` lacks.
#[inline(always)]
pub(crate) fn sqrt(x: f32) -> f32 {
    #[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
    return vsqrt(x);
    #[cfg(all(target_family = "wasm", target_feature = "simd128"))]
    {
        use core::arch::wasm32::{f32x4_extract_lane, f32x4_splat, f32x4_sqrt};
        f32x4_extract_lane::<0>(f32x4_sqrt(f32x4_splat(x)))
    }
    #[cfg(not(any(
        all(target_arch = "arm", target_abi = "eabihf"),
        all(target_family = "wasm", target_feature = "simd128")
    )))]
    libm::sqrtf(x)
}

/// The function is not inlined, because boards have little flash. The compiler knows no register class of
/// floating-point units of single precision alone, but takes their registers as clobbers.
#[cfg(all(target_arch = "arm", target_abi = "eabihf"))]
#[expect(unsafe_code, reason = "an instruction that the compiler does not offer")]
#[inline(never)]
fn vsqrt(x: f32) -> f32 {
    let mut bits = x.to_bits();
    // SAFETY: processors of this ABI have the instruction; all registers that change are named.
    unsafe {
        core::arch::asm!(
            "vmov s0, {bits}",
            "vsqrt.f32 s0, s0",
            "vmov {bits}, s0",
            bits = inout(reg) bits,
            out("s0") _,
            options(pure, nomem, nostack)
        );
    }
    f32::from_bits(bits)
}

/// Mirror direction about a unit normal: `2 (n.d) n - d`.
#[inline(always)]
pub(crate) fn mirror(direction: Vec3, normal: Vec3) -> Vec3 {
    normal * (2.0 * normal.dot(direction)) - direction
}

/// Unit tangent and bitangent that form a right-handed orthonormal basis with a unit normal (Duff et al.
/// 2017, *Building an orthonormal basis, revisited*).
#[inline(always)]
pub(crate) fn tangents(normal: Vec3) -> (Vec3, Vec3) {
    let sign = if normal.z < 0.0 { -1.0 } else { 1.0 };
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    let tangent = Vec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x);
    let bitangent = Vec3::new(b, sign + normal.y * normal.y * a, -normal.y);
    (tangent, bitangent)
}

/// Vector with the coordinates `x`, `y`, `z` along tangent, bitangent ([`tangents`]) and `normal`.
#[inline(always)]
pub(crate) fn from_frame(normal: Vec3, x: f32, y: f32, z: f32) -> Vec3 {
    let (tangent, bitangent) = tangents(normal);
    tangent * x + bitangent * y + normal * z
}

/// Vector with the given cylindrical coordinates about `axis`: azimuth in radians from the first of the
/// [`tangents`], radius, and height along the axis.
#[inline(always)]
pub(crate) fn about(axis: Vec3, azimuth: f32, radius: f32, height: f32) -> Vec3 {
    let (y, x) = libm::sincosf(azimuth);
    from_frame(axis, radius * x, radius * y, height)
}

/// Point of the unit disc, uniformly distributed for a uniform point of the unit square.
pub(crate) fn point_on_disc([u, v]: [f32; 2]) -> [f32; 2] {
    let (sine, cosine) = libm::sincosf(core::f32::consts::TAU * u);
    let radius = sqrt(v);
    [radius * cosine, radius * sine]
}

/// Normalised vector `vector / |vector|`; zero for a zero vector.
#[inline(always)]
pub(crate) fn unit(vector: Vec3) -> Vec3 {
    let length_squared = vector.length_squared();
    if length_squared > 0.0 { vector * (1.0 / sqrt(length_squared)) } else { Vec3::ZERO }
}

/// Maximum component of a vector.
#[inline(always)]
pub(crate) fn max_component(v: Vec3) -> f32 {
    max(max(v.x, v.y), v.z)
}

/// Converts an `f32` to the bits of a bfloat16, rounded to nearest, ties away from zero. Finite numbers above
/// the largest bfloat16 round to infinity. A NaN gives an arbitrary value.
#[inline(always)]
pub(crate) fn upper_half(value: f32) -> u16 {
    (value.to_bits().saturating_add(0x8000) >> 16) as u16
}

/// Converts the bits of a bfloat16 to `f32`.
#[inline(always)]
pub(crate) fn from_upper_half(half: u16) -> f32 {
    f32::from_bits((half as u32) << 16)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_are_rounded_to_nearest() {
        let chosen = [0.0, -0.0, f32::INFINITY, f32::from_bits(1), f32::MIN_POSITIVE, f32::MAX, 1.0, 2.0];
        let others = (0..0x7f80_0000).step_by(9973).map(f32::from_bits);
        for x in chosen.into_iter().chain(others) {
            // A root of 53 bits is rounded to 24 as the exact one is (Figueroa 1995).
            let root = f64::from(x).sqrt() as f32;
            assert_eq!(sqrt(x).to_bits(), root.to_bits(), "{x:e}");
        }
        assert!(sqrt(-1.0).is_nan() && sqrt(f32::NAN).is_nan());
    }

    #[test]
    fn bfloat16_keeps_eight_bits_and_the_sign() {
        for value in [1.0_f32, -1.0, 0.3, -7.7e-12, 1e18, 3.1e38] {
            let found = from_upper_half(upper_half(value));
            assert!((found / value - 1.0).abs() <= 1.0 / 256.0, "{value} {found}");
        }
        assert_eq!(from_upper_half(upper_half(0.0)), 0.0);
        assert_eq!(from_upper_half(upper_half(f32::MAX)), f32::INFINITY);
        assert_eq!(from_upper_half(upper_half(f32::NEG_INFINITY)), f32::NEG_INFINITY);
    }
}
