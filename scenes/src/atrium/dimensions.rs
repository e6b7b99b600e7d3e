//! Dimensions of the atrium, metres.
//!
//! The centre lines of the four arcades form a rectangle of 24 by 9 m about the origin. Each side of the
//! court has a local frame: x along the arcade, y up, z outwards, with z = 0 on the centre line. An *offset*
//! is a z coordinate in this frame. Adjacent meshes overlap slightly, so that no two surfaces are coplanar.

use glam::Vec2;

/// Half the size in x and z of the rectangle of the arcades' centre lines, metres.
pub(super) const HALF: Vec2 = Vec2::new(12.0, 4.5);

/// Distance between the columns of the ground floor's arches, metres. The upper arches are half as wide.
pub(super) const BAY: f32 = 3.0;

/// Offsets of the inner and the outer border of the corridor's clear space, metres.
pub(super) const CORRIDOR: [f32; 2] = [0.3, 3.3];

/// Offsets of the outer wall's inner face (the back of the niches) and of its outer face, metres.
pub(super) const OUTER_WALL: [f32; 2] = [3.6, 3.9];

/// Height of the top of the steps on which the arcade stands, metres.
pub(super) const STEP_TOP: f32 = 0.16;

/// Springing height of the arches on the ground floor and of the vaults, metres.
pub(super) const GROUND_SPRINGING: f32 = 3.0;

/// Heights of the lower and upper surface of the gallery's floor, metres.
pub(super) const GALLERY_FLOOR: [f32; 2] = [4.62, 5.0];

/// Springing height of the upper arches, metres.
pub(super) const UPPER_SPRINGING: f32 = 7.7;

/// Heights of the lower and upper surface of the roof, metres.
pub(super) const ROOF: [f32; 2] = [8.7, 9.3];

/// Radius of the arches on the ground floor, and half the thickness of their wall, metres.
pub(super) const GROUND_ARCH: [f32; 2] = [1.15, 0.3];

/// Radius of the upper arches, and half the thickness of their wall, metres.
pub(super) const UPPER_ARCH: [f32; 2] = [0.55, 0.2];

/// Depth by which adjacent meshes overlap, metres.
pub(super) const EMBED: f32 = 0.02;
