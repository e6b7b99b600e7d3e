//! Environment light: radiance from infinitely far.

use std::fs;
use std::io;
use std::path::Path;

use glam::Vec3;
use photoncard_picture::allocation::OutOfMemory;
use photoncard_picture::exr::{self, ExrError};

use super::limits::BRIGHTEST;
use super::map_size::{MAX_ENVIRONMENT_TEXELS, check_map_size, too_large};
use super::radiance;
use super::raster::{Fault, walled};
#[cfg(doc)]
use super::texture::MAX_SIDE;
use crate::error::SceneError;

const EXR_MAGIC: &[u8] = &[0x76, 0x2f, 0x31, 0x01];

/// Equirectangular map of radiance from infinitely far, W/(sr m^2) per linear RGB channel. A map of 1 x 1
/// texels is constant in all directions.
///
/// Column u, 0 to 1 from the left, and row v, 0 to 1 from the top, show the direction `(sin(theta) sin(phi),
/// cos(theta), -sin(theta) cos(phi))` with `phi = 2 pi (u - 0.5)` and `theta = pi v`: y is up, and the middle
/// of the map is -z, where a camera of glTF looks.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// Width, texels.
    pub width: u32,
    /// Height, texels.
    pub height: u32,
    /// Texels, rows from the top; finite, and 0 or more.
    pub texels: Vec<[f32; 3]>,
    /// Factor by which the texels are multiplied, 0 or more.
    pub strength: f32,
}

impl Environment {
    /// Creates an environment of equal radiance in all directions.
    pub fn constant(radiance: Vec3) -> Self {
        Self { width: 1, height: 1, texels: vec![radiance.to_array()], strength: 1.0 }
    }

