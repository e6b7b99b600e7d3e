//! Limits of a scene file.

/// Maximum number of triangles of a scene, including those of zero area.
pub const MAX_TRIANGLES: usize = 1 << 24;
