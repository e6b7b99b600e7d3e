//! Filters of decoded attributes. They never panic: invalid input gives arbitrary numbers.

use serde::Deserialize;

/// Transform of decoded attributes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(crate) enum Filter {
    /// No transform.
    #[default]
    None,
    /// Unit vectors in octahedral encoding.
    Octahedral,
    /// Unit quaternions whose largest component is left out.
    Quaternion,
    /// Floating-point numbers as mantissa and exponent.
    Exponential,
    /// Colours as luma and two chroma differences, with alpha.
    Color,
}

/// Applies a filter to elements of `stride` bytes, in place.
pub(super) fn apply(filter: Filter, stride: usize, decoded: &mut [u8]) {
    match (filter, stride) {
        (Filter::None, _) => {}
        (Filter::Exponential, _) => {
            decoded.as_chunks_mut().0.iter_mut().for_each(|word| *word = float(*word));
        }
        (Filter::Octahedral, 4) => bytes(decoded, |[x, y, one, w]| {
            let [x, y, z] = octahedral([x, y, one].map(|value| f32::from(value as i8)), 127.0);
            [x, y, z].map(|value| value as i8 as u8).into_iter().chain([w])
        }),
        (Filter::Octahedral, _) => halves(decoded, |[x, y, one, w]| {
            let [x, y, z] = octahedral([x, y, one].map(|value| f32::from(value as i16)), 32_767.0);
            [x, y, z].map(|value| value as i16 as u16).into_iter().chain([w])
        }),
        (Filter::Quaternion, _) => halves(decoded, quaternion),
        (Filter::Color, 4) => bytes(decoded, |code| {
            let [luma, orange, green, alpha] = code;
            let code = [i32::from(luma), i32::from(orange as i8), i32::from(green as i8), i32::from(alpha)];
            colour(code, 255.0).map(|value| value as u8)
        }),
        (Filter::Color, _) => halves(decoded, |code| {
            let [luma, orange, green, alpha] = code;
            let code = [i32::from(luma), i32::from(orange as i16), i32::from(green as i16), i32::from(alpha)];
            colour(code, 65_535.0).map(|value| value as u16)
        }),
    }
}

/// Applies `filter` to elements of four bytes each, in place.
fn bytes<R: IntoIterator<Item = u8>>(decoded: &mut [u8], filter: impl Fn([u8; 4]) -> R) {
    for element in decoded.as_chunks_mut::<4>().0 {
        let filtered = filter(*element);
        element.iter_mut().zip(filtered).for_each(|(byte, value)| *byte = value);
    }
}

/// Applies `filter` to elements of four 16-bit integers each, in place.
fn halves<R: IntoIterator<Item = u16>>(decoded: &mut [u8], filter: impl Fn([u16; 4]) -> R) {
    for element in decoded.as_chunks_mut::<8>().0 {
        let halves = element.as_chunks_mut::<2>().0;
        let filtered = filter([0, 1, 2, 3].map(|at| u16::from_le_bytes(halves[at])));
        halves.iter_mut().zip(filtered).for_each(|(half, value)| *half = value.to_le_bytes());
    }
}

/// Rounds to the nearest integer; halves away from zero.
fn rounded(value: f32) -> f32 {
    libm::roundf(value)
}

/// Decodes an octahedral unit vector and scales it by `whole`. `one` is the code of 1.
fn octahedral([x, y, one]: [f32; 3], whole: f32) -> [f32; 3] {
    let (x, y) = (x / one, y / one);
    let z = 1.0 - x.abs() - y.abs();
    // The lower half is folded over the corners of the upper one.
    let fold = (-z).max(0.0);
    let unfolded = |value: f32| if value >= 0.0 { value - fold } else { value + fold };
    let (x, y) = (unfolded(x), unfolded(y));
    let scale = whole / libm::sqrtf(x * x + y * y + z * z);
    [x, y, z].map(|value| rounded(value * scale))
}

/// Decodes a quaternion from three of its components. The two lowest bits of the fourth value are the index
/// of the largest component; the other bits are the scale of the three.
fn quaternion(code: [u16; 4]) -> [u16; 4] {
    let [x, y, z, w] = code.map(|value| value as i16);
    let scale = std::f32::consts::FRAC_1_SQRT_2 / f32::from(w | 3);
    let [x, y, z] = [x, y, z].map(|value| f32::from(value) * scale);
    let largest = libm::sqrtf((1.0 - x * x - y * y - z * z).max(0.0));
    let mut components = [0; 4];
    for (place, value) in [largest, x, y, z].into_iter().enumerate() {
        components[(usize::from(w as u16 & 3) + place) % 4] = rounded(value * 32_767.0) as i16 as u16;
    }
    components
}

/// Decodes a floating-point number from a signed 24-bit mantissa and a signed 8-bit exponent.
fn float(word: [u8; 4]) -> [u8; 4] {
    let word = i32::from_le_bytes(word);
    let mantissa = (word << 8) >> 8;
    libm::ldexpf(mantissa as f32, word >> 24).to_le_bytes()
}

/// Decodes a `YCoCg` colour (luma, chroma orange, chroma green) with alpha, and scales it by `whole`. If bit
/// b is the highest set bit of alpha, the code of 1 is `2^(b + 1) - 1`.
fn colour([luma, orange, green, alpha]: [i32; 4], whole: f32) -> [f32; 4] {
    let bit = alpha.checked_ilog2().unwrap_or(0);
    let one = (2 << bit) - 1;
    let alpha = alpha & (one >> 1);
    let alpha = alpha << 1 | alpha & 1;
    let scale = whole / one as f32;
    [luma + orange - green, luma + green, luma - orange - green, alpha]
        .map(|value| rounded(value as f32 * scale))
}
