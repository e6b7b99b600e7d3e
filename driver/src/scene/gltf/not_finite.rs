//! Record of attributes that are not finite, which are loaded nevertheless.

/// One value for each attribute that may be NaN or infinite.
#[derive(Default)]
pub(super) struct NotFinite<T> {
    /// Value of normals.
    pub(super) normals: T,
    /// Value of colours.
    pub(super) colours: T,
}
