//! What a chip counts.

use serde::{Deserialize, Serialize};

/// Work done since the frame began. Sums over chips do not depend on how tiles were dealt.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Counters {
    /// Rays from the eye.
    pub eye_rays: u64,
    /// Rays towards emitters.
    pub shadow_rays: u64,
    /// Final gather rays.
    pub gather_rays: u64,
    /// Searches for the nearest photons.
    pub gathers: u64,
    /// Photons whose distance was computed.
    pub photons_tested: u64,
    /// Photons that the searches returned.
    pub photons_found: u64,
}

impl Counters {
    /// All zero.
    pub const ZERO: Self =
        Self { eye_rays: 0, shadow_rays: 0, gather_rays: 0, gathers: 0, photons_tested: 0, photons_found: 0 };

    /// Adds another chip's counts.
    pub fn add(&mut self, other: &Self) {
        self.eye_rays += other.eye_rays;
        self.shadow_rays += other.shadow_rays;
        self.gather_rays += other.gather_rays;
        self.gathers += other.gathers;
        self.photons_tested += other.photons_tested;
        self.photons_found += other.photons_found;
    }
}
