//! The host half of photoncard.
#![forbid(unsafe_code)]

mod allocation;
pub mod bvh;
pub mod choice;
mod density;
pub mod difference;
pub mod dispatcher;
pub mod display;
pub mod emulator;
pub mod error;
pub mod exr;
pub mod film;
mod fold;
mod foreign;
pub mod layer;
mod light;
pub mod link;
pub mod output;
pub mod pack;
pub mod partial;
pub mod photon;
pub mod photon_map;
pub mod preview;
pub mod printable;
pub mod render;
pub mod scene;
pub mod scheduler;
pub mod session;
pub mod sink;
pub mod study;
