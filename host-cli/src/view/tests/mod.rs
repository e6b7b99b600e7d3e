//! Tests of a view's state and command line with random actions.

mod commands;
mod random;
mod simulation;
mod world;
