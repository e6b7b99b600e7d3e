//! The host half of photoncard: a library that renders glTF scenes with global illumination, on emulated
//! chips in this process or on cards at the other end of a link.
//!
//! photoncard is photon mapping (Jensen 2001) on *rendering chips*: small processors with a fixed amount of
//! on-chip memory, a private DRAM and one link to a host. A chip runs `photoncard_firmware`. This crate runs
//! on the host: it loads a scene, traces photons, packs scene and photon map into a *card image*, sends the
//! image to each card, assigns tiles to the cards and assembles the picture. The picture is equal, bit for
//! bit, for any number and kind of cards.
//!
//! # First steps
//!
//! A render takes three calls: [`scene::gltf::load`], [`render::render`] and [`exr::write`].
//!
//! ```
//! use std::path::Path;
//!
//! use photoncard_driver::exr::{self, Content, SampleFormat};
//! use photoncard_driver::quality::Quality;
//! use photoncard_driver::render::{Unobserved, render};
//! use photoncard_driver::scene::gltf;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let scene = gltf::load(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell.gltf")))?;
//! let settings = Quality::Good.settings().with(|settings| {
//!     (settings.picture.width, settings.picture.height) = (16, 16);
//!     // Far fewer photons than the quality's, so that the example is fast.
//!     settings.photons.count = 5_000;
//! });
//! let rendering = render(&scene, &settings, &Unobserved)?;
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("cornell.exr");
//! let provenance = serde_json::to_string(&rendering.statistics.provenance.pixels)?;
//! let content = Content::new(&rendering.film, &settings.picture.layers);
//! exr::write(&path, &content, &provenance, SampleFormat::Float)?;
//! let picture = exr::read(&path, exr::Shown::Rendered)?;
//! assert_eq!((picture.width, picture.height), (16, 16));
//! assert!(picture.pixels.iter().flatten().sum::<f32>() > 0.0);
//! # Ok(())
//! # }
//! ```
//!
//! [`RenderSettings`](render::RenderSettings) has the options of `photoncard render` in groups.
//! [`Quality::settings`](quality::Quality::settings) returns the settings of a `--quality` for an unknown
//! scene, with the fewest samples and medium numbers of rays and photons.
//! [`Quality::fit`](quality::Quality::fit) chooses these numbers for a given scene;
//! [`render_chosen`](render::render_chosen) can call it once the scene is packed. `RenderSettings::default()`
//! is [`Quality::Paper`](quality::Quality::Paper), the nominal frame of Steinhurst's dissertation (2007), but
//! for near ends of gather rays and foci of their directions, which `Paper` does without. All
//! these settings are for one emulated reference chip. [`Rendering`](render::Rendering) holds the
//! [`Film`](film::Film) and the [`Statistics`](render::Statistics). A [`Renderer`](render::Renderer) renders
//! further pictures on cards that stay open. [`tone_mapping::write_png`] writes a tone-mapped PNG;
//! [`difference`] compares two pictures.
//!
//! # Cards
//!
//! [`CardAddress`](render::CardAddress) names cards in the syntax of the option `--card`. One render can use
//! both emulated and remote cards:
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
//! The threads of a render call its [`Observer`](render::Observer). The render ends early when
//! [`is_stopped`](render::Observer::is_stopped) returns true:
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
//! # Crates
//!
//! This crate re-exports the modules of seven crates. Each of them imports only crates above it in this list;
//! `photoncard_cards` and `photoncard_denoise` import only `photoncard_picture`.
//!
//! - [`photoncard_picture`] ([`film`], [`false_color`], [`sums`], [`sink`], [`viewer`], [`layer`], [`exr`],
//!   [`tone_mapping`], [`difference`], [`output`], [`printable`], [`choice`]): pixels of a picture and their
//!   destinations; its files; names of enumerations.
//! - [`photoncard_denoise`] ([`denoise`]): Open Image Denoise, loaded at run time.
//! - [`photoncard_scene`] ([`scene`], [`error`]): triangles, materials, textures, lights and cameras of a
//!   glTF file; its errors.
//! - [`photoncard_map`] ([`bvh`], [`pack`], [`photon`], [`photon_map`]): bounding volume hierarchy, light
//!   tree, photon pass and photon map: the sections of the card image.
//! - [`photoncard_cards`] ([`link`], [`session`], [`scheduler`], [`dispatcher`]): ports of bytes; the host's
//!   end of the protocol, without I/O; assignment of tiles to cards.
//! - [`photoncard_render`] ([`render`], [`emulator`], [`quality`], [`partial`], [`parts`], [`display`],
//!   [`cost_model`]): a render from a scene to a complete film; emulated chips on threads of this process;
//!   settings from pilot renders; the file of finished tiles; parts of a picture and their merge; the client
//!   of a display server; FLOPs and DRAM bytes by Table 7.1 of the dissertation.
//! - [`photoncard_study`] ([`study`]): measurements of shipped scenes, and reports.
//!
//! Below all of them are `photoncard_shared` (formats of memory and wire) and `photoncard_firmware`, whose
//! code `photoncard_map` uses to compute photons, disc fractions and irradiance points.
//!
//! # Data flow
//!
//! ```text
//! scene::gltf -> Scene -> pack -> photon -> photon_map (with density) -> CardImage
//!     -> session -> link -> card -> link -> session -> dispatcher -> TileSinks: Film, PartialRender, Display
//! Film -> denoise -> exr, tone_mapping
//! ```
//!
//! `docs/glossary.md` defines the terms, `docs/architecture.md` explains design decisions, and
//! `CONTRIBUTING.md` has "how to add" lists.
#![forbid(unsafe_code)]

pub use photoncard_cards::{dispatcher, link, scheduler, session};
pub use photoncard_denoise as denoise;
pub use photoncard_map::{bvh, pack, photon, photon_map};
pub use photoncard_picture::{
    choice, cryptomatte, difference, exr, false_color, film, layer, output, printable, sink, sums,
    tone_mapping, viewer,
};
pub use photoncard_render::{self as render, cost_model, display, emulator, partial, parts, quality};
pub use photoncard_scene::{self as scene, error};
#[cfg(feature = "study")]
pub use photoncard_study as study;
