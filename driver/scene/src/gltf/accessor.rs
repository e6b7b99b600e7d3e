//! Elements of accessors, read in place after every bound is checked.
//!
//! Nothing is allocated in proportion to an accessor's count. A short file may state any count, because
//! elements without a buffer view are zeros.

use std::borrow::Cow;
use std::cell::{Cell, RefCell};
use std::collections::BTreeSet;

use gltf::json;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::validation::Checked;

use super::buffers::Buffers;
use super::document::Document;
use crate::error::SceneError;

const REMEDY: &str = "export the scene again; the accessor, its buffer view and its buffer do not fit";

/// Document with the bytes of its buffers.
pub(super) struct Source<'a> {
    pub(super) document: &'a Document,
    buffers: &'a Buffers<'a>,
    /// Indices of accessors whose sparse indices were found to increase. An accessor that many primitives
    /// share is thus checked once.
    increasing: RefCell<BTreeSet<usize>>,
    pub(super) decompressed: Decompressed,
}

/// Sums over all primitives that were decompressed.
#[derive(Default)]
pub(super) struct Decompressed {
    pub(super) triangles: Cell<u64>,
    /// Size of the attributes and indices, bytes.
    pub(super) bytes: Cell<u64>,
}

/// Element and component types that an accessor may have for one purpose, such as texture coordinates.
pub(super) struct Format {
    pub(super) types: &'static [Type],
    pub(super) components: &'static [ComponentType],
    pub(super) integers: Integers,
}

/// Interpretation of integer components (glTF 2.0, 3.11 "Accessors").
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Integers {
    /// Integers that are converted to floating-point numbers without scaling.
    Whole,
    /// Integers mapped to 0 to 1, or to -1 to 1 if signed.
    Normalized,
    /// Integers that are normalised if the accessor's `normalized` is true.
    AsStated,
}

/// Element type and count that an accessor states.
#[derive(Clone, Copy)]
pub(super) struct Header {
    pub(super) count: u64,
    pub(super) kind: Type,
    pub(super) component: ComponentType,
}

/// Elements of one accessor.
pub(super) struct Elements<'a> {
    pub(super) count: u64,
    component: ComponentType,
    components: usize,
    is_normalized: bool,
    base: Option<Strided<'a>>,
    sparse: Option<Sparse<'a>>,
}

/// Elements of equal size at a constant stride.
struct Strided<'a> {
    bytes: Cow<'a, [u8]>,
    stride: usize,
    size: usize,
}

impl Strided<'_> {
    fn get(&self, index: usize) -> Option<&[u8]> {
        let start = index.checked_mul(self.stride)?;
        self.bytes.get(start..start.checked_add(self.size)?)
    }
}

/// Sparse elements, which replace elements of the base, sorted by index.
struct Sparse<'a> {
    count: usize,
    indices: Strided<'a>,
    values: Strided<'a>,
}

impl Sparse<'_> {
    fn index(&self, position: usize) -> Option<u64> {
        self.indices.get(position).map(unsigned)
    }

    fn get(&self, index: u64) -> Option<&[u8]> {
        let (mut low, mut high) = (0, self.count);
        while low < high {
            let middle = low + (high - low) / 2;
            match self.index(middle)?.cmp(&index) {
                std::cmp::Ordering::Less => low = middle + 1,
                std::cmp::Ordering::Greater => high = middle,
                std::cmp::Ordering::Equal => return self.values.get(middle),
            }
        }
        None
    }
}

/// Converts a little-endian component to `f32`; normalised integers are mapped to 0 to 1, or to -1 to 1 if
/// signed.
fn number(component: ComponentType, is_normalized: bool, bytes: &[u8]) -> f32 {
    let scaled = |value: f32, whole: f32| if is_normalized { (value / whole).max(-1.0) } else { value };
    match (component, bytes) {
        (ComponentType::I8, &[a]) => scaled(f32::from(a as i8), 127.0),
        (ComponentType::U8, &[a]) => scaled(f32::from(a), 255.0),
        (ComponentType::I16, &[a, b]) => scaled(f32::from(i16::from_le_bytes([a, b])), 32_767.0),
        (ComponentType::U16, &[a, b]) => scaled(f32::from(u16::from_le_bytes([a, b])), 65_535.0),
        (ComponentType::U32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]) as f32,
        (ComponentType::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
        _ => 0.0,
    }
}

fn unsigned(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |value, &byte| value << 8 | u64::from(byte))
}

