//! Creates card images: everything that a host computes from a scene once, before any tile is rendered.
//!
//! A [`PackedScene`](pack::PackedScene) holds the scene's sections of the card image.
//! [`map_photons`](photon_map::map_photons) traces photons in it and adds the sections of the photon map. The
//! result is a [`CardImage`](pack::CardImage). The chip's ray caster traces the photons in the packed data,
//! so that they lie on exactly the surfaces that gather rays hit.
//!
//! - [`bvh`]: bounding volume hierarchy; `fold`: folding of binary trees into wide nodes; `light`: light tree
//!   and environment.
//! - [`pack`]: the scene's sections of the card image.
//! - [`photon`]: photon pass; `density`: area corrections of the density estimate; [`photon_map`]: the photon
//!   map's sections.
//!
//! These modules are one crate because inlining across them saves a third of the photon pass's time.
#![forbid(unsafe_code)]

pub mod bvh;
mod density;
mod detail;
mod fold;
mod light;
pub mod pack;
pub mod photon;
pub mod photon_map;
