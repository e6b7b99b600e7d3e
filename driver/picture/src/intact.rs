//! Checks that files of finished pictures are unchanged since they were written.
//!
//! An `OpenEXR` file has no checksum of its own. Files of this program contain a CRC-32C of the file in the
//! standard attribute `comments`. It is computed with zeros in place of its digits. A PNG has a CRC-32 for
//! each of its chunks.

use photoncard_shared::checksum::Checksum;

/// Text of the attribute `comments` before the checksum is known.
pub(crate) const BLANK: &str = "photoncard checksum 00000000";
/// Number of hexadecimal digits of the checksum, at the end of the text.
const DIGITS: usize = 8;

const PNG_SIGNATURE: [u8; 8] = *b"\x89PNG\r\n\x1a\n";

/// Writes the checksum of an `OpenEXR` file into its attribute `comments`, which is [`BLANK`].
pub(crate) fn seal_exr(bytes: &mut [u8]) {
    let Some(at) = digits_at(bytes) else { return };
    let sum = sum_without_digits(bytes, at);
    bytes[at..at + DIGITS].copy_from_slice(format!("{sum:0DIGITS$x}").as_bytes());
}

/// Returns whether an `OpenEXR` file contains the checksum of its bytes.
pub(crate) fn is_intact_exr(bytes: &[u8]) -> bool {
    digits_at(bytes).is_some_and(|at| {
        let stated = str::from_utf8(&bytes[at..at + DIGITS]).ok();
        stated == Some(&format!("{:0DIGITS$x}", sum_without_digits(bytes, at)))
    })
}

/// Position of the checksum's digits. No text attribute contains zero bytes, so that the first match is in
/// the attribute `comments`.
fn digits_at(bytes: &[u8]) -> Option<usize> {
    let text = &BLANK[..BLANK.len() - DIGITS];
    let mut mark = b"comments\0string\0".to_vec();
    mark.extend((BLANK.len() as u32).to_le_bytes());
    mark.extend(text.as_bytes());
    let at = bytes.windows(mark.len()).position(|window| window == mark)? + mark.len();
    (at + DIGITS <= bytes.len()).then_some(at)
}

/// CRC-32C of a file with zeros in place of the digits.
fn sum_without_digits(bytes: &[u8], at: usize) -> u32 {
    let mut sum = Checksum::default();
    sum.update(&bytes[..at]);
    sum.update(&[b'0'; DIGITS]);
    sum.update(&bytes[at + DIGITS..]);
    sum.value()
}

/// Returns whether a file is a PNG whose chunks are complete and have the right CRC-32, and whose last chunk
/// is `IEND`.
pub(crate) fn is_intact_png(bytes: &[u8]) -> bool {
    let Some(mut rest) = bytes.strip_prefix(&PNG_SIGNATURE) else { return false };
    while let Some((kind, behind)) = take_chunk(rest) {
        if kind == *b"IEND" {
            return behind.is_empty();
        }
        rest = behind;
    }
    false
}

/// Kind of the first chunk, and the bytes after the chunk; `None` if the chunk is truncated or has a wrong
/// CRC-32.
fn take_chunk(bytes: &[u8]) -> Option<([u8; 4], &[u8])> {
    let (length, rest) = bytes.split_first_chunk()?;
    let checked = 4 + usize::try_from(u32::from_be_bytes(*length)).ok()?;
    let (chunk, rest) = rest.split_at_checked(checked)?;
    let (sum, behind) = rest.split_first_chunk()?;
    let mut own = flate2::Crc::new();
    own.update(chunk);
    (own.sum() == u32::from_be_bytes(*sum)).then_some((*chunk.first_chunk()?, behind))
}
