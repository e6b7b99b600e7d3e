//! Dimensions of the atrium, in metres.
//!
//! The arcades stand on the centre line of a rectangle of 24 by 9 m about the origin. A side's own frame has
//! x along the arcade, y up and z outwards, with z = 0 on the centre line; an *offset* is a z in that frame.
//! Parts that meet reach a little into each other, so that no two surfaces are coplanar.

use glam::Vec2;

/// Half the size of the rectangle of the arcades' centre lines, x and z.
pub(super) const HALF: Vec2 = Vec2::new(12.0, 4.5);

/// Width of an arch on the ground, from column to column; the upper arches are half as wide.
pub(super) const BAY: f32 = 3.0;

/// Inner and outer border of the corridor's clear space, as offsets.
pub(super) const CORRIDOR: [f32; 2] = [0.3, 3.3];

/// Inner face (the niches' backs) and outer face of the outer wall, as offsets.
pub(super) const OUTER_WALL: [f32; 2] = [3.6, 3.9];

/// Height of the top of the steps on which the arcade stands.
pub(super) const STEP_TOP: f32 = 0.16;

/// Springing height of the ground arches and the vaults.
pub(super) const GROUND_SPRINGING: f32 = 3.0;

/// Heights of the underside and the top of the gallery's floor.
pub(super) const GALLERY_FLOOR: [f32; 2] = [4.62, 5.0];

/// Springing height of the upper arches.
pub(super) const UPPER_SPRINGING: f32 = 7.7;

/// Heights of the underside and the top of the roof.
pub(super) const ROOF: [f32; 2] = [8.7, 9.3];

/// Radius of the ground arches and half the thickness of their wall.
pub(super) const GROUND_ARCH: [f32; 2] = [1.15, 0.3];

/// Radius of the upper arches and half the thickness of their wall.
pub(super) const UPPER_ARCH: [f32; 2] = [0.55, 0.2];

/// Depth by which a part reaches into its neighbour.
pub(super) const EMBED: f32 = 0.02;
