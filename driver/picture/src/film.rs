//! Film: the pixels of a picture's crop window that were rendered so far.
//!
//! ```
//! use photoncard_picture::film::{Film, PixelSums, SumFormat, Window};
//!
//! # fn main() -> Result<(), photoncard_picture::film::FilmError> {
//! let format = SumFormat { samples: 2, ..SumFormat::ONE };
//! let mut film = Film::new(640, 480, Window { x0: 0, x1: 2, y0: 0, y1: 1 }, format)?;
//! film.write(1, 0, &PixelSums { light: [1 << 40; 3], ..PixelSums::default() })?;
//! assert_eq!((film.missing(), film.is_complete()), (1, false));
//! assert_eq!(film.pixel(1, 0).map(|pixel| pixel.radiance), Some([0.5; 3]));
//! assert_eq!(film.pixel(2, 0), None);
//! # Ok(())
//! # }
//! ```

use std::sync::{Mutex, PoisonError};

use photoncard_shared::message::Tile;
pub use photoncard_shared::message::{
    GroupSums, LayerSums, Pixel as PixelValue, PixelForm, PixelLayers, PixelSums, SumScale,
};
use thiserror::Error;

use crate::allocation;
use crate::sink::{FinishedTile, TileSink, pixel_positions};
pub use crate::sums::{FilmPixel, SumFormat};

/// Maximum number of pixels of a film, 2^28. They take 15 GiB, or up to 83 GiB with optional contents.
pub const MAX_PIXELS: u64 = 1 << 28;

/// Maximum width and height of a picture, pixels.
pub const MAX_SIDE: u32 = 1 << 20;

/// A rectangle of pixels with exclusive ends, in coordinates of the full picture: x to the right, y down.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// First column.
    pub x0: u32,
    /// Column after the last.
    pub x1: u32,
    /// First row.
    pub y0: u32,
    /// Row after the last.
    pub y1: u32,
}

impl Window {
    /// Window of a whole picture.
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

/// Error of creating a [`Film`] or writing its pixels.
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
    /// The crop window is empty, or not inside the picture.
    #[error(
        "the crop window {},{},{},{} is empty or not inside the picture of {width} x {height}; X0 < X1 <= width and \
         Y0 < Y1 <= height must hold", window.x0, window.x1, window.y0, window.y1
    )]
    Window {
        /// The crop window.
        window: Window,
        /// Width of the picture.
        width: u32,
        /// Height of the picture.
        height: u32,
    },
    /// The crop window has more than [`MAX_PIXELS`] pixels, or more than memory can hold.
    #[error("a film of {width} x {height} pixels does not fit in memory; render it in several crops")]
    Memory {
        /// Columns of the crop window.
        width: u32,
        /// Rows of the crop window.
        height: u32,
    },
    /// The films have different windows, layers or units.
    #[error(
        "the samples of a film of another window, other layers or other units cannot be added; render all with equal settings"
    )]
    Other,
    /// The film of earlier samples is incomplete, or it has at least as many samples as the picture is to
    /// have.
    #[error("a complete film of {samples} samples a pixel is no part of a picture of {asked}")]
    NoMore {
        /// Number of samples of the film.
        samples: u32,
        /// Number of samples of the picture.
        asked: u32,
    },
    /// The pixel lies outside the crop window.
    #[error("pixel ({x}, {y}) lies outside the crop window {},{},{},{}", window.x0, window.x1, window.y0, window.y1)]
    Outside {
        /// Column of the pixel.
        x: u32,
        /// Row of the pixel.
        y: u32,
        /// The crop window.
        window: Window,
    },
}

/// The pixels of a picture's crop window: sums over samples, and their mean values.
#[derive(Clone, Debug)]
pub struct Film {
    width: u32,
    height: u32,
    window: Window,
    format: SumFormat,
    /// Position of the scene's origin in the coordinates of its file, metres.
    origin: [f64; 3],
    /// Names of the light groups, one for each in the format.
    light_groups: Vec<String>,
    /// Encoded sums of the pixels, row by row.
    records: Vec<u8>,
    written: Vec<bool>,
    missing: usize,
}

