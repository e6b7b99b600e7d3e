//! Film: the pixels of a picture's crop window, as far as they are rendered.
//!
//! ```
//! use photoncard_driver::film::{Film, PixelValue, Window};
//!
//! # fn main() -> Result<(), photoncard_driver::film::FilmError> {
//! let mut film = Film::new(640, 480, Window { x0: 0, x1: 2, y0: 0, y1: 1 })?;
//! film.write(1, 0, PixelValue { radiance: [0.5; 3], ..PixelValue::default() })?;
//! assert_eq!((film.missing(), film.is_complete()), (1, false));
//! assert_eq!(film.pixel(1, 0).map(|pixel| pixel.radiance), Some([0.5; 3]));
//! assert_eq!(film.pixel(2, 0), None);
//! # Ok(())
//! # }
//! ```

use std::sync::{Mutex, PoisonError};

use photoncard_shared::message::Tile;
pub use photoncard_shared::message::{Pixel as PixelValue, PixelLayers, PixelRecord};
use thiserror::Error;

use crate::sink::{FinishedTile, TileSink, pixel_positions};

/// Maximum number of pixels of a film: 2^28, about 10 GiB, or 20 GiB with layers.
pub const MAX_PIXELS: u64 = 1 << 28;

/// Maximum width and height of a picture, pixels.
pub const MAX_SIDE: u32 = 1 << 20;

/// A rectangle of pixels, ends exclusive, in coordinates of the full picture: x to the right, y down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// First column.
    pub x0: u32,
    /// One past the last column.
    pub x1: u32,
    /// First row.
    pub y0: u32,
    /// One past the last row.
    pub y1: u32,
}

impl Window {
    /// The window of a whole picture.
    pub const fn full(width: u32, height: u32) -> Self {
        Self { x0: 0, x1: width, y0: 0, y1: height }
    }

    /// Number of columns; 0 if `x1 < x0`.
    pub const fn width(&self) -> u32 {
        self.x1.saturating_sub(self.x0)
    }

    /// Number of rows; 0 if `y1 < y0`.
    pub const fn height(&self) -> u32 {
        self.y1.saturating_sub(self.y0)
    }

    /// Returns whether the pixel `(x, y)` lies in the window.
    pub const fn contains(&self, x: u32, y: u32) -> bool {
        x >= self.x0 && x < self.x1 && y >= self.y0 && y < self.y1
    }
}

/// Error of making a [`Film`] or writing its pixels.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum FilmError {
    /// The picture has no pixels, or a side above [`MAX_SIDE`].
    #[error(
        "a picture of {width} x {height} pixels is not possible: each side must be 1 to {MAX_SIDE}; choose another size"
    )]
    Size {
        /// Requested width.
        width: u32,
        /// Requested height.
        height: u32,
    },
    /// The crop window is empty or not inside the picture.
    #[error(
        "the crop window {},{},{},{} is empty or not inside the picture of {width} x {height}; X0 < X1 <= width and \
         Y0 < Y1 <= height must hold", window.x0, window.x1, window.y0, window.y1
    )]
    Window {
        /// The crop window.
        window: Window,
        /// The picture's width.
        width: u32,
        /// The picture's height.
        height: u32,
    },
    /// The crop window has more than [`MAX_PIXELS`], or more than memory can hold.
    #[error("a film of {width} x {height} pixels does not fit in memory; render it in several crops")]
    Memory {
        /// Columns of the crop window.
        width: u32,
        /// Rows of the crop window.
        height: u32,
    },
    /// The pixel lies outside the crop window.
    #[error("pixel ({x}, {y}) lies outside the crop window {},{},{},{}", window.x0, window.x1, window.y0, window.y1)]
    Outside {
        /// The pixel's column.
        x: u32,
        /// The pixel's row.
        y: u32,
        /// The crop window.
        window: Window,
    },
}

/// A film's pixel with its layers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FilmPixel {
    /// Radiance, albedo, normal and depth.
    pub pixel: PixelValue,
    /// Layers; zero in a film without layers.
    pub layers: PixelLayers,
}

impl From<PixelRecord> for FilmPixel {
    fn from(PixelRecord { pixel, layers }: PixelRecord) -> Self {
        Self { pixel, layers: layers.unwrap_or_default() }
    }
}

/// The pixels of a crop window of a picture.
#[derive(Clone, Debug)]
pub struct Film {
    width: u32,
    height: u32,
    window: Window,
    pixels: Vec<PixelValue>,
    /// Layers of each pixel; empty in a film without layers.
    layers: Vec<PixelLayers>,
    written: Vec<bool>,
    missing: usize,
}

