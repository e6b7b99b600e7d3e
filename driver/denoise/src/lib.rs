//! Removes noise from pictures and lightmaps by Intel Open Image Denoise (Áfra 2019), neural networks of
//! which that for pictures reads radiance, albedo and normals.
//!
//! The library is not part of this program. [`Denoiser::find`] loads version 2 of it at run time, from the
//! first of these locations that has it:
//!
//! 1. the file that the environment variable `PHOTONCARD_OIDN` names;
//! 2. the folder of the program, and the folders `lib` in and beside it;
//! 3. the package `pyoidn` of Python, in the active environment, the user's or the system's;
//! 4. the library folders of the system.
//!
//! Rounding makes a denoised picture depend on the library's version and on the processor. The film, which
//! holds the rendered pixels, is not changed.

#![deny(unsafe_code)]

mod background;
mod library;
#[cfg(target_family = "wasm")]
mod no_loader;
mod places;

use std::path::PathBuf;

use photoncard_picture::film::{Film, PixelValue};

pub use self::library::{DenoiseError, MustStop};
use self::library::{Device, Input, Kind, Library, Quality};
pub use self::places::VARIABLE;

/// Open Image Denoise, ready to run on this machine's processor.
pub struct Denoiser {
    library: Library,
    version: String,
}

impl Denoiser {
    /// Loads the library.
    ///
    /// # Errors
    /// [`DenoiseError::Missing`] if no file of the library is found; [`DenoiseError::Unusable`] if a file of
    /// it does not load; [`DenoiseError::Failed`] if the library cannot use the processor.
    pub fn find() -> Result<Self, DenoiseError> {
        if let Some(path) = places::stated() {
            return Self::open(path);
        }
        let mut unusable = None;
        for path in places::candidates() {
            match Self::open(path) {
                Ok(denoiser) => return Ok(denoiser),
                Err(error) => unusable = unusable.or(Some(error)),
            }
        }
        // The system's loader searches last, and has no more to say if it finds nothing.
        Self::open(places::FILE.into()).map_err(|error| match (unusable, error) {
            (Some(error), _) | (None, error @ DenoiseError::Failed { .. }) => error,
            (None, _) => DenoiseError::Missing,
        })
    }

    fn open(path: PathBuf) -> Result<Self, DenoiseError> {
        let library = Library::open(&path).map_err(|reason| DenoiseError::Unusable { path, reason })?;
        let version = Device::new(&library, Some(1))?.version();
        Ok(Self { library, version })
    }

    /// Returns the name and version of the library, such as `OIDN 2.5.1`.
    pub fn version(&self) -> &str {
        &self.version
    }

    /// Returns the denoised radiance of a complete film, W/(sr m^2), row by row from the top of the crop
    /// window.
    ///
    /// Albedo and normals are denoised first, each alone, and then guide the denoising of the radiance.
    /// Because they have little noise, the library's smaller network (quality *balanced*) denoises them; this
    /// changes the picture's error by 2 % at most. Pixels around which no eye ray hits a surface keep their
    /// radiance: the environment has no noise, and the network would change it. `threads` is the maximum
    /// number of threads; `None` for one per core.
    ///
    /// # Errors
    /// [`DenoiseError::Incomplete`], [`DenoiseError::Stopped`] soon after `must_stop` returns true, and
    /// [`DenoiseError::Failed`] if the library lacks memory.
    pub fn radiance(
        &self,
        film: &Film,
        threads: Option<usize>,
        must_stop: MustStop,
    ) -> Result<Vec<[f32; 3]>, DenoiseError> {
        if !film.is_complete() {
            return Err(DenoiseError::Incomplete { missing: film.missing() });
        }
        let size = [film.window().width(), film.window().height()];
        self.radiance_of(size, film.pixels(), threads, must_stop)
    }

    /// Does [`Self::radiance`] for pixels, row by row, of a picture of `size` columns and rows.
    ///
    /// # Errors
    /// As [`Self::radiance`]. [`DenoiseError::Incomplete`] if there are fewer pixels.
    pub fn radiance_of(
        &self,
        size: [u32; 2],
        pixels: impl Iterator<Item = PixelValue>,
        threads: Option<usize>,
        must_stop: MustStop,
    ) -> Result<Vec<[f32; 3]>, DenoiseError> {
        let size = size.map(|side| side as usize);
        let device = Device::new(&self.library, threads)?;
        let [mut radiance, mut albedo, mut normal] = [const { Vec::new() }; 3];
        let mut hits_surface = Vec::new();
        for pixel in pixels {
            hits_surface.push(pixel.depth.is_finite());
            radiance.push(pixel.radiance);
            albedo.push(pixel.albedo);
            normal.push(pixel.normal);
        }
        let missing = (size[0] * size[1]).saturating_sub(radiance.len());
        if missing > 0 {
            return Err(DenoiseError::Incomplete { missing });
        }
        let feature = |name, image: &[[f32; 3]]| {
            let (kind, quality) = (Kind::Picture, Quality::Balanced);
            let input = Input { kind, images: &[(name, image)], switches: &[], quality };
            device.run(size, &input, must_stop)
        };
        let [albedo, normal] = [feature("albedo", &albedo)?, feature("normal", &normal)?];
        let images = [("color", &*radiance), ("albedo", &*albedo), ("normal", &*normal)];
        let (kind, quality) = (Kind::Picture, Quality::High);
        let input = Input { kind, images: &images, switches: &["hdr", "cleanAux"], quality };
        let mut denoised = device.run(size, &input, must_stop)?;
        for pixel in background::pixels(&hits_surface, size) {
            denoised[pixel] = radiance[pixel];
        }
        Ok(denoised)
    }

    /// Returns the denoised values of a lightmap of `size` columns and rows, row by row: irradiance, W/m^2.
    /// `threads` is the maximum number of threads; `None` for one per core.
    ///
    /// # Errors
    /// As [`Self::radiance`]. [`DenoiseError::Incomplete`] if there are not as many texels.
    pub fn lightmap(
        &self,
        size: [u32; 2],
        irradiance: &[[f32; 3]],
        threads: Option<usize>,
        must_stop: MustStop,
    ) -> Result<Vec<[f32; 3]>, DenoiseError> {
        let size = size.map(|side| side as usize);
        let texels = size[0] * size[1];
        if irradiance.len() != texels {
            return Err(DenoiseError::Incomplete { missing: texels.abs_diff(irradiance.len()) });
        }
        let (kind, quality) = (Kind::Lightmap, Quality::High);
        let input = Input { kind, images: &[("color", irradiance)], switches: &[], quality };
        Device::new(&self.library, threads)?.run(size, &input, must_stop)
    }
}
