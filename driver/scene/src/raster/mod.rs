//! Decoders of PNG, JPEG, WebP and KTX2 to RGBA texels of 32 bits.
//!
//! Sizes in the header are checked before memory is allocated for them: against limits and, where the format
//! bounds compression, against the maximum that a file of this length can hold. The colour space of a file is
//! ignored, as glTF requires.

mod deep;
mod fault;
mod jpeg;
mod ktx2;
mod png;
mod webp;

pub(super) use self::deep::Deep;
pub(super) use self::fault::Fault;
use super::texture::MAX_SIDE;
use photoncard_picture::allocation;
use photoncard_picture::foreign;

/// Memory per texel while decoding, bytes: the texel itself, and interlaced rows of a 16-bit PNG or
/// coefficients of a progressive JPEG.
const DECODING_BYTES: u64 = 16;

/// Runs a decoder. If the decoder panics, the error is that of a damaged file.
pub(super) fn walled<T>(decoder: impl FnOnce() -> Result<T, Fault>) -> Result<T, Fault> {
    foreign::decode(decoder, || Fault::damaged("its structure contradicts itself"))
}

/// Format of an image file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Png,
    Jpeg,
    WebP,
    Ktx2,
}

impl Kind {
    /// Recognises the format by the first bytes of a file.
    pub(super) fn of(bytes: &[u8]) -> Result<Self, Fault> {
        const REMEDY: &str = "convert the image to PNG, JPEG or WebP";
        const OTHERS: [(&[u8], &str); 6] = [
            (b"\xabKTX 11", "KTX 1"),
            (b"sB\x13\0", "a .basis file"),
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
        if webp::is_webp(bytes) {
            return Ok(Self::WebP);
        }
        if bytes.starts_with(ktx2::MAGIC) {
            return Ok(Self::Ktx2);
        }
        let other = OTHERS.into_iter().find(|(magic, _)| bytes.starts_with(magic));
        let reason = match other {
            _ if bytes.is_empty() => "the image is empty".to_owned(),
            Some((_, name)) => {
                format!("the image is neither PNG, JPEG, WebP nor KTX2, but seems to be {name}")
            }
            None => "the image is neither PNG, JPEG, WebP nor KTX2".to_owned(),
        };
        Err(Fault::unreadable(reason, REMEDY))
    }

    /// Width and height from the header, checked against the limits and the length of the file.
    pub(super) fn size(self, bytes: &[u8]) -> Result<[u32; 2], Fault> {
        let (size, most_texels) = walled(|| match self {
            Self::Png => png::size(bytes),
            Self::Jpeg => jpeg::size(bytes),
            Self::WebP => webp::size(bytes),
            Self::Ktx2 => ktx2::size(bytes),
        })?;
        check_size(size)?;
        let [width, height] = size;
        if u64::from(width) * u64::from(height) > most_texels {
            let reason = format!("{width} x {height} texels do not fit into {} bytes", bytes.len());
            return Err(Fault::damaged(reason));
        }
        Ok(size)
    }

    /// Returns whether an image has more than 8 bits per channel.
    pub(super) fn is_deep(self, bytes: &[u8]) -> bool {
        self == Self::Png && walled(|| Ok(png::is_deep(bytes))) == Ok(true)
    }

    /// Decodes an image to texels in rows from the top. An image that [is deep](Self::is_deep) is encoded as
    /// `deep` states. Other images, and all if `deep` is `None`, have 8 bits per channel. `size` is the
    /// result of [`Kind::size`].
    pub(super) fn decode(
        self,
        bytes: &[u8],
        size: [u32; 2],
        deep: Option<Deep>,
    ) -> Result<Vec<[u8; 4]>, Fault> {
        let bytes_needed = DECODING_BYTES * u64::from(size[0]) * u64::from(size[1]);
        allocation::check(bytes_needed).map_err(Fault::memory)?;
        let texels = walled(|| match self {
            Self::Png => png::decode(bytes, size, deep),
            Self::Jpeg => jpeg::decode(bytes, size),
            Self::WebP => webp::decode(bytes, size),
            Self::Ktx2 => ktx2::decode(bytes, size),
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
    if width > MAX_SIDE || height > MAX_SIDE {
        let reason = format!("the image has {width} x {height} texels, more than {MAX_SIDE} x {MAX_SIDE}");
        return Err(Fault {
            reason,
            remedy: "scale the image down to 16384 texels a side or less",
            is_limit: true,
        });
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
        assert_eq!(Kind::of(b"RIFF....WEBP"), Ok(Kind::WebP));
        assert_eq!(Kind::of(b"\xabKTX 20\xbb\r\n\x1a\n"), Ok(Kind::Ktx2));
        for (bytes, name) in [
            (&b""[..], "empty"),
            (b"RIFF....WAVE", "neither"),
            (b"GIF89a", "GIF"),
            (b"\xabKTX 11\xbb\r\n\x1a\n", "KTX 1"),
            (b"sB\x13\0M\0", ".basis"),
        ] {
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
