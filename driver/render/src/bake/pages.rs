//! Pages: values of all texels, filled where no light was measured, and their 8-bit codes.

use glam::Vec3;

use super::atlas::Atlas;
use super::error::BakeError;
use super::texels::Texel;

/// Rings of texels around charts that get the values of their neighbours.
const RINGS: u32 = 4;

/// Values of the texels of a page.
#[derive(Clone, Debug, PartialEq)]
pub struct Page {
    /// Side, texels.
    pub size: u32,
    /// Value of each texel, row by row from the top.
    pub values: Vec<Vec3>,
    /// Chart of each texel, and of the texels around it; [`NO_CHART`] elsewhere.
    pub charts: Vec<u32>,
    /// Primitive of each texel that has a chart.
    pub primitives: Vec<u32>,
}

/// Chart of a texel that belongs to none.
pub const NO_CHART: u32 = u32::MAX;

impl Page {
    fn new(size: u32) -> Self {
        let texels = (size as usize).pow(2);
        Self {
            size,
            values: vec![Vec3::ZERO; texels],
            charts: vec![NO_CHART; texels],
            primitives: vec![0; texels],
        }
    }

    fn index(&self, [x, y]: [u32; 2]) -> usize {
        y as usize * self.size as usize + x as usize
    }

    /// Indices of the eight texels around a texel.
    fn around(&self, index: usize) -> impl Iterator<Item = usize> + use<> {
        let size = self.size as i64;
        let (x, y) = (index as i64 % size, index as i64 / size);
        let steps = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
        steps.filter_map(move |(dx, dy)| {
            let (x, y) = (x + dx, y + dy);
            let is_inside = (0..size).contains(&x) && (0..size).contains(&y) && (dx, dy) != (0, 0);
            is_inside.then_some((y * size + x) as usize)
        })
    }
}

/// Pages of the values of texels, `None` for texels whose value is the mean of their chart's nearest known
/// ones. Texels around the charts continue them.
pub(super) fn pages(atlas: &Atlas, texels: &[Texel], values: &[Option<Vec3>]) -> Vec<Page> {
    let mut pages = vec![Page::new(atlas.size); atlas.pages as usize];
    let mut unknown: Vec<Vec<usize>> = vec![Vec::new(); pages.len()];
    for (texel, value) in texels.iter().zip(values) {
        let number = texel.page as usize;
        let (Some(page), Some(unknown)) = (pages.get_mut(number), unknown.get_mut(number)) else { continue };
        let index = page.index(texel.place);
        page.charts[index] = texel.chart;
        page.primitives[index] = texel.primitive;
        match value {
            Some(value) => page.values[index] = *value,
            None => unknown.push(index),
        }
    }
    for (page, unknown) in pages.iter_mut().zip(unknown) {
        fill(page, unknown);
        for _ in 0..RINGS {
            dilate(page);
        }
    }
    pages
}

/// Gives unknown texels the means of their known neighbours in the chart, ring by ring.
fn fill(page: &mut Page, mut unknown: Vec<usize>) {
    let mut is_unknown = vec![false; page.values.len()];
    unknown.iter().for_each(|&index| is_unknown[index] = true);
    loop {
        let mut found = Vec::new();
        unknown.retain(|&index| {
            let is_known = |&other: &usize| !is_unknown[other] && page.charts[other] == page.charts[index];
            let mean = mean(page.around(index).filter(is_known).map(|other| page.values[other]));
            found.extend(mean.map(|mean| (index, mean)));
            mean.is_none()
        });
        if found.is_empty() {
            return;
        }
        for (index, value) in found {
            page.values[index] = value;
            is_unknown[index] = false;
        }
    }
}

/// Extends each chart by one ring of texels. Between charts the one of the lower number wins.
fn dilate(page: &mut Page) {
    let free = (0..page.charts.len()).filter(|&index| page.charts[index] == NO_CHART);
    let mut found = Vec::new();
    for index in free {
        let Some(first) = page.around(index).min_by_key(|&other| (page.charts[other], other)) else {
            continue;
        };
        let chart = page.charts[first];
        if chart != NO_CHART {
            let alike = page.around(index).filter(|&other| {
                page.charts[other] == chart && page.primitives[other] == page.primitives[first]
            });
            let value = mean(alike.map(|other| page.values[other])).unwrap_or_default();
            found.push((index, value, chart, page.primitives[first]));
        }
    }
    for (index, value, chart, primitive) in found {
        page.values[index] = value;
        page.charts[index] = chart;
        page.primitives[index] = primitive;
    }
}

