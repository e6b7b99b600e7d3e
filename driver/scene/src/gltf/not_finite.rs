//! Attributes with unusable values in files that are loaded nevertheless.

/// One value for each kind of attribute that may hold NaN, infinity or, for tangents, zero.
#[derive(Default)]
pub(super) struct NotFinite<T> {
    pub(super) normals: T,
    pub(super) colours: T,
    pub(super) tangents: T,
}
