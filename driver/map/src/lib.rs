//! Card images: what a host computes of a scene once, before any tile is rendered.
//!
//! A [`PackedScene`](pack::PackedScene) has the scene's sections, [`map_photons`](photon_map::map_photons)
//! traces photons in it and adds theirs; the result is a [`CardImage`](pack::CardImage). Photons are traced
//! by the chip's own ray caster, in the packed lines, and lie on exactly the surfaces that gather rays meet.
//!
//! - [`bvh`], `fold`, `light`: bounding volume hierarchy; folding of binary trees into wide nodes; light tree
//!   and environment.
//! - [`pack`]: the scene's sections of the card image.
//! - [`photon`], `density`, [`photon_map`]: photon pass; area corrections of the density estimate; the photon
//!   map's sections.
//!
//! Photon, density and pack are one crate: inlining across them is worth a third of the photon pass.
#![forbid(unsafe_code)]

pub mod bvh;
mod density;
mod fold;
mod light;
pub mod pack;
pub mod photon;
pub mod photon_map;
