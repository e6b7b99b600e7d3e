//! Frame parameters for unit tests.

use photoncard_shared::message::{Camera, FrameParameters};

/// Frame of 8x8 pixels with one sample per pixel and one ray of each kind.
pub(super) fn frame() -> FrameParameters {
    let camera = Camera::pinhole([0.0; 3], [0.0; 3], [0.0; 3], [0.0; 3]);
    FrameParameters {
        width: 8,
        height: 8,
        camera,
        seed: 0,
        first_sample: 0,
        samples: 1,
        planned_samples: 1,
        gather_rays: 1,
        shadow_rays: 1,
        neighbors: 2,
        max_distance: 1.0,
        sampling: Default::default(),
        irradiance_error: None,
        bins: 1,
        drain: Default::default(),
        queue: 1,
        radiance: Default::default(),
        caustics: None,
        layers: false,
        light_groups: 0,
        filter: Default::default(),
        in_flight: 3,
        keep_records: false,
        adaptive_threshold: None,
        transparent: false,
        position: false,
        coverage: false,
        identities: false,
        irradiance: false,
        near_distance: 0.0,
    }
}