impl Film {
    /// Creates an empty film for the crop window `window` of a picture of `width` x `height` pixels.
    ///
    /// # Errors
    /// If the picture or the window has no pixels or too many, or the window extends beyond the picture.
    pub fn new(width: u32, height: u32, window: Window, format: SumFormat) -> Result<Self, FilmError> {
        let count = Self::check(width, height, window)?;
        let too_large = FilmError::Memory { width: window.width(), height: window.height() };
        let bytes = count.checked_mul(format.record_bytes()).ok_or(too_large)?;
        let records = allocation::zeros(bytes).map_err(|_| too_large)?;
        allocation::check(count as u64).map_err(|_| too_large)?;
        let written = vec![false; count];
        let light_groups = (1..=format.form.light_groups).map(|group| group.to_string()).collect();
        let origin = [0.0; 3];
        Ok(Self { width, height, window, format, origin, light_groups, records, written, missing: count })
    }

    /// Checks that a film can be created, before its memory is allocated. Returns its number of pixels.
    pub fn check(width: u32, height: u32, window: Window) -> Result<usize, FilmError> {
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

    /// Format of the sums.
    pub fn format(&self) -> &SumFormat {
        &self.format
    }

    /// Position of the scene's origin in the coordinates of its file, metres; 0 unless it was set.
    pub fn origin(&self) -> [f64; 3] {
        self.origin
    }

    /// Sets the position of the scene's origin in the coordinates of its file, metres. Positions of pixels
    /// are in these coordinates.
    pub fn set_origin(&mut self, origin: [f64; 3]) {
        self.origin = origin;
    }

    /// Names of the light groups: their numbers from 1 unless they were set.
    pub fn light_groups(&self) -> &[String] {
        &self.light_groups
    }

    /// Sets the names of the light groups, as many as the format has; others have no effect.
    pub fn set_light_groups(&mut self, names: &[String]) {
        if names.len() == self.light_groups.len() {
            self.light_groups = names.to_vec();
        }
    }

    /// Restricts an empty film to the samples that `base` lacks, so that only these are rendered.
    ///
    /// # Errors
    /// [`FilmError::Other`] if windows, layers or units differ, [`FilmError::NoMore`] if no sample remains or
    /// `base` is not complete.
    pub fn begin_after(&mut self, base: &Self) -> Result<(), FilmError> {
        let more = self.format.samples.saturating_sub(base.format.samples);
        let others = self.format.of_part(base.format.samples, more);
        let all = others.plus(&base.format);
        if self.window != base.window || all.is_none() {
            return Err(FilmError::Other);
        }
        if more == 0 || !base.is_complete() {
            return Err(FilmError::NoMore { samples: base.format.samples, asked: self.format.samples });
        }
        self.format = others;
        Ok(())
    }

    /// Creates an empty film with the same window, for a part of the picture's samples: `samples` of them
    /// from number `first` on.
    ///
    /// # Errors
    /// [`FilmError::Memory`].
    pub fn empty_with(&self, first: u32, samples: u32) -> Result<Self, FilmError> {
        let film = Self::new(self.width, self.height, self.window, self.format.of_part(first, samples))?;
        Ok(Self { origin: self.origin, light_groups: self.light_groups.clone(), ..film })
    }

    /// Excludes samples before number `first` from an empty film.
    pub fn set_first_sample(&mut self, first: u32) {
        self.format = self.format.of_part(first, self.format.samples.saturating_sub(first));
    }

    /// Width of the full picture, pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height of the full picture, pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Crop window: the part of the picture that this film has.
    pub fn window(&self) -> Window {
        self.window
    }

    /// Sums of the pixels of the crop window, row by row from the top.
    pub fn sums(&self) -> impl ExactSizeIterator<Item = PixelSums> + Clone {
        let records = self.records.chunks_exact(self.format.record_bytes());
        records.map(|record| PixelSums::read(self.format.form, record).unwrap_or_default())
    }

    /// Values of the pixels in the crop window, row by row from the top.
    pub fn pixels(&self) -> impl ExactSizeIterator<Item = PixelValue> + Clone {
        self.all().map(|all| all.pixel)
    }

    /// Values of the pixels in the crop window including layers, row by row from the top.
    pub fn all(&self) -> impl ExactSizeIterator<Item = FilmPixel> + Clone {
        self.sums().map(|sums| self.format.values(&sums, self.origin))
    }

    /// Values of the pixel at `(x, y)` of the full picture; `None` outside the crop window.
    pub fn pixel(&self, x: u32, y: u32) -> Option<PixelValue> {
        self.all_at(x, y).map(|all| all.pixel)
    }

    /// Values of the pixel at `(x, y)` of the full picture including layers; `None` outside the crop window.
    pub fn all_at(&self, x: u32, y: u32) -> Option<FilmPixel> {
        self.sums_at(x, y).map(|sums| self.format.values(&sums, self.origin))
    }

    /// Sums of the pixel at `(x, y)` of the full picture; `None` outside the crop window.
    pub fn sums_at(&self, x: u32, y: u32) -> Option<PixelSums> {
        let bytes = self.format.record_bytes();
        let index = self.index(x, y)?;
        PixelSums::read(self.format.form, &self.records[index * bytes..(index + 1) * bytes])
    }

    /// Writes the sums of the pixel at `(x, y)` of the full picture, replacing earlier ones. Optional
    /// contents that the film lacks are dropped; those that the sums lack become zero.
    ///
    /// # Errors
    /// [`FilmError::Outside`] if the pixel is not in the crop window. The film does not change then.
    pub fn write(&mut self, x: u32, y: u32, sums: &PixelSums) -> Result<(), FilmError> {
        let index = self.index(x, y).ok_or(FilmError::Outside { x, y, window: self.window })?;
        let sums = sums.in_form(self.format.form);
        let bytes = self.format.record_bytes();
        store(&sums, &mut self.records[index * bytes..(index + 1) * bytes]);
        if !std::mem::replace(&mut self.written[index], true) {
            self.missing -= 1;
        }
        Ok(())
    }

    /// Adds the samples of another film with equal window, layers and units. A pixel that is missing in
    /// either film becomes missing.
    ///
    /// # Errors
    /// [`FilmError::Other`] if windows, layers or units differ. The film does not change then.
    pub fn add(&mut self, more: &Self) -> Result<(), FilmError> {
        let format = self.format.plus(&more.format).filter(|_| self.window == more.window);
        self.format = format.ok_or(FilmError::Other)?;
        let (bytes, form) = (self.format.record_bytes(), self.format.form);
        let records = self.records.chunks_exact_mut(bytes).zip(more.sums());
        for ((record, more_sums), (written, more_written)) in
            records.zip(self.written.iter_mut().zip(&more.written))
        {
            store(&PixelSums::read(form, record).unwrap_or_default().plus(&more_sums), record);
            self.missing += usize::from(*written && !more_written);
            *written &= more_written;
        }
        Ok(())
    }

    /// Returns `tile` with this film's samples added; its counters do not change. `None` if the film lacks a
    /// pixel of the tile, or has other units or layers.
    pub fn added_to(&self, tile: &FinishedTile) -> Option<FinishedTile> {
        let format = self.format.plus(tile.format())?;
        if !self.has(tile.tile()) {
            return None;
        }
        let sums = tile.sums().filter_map(|((x, y), sums)| Some(self.sums_at(x, y)?.plus(&sums)));
        let mut added = FinishedTile::of_pixels(*tile.tile(), sums, format)?;
        added.counters = tile.counters;
        Some(added)
    }

    /// Number of pixels in the crop window that are not written.
    pub fn missing(&self) -> usize {
        self.missing
    }

    /// Number of written pixels that are dazzling ([`SumFormat::is_dazzling`]).
    pub fn dazzling_pixels(&self) -> usize {
        let Window { x0, y0, x1, y1 } = self.window;
        let places = (y0..y1).flat_map(|y| (x0..x1).map(move |x| (x, y)));
        places.filter_map(|(x, y)| self.sums_at(x, y)).filter(|sums| self.format.is_dazzling(sums)).count()
    }

    /// Returns whether every pixel in the crop window was written.
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

    /// Returns the pixels of a tile; `None` unless all were written.
    pub fn finished(&self, tile: &Tile) -> Option<FinishedTile> {
        if !self.has(tile) {
            return None;
        }
        let sums = pixel_positions(tile).filter_map(|(x, y)| self.sums_at(x, y));
        FinishedTile::of_pixels(*tile, sums, self.format)
    }

    /// Marks a tile's pixels as not written.
    pub(crate) fn erase(&mut self, tile: &Tile) {
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

fn store(sums: &PixelSums, record: &mut [u8]) {
    let mut at = 0;
    sums.write(&mut |bytes| {
        record[at..at + bytes.len()].copy_from_slice(bytes);
        at += bytes.len();
    });
}

impl TileSink for Mutex<Film> {
    fn put(&self, tile: &FinishedTile) {
        // A thread that panicked holding the lock has left whole pixels.
        let mut film = self.lock().unwrap_or_else(PoisonError::into_inner);
        for ((x, y), sums) in tile.sums() {
            // The tiles of a render lie in its film's window.
            let _ = film.write(x, y, &sums);
        }
    }

    fn revoke(&self, tile: &Tile) {
        self.lock().unwrap_or_else(PoisonError::into_inner).erase(tile);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sums(light: u32) -> PixelSums {
        PixelSums { light: [i64::from(light) << 40; 3], ..PixelSums::default() }
    }

    #[test]
    fn a_film_is_complete_once_each_pixel_of_the_window_was_written() {
        let mut film = Film::new(8, 6, Window { x0: 2, x1: 5, y0: 1, y1: 3 }, SumFormat::ONE).unwrap();
        for y in 1..3 {
            for x in 2..5 {
                assert!(!film.is_complete());
                film.write(x, y, &sums(0)).unwrap();
                film.write(x, y, &sums(10 * y + x)).unwrap();
            }
        }
        assert!(film.is_complete());
        assert_eq!(film.pixel(4, 2).unwrap().radiance, [24.0; 3]);
        assert_eq!(film.pixels().next().unwrap().radiance, [12.0; 3]);
    }

    #[test]
    fn pixels_outside_the_window_are_refused() {
        let window = Window { x0: 2, x1: 5, y0: 1, y1: 3 };
        let mut film = Film::new(8, 6, window, SumFormat::ONE).unwrap();
        for (x, y) in [(1, 1), (5, 1), (2, 0), (2, 3), (u32::MAX, u32::MAX)] {
            assert_eq!(film.write(x, y, &sums(1)), Err(FilmError::Outside { x, y, window }));
            assert_eq!(film.pixel(x, y), None);
        }
        assert_eq!(film.missing(), 6);
    }

    #[test]
    fn impossible_films_are_refused() {
        assert!(matches!(Film::new(0, 4, Window::full(0, 4), SumFormat::ONE), Err(FilmError::Size { .. })));
        assert!(matches!(
            Film::new(u32::MAX, 4, Window::full(1, 1), SumFormat::ONE),
            Err(FilmError::Size { .. })
        ));
        for window in [
            Window { x0: 3, x1: 3, y0: 0, y1: 4 },
            Window { x0: 3, x1: 2, y0: 0, y1: 4 },
            Window { x0: 0, x1: 5, y0: 0, y1: 4 },
            Window { x0: 0, x1: 4, y0: 0, y1: 5 },
        ] {
            assert!(
                matches!(Film::new(4, 4, window, SumFormat::ONE), Err(FilmError::Window { .. })),
                "{window:?}"
            );
        }
        let side = MAX_SIDE;
        let film = Film::new(side, side, Window::full(side, side), SumFormat::ONE);
        assert!(matches!(film, Err(FilmError::Memory { .. })));
    }

    #[test]
    fn added_films_have_the_sums_of_all_samples_where_both_have_pixels() {
        let window = Window::full(3, 1);
        let film = |samples, lights: &[u32]| {
            let mut film = Film::new(3, 1, window, SumFormat { samples, ..SumFormat::ONE }).unwrap();
            (0..).zip(lights).for_each(|(x, &light)| film.write(x, 0, &sums(light)).unwrap());
            film
        };
        let mut all = film(1, &[1, 2, 3]);
        let more = film(3, &[7, 6]);
        let tile = |width| Tile { id: 4, x: 0, y: 0, width, height: 1 };
        let added = all.added_to(&more.finished(&tile(2)).unwrap()).unwrap();
        all.add(&more).unwrap();
        assert_eq!((all.format().samples, all.missing()), (4, 1));
        assert_eq!(all.pixel(0, 0).unwrap().radiance, [2.0; 3]);
        assert_eq!(all.finished(&tile(2)).as_ref(), Some(&added));
        assert_eq!(all.finished(&tile(3)), None);
        let mut other =
            Film::new(3, 1, window, SumFormat { form: PixelForm::LAYERED, ..SumFormat::ONE }).unwrap();
        assert_eq!(other.add(&all), Err(FilmError::Other));
    }
}
