//! Tests of a view's state with random actions.

mod commands;
mod random;
mod simulation;
mod world;