impl Film {
    /// An empty film for the crop window `window` of a picture of `width` x `height` pixels, without layers.
    ///
    /// # Errors
    /// If the picture or the window has no pixels or too many, or the window leaves the picture.
    pub fn new(width: u32, height: u32, window: Window) -> Result<Self, FilmError> {
        let count = Self::check(width, height, window)?;
        let too_large = FilmError::Memory { width: window.width(), height: window.height() };
        let mut pixels = Vec::new();
        let mut written = Vec::new();
        pixels.try_reserve_exact(count).map_err(|_| too_large)?;
        written.try_reserve_exact(count).map_err(|_| too_large)?;
        pixels.resize(count, PixelValue::default());
        written.resize(count, false);
        Ok(Self { width, height, window, pixels, layers: Vec::new(), written, missing: count })
    }

    /// Checks that a film can be made, as far as that is known before its memory is asked for. Returns its pixels.
    pub(crate) fn check(width: u32, height: u32, window: Window) -> Result<usize, FilmError> {
        if !(1..=MAX_SIDE).contains(&width) || !(1..=MAX_SIDE).contains(&height) {
            return Err(FilmError::Size { width, height });
        }
        let (columns, rows) = (window.width(), window.height());
        if columns == 0 || rows == 0 || window.x1 > width || window.y1 > height {
            return Err(FilmError::Window { window, width, height });
        }
        let count = u64::from(columns) * u64::from(rows);
        let count = usize::try_from(count).ok().filter(|_| count <= MAX_PIXELS);
        count.ok_or(FilmError::Memory { width: columns, height: rows })
    }

    /// [`Self::new`] with layers.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_layers(width: u32, height: u32, window: Window) -> Result<Self, FilmError> {
        let mut film = Self::new(width, height, window)?;
        let count = film.pixels.len();
        let too_large = FilmError::Memory { width: window.width(), height: window.height() };
        film.layers.try_reserve_exact(count).map_err(|_| too_large)?;
        film.layers.resize(count, PixelLayers::default());
        Ok(film)
    }

    /// Returns whether the film has layers.
    pub fn has_layers(&self) -> bool {
        !self.layers.is_empty()
    }

    /// Width of the full picture, pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height of the full picture, pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The crop window: the part of the picture that this film holds.
    pub fn window(&self) -> Window {
        self.window
    }

    /// The pixels of the crop window, row by row from the top.
    pub fn pixels(&self) -> &[PixelValue] {
        &self.pixels
    }

    /// The pixel at `(x, y)` of the full picture, or `None` outside the crop window.
    pub fn pixel(&self, x: u32, y: u32) -> Option<&PixelValue> {
        self.index(x, y).map(|index| &self.pixels[index])
    }

    /// The pixels of the crop window with their layers, row by row from the top.
    pub fn all(&self) -> impl Iterator<Item = FilmPixel> {
        (0..self.pixels.len()).map(|index| self.all_of(index))
    }

    /// The pixel at `(x, y)` of the full picture with its layers, or `None` outside the crop window.
    pub fn all_at(&self, x: u32, y: u32) -> Option<FilmPixel> {
        self.index(x, y).map(|index| self.all_of(index))
    }

    fn all_of(&self, index: usize) -> FilmPixel {
        let layers = self.layers.get(index).copied().unwrap_or_default();
        FilmPixel { pixel: self.pixels[index], layers }
    }

    /// Writes the pixel at `(x, y)` of the full picture from a chip's record. Layers that the record or the film lacks
    /// are left out.
    ///
    /// # Errors
    /// As [`Self::write`].
    pub fn write_record(&mut self, x: u32, y: u32, record: &PixelRecord) -> Result<(), FilmError> {
        self.write(x, y, record.pixel)?;
        if let (Some(index), Some(layers)) = (self.index(x, y), record.layers)
            && let Some(slot) = self.layers.get_mut(index)
        {
            *slot = layers;
        }
        Ok(())
    }

    /// Writes the pixel at `(x, y)` of the full picture; writing one again replaces it.
    ///
    /// # Errors
    /// [`FilmError::Outside`] if the pixel is not in the crop window; the film stays as it was.
    pub fn write(&mut self, x: u32, y: u32, value: PixelValue) -> Result<(), FilmError> {
        let index = self.index(x, y).ok_or(FilmError::Outside { x, y, window: self.window })?;
        self.pixels[index] = value;
        if !std::mem::replace(&mut self.written[index], true) {
            self.missing -= 1;
        }
        Ok(())
    }

    /// Number of pixels of the crop window that were never written.
    pub fn missing(&self) -> usize {
        self.missing
    }

    /// Returns whether every pixel of the crop window was written.
    pub fn is_complete(&self) -> bool {
        self.missing == 0
    }

    /// Returns whether every pixel of a tile was written.
    pub fn has(&self, tile: &Tile) -> bool {
        let mut rows = tile.y..tile.y + tile.height;
        rows.all(|y| {
            (tile.x..tile.x + tile.width).all(|x| self.index(x, y).is_some_and(|index| self.written[index]))
        })
    }

    /// The pixels of a tile; `None` unless all were written.
    pub fn finished(&self, tile: &Tile) -> Option<FinishedTile> {
        if !self.has(tile) {
            return None;
        }
        let pixels = pixel_positions(tile).filter_map(|(x, y)| self.all_at(x, y));
        let records = pixels.map(|FilmPixel { pixel, layers }| PixelRecord { pixel, layers: Some(layers) });
        FinishedTile::of_pixels(*tile, records, self.has_layers())
    }

    /// Marks a tile's pixels as not written.
    pub fn erase(&mut self, tile: &Tile) {
        for index in pixel_positions(tile).filter_map(|(x, y)| self.index(x, y)).collect::<Vec<_>>() {
            self.missing += usize::from(std::mem::replace(&mut self.written[index], false));
        }
    }

    fn index(&self, x: u32, y: u32) -> Option<usize> {
        let Window { x0, y0, .. } = self.window;
        self.window
            .contains(x, y)
            .then(|| (y - y0) as usize * self.window.width() as usize + (x - x0) as usize)
    }
}