impl Header {
    /// Reads the header of accessor `index`; an error if `format` does not allow its types. `item` is the
    /// JSON path that refers to the accessor.
    fn of(
        document: &Document,
        index: usize,
        accessor: &json::Accessor,
        item: &str,
        format: &Format,
    ) -> Result<Self, SceneError> {
        let here = format!("accessors[{index}]");
        let component = match accessor.component_type {
            Checked::Valid(component) if format.components.contains(&component.0) => component.0,
            _ => {
                let reason = format!("{here} is of a component type that is not allowed here");
                return Err(document.invalid(
                    item,
                    reason,
                    "export the mesh without compression or quantisation",
                ));
            }
        };
        let kind = match accessor.type_ {
            Checked::Valid(kind) if format.types.contains(&kind) => kind,
            _ => {
                let types: Vec<_> = format.types.iter().map(|kind| format!("{kind:?}")).collect();
                let reason = format!("{here} is not of type {}", types.join(" or "));
                return Err(document.invalid(item, reason, REMEDY));
            }
        };
        Ok(Self { count: accessor.count.0, kind, component })
    }

    /// Size of an element, bytes.
    pub(super) fn size(self) -> usize {
        self.component.size() * self.kind.multiplicity()
    }
}

impl<'a> Elements<'a> {
    /// Reads the elements of accessor `index`; an error if `format` does not allow its types. `item` is the
    /// JSON path that refers to the accessor.
    pub(super) fn new(
        source: &Source<'a>,
        index: usize,
        item: &str,
        format: &Format,
    ) -> Result<Self, SceneError> {
        Self::decompressed(source, index, item, format, |_| Ok(None))
    }

    /// Does what [`new`](Self::new) does. `decompress` may return bytes that replace the accessor's buffer
    /// view.
    pub(super) fn decompressed(
        source: &Source<'a>,
        index: usize,
        item: &str,
        format: &Format,
        decompress: impl FnOnce(Header) -> Result<Option<Vec<u8>>, SceneError>,
    ) -> Result<Self, SceneError> {
        let accessor = source.accessor(index, item)?;
        let here = format!("accessors[{index}]");
        let header = Header::of(source.document, index, accessor, item, format)?;
        let Header { count, kind, component } = header;
        let size = header.size();
        let base = match decompress(header)? {
            Some(bytes) => Some(Strided { bytes: bytes.into(), stride: size, size }),
            None => {
                let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
                let view = accessor.buffer_view.map(|view| view.value());
                view.map(|view| source.strided(view, offset, count, size, &here)).transpose()?
            }
        };
        let sparse =
            accessor.sparse.as_ref().map(|sparse| source.sparse(index, sparse, count, size)).transpose()?;
        let is_normalized = match format.integers {
            Integers::Whole => false,
            Integers::Normalized => true,
            Integers::AsStated => accessor.normalized,
        };
        Ok(Self { count, component, components: kind.multiplicity(), is_normalized, base, sparse })
    }

    /// Creates elements from the indices of a decompressed primitive, without an accessor.
    pub(super) fn indices(indices: impl Iterator<Item = u32>) -> Self {
        let bytes: Vec<u8> = indices.flat_map(u32::to_le_bytes).collect();
        let size = size_of::<u32>();
        Self {
            count: (bytes.len() / size) as u64,
            component: ComponentType::U32,
            components: 1,
            is_normalized: false,
            base: Some(Strided { bytes: bytes.into(), stride: size, size }),
            sparse: None,
        }
    }

    /// Bytes of an element; `None` if glTF defines the element as zero.
    fn bytes(&self, index: u64) -> Option<&[u8]> {
        let replaced = self.sparse.as_ref().and_then(|sparse| sparse.get(index));
        replaced.or_else(|| self.base.as_ref()?.get(usize::try_from(index).ok()?))
    }

    /// Returns an element as floating-point numbers. Components that the accessor lacks are taken from
    /// `absent`.
    pub(super) fn floats<const N: usize>(&self, index: u64, absent: [f32; N]) -> [f32; N] {
        let mut vector = absent;
        let present = vector.iter_mut().take(self.components);
        match self.bytes(index) {
            None => present.for_each(|value| *value = 0.0),
            Some(bytes) => {
                for (value, bytes) in present.zip(bytes.chunks_exact(self.component.size())) {
                    *value = number(self.component, self.is_normalized, bytes);
                }
            }
        }
        vector
    }

    pub(super) fn vec3(&self, index: u64) -> [f32; 3] {
        self.floats(index, [0.0; 3])
    }

    pub(super) fn unsigned4(&self, index: u64) -> [u64; 4] {
        let mut vector = [0; 4];
        if let Some(bytes) = self.bytes(index) {
            for (value, bytes) in vector.iter_mut().zip(bytes.chunks_exact(self.component.size())) {
                *value = unsigned(bytes);
            }
        }
        vector
    }

