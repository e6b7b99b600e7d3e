//! Bounds of a scene file.

/// The most triangles a scene may hold, those of zero area included.
pub const MAX_TRIANGLES: usize = 1 << 24;