impl TileSink for Mutex<Film> {
    fn put(&self, tile: &FinishedTile) {
        // A thread that panicked holding the lock has left whole pixels.
        let mut film = self.lock().unwrap_or_else(PoisonError::into_inner);
        for ((x, y), record) in tile.pixels() {
            // The tiles of a render lie in its film's window.
            let _ = film.write_record(x, y, &record);
        }
    }

    fn revoke(&self, tile: &Tile) {
        self.lock().unwrap_or_else(PoisonError::into_inner).erase(tile);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(radiance: f32) -> PixelValue {
        PixelValue { radiance: [radiance; 3], ..PixelValue::default() }
    }

    #[test]
    fn a_film_is_complete_once_each_pixel_of_the_window_was_written() {
        let mut film = Film::new(8, 6, Window { x0: 2, x1: 5, y0: 1, y1: 3 }).unwrap();
        for y in 1..3 {
            for x in 2..5 {
                assert!(!film.is_complete());
                film.write(x, y, value(0.0)).unwrap();
                film.write(x, y, value((10 * y + x) as f32)).unwrap();
            }
        }
        assert!(film.is_complete());
        assert_eq!(film.pixel(4, 2), Some(&value(24.0)));
        assert_eq!(film.pixels()[0], value(12.0));
    }

    #[test]
    fn pixels_outside_the_window_are_refused() {
        let window = Window { x0: 2, x1: 5, y0: 1, y1: 3 };
        let mut film = Film::new(8, 6, window).unwrap();
        for (x, y) in [(1, 1), (5, 1), (2, 0), (2, 3), (u32::MAX, u32::MAX)] {
            assert_eq!(film.write(x, y, value(1.0)), Err(FilmError::Outside { x, y, window }));
            assert_eq!(film.pixel(x, y), None);
        }
        assert_eq!(film.missing(), 6);
    }

    #[test]
    fn impossible_films_are_refused() {
        assert!(matches!(Film::new(0, 4, Window::full(0, 4)), Err(FilmError::Size { .. })));
        assert!(matches!(Film::new(u32::MAX, 4, Window::full(1, 1)), Err(FilmError::Size { .. })));
        for window in [
            Window { x0: 3, x1: 3, y0: 0, y1: 4 },
            Window { x0: 3, x1: 2, y0: 0, y1: 4 },
            Window { x0: 0, x1: 5, y0: 0, y1: 4 },
            Window { x0: 0, x1: 4, y0: 0, y1: 5 },
        ] {
            assert!(matches!(Film::new(4, 4, window), Err(FilmError::Window { .. })), "{window:?}");
        }
        let side = MAX_SIDE;
        assert!(matches!(Film::new(side, side, Window::full(side, side)), Err(FilmError::Memory { .. })));
    }
}
