//! Animations of nodes, joints, morph targets, cameras and lights, evaluated at a moment.

mod animated;
mod hostile;
mod interpolation;
mod parts;
