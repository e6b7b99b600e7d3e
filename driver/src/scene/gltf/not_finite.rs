//! Attributes that are read even where they are not finite.

/// A value for each attribute that may be NaN or infinite.
#[derive(Default)]
pub(super) struct NotFinite<T> {
    /// Of normals.
    pub(super) normals: T,
    /// Of colours.
    pub(super) colours: T,
}