    /// Reads a map from a Radiance picture (`.hdr`) or the first part of an `OpenEXR` picture (`.exr`) that
    /// has the channels R, G and B. The first bytes of the file determine its format.
    ///
    /// Invalid channels are clamped: negative and NaN ones to 0, finite ones above [`BRIGHTEST`] to that
    /// limit, and infinite ones to the brightest finite channel of the map.
    ///
    /// # Errors
    /// [`SceneError::Unreadable`] if there is no such file, and [`SceneError::Environment`] if it is damaged,
    /// has infinite channels and no finite one above 0, or is larger than [`MAX_SIDE`] texels a side or
    /// [`MAX_ENVIRONMENT_TEXELS`] in all.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        Self::load_with_notice(path).map(|(environment, _)| environment)
    }

    /// Does what [`Self::load`] does, and also returns a sentence about clamped texels, if there are any.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn load_with_notice(path: &Path) -> Result<(Self, Option<String>), SceneError> {
        let unreadable = |source| SceneError::Unreadable { file: path.to_owned(), source };
        if !fs::metadata(path).map_err(unreadable)?.is_file() {
            let error = io::Error::new(io::ErrorKind::InvalidInput, "it is not a regular file");
            return Err(unreadable(error));
        }
        Self::of_bytes(path, &fs::read(path).map_err(unreadable)?)
    }

    /// Decodes the bytes of a file, as [`Self::load_with_notice`] does; `path` is its name in errors.
    ///
    /// # Errors
    /// [`SceneError::Environment`].
    pub fn of_bytes(path: &Path, bytes: &[u8]) -> Result<(Self, Option<String>), SceneError> {
        let read = if bytes.starts_with(EXR_MAGIC) {
            read_exr(path, bytes)
        } else if bytes.starts_with(radiance::MAGIC) {
            walled(|| radiance::read(bytes)).map(|(size, texels)| Self::of(size, texels))
        } else {
            Err(Fault::unreadable(
                "it is neither a Radiance picture nor an OpenEXR picture",
                "convert the environment to .hdr or .exr",
            ))
        };
        let fault =
            |Fault { reason, remedy, .. }| SceneError::Environment { file: path.to_owned(), reason, remedy };
        let mut environment = read.map_err(fault)?;
        let clamped = environment.clamp().ok_or_else(|| {
            let reason = "it has infinite texels, and no finite one that is bright says how bright they are";
            fault(Fault::unreadable(reason, "write the picture with finite radiance"))
        })?;
        let notice = (clamped > 0).then(|| {
            format!(
                "{clamped} of {} texels of the environment are clamped: negative channels and NaN count as 0, infinite ones as the \
                 brightest of the others, and those above {BRIGHTEST:e} as {BRIGHTEST:e}",
                environment.texels.len()
            )
        });
        Ok((environment, notice))
    }

    fn of([width, height]: [u32; 2], texels: Vec<[f32; 3]>) -> Self {
        Self { width, height, texels, strength: 1.0 }
    }

    /// Clamps invalid channels. Returns the number of texels with invalid channels; `None` if channels are
    /// infinite and no finite one is above 0.
    fn clamp(&mut self) -> Option<usize> {
        let is_bad = |texel: &&mut [f32; 3]| !texel.iter().all(|value| (0.0..=BRIGHTEST).contains(value));
        let finite = self.texels.iter().flatten().filter(|value| value.is_finite());
        let brightest = finite.fold(0.0_f32, |brightest, value| brightest.max(*value)).min(BRIGHTEST);
        if brightest == 0.0 && self.texels.iter().flatten().any(|value| *value == f32::INFINITY) {
            return None;
        }
        let mut clamped = 0;
        for texel in self.texels.iter_mut().filter(is_bad) {
            clamped += 1;
            // The maximum of 0 and NaN is 0.
            *texel = texel.map(|value| value.max(0.0).min(brightest));
        }
        Some(clamped)
    }

    /// Returns the environment turned about +y by an angle in degrees, counter-clockwise seen from above.
    /// Texels are interpolated if the angle is no whole number of columns.
    #[must_use]
    pub fn turned(mut self, degrees: f32) -> Self {
        let width = self.width as usize;
        let columns = (f64::from(degrees) / 360.0 * width as f64).rem_euclid(width as f64);
        let (whole, share) = (columns.floor() as usize, columns.fract() as f32);
        if width < 2 || whole == 0 && share == 0.0 {
            return self;
        }
        for row in self.texels.chunks_exact_mut(width) {
            row.rotate_left(whole % width);
            if share > 0.0 {
                let first = row.first().copied().unwrap_or_default();
                for column in 0..width {
                    let next = row.get(column + 1).copied().unwrap_or(first);
                    let mixed = |channel: usize| row[column][channel] * (1.0 - share) + next[channel] * share;
                    row[column] = [0, 1, 2].map(mixed);
                }
            }
        }
        self
    }

    /// Returns whether the texels of each row are equal, so that a turn about +y changes nothing.
    pub fn is_equal_around(&self) -> bool {
        let rows = self.texels.chunks_exact((self.width as usize).max(1));
        rows.into_iter().all(|row| row.iter().all(|texel| Some(texel) == row.first()))
    }

    /// Returns whether any texel emits light.
    pub fn is_lit(&self) -> bool {
        self.strength > 0.0 && self.texels.iter().flatten().any(|radiance| *radiance > 0.0)
    }
}

fn read_exr(path: &Path, bytes: &[u8]) -> Result<Environment, Fault> {
    let image = exr::decode_rgb(path, bytes, MAX_ENVIRONMENT_TEXELS).map_err(|error| match error {
        ExrError::NoColour { channels, .. } => Fault::unreadable(
            format!("it has no channels R, G and B, only {channels}"),
            "write the picture as plain RGB",
        ),
        ExrError::Compression { compression, .. } => Fault::unreadable(
            format!("it has {compression}, which is not read"),
            "store the picture with ZIP compression",
        ),
        ExrError::TooLarge { width, height, .. } => too_large([width, height]),
        ExrError::Memory { bytes, .. } => Fault::memory(OutOfMemory { bytes }),
        other => Fault::unreadable(other.to_string(), "export or copy the picture again"),
    })?;
    let size = [image.width, image.height].map(|side| u32::try_from(side).unwrap_or(u32::MAX));
    check_map_size(size)?;
    Ok(Environment::of(size, image.pixels))
}
