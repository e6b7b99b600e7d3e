//! PNG and JPEG files as texels of 8-bit RGBA.
//!
//! Sizes are checked in the header, before anything is allocated for them: against limits, and against what a file of
//! its length can hold however well it is compressed. What a file says of its own colour space is ignored, as glTF
//! demands.

mod fault;
mod jpeg;
mod png;

pub(super) use self::fault::Fault;
use super::texture::{MAX_SIDE, MAX_TEXELS};
use crate::allocation;
use crate::foreign;

/// Bytes of memory that decoding takes for a texel: itself, interlaced rows of PNG of 16 bits, or coefficients of progressive JPEG.
const DECODING_BYTES: u64 = 16;

/// Runs a decoder; one that panics has found a damaged file.
pub(super) fn walled<T>(decoder: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    foreign::decode(decoder, || Fault::damaged("its structure contradicts itself"))
}

/// A kind of image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Png,
    Jpeg,
}

impl Kind {
    /// The kind that the first bytes tell.
    pub(super) fn of(bytes: &[u8]) -> Result<Self, Fault> {
        const REMEDY: &str = "convert the image to PNG or JPEG";
        const OTHERS: [(&[u8], &str); 6] = [
            (b"RIFF", "WebP"),
            (b"\xabKTX", "KTX"),
            (b"GIF8", "GIF"),
            (b"DDS ", "DDS"),
            (b"BM", "BMP"),
            (b"II*\0", "TIFF"),
        ];
        if bytes.starts_with(png::MAGIC) {
            return Ok(Self::Png);
        }
        if bytes.starts_with(jpeg::MAGIC) {
            return Ok(Self::Jpeg);
        }
        let other = OTHERS.into_iter().find(|(magic, _)| bytes.starts_with(magic));
        let reason = match other {
            _ if bytes.is_empty() => "the image is empty".to_owned(),
            Some((_, name)) => format!("the image is neither PNG nor JPEG, but seems to be {name}"),
            None => "the image is neither PNG nor JPEG".to_owned(),
        };
        Err(Fault { reason, remedy: REMEDY })
    }

    /// Its media type, as glTF states it.
    pub(super) fn media_type(self) -> &'static str {
        match self {
            Self::Png => "image/png",
            Self::Jpeg => "image/jpeg",
        }
    }

    /// Width and height, from the header, if the limits and the file's length allow them.
    pub(super) fn size(self, bytes: &[u8]) -> Result<[u32; 2], Fault> {
        let (size, most_texels) = walled(|| match self {
            Self::Png => png::size(bytes),
            Self::Jpeg => jpeg::size(bytes),
        })?;
        check_size(size)?;
        let [width, height] = size;
        if u64::from(width) * u64::from(height) > most_texels {
            let reason = format!("{width} x {height} texels do not fit into {} bytes", bytes.len());
            return Err(Fault::damaged(reason));
        }
        Ok(size)
    }

    /// The texels of an image of that size, as [`Kind::size`] has told it, rows from the top.
    pub(super) fn decode(self, bytes: &[u8], size: [u32; 2]) -> Result<Vec<[u8; 4]>, Fault> {
        let bytes_needed = DECODING_BYTES * u64::from(size[0]) * u64::from(size[1]);
        allocation::check(bytes_needed).map_err(Fault::memory)?;
        let texels = walled(|| match self {
            Self::Png => png::decode(bytes, size),
            Self::Jpeg => jpeg::decode(bytes, size),
        })?;
        let [width, height] = size.map(|side| side as usize);
        if texels.len() == width * height { Ok(texels) } else { Err(Fault::damaged("rows are missing")) }
    }
}

/// Checks an image's size against the limits.
pub(super) fn check_size([width, height]: [u32; 2]) -> Result<(), Fault> {
    if width == 0 || height == 0 {
        return Err(Fault::damaged("it has no texels"));
    }
    if width > MAX_SIDE || height > MAX_SIDE || u64::from(width) * u64::from(height) > MAX_TEXELS {
        let reason = format!("the image has {width} x {height} texels, more than {MAX_SIDE} x {MAX_SIDE}");
        return Err(Fault { reason, remedy: "scale the image down to 16384 texels a side or less" });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_told_by_the_first_bytes() {
        assert_eq!(Kind::of(b"\x89PNG\r\n\x1a\n..."), Ok(Kind::Png));
        assert_eq!(Kind::of(b"\xff\xd8\xff\xe0"), Ok(Kind::Jpeg));
        for (bytes, name) in [(&b""[..], "empty"), (b"RIFF....WEBP", "WebP"), (b"text", "neither")] {
            let fault = Kind::of(bytes).unwrap_err();
            assert!(fault.reason.contains(name), "{fault:?}");
        }
    }

    #[test]
    fn sides_are_limited() {
        assert!(check_size([16_384, 16_384]).is_ok());
        for size in [[1, 100_000], [16_385, 1], [0, 1], [1, 0], [u32::MAX, u32::MAX]] {
            assert!(check_size(size).is_err(), "{size:?}");
        }
    }
}
