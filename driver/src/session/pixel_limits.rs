//! Ranges of pixel values that a chip can produce: a value outside shows that the card or its memory is wrong.

use photoncard_shared::image::Header;
use photoncard_shared::message::{FrameParameters, Pixel, PixelLayers, PixelRecord, record_bytes};

/// Maximum of a fixed-point sum of light, in radiance units.
const GREATEST_SUM: f32 = (1 << 23) as f32;
/// Relative rounding error of a sum of light in `f32`, and of the sum of a few.
const LIGHT_ROUNDING: f64 = 1.0 / (1 << 22) as f64;
/// Relative rounding error of one operation in `f32`.
const ROUNDING: f64 = 1.0 / (1 << 23) as f64;
/// Number of operations that a unit normal and its mean take, in addition to one per sample.
const OPERATIONS: f64 = 16.0;
/// Rounding error of a surface's position along the view's axis, relative to the scene's maximum coordinate.
const DEPTH_ROUNDING: f32 = 1.0 / (1 << 19) as f32;
/// Maximum number of cells of the photon grid along the scene's longest side.
const GRID_CELLS: f32 = (1 << 20) as f32;

/// Ranges of a frame's pixel values.
///
/// | value | range |
/// |---|---|
/// | radiance, direct, indirect, caustic | 0 to 2^23 radiance units, finite; radiance is the sum of the others, except for rounding |
/// | albedo | 0 to 1 |
/// | normal | length 0 to 1, and (n + 16) 2^-23 for the rounding of n samples |
/// | depth | at least -2^-19 times the maximum coordinate, for a surface in the eye's plane; infinite where nothing is seen |
/// | gathers | an integer from 0 to n |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelLimits {
    greatest_light: f32,
    greatest_length: f64,
    least_depth: f32,
    samples: f32,
    has_layers: bool,
}

/// Invalid value of a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BadValue {
    pub(super) channel: &'static str,
    pub(super) value: f32,
}

impl PixelLimits {
    /// Limits of a frame of the image with the header `header`.
    pub fn new(header: &Header, frame: &FrameParameters) -> Self {
        let grid = &header.photon_grid;
        let corners = grid.origin.iter().map(|&origin| (origin as f32).abs() * grid.cell);
        let farthest = corners.fold(0.0, f32::max) + GRID_CELLS * grid.cell;
        let eye = frame.camera.origin.iter().fold(0.0, |most: f32, coordinate| most.max(coordinate.abs()));
        Self {
            greatest_light: GREATEST_SUM * header.radiance_unit,
            greatest_length: 1.0 + (f64::from(frame.samples) + OPERATIONS) * ROUNDING,
            least_depth: -DEPTH_ROUNDING * (farthest + eye),
            samples: frame.samples as f32,
            has_layers: frame.layers,
        }
    }

    /// Returns whether pixels have layers.
    pub(super) fn has_layers(&self) -> bool {
        self.has_layers
    }

    /// Size of one record, bytes.
    pub(super) fn record_bytes(&self) -> usize {
        record_bytes(self.has_layers)
    }

    /// First invalid value of a pixel.
    pub(super) fn find_bad(&self, record: &PixelRecord) -> Option<BadValue> {
        let Pixel { radiance, albedo, normal, depth } = record.pixel;
        let is_light = |value: f32| value.is_finite() && (0.0..=self.greatest_light).contains(&value);
        let find = |channel, values: &[f32], is_possible: &dyn Fn(f32) -> bool| {
            let bad = values.iter().find(|&&value| !is_possible(value));
            bad.map(|&value| BadValue { channel, value })
        };
        let length = normal.iter().map(|&n| f64::from(n) * f64::from(n)).sum::<f64>().sqrt();
        let is_component = |value: f32| value.is_finite() && length <= self.greatest_length;
        find("radiance", &radiance, &is_light)
            .or_else(|| find("albedo", &albedo, &|value| (0.0..=1.0).contains(&value)))
            .or_else(|| find("a normal of component", &normal, &is_component))
            .or_else(|| find("depth", &[depth], &|value| value >= self.least_depth))
            .or_else(|| {
                let layers = record.layers?;
                let PixelLayers { direct, indirect, caustic, gathers } = layers;
                let is_count = |value: f32| value.fract() == 0.0 && (0.0..=self.samples).contains(&value);
                find("direct light", &direct, &is_light)
                    .or_else(|| find("indirect light", &indirect, &is_light))
                    .or_else(|| find("caustic light", &caustic, &is_light))
                    .or_else(|| find("gathers", &[gathers], &is_count))
                    .or_else(|| self.find_other_sum(&radiance, &layers))
            })
    }

    /// Component of radiance that is not the sum of its layers. A sum above the maximum is clamped, which is valid.
    fn find_other_sum(&self, radiance: &[f32; 3], layers: &PixelLayers) -> Option<BadValue> {
        let PixelLayers { direct, indirect, caustic, .. } = layers;
        let parts = direct.iter().zip(indirect).zip(caustic);
        let mut sums =
            radiance.iter().zip(parts.map(|((&a, &b), &c)| f64::from(a) + f64::from(b) + f64::from(c)));
        let is_other = |value: f32, sum: f64| {
            let rounding = sum * LIGHT_ROUNDING + f64::from(f32::MIN_POSITIVE);
            let is_cut = value == self.greatest_light && sum >= f64::from(value);
            !is_cut && (f64::from(value) - sum).abs() > rounding
        };
        let (&value, _) = sums.find(|&(&value, sum)| is_other(value, sum))?;
        Some(BadValue { channel: "radiance that is not the sum of its layers:", value })
    }
}
