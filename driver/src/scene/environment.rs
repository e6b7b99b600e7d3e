//! Environment light from infinitely far.

use std::fs;
use std::io;
use std::path::Path;

use glam::Vec3;

use super::limits::BRIGHTEST;
use super::map_size::{MAX_ENVIRONMENT_TEXELS, check_map_size, too_large};
use super::radiance;
use super::raster::{Fault, walled};
#[cfg(doc)]
use super::texture::MAX_SIDE;
use crate::allocation::OutOfMemory;
use crate::error::SceneError;
use crate::exr::{self, ExrError};

const EXR_MAGIC: &[u8] = &[0x76, 0x2f, 0x31, 0x01];

/// Radiance from infinitely far, W/(sr m^2) per linear RGB channel: an equirectangular map, constant if it is 1 x 1.
///
/// Column u, 0 to 1 from the left, and row v, 0 to 1 from the top, show the direction `(sin(theta) sin(phi),
/// cos(theta), -sin(theta) cos(phi))` with `phi = 2 pi (u - 0.5)` and `theta = pi v`: y is up, and the middle of the
/// map is -z, where a camera of glTF looks.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// Width, texels.
    pub width: u32,
    /// Height, texels.
    pub height: u32,
    /// Texels, rows from the top; finite, and 0 or more.
    pub texels: Vec<[f32; 3]>,
    /// Factor of the texels, 0 or more; 1 shows them as they are.
    pub strength: f32,
}

impl Environment {
    /// Environment of equal radiance in all directions.
    pub fn constant(radiance: Vec3) -> Self {
        Self { width: 1, height: 1, texels: vec![radiance.to_array()], strength: 1.0 }
    }

    /// Reads a map from a Radiance picture (`.hdr`) or the first part of an `OpenEXR` picture (`.exr`) that has the
    /// channels R, G and B. The first bytes of the file determine its format.
    ///
    /// # Errors
    /// [`SceneError::Unreadable`] if there is no such file, and [`SceneError::Environment`] if it is damaged, larger
    /// than [`MAX_SIDE`] texels a side or [`MAX_ENVIRONMENT_TEXELS`] in all, or holds a radiance that is negative,
    /// infinite, not a number, or above [`BRIGHTEST`].
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        let unreadable = |source| SceneError::Unreadable { file: path.to_owned(), source };
        if !fs::metadata(path).map_err(unreadable)?.is_file() {
            let error = io::Error::new(io::ErrorKind::InvalidInput, "it is not a regular file");
            return Err(unreadable(error));
        }
        let bytes = fs::read(path).map_err(unreadable)?;
        let read = if bytes.starts_with(EXR_MAGIC) {
            read_exr(path, &bytes)
        } else if bytes.starts_with(radiance::MAGIC) {
            walled(|| radiance::read(&bytes)).map(|(size, texels)| Self::of(size, texels))
        } else {
            Err(Fault::unreadable(
                "it is neither a Radiance picture nor an OpenEXR picture",
                "convert the environment to .hdr or .exr",
            ))
        };
        let fault =
            |Fault { reason, remedy, .. }| SceneError::Environment { file: path.to_owned(), reason, remedy };
        read.and_then(Self::checked).map_err(fault)
    }

    fn of([width, height]: [u32; 2], texels: Vec<[f32; 3]>) -> Self {
        Self { width, height, texels, strength: 1.0 }
    }

    fn checked(self) -> Result<Self, Fault> {
        let is_bad = |texel: &[f32; 3]| !texel.iter().all(|value| (0.0..=BRIGHTEST).contains(value));
        let Some(index) = self.texels.iter().position(is_bad) else { return Ok(self) };
        let (x, y) = (index % self.width as usize, index / self.width as usize);
        let reason = format!("texel ({x}, {y}) is {:?}, which is no radiance", self.texels[index]);
        Err(Fault::unreadable(
            reason,
            "limit every channel to the range of 0 to 1e20, and store the map again",
        ))
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
