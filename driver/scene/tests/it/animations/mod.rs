//! Animations: nodes, joints, morph targets, cameras and lights at a moment.

mod animated;
mod hostile;
mod interpolation;
mod parts;
