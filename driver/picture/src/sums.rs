//! Format of the sums of pixels, and the values that they represent.

use photoncard_shared::budget::MAX_LIGHT_GROUPS;
use photoncard_shared::image::Header;
use photoncard_shared::message::{
    FrameParameters, Pixel, PixelForm, PixelLayers, PixelSums, SampleCount, SumScale,
};

/// Binary logarithm of the mean light per sample above which a pixel is dazzling. The unit of the light is
/// that of the sums, 2^-40 radiance units.
const DAZZLING_SAMPLE: u32 = 40 + 16;
/// Sum of light above which a pixel is dazzling whatever its number of samples: a fourth of the greatest sum.
const DAZZLING: i64 = 1 << 61;

/// Format of the sums in a tile or a film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SumFormat {
    /// Optional contents of the sums.
    pub form: PixelForm,
    /// Number of samples in each sum.
    pub samples: u32,
    /// Number of probes among the samples: with adaptive sampling the first samples of a pixel, else 0. The
    /// light of probes has the weight 1/2.
    pub probes: u32,
    /// Units of the sums.
    pub scale: SumScale,
}

/// Values of a pixel, including layers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FilmPixel {
    /// Radiance, albedo, normal and depth.
    pub pixel: Pixel,
    /// Layers of the pixel; zero in a film without layers.
    pub layers: PixelLayers,
    /// Fraction of the pixel that surfaces cover, 0 to 1.
    pub alpha: f32,
    /// Mean position of the surfaces that the samples see, metres; zero if none is seen, and in a film
    /// without positions.
    pub position: [f32; 3],
    /// Light of each light group, W/(sr m^2); zero for groups that the film does not have.
    pub light_groups: [[f32; 3]; MAX_LIGHT_GROUPS],
}

impl SumFormat {
    /// Format with one sample per pixel and without layers, in units of 1 W/(sr m^2) and 1 m.
    pub const ONE: Self =
        Self { form: PixelForm::PLAIN, samples: 1, probes: 0, scale: SumScale { radiance: 1.0, depth: 1.0 } };

    /// Format of a frame of the card image with the header `header`.
    pub fn new(header: &Header, frame: &FrameParameters) -> Self {
        let is_adaptive = frame.adaptive_threshold.is_some();
        let scale = header.sum_scale();
        let scale = if frame.irradiance { scale.of_irradiance() } else { scale };
        Self::of_range(frame.form(), (frame.first_sample, frame.samples), is_adaptive, scale)
    }

    /// Format of `samples` samples from number `first` on, with or without adaptive sampling.
    pub fn of_range(
        form: PixelForm,
        (first, samples): (u32, u32),
        is_adaptive: bool,
        scale: SumScale,
    ) -> Self {
        let SampleCount { samples, probes } = SampleCount::of_range(first, samples, is_adaptive);
        Self { form, samples, probes, scale }
    }

    /// Format of `samples` samples from number `first` on. `self` is the format of all samples of the
    /// picture.
    pub(crate) fn of_part(&self, first: u32, samples: u32) -> Self {
        Self::of_range(self.form, (first, samples), self.probes > 0, self.scale)
    }

    /// Numbers of samples and of probes among them.
    pub fn count(&self) -> SampleCount {
        SampleCount { samples: self.samples, probes: self.probes }
    }

    /// Size of the record of a pixel, bytes.
    pub fn record_bytes(&self) -> usize {
        self.form.record_bytes()
    }

    /// Values of a pixel with the sums `sums`: means over the samples. The position is relative to `origin`,
    /// metres, the scene's origin in the coordinates of its file.
    pub fn values(&self, sums: &PixelSums, origin: [f64; 3]) -> FilmPixel {
        let place = |mean: [f64; 3]| [0, 1, 2].map(|axis: usize| (mean[axis] + origin[axis]) as f32);
        FilmPixel {
            pixel: sums.pixel(self.count(), &self.scale),
            layers: sums.pixel_layers(self.count(), &self.scale).unwrap_or_default(),
            alpha: sums.alpha(self.count()),
            position: sums.mean_position(&self.scale).map_or([0.0; 3], place),
            light_groups: sums.group_radiance(self.count(), &self.scale),
        }
    }

    /// Returns whether the light of a pixel is far above that of its scene: more than 2^16 radiance units per
    /// sample on average. The brightest surface has at most 2^7. Such pixels are rare. They occur where a
    /// lamp without an area touches a surface.
    pub fn is_dazzling(&self, sums: &PixelSums) -> bool {
        let most = (i64::from(self.samples) << DAZZLING_SAMPLE).min(DAZZLING);
        sums.light.into_iter().any(|light| light > most)
    }

    /// Sums whose values are nearest to those of a pixel, without light groups, position, coverage and
    /// identities.
    pub fn sums(&self, FilmPixel { pixel, layers, .. }: &FilmPixel) -> PixelSums {
        let sums = PixelSums::nearest(pixel, self.count(), &self.scale);
        if self.form.layers { sums.with_nearest_layers(layers, self.count(), &self.scale) } else { sums }
    }

    /// Format of sums over the samples of this format and of `more`; `None` if units or contents differ, or
    /// the number of samples overflows.
    pub fn plus(&self, more: &Self) -> Option<Self> {
        let is_alike = self.form == more.form && self.scale == more.scale;
        let samples = self.samples.checked_add(more.samples)?;
        is_alike.then_some(Self { samples, probes: self.probes.saturating_add(more.probes), ..*self })
    }
}
