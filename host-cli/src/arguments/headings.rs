//! Headings under which help lists options. An option's heading states the steps of a job that take it.

pub(super) const SCENE: &str = "Scene";
pub(super) const FRAMES: &str = "Frames";
pub(super) const PICTURE: &str = "Picture and camera";
pub(super) const PHOTONS: &str = "Photon maps";
pub(super) const RAYS: &str = "Rays and samples";
pub(super) const ORDER: &str = "Order of the work";
pub(super) const OUTPUTS: &str = "Outputs";
