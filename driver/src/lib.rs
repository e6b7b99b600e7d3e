//! The host half of photoncard: a library that renders glTF scenes with global illumination, on emulated chips in this process
//! or on cards at the other end of a link.
//!
//! photoncard is photon mapping (Jensen 2001) on *rendering chips*: small processors with a fixed amount of on-chip memory, a
//! private DRAM and one link to a host. A chip runs [`photoncard_firmware`]. This crate is what runs on the host: it loads a
//! scene, traces photons, packs scene and photon map into a *card image*, sends the image to each card, deals tiles to the cards
//! and assembles the picture. The picture is equal, bit for bit, for any number and kind of cards.
//!
//! # First steps
//!
//! A render takes three calls: [`scene::gltf::load`], [`render::render`] and [`exr::write`].
//!
//! ```
//! use std::path::Path;
//!
//! use photoncard_driver::exr::{self, SampleFormat};
//! use photoncard_driver::quality::Quality;
//! use photoncard_driver::render::{Unobserved, render};
//! use photoncard_driver::scene::gltf;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let scene = gltf::load(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell.gltf")))?;
//! let settings = Quality::Good.settings().with(|settings| {
//!     (settings.picture.width, settings.picture.height) = (16, 16);
//!     // Less than the quality's half a million: an example is to take no time.
//!     settings.photons.count = 5_000;
//! });
//! let rendering = render(&scene, &settings, &Unobserved)?;
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("cornell.exr");
//! let provenance = serde_json::to_string(&rendering.statistics.provenance.pixels)?;
//! exr::write(&path, &rendering.film, &settings.picture.layers, &provenance, SampleFormat::Float)?;
//! let picture = exr::read_rgb(&path)?;
//! assert_eq!((picture.width, picture.height), (16, 16));
//! assert!(picture.pixels.iter().flatten().sum::<f32>() > 0.0);
//! # Ok(())
//! # }
//! ```
//!
//! [`RenderSettings`](render::RenderSettings) has the options of `photoncard render` in groups.
//! [`Quality::settings`](quality::Quality::settings) has cache and filter of a `--quality`, with the fewest samples and middle numbers of rays and photons, which
//! [`Quality::fit`](quality::Quality::fit) chooses for a scene, within [`render_chosen`](render::render_chosen). `RenderSettings::default()` is
//! [`Quality::Paper`](quality::Quality::Paper), the dissertation's nominal frame. All are for one emulated reference chip. [`Rendering`](render::Rendering) holds the
//! [`Film`](film::Film) and the [`Statistics`](render::Statistics). A [`Renderer`](render::Renderer) renders further pictures on cards that stay
//! open. A tone-mapped PNG is written by
//! [`tone_mapping::write_png`], and two pictures are compared by [`difference`].
//!
//! # Cards
//!
//! [`CardAddress`](render::CardAddress) names cards as `--card` does. Emulated and remote cards may be mixed in one render:
//!
//! ```
//! use photoncard_driver::render::{CardAddress, CardSet, RenderSettings};
//!
//! # fn main() -> Result<(), String> {
//! let addresses: Vec<CardAddress> = vec!["emulated:4".parse()?, "tcp:render-node:7000".parse()?];
//! let cards = CardSet { addresses, ..CardSet::default() };
//! let settings = RenderSettings { cards, ..RenderSettings::default() };
//! assert_eq!(settings.cards.addresses[1].to_string(), "tcp:render-node:7000");
//! assert!("usb:1".parse::<CardAddress>().is_err());
//! # Ok(())
//! # }
//! ```
//!
//! # Progress and cancellation
//!
//! [`Observer`](render::Observer) is called from the threads of a render, and ends it by [`is_stopped`](render::Observer::is_stopped):
//!
//! ```
//! use std::sync::atomic::{AtomicBool, Ordering};
//!
//! use photoncard_driver::render::{Observer, Phase};
//!
//! #[derive(Default)]
//! struct Progress {
//!     cancelled: AtomicBool,
//! }
//!
//! impl Observer for Progress {
//!     fn progress(&self, phase: Phase, done: u64, total: u64) {
//!         eprintln!("{phase:?}: {done} of {total}");
//!     }
//!
//!     fn is_stopped(&self) -> bool {
//!         self.cancelled.load(Ordering::Relaxed)
//!     }
//! }
//!
//! let progress = Progress::default();
//! progress.cancelled.store(true, Ordering::Relaxed);
//! assert!(progress.is_stopped());
//! ```
//!
//! # Layers
//!
//! Modules from bottom to top. A module imports modules of its own row and of rows above it in this table, never of rows below
//! it; and no file imports one that imports it back, directly or around (`tests/tests/imports`).
//!
//! | layer | modules | contents |
//! |---|---|---|
//! | foundation | [`output`], [`printable`], [`choice`], `allocation`, `foreign`, `heading`, `intact` | output files that appear whole or not at all; escaping of foreign text; names of enumerations; memory limits; isolation of decoders that panic; headings of files; checks that finished files are whole |
//! | tiles | [`sums`], [`sink`] | format of pixels' sums, and their values; a finished tile, and [`TileSink`](sink::TileSink), the trait of every output |
//! | pictures | [`film`], [`layer`], [`exr`], [`tone_mapping`], [`difference`] | pixels of a picture; its layers; files; comparison |
//! | scenes | [`scene`], [`error`] | triangles, materials, textures, lights and cameras of a glTF file; what can be wrong with one |
//! | trees | [`bvh`], `fold`, `light` | bounding volume hierarchy; folding of binary trees into wide nodes; light tree and environment |
//! | card image | [`pack`] | the scene's sections of the card image |
//! | photons | [`photon`], `density`, [`photon_map`] | photon pass; area corrections of the density estimate; the photon map's sections of the card image |
//! | links | [`link`], [`session`] | ports of bytes; the host's end of the protocol, without I/O |
//! | cards | [`emulator`] | chips on threads of this process, memory models and traces |
//! | tiles to cards | [`scheduler`], [`dispatcher`] | which card renders which tile; finished tiles to the sinks |
//! | sinks | [`viewer`], [`partial`], [`parts`], [`display`] | [`Viewer`](viewer::Viewer), the trait of sinks that show tiles; the file of finished tiles, for `--resume`; parts of a picture, and their merge; the client of a display server |
//! | cost model | [`cost_model`] | FLOPs and DRAM bytes of a frame by Table 7.1 |
//! | render | [`render`] | one render from a scene to a complete film; settings, statistics, card addresses |
//! | quality | [`quality`] | settings for what a picture is needed for, by pilot renders |
//! | studies | [`study`] | measurements of shipped scenes, and reports |
//!
//! Below all of them are [`photoncard_shared`] (formats of memory and wire) and [`photoncard_firmware`]. `pack`, `light`,
//! `photon`, `density`, `photon_map` and `emulator` import the firmware, so that photons, chords and irradiance points are
//! computed by the chip's own code.
//!
//! # Way of the data
//!
//! ```text
//! scene::gltf -> Scene -> pack -> photon -> photon_map (with density) -> CardImage
//!     -> session -> link -> card -> link -> session -> dispatcher -> TileSinks: Film, PartialRender, Display
//! Film -> exr, tone_mapping
//! ```
//!
//! Terms are defined in `docs/glossary.md`, design decisions and "how to add" lists are in `docs/architecture.md`.
#![forbid(unsafe_code)]

mod allocation;
pub mod bvh;
pub mod choice;
pub mod cost_model;
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
mod heading;
mod intact;
pub mod layer;
mod light;
pub mod link;
pub mod output;
pub mod pack;
pub mod partial;
pub mod parts;
pub mod photon;
pub mod photon_map;
pub mod printable;
pub mod quality;
pub mod render;
pub mod scene;
pub mod scheduler;
pub mod session;
pub mod sink;
pub mod study;
pub mod sums;
pub mod tone_mapping;
pub mod viewer;
