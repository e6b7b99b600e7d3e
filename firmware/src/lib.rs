//! Photon mapping renderer of one rendering chip.
//!
//! It has no allocator and no I/O. A [`kind`] of chip fixes the size of every buffer at compile time.
//! Emulated cards, QEMU and boards run the same code. Terms are defined in `docs/glossary.md`.
//!
//! # Example
//!
//! A card consists of its firmware and its DRAM. It is a static, as its buffers are larger than a chip's
//! stack; all of its bytes are zero at first, so that it takes no place in flash. In this example it answers
//! a host's first message. On a real link, [`serve::serve`] moves the bytes.
//!
//! ```
//! // A chip has `static_cell::ConstStaticCell`, or another cell that is taken once, in place of the mutex.
//! use std::sync::Mutex;
//!
//! use photoncard_firmware::card::MicroCard;
//! use photoncard_firmware::kind::MICRO;
//! use photoncard_firmware::memory::Dram;
//! use photoncard_shared::address::Line;
//! use photoncard_shared::image::LAYOUT_VERSION;
//! use photoncard_shared::message::{self, Command, PROTOCOL_VERSION, Reply};
//! use photoncard_shared::transport::Transport;
//!
//! static CARD: Mutex<MicroCard<Dram<'static>>> = Mutex::new(MicroCard::new(Dram::EMPTY));
//!
//! let mut card = CARD.lock().unwrap();
//! *card.memory() = Dram::new(vec![Line::ZERO; 64].leak());
//! let mut host = Transport::host();
//! host.open(0x5eed);
//! host.send(|payload| {
//!     message::encode(&Command::Hello { protocol: PROTOCOL_VERSION, layout: LAYOUT_VERSION }, payload)
//! });
//!
//! card.feed(host.outgoing());
//! host.receive(card.outgoing());
//! let reply = message::decode(host.take().expect("a card answers a hello"));
//! let Some(Reply::Hello { budget, .. }) = reply else { panic!("{reply:?}") };
//! assert_eq!(budget.tile_pixels, MICRO.tile_pixels);
//! ```
//!
//! # Layers
//!
//! Modules from bottom to top. A module imports modules of its own row and of rows above it in this table,
//! never of rows below it.
//!
//! | module | contents |
//! |---|---|
//! | `vector`, [`fixed_point`], [`simd`] | arithmetic with equal bits on every processor; sums independent of order; vector kernels |
//! | [`sampler`] | stratified random numbers, functions of (seed, pixel, sample, dimension) |
//! | [`memory`] | 128-byte lines of card DRAM; caches and counters |
//! | [`scene`], `wide_tree` | ray caster, surfaces, reflection, textures and lights, read from card memory; traversal of trees of sixteen-wide nodes |
//! | [`photon`] | search for the k nearest photons, density estimate, precomputed irradiance |
//! | [`kind`] | kinds of chip: budgets, and capacities of buffers |
//! | [`gather`] | queue of photon gathers, and their order |
//! | [`importance`] | importance sampling of final gather directions |
//! | [`render`] | passes of a tile: eye rays, direct light, caustics, final gather |
//! | [`irradiance_cache`] | indirect irradiance, gathered at few points and interpolated between them |
//! | [`chip`] | state of a tile; one method for each pass |
//! | [`self_test`] | test of card memory, and of arithmetic |
//! | [`card`] | protocol of a card: commands in, replies out |
//! | [`serve`] | main loop of a card on a port, or as a task; ring buffer of an interrupt's bytes |
//! | [`stack`] | measure of the use of a board's stack |
//!
//! [`card::Card`] is the whole firmware: it consumes bytes, works in small steps, and produces bytes.
//! `boards/` contains the images of boards, which add registers and a memory map.
//!
//! # Light paths
//!
//! Every path is counted once. In Heckbert's notation, L is a light and E the eye. D is a reflection by the
//! Lambertian part or a wide lobe of a surface. S is a perfectly specular reflection, a refraction, or a
//! reflection by a narrow lobe ([`scene::Reflection::has_narrow_lobe`]) that the eye does not see directly:
//!
//! - `L S* E`, visible emission: the eye path, followed through S ([`render::eye`]).
//! - `L D S* E`, direct light: shadow rays, and final gather rays that meet a light, combined by multiple
//!   importance sampling ([`render::direct`]).
//! - `L S+ D S* E`, caustics: the caustic map ([`render::caustic`]).
//! - `L (S|D)* D S* D S* E`, indirect light: final gather rays alone, followed through S
//!   ([`render::final_gather`]). At their ends the photon map gives all reflected light, including direct
//!   light, because no shadow rays start there. A ray that ends near its point goes on instead.
//!
//! # Exactness
//!
//! Random numbers are functions of (seed, pixel, sample, dimension). Sums over photons and over gather rays
//! are in fixed point ([`fixed_point`]), so that their order does not matter. All processors give equal bits,
//! because the code uses only integer arithmetic, `libm`, and `f32` addition, multiplication, division and
//! square root, never a fused multiply-add.
// `simd` is exempt, for its vector instructions, `stack`, which reads a stack as memory, and the square root
// on Arm with hardware floats.
#![deny(unsafe_code)]
#![no_std]
// A chip never panics: these lints catch what could, and each exception gives its reason.
#![cfg_attr(
    not(test),
    warn(
        clippy::indexing_slicing,
        clippy::unwrap_used,
        clippy::expect_used,
        clippy::panic,
        clippy::unreachable
    )
)]

#[cfg(test)]
extern crate std;

pub mod card;
pub mod chip;
pub mod fixed_point;
pub mod gather;
pub mod importance;
pub mod irradiance_cache;
pub mod kind;
pub mod light_groups;
pub mod memory;
pub mod photon;
pub mod render;
pub mod sampler;
pub mod scene;
pub mod self_test;
pub mod serve;
pub mod simd;
mod slot;
#[expect(unsafe_code, reason = "what the stack leaves behind is read as memory")]
pub mod stack;
mod vector;
mod wide_tree;
