//! Dimensions of the atrium, metres.
//!
//! The arcades stand on the centre line of a rectangle of 24 by 9 m about the origin. The local frame of a
//! side has x along the arcade, y up and z outwards, with z = 0 on the centre line. An *offset* is a z in
//! that frame. Adjacent parts overlap slightly, so that no two surfaces are coplanar.

use glam::Vec2;

/// Half the size in x and z of the rectangle that the centre lines of the arcades form, metres.
pub(super) const HALF: Vec2 = Vec2::new(12.0, 4.5);

/// Distance between the columns of the ground floor's arches, metres. The upper arches are half as wide.
pub(super) const BAY: f32 = 3.0;

/// Offsets (z in the local frame of a side, metres) of the inner and the outer border of the corridor's clear
/// space.
pub(super) const CORRIDOR: [f32; 2] = [0.3, 3.3];

/// Offsets (z in the local frame of a side, metres) of the outer wall's inner face, which is the back of the
/// niches, and of its outer face.
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

/// Depth by which adjacent parts overlap, metres.
pub(super) const EMBED: f32 = 0.02;
