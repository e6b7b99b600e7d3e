//! Properties of a view's state, on random actions.

mod commands;
mod random;
mod simulation;
mod world;
