//! Pictures: pixels as sums of samples, their layers, and files that appear whole or not at all.
//!
//! A card renders a [`FinishedTile`](sink::FinishedTile). A [`TileSink`](sink::TileSink) is its destination:
//! a [`Film`](film::Film), which [`exr`] and [`tone_mapping`] write to files, or a sink of another crate. A
//! film does not depend on the order of its tiles, because sums are integers.
//!
//! - [`output`]: output files; [`heading`]: their headings; [`intact`]: checks that files are intact.
//! - [`printable`]: escaping of foreign text; [`choice`]: names of enumeration values.
//! - [`allocation`]: checks that memory can be allocated; [`foreign`]: isolation of decoders that may panic.
//! - [`sums`]: format of pixels' sums, and their values; [`sink`] and [`viewer`]: traits of destinations of
//!   tiles, and of viewers.
//! - [`film`]: pixels of a picture; [`layer`]: its layers; [`cryptomatte`]: mattes; [`exr`] and
//!   [`tone_mapping`]: picture files; [`difference`]: comparison of pictures.
//!
//! This is the lowest crate of the host. Scenes read environments through [`exr`], and all crates write files
//! through [`output`].
#![forbid(unsafe_code)]

pub mod allocation;
pub mod choice;
pub mod cryptomatte;
pub mod difference;
pub mod exr;
pub mod false_color;
pub mod film;
pub mod foreign;
pub mod heading;
pub mod intact;
pub mod layer;
pub mod output;
pub mod printable;
pub mod sink;
pub mod sums;
pub mod tone_mapping;
pub mod viewer;