fn mean(values: impl Iterator<Item = Vec3>) -> Option<Vec3> {
    let (sum, count) = values.fold((Vec3::ZERO, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    (count > 0.0).then(|| sum / count)
}

/// Divisors of a primitive's greatest value, by which its charts have their scales.
const DIVISORS: [f32; 5] = [4096.0, 512.0, 64.0, 8.0, 1.0];

/// Values that have the greatest of 256 codes: those of a primitive, divided by one of
/// [`DIVISORS`] on its dim charts. The bright inside of a lamp does not coarsen the steps of its outside.
pub(super) struct Scales {
    /// Greatest value of each primitive; 0 for dark ones.
    greatest: Vec<f32>,
    /// Divisor on each chart. It is 1 on charts of several primitives: at their borders a texel is seen on
    /// both.
    divisors: Vec<f32>,
}

impl Scales {
    /// Scales of the charts on the pages, by the charts' greatest values.
    pub(super) fn of_charts(pages: &[Page], primitives: usize, charts: usize) -> Self {
        let mut greatest = vec![0.0_f32; primitives];
        let mut of_charts: Vec<Option<(u32, f32)>> = vec![None; charts];
        let mut is_shared = vec![false; charts];
        for page in pages {
            for ((value, &chart), &primitive) in page.values.iter().zip(&page.charts).zip(&page.primitives) {
                let place = (greatest.get_mut(primitive as usize), of_charts.get_mut(chart as usize));
                let (Some(of_primitive), Some(of_chart)) = place else { continue };
                let value = value.max_element();
                *of_primitive = of_primitive.max(value);
                let (first, of_chart) = of_chart.get_or_insert((primitive, 0.0));
                *of_chart = of_chart.max(value);
                is_shared[chart as usize] |= *first != primitive;
            }
        }
        let divisor = |(of_chart, is_shared): (&Option<(u32, f32)>, bool)| match of_chart {
            Some((primitive, own)) if *own > 0.0 && !is_shared => {
                let fits = |divisor: &f32| greatest[*primitive as usize] / divisor >= *own;
                DIVISORS.into_iter().find(fits).unwrap_or(1.0)
            }
            _ => 1.0,
        };
        let divisors = of_charts.iter().zip(is_shared).map(divisor).collect();
        Self { greatest, divisors }
    }

    /// The greatest value of all, for every primitive and chart.
    pub(super) fn even(pages: &[Page], primitives: usize) -> Self {
        Self { greatest: vec![greatest(pages); primitives], divisors: Vec::new() }
    }

    /// Scale of a primitive on a chart; 0 if the primitive is dark.
    pub(super) fn of(&self, primitive: u32, chart: u32) -> f32 {
        let greatest = self.greatest.get(primitive as usize).copied().unwrap_or_default();
        greatest / self.divisors.get(chart as usize).copied().unwrap_or(1.0)
    }
}

/// Greatest value of all pages.
pub(super) fn greatest(pages: &[Page]) -> f32 {
    let of_page = |page: &Page| {
        let owned = page.values.iter().zip(&page.charts).filter(|(_, chart)| **chart != NO_CHART);
        owned.map(|(value, _)| value.max_element()).fold(0.0, f32::max)
    };
    pages.iter().map(of_page).fold(0.0, f32::max)
}

/// PNG of a page, sRGB, of values divided by their scales. Ordered noise before the rounding keeps slow
/// gradients from showing steps.
///
/// # Errors
/// If the encoder fails.
pub(super) fn srgb_png(page: &Page, scales: &Scales) -> Result<Vec<u8>, BakeError> {
    let mut codes = Vec::with_capacity(page.values.len() * 3);
    for (index, (value, (&primitive, &chart))) in
        page.values.iter().zip(page.primitives.iter().zip(&page.charts)).enumerate()
    {
        let scale = scales.of(primitive, chart);
        let share = if scale > 0.0 { *value / scale } else { Vec3::ZERO };
        for (channel, share) in share.to_array().into_iter().enumerate() {
            codes.push(code(srgb(share), noise(index, page.size, channel)));
        }
    }
    png(page.size, png::ColorType::Rgb, &codes, "lightmap")
}

/// PNG of a page in RGBM, linear: the value is `rgb * alpha * range`, codes as shares of 255.
///
/// # Errors
/// If the encoder fails.
pub(super) fn rgbm_png(page: &Page, range: f32) -> Result<Vec<u8>, BakeError> {
    let mut codes = Vec::with_capacity(page.values.len() * 4);
    for (index, value) in page.values.iter().enumerate() {
        let share = if range > 0.0 { (*value / range).clamp(Vec3::ZERO, Vec3::ONE) } else { Vec3::ZERO };
        // The least multiplier that no channel exceeds has the finest steps.
        let alpha = (share.max_element() * 255.0).ceil().max(1.0);
        let coded = |(channel, share): (usize, f32)| {
            code((share * 255.0 / alpha).min(1.0), noise(index, page.size, channel))
        };
        codes.extend(share.to_array().into_iter().enumerate().map(coded));
        codes.push(alpha as u8);
    }
    png(page.size, png::ColorType::Rgba, &codes, "RGBM page")
}

/// Encodes an image of 8 bits a channel.
///
/// # Errors
/// If the encoder fails.
pub(super) fn png_of(
    [width, height]: [u32; 2],
    colour: png::ColorType,
    codes: &[u8],
    what: &'static str,
) -> Result<Vec<u8>, BakeError> {
    let failed = |error: png::EncodingError| BakeError::Encode { what, reason: error.to_string() };
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(colour);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Balanced);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(codes).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(bytes)
}

fn png(size: u32, colour: png::ColorType, codes: &[u8], what: &'static str) -> Result<Vec<u8>, BakeError> {
    png_of([size; 2], colour, codes, what)
}

/// Code of a share of 1; `noise` is 0 to 1.
fn code(share: f32, noise: f32) -> u8 {
    (share * 255.0 + noise).floor().clamp(0.0, 255.0) as u8
}

/// sRGB transfer function (IEC 61966-2-1).
pub(super) fn srgb(linear: f32) -> f32 {
    if linear <= 0.003_130_8 {
        12.92 * linear.max(0.0)
    } else {
        1.055 * libm::powf(linear.min(1.0), 1.0 / 2.4) - 0.055
    }
}

/// Interleaved gradient noise of a texel, 0 to 1, whose low frequencies are weak (Jimenez, *Next Generation
/// Post Processing in Call of Duty*, 2014). Channels have other parts of the pattern.
fn noise(index: usize, size: u32, channel: usize) -> f32 {
    let shift = 5.588_238 * channel as f64;
    let [x, y] = [index % size as usize, index / size as usize].map(|side| side as f64 + shift);
    let inner = 0.067_110_56 * x + 0.005_837_15 * y;
    let outer = 52.982_918_9 * (inner - inner.floor());
    (outer - outer.floor()) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_keeps_the_mean_of_codes_and_never_exceeds_the_range() {
        for share in [0.0, 0.1003, 0.5, 0.7777, 1.0] {
            let codes = (0..4096).map(|index| f64::from(code(share, noise(index, 64, index % 3))));
            let mean = codes.sum::<f64>() / 4096.0;
            assert!((mean - f64::from(share) * 255.0).abs() < 0.03, "{share}: {mean}");
        }
    }

    #[test]
    fn dim_charts_of_one_primitive_have_scales_of_their_own() {
        let mut page = Page::new(3);
        // A bright chart, two dim ones, one at the very ratio, a dark one, and one of two primitives.
        page.charts = vec![0, 1, 2, 3, 4, 5, 5, NO_CHART, NO_CHART];
        page.primitives = vec![0, 0, 0, 0, 0, 0, 1, 0, 0];
        page.values = [800.0, 99.0, 0.01, 100.0, 0.0, 0.5, 3.0, 0.0, 0.0].map(Vec3::splat).to_vec();
        let of = |scales: &Scales, pairs: &[(u32, u32)]| -> Vec<f32> {
            pairs.iter().map(|&(primitive, chart)| scales.of(primitive, chart)).collect()
        };
        let scales = Scales::of_charts(std::slice::from_ref(&page), 2, 7);
        assert_eq!(of(&scales, &[(0, 0), (0, 1), (0, 3)]), [800.0, 100.0, 100.0]);
        assert_eq!(of(&scales, &[(0, 2), (0, 4), (0, 5), (1, 5)]), [800.0 / 4096.0, 800.0, 800.0, 3.0]);
        // A chart without texels, and texels without a chart.
        assert_eq!(of(&scales, &[(0, 6), (1, NO_CHART)]), [800.0, 3.0]);
        assert_eq!(of(&Scales::even(std::slice::from_ref(&page), 2), &[(0, 0), (1, 5), (1, 6)]), [800.0; 3]);
        page.values[0] = Vec3::INFINITY;
        assert_eq!(Scales::of_charts(&[page], 2, 7).of(0, 1), f32::INFINITY);
    }

    #[test]
    fn unknown_texels_take_values_of_their_chart_alone() {
        let mut page = Page::new(4);
        page.charts[..8].copy_from_slice(&[0, 0, 0, 0, 1, 1, 1, 1]);
        page.values[0] = Vec3::ONE;
        page.values[4] = Vec3::splat(9.0);
        fill(&mut page, vec![1, 2, 3, 5, 6, 7]);
        assert_eq!(page.values[3], Vec3::ONE);
        assert_eq!(page.values[7], Vec3::splat(9.0));
        dilate(&mut page);
        assert_eq!(page.charts[8..12], [1; 4]);
        assert_eq!(page.values[8], Vec3::splat(9.0));
        assert_eq!(page.charts[12], NO_CHART);
    }

    #[test]
    fn rgbm_codes_give_back_the_value() {
        let mut page = Page::new(1);
        page.values[0] = Vec3::new(3.0, 0.5, 0.01);
        let bytes = rgbm_png(&page, 12.0).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut codes = [0; 4];
        reader.next_frame(&mut codes).unwrap();
        let [r, g, b, m] = codes.map(|code| f32::from(code) / 255.0);
        let found = Vec3::new(r, g, b) * m * 12.0;
        assert!((found - page.values[0]).abs().max_element() < 0.02, "{found}");
    }
}
