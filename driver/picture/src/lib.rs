//! Pictures: pixels as sums of samples, their layers, and files that appear whole or not at all.
//!
//! A card's tile is a [`FinishedTile`](sink::FinishedTile), and [`TileSink`](sink::TileSink) is what takes
//! one: a [`Film`](film::Film), which [`exr`] and [`tone_mapping`] write, or a sink of another crate. A film
//! is equal for every order of its tiles, since sums are integers.
//!
//! - [`output`], [`heading`], [`intact`]: output files; their headings; checks that finished files are whole.
//! - [`printable`], [`choice`]: escaping of foreign text; names of enumerations.
//! - [`allocation`], [`foreign`]: memory limits; decoders that panic.
//! - [`sums`], [`sink`], [`viewer`]: format of pixels' sums, and their values; traits of what takes tiles,
//!   and of what shows them.
//! - [`film`], [`layer`], [`exr`], [`tone_mapping`], [`difference`]: pixels of a picture; its layers; files;
//!   comparison.
//!
//! This is the lowest crate of the host: scenes read environments by [`exr`], and all crates write by
//! [`output`].
#![forbid(unsafe_code)]

pub mod allocation;
pub mod choice;
pub mod difference;
pub mod exr;
pub mod film;
pub mod foreign;
pub mod heading;
pub mod intact;
pub mod layer;
#[cfg(not(target_family = "wasm"))]
pub mod output;
pub mod printable;
pub mod sink;
pub mod sums;
pub mod tone_mapping;
pub mod viewer;
