//! Animations: nodes, joints, morph targets, cameras and lights at a moment.

#[path = "../scene_support/mod.rs"]
mod scene_support;

mod animated;
mod hostile;
mod interpolation;
mod parts;
