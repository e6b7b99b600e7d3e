//! Decoder of buffer views compressed by meshopt (`EXT_meshopt_compression`, `KHR_meshopt_compression`).
//!
//! The decoded size is checked against the maximum for the stream's length before memory is allocated. A
//! damaged stream gives an error or wrong bytes; the reader of accessors checks these bytes like those of any
//! buffer.

mod attributes;
mod filter;
mod indices;

use serde::Deserialize;

pub(super) use self::filter::Filter;
use photoncard_picture::allocation::{self, OutOfMemory};

/// Maximum number of decoded bytes per byte of a stream. A byte of control bits codes four bytes of each of
/// 256 elements.
const EXPANSION: u64 = 4 * 256;

/// Maximum size of an element, bytes.
const MAX_STRIDE: usize = 256;

/// Format of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(super) enum Mode {
    /// Elements of any content, as differences between their bytes.
    Attributes,
    /// Indices of a list of triangles, relative to recent edges and vertices.
    Triangles,
    /// Lists of indices other than triangles, as differences.
    Indices,
}

/// Count and size of the decoded elements, and the format of their stream.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    pub(super) count: usize,
    /// Size of an element, bytes.
    pub(super) stride: usize,
    pub(super) mode: Mode,
    pub(super) filter: Filter,
}

/// Error of a stream or its layout, or of the memory for the result.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Fault {
    /// Damage of the stream, or a combination of sizes, mode and filter that the extension does not allow,
    /// described as a clause.
    Invalid(String),
    /// Memory that the system refuses.
    Memory(OutOfMemory),
}

impl Layout {
    /// Number of decoded bytes.
    ///
    /// # Errors
    /// If the extension does not allow the layout.
    pub(super) fn bytes(&self) -> Result<u64, Fault> {
        let Self { count, stride, mode, filter } = *self;
        let is_element = match mode {
            Mode::Attributes => stride.is_multiple_of(4) && (4..=MAX_STRIDE).contains(&stride),
            Mode::Triangles | Mode::Indices => matches!(stride, 2 | 4),
        };
        let is_filtered = match filter {
            Filter::None => true,
            _ if mode != Mode::Attributes => false,
            Filter::Exponential => true,
            Filter::Octahedral | Filter::Color => matches!(stride, 4 | 8),
            Filter::Quaternion => stride == 8,
        };
        let is_whole = mode != Mode::Triangles || count.is_multiple_of(3);
        if !is_element || !is_filtered || !is_whole {
            let reason = format!(
                "{count} elements of {stride} bytes do not go with {mode:?} and the filter {filter:?}"
            );
            return Err(Fault::Invalid(reason));
        }
        Ok((count as u64).saturating_mul(stride as u64))
    }
}

/// Decodes a stream.
pub(super) fn decode(stream: &[u8], layout: &Layout) -> Result<Vec<u8>, Fault> {
    let bytes = layout.bytes()?;
    if bytes > EXPANSION * stream.len() as u64 {
        let reason = format!("{bytes} bytes do not fit into a stream of {}", stream.len());
        return Err(Fault::Invalid(reason));
    }
    allocation::check(bytes).map_err(Fault::Memory)?;
    let mut decoded = vec![0; bytes as usize];
    let done = match layout.mode {
        Mode::Attributes => attributes::decode(stream, layout.stride, &mut decoded),
        Mode::Triangles => indices::decode_triangles(stream, layout.stride, &mut decoded),
        Mode::Indices => indices::decode_sequence(stream, layout.stride, &mut decoded),
    };
    done.ok_or_else(|| Fault::Invalid("its stream is damaged, or of another format".to_owned()))?;
    filter::apply(layout.filter, layout.stride, &mut decoded);
    Ok(decoded)
}

#[cfg(test)]
mod tests;