    pub(super) fn unsigned(&self, index: u64) -> u64 {
        self.bytes(index).map_or(0, unsigned)
    }
}

impl<'a> Source<'a> {
    pub(super) fn new(document: &'a Document, buffers: &'a Buffers<'a>) -> Self {
        Self { document, buffers, increasing: RefCell::default(), decompressed: Decompressed::default() }
    }

    /// Accessor `index`; `item` is the JSON path that refers to it.
    fn accessor(&self, index: usize, item: &str) -> Result<&'a json::Accessor, SceneError> {
        let found = self.document.root.accessors.get(index);
        found.ok_or_else(|| self.document.invalid(item, format!("accessor {index} does not exist"), REMEDY))
    }

    /// Bytes of buffer view `view`; `item` is the JSON path that refers to it.
    pub(super) fn bytes(&self, view: usize, item: &str) -> Result<&'a [u8], SceneError> {
        let (bytes, _) = self.view(view, item)?;
        bytes.ok_or_else(|| {
            let reason = format!("bufferViews[{view}] reaches beyond its buffer");
            self.document.invalid(item, reason, REMEDY)
        })
    }

    /// Returns `count` elements of `size` bytes each that start at byte `offset` of a buffer view.
    fn strided(
        &self,
        view: usize,
        offset: u64,
        count: u64,
        size: usize,
        item: &str,
    ) -> Result<Strided<'a>, SceneError> {
        let fault = |reason: String| self.document.invalid(item, reason, REMEDY);
        let (Some(bytes), stride) = self.view(view, item)? else {
            return Err(fault(format!("bufferViews[{view}] reaches beyond its buffer")));
        };
        let stride = stride.unwrap_or(size);
        if stride < size {
            return Err(fault(format!("elements of {size} bytes overlap at a stride of {stride}")));
        }
        let needed = match count.checked_sub(1) {
            None => Some(0),
            Some(last) => last.checked_mul(stride as u64).and_then(|start| start.checked_add(size as u64)),
        };
        let bytes = usize::try_from(offset).ok().and_then(|offset| bytes.get(offset..));
        match (bytes, needed) {
            (Some(bytes), Some(needed)) if needed <= bytes.len() as u64 => {
                Ok(Strided { bytes: bytes.into(), stride, size })
            }
            _ => {
                let reason = format!(
                    "{count} elements of {size} bytes at offset {offset} reach beyond bufferViews[{view}]"
                );
                Err(fault(reason))
            }
        }
    }

    /// Bytes and stride of a buffer view. The bytes are `None` if they exceed the buffer.
    fn view(&self, index: usize, item: &str) -> Result<(Option<&'a [u8]>, Option<usize>), SceneError> {
        let view = self.document.root.buffer_views.get(index).ok_or_else(|| {
            self.document.invalid(item, format!("buffer view {index} does not exist"), REMEDY)
        })?;
        let bytes = self.buffers.view(index, view)?;
        Ok((bytes, view.byte_stride.map(|stride| stride.0)))
    }

    fn sparse(
        &self,
        accessor: usize,
        sparse: &json::accessor::sparse::Sparse,
        base_count: u64,
        size: usize,
    ) -> Result<Sparse<'a>, SceneError> {
        let item = format!("accessors[{accessor}].sparse");
        let fault =
            |field: &str, reason: &str| self.document.invalid(format!("{item}{field}"), reason, REMEDY);
        let Checked::Valid(component) = sparse.indices.component_type else {
            return Err(fault(".indices.componentType", "it is not an unsigned integer type"));
        };
        let count = sparse.count.0;
        let (indices, values) = (&sparse.indices, &sparse.values);
        let indices = self.strided(
            indices.buffer_view.value(),
            indices.byte_offset.0,
            count,
            component.0.size(),
            &format!("{item}.indices"),
        )?;
        let values = self.strided(
            values.buffer_view.value(),
            values.byte_offset.0,
            count,
            size,
            &format!("{item}.values"),
        )?;
        // `strided` has found bytes for every element, so `count` fits `usize`.
        let count = usize::try_from(count).map_err(|_| fault(".count", "it is too large"))?;
        let sparse = Sparse { count, indices, values };
        if !self.increasing.borrow_mut().insert(accessor) {
            return Ok(sparse);
        }
        let mut next = 0;
        for position in 0..count {
            match sparse.index(position) {
                Some(index) if (next..base_count).contains(&index) => next = index + 1,
                _ => {
                    return Err(fault(
                        ".indices",
                        "the indices do not increase, or exceed the accessor's count",
                    ));
                }
            }
        }
        Ok(sparse)
    }
}
