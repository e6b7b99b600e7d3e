//! Format of the sums of pixels, and the values that they stand for.

use photoncard_shared::image::Header;
use photoncard_shared::message::{FrameParameters, Pixel, PixelLayers, PixelSums, SumScale, record_bytes};

/// Format of the sums of a tile or a film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SumFormat {
    /// True with layers.
    pub layers: bool,
    /// Number of samples in each sum.
    pub samples: u32,
    /// Units of the sums.
    pub scale: SumScale,
}

/// Values of a pixel, with its layers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FilmPixel {
    /// Radiance, albedo, normal and depth.
    pub pixel: Pixel,
    /// Layers; zero in a film without layers.
    pub layers: PixelLayers,
}

impl SumFormat {
    /// Format of one sample a pixel without layers, in units of 1 W/(sr m^2) and 1 m.
    pub const ONE: Self = Self { layers: false, samples: 1, scale: SumScale { radiance: 1.0, depth: 1.0 } };

    /// Format of a frame of the image with the header `header`.
    pub fn new(header: &Header, frame: &FrameParameters) -> Self {
        Self { layers: frame.layers, samples: frame.samples, scale: header.sum_scale() }
    }

    /// Size of the record of a pixel, bytes.
    pub fn record_bytes(&self) -> usize {
        record_bytes(self.layers)
    }

    /// Values that sums stand for.
    pub fn values(&self, sums: &PixelSums) -> FilmPixel {
        FilmPixel {
            pixel: sums.pixel(self.samples, &self.scale),
            layers: sums.pixel_layers(self.samples, &self.scale).unwrap_or_default(),
        }
    }

    /// Sums whose values are nearest to `pixel`.
    pub fn sums(&self, FilmPixel { pixel, layers }: &FilmPixel) -> PixelSums {
        let sums = PixelSums::nearest(pixel, self.samples, &self.scale);
        if self.layers { sums.with_nearest_layers(layers, self.samples, &self.scale) } else { sums }
    }

    /// Format of the sums of the samples of both; `None` if their units or layers differ.
    pub fn plus(&self, more: &Self) -> Option<Self> {
        let is_alike = self.layers == more.layers && self.scale == more.scale;
        is_alike.then_some(Self { samples: self.samples.checked_add(more.samples)?, ..*self })
    }
}
