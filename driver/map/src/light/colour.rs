//! Conversion of colours to a single number.

use glam::Vec3;

/// Mean of the channels.
pub(super) fn mean(colour: Vec3) -> f64 {
    colour.as_dvec3().element_sum() / 3.0
}
