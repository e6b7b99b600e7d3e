//! Lower bound of the memory that a scene takes on a card. It is computed from accessors, instances and image
//! headers, before geometry is expanded and images are decoded.
//!
//! A scene that is rejected here cannot fit a card. Other scenes are measured after they are packed
//! (`pack::budget`). The bound assumes full leaves of the hierarchy, and ignores vertices that primitives
//! share.

use std::path::{Path, PathBuf};

use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::layout::{
    Attributes, LEAF_TRIANGLES, LEAF_VERTICES, Material, NODE_CHILDREN, Record, TILE_HEIGHT, TILE_WIDTH,
    Tangents,
};

use crate::error::SceneError;
use crate::reduction::reduced_size;

/// Memory of a card, bytes: its size, and the part that the contents counted so far take.
#[derive(Clone)]
pub(super) struct Room {
    file: PathBuf,
    available: u64,
    taken: u64,
    /// Maximum width and height of an image, texels.
    side: u32,
}

impl Room {
    pub(super) fn new(file: &Path, available: u64, side: u32) -> Self {
        Self { file: file.to_owned(), available, taken: 0, side }
    }

    /// Size in which an image of size `size` is stored.
    pub(super) fn image_size(&self, size: [u32; 2]) -> [u32; 2] {
        reduced_size(size, self.side)
    }

    pub(super) fn materials(&mut self, count: usize) -> Result<(), SceneError> {
        self.take((count * Material::BYTES) as u64, || format!("{count} materials"))
    }

    /// Maximum total size of all image files, bytes: twice the card's memory, at least 2 GiB. A texel takes 4
    /// bytes on the card, and at most 8 bytes in any file format.
    pub(super) fn image_file_bytes(&self) -> u64 {
        self.available.saturating_mul(2).max(2 << 30)
    }

    /// Adds the card memory of the texels of an image of size `size`.
    pub(super) fn texels(&mut self, size: [u32; 2]) -> Result<(), SceneError> {
        let [width, height] = self.image_size(size);
        let tiles = u64::from(width.div_ceil(TILE_WIDTH)) * u64::from(height.div_ceil(TILE_HEIGHT));
        self.take(tiles * LINE_BYTES as u64, || "images and materials".to_owned())
    }

    /// Adds the card memory of `count` instances, one line ([`LINE_BYTES`]) each.
    pub(super) fn instances(&mut self, count: u64) -> Result<(), SceneError> {
        self.take(count.saturating_mul(LINE_BYTES as u64), || {
            format!("{count} instances, images and materials")
        })
    }

    /// Returns whether the lower bound for `triangles` triangles fits even if they share no vertices and have
    /// all attributes.
    pub(super) fn fits_any(&self, triangles: u64) -> bool {
        let corners = triangles.saturating_mul(3);
        self.available - self.taken
            >= Self::geometry(triangles, corners).saturating_add(attributes(triangles, 2, true))
    }

    /// Adds `bytes`, the card memory of the scene's `triangles` triangles with their nodes and attributes.
    pub(super) fn triangles(&mut self, triangles: u64, bytes: u64) -> Result<(), SceneError> {
        self.take(bytes, || format!("{triangles} triangles, images and materials"))
    }

    /// Minimum size of the leaves and nodes of a hierarchy of triangles with `corners` distinct vertices,
    /// bytes.
    pub(super) fn geometry(triangles: u64, corners: u64) -> u64 {
        let leaves = triangles.div_ceil(LEAF_TRIANGLES as u64).max(corners.div_ceil(LEAF_VERTICES as u64));
        let nodes = leaves.saturating_sub(1) / (NODE_CHILDREN as u64 - 1);
        (leaves + nodes).saturating_mul(LINE_BYTES as u64)
    }

    fn take(&mut self, bytes: u64, what: impl FnOnce() -> String) -> Result<(), SceneError> {
        let needed = self.taken.saturating_add(bytes);
        if needed > self.available {
            let (file, available) = (self.file.clone(), self.available);
            return Err(SceneError::TooLarge { file, what: what(), needed, available });
        }
        self.taken = needed;
        Ok(())
    }
}

/// Size of the attributes of triangles with `sets` sets of texture coordinates, bytes.
pub(super) fn attributes(triangles: u64, sets: u64, have_tangents: bool) -> u64 {
    let tangents =
        if have_tangents { (Tangents::RECORDS * Attributes::BYTES / LEAF_TRIANGLES) as u64 } else { 0 };
    triangles.saturating_mul(sets.max(1) * Attributes::BYTES as u64 + tangents)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_are_counted_in_the_size_in_which_they_are_stored() {
        let mut room = Room::new(Path::new("scene.gltf"), 2 * 128, 16);
        assert!(room.texels([64, 32]).is_err());
        assert!(Room { side: 8, ..room.clone() }.texels([64, 32]).is_ok());
        assert!(room.texels([9, 4]).is_ok());
    }

    #[test]
    fn triangles_take_a_leaf_for_eight_of_them_or_nine_corners() {
        assert_eq!(Room::geometry(0, 0), 0);
        assert_eq!(Room::geometry(8, 9), 128);
        assert_eq!(Room::geometry(8, 24), 3 * 128);
        assert_eq!(Room::geometry(8 * 16, 9), (16 + 1) * 128);
    }

    #[test]
    fn the_error_of_a_scene_too_large_counts_all_contents() {
        let mut room = Room::new(Path::new("scene.gltf"), 128 * 10, 16);
        assert!(room.materials(2).is_ok() && room.texels([9, 4]).is_ok());
        assert!(room.fits_any(1) && !room.fits_any(1000));
        let error = room.triangles(7, 128 * 8).unwrap_err();
        assert!(matches!(error, SceneError::TooLarge { needed: 1408, available: 1280, .. }), "{error:?}");
        assert!(room.triangles(7, 128 * 7).is_ok());
    }
}
