//! Limits of a scene file.

/// Maximum number of triangles of a scene, including those of zero area.
pub const MAX_TRIANGLES: usize = 1 << 24;

/// Maximum magnitude of a coordinate, metres. The product of three is far below the maximum of single
/// precision.
pub(super) const MAX_COORDINATE: f32 = 1e8;
