//! Record of attributes that are not usable numbers, of files that are loaded nevertheless.

/// One value for each attribute that may be NaN or infinite, or zero if it is a tangent.
#[derive(Default)]
pub(super) struct NotFinite<T> {
    /// Value of normals.
    pub(super) normals: T,
    /// Value of colours.
    pub(super) colours: T,
    /// Value of tangents.
    pub(super) tangents: T,
}
