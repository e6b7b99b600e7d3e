//! Formats of the records in card memory. Numbers are little-endian, and no record crosses the border of a
//! line.
//!
//! | record | bytes | records in a line |
//! |---|---|---|
//! | [`Photon`] | 20 | 6 |
//! | [`PhotonNode`] | 128 | 1 |
//! | [`PhotonLeaf`] | 128 | 1 |
//! | [`PhotonLeaf`] of [`IrradiancePoint`]s | 128 | 1 |
//! | [`BvhNode`] | 128 | 1 |
//! | [`BvhLeaf`], up to eight triangles | 128 | 1 |
//! | [`Instance`] of a group of triangles, among the leaves | 128 | 1 |
//! | [`Attributes`] | 64 | 2 |
//! | [`Tangents`] of four triangles | 64 | 2 |
//! | [`LeafAttributes`] | 4 | 32 |
//! | [`Material`] | 64 | 2 |
//! | [`Layers`] | 128 | 1 |
//! | [`Texture`] | 40 | 3 |
//! | texel | 4 | 32 |
//! | [`Emitter`] | 64 | 2 |
//! | [`LightNode`] | 128 | 1 |
//! | [`DistantLight`] | 32 | 4 |
//! | [`Sensor`] | 24 | 5 |
//! | threshold of the environment's distribution | 4 | 32 |
//!
//! Colours and vectors are three `f32`. Lengths are in metres, radiances in W/(sr m^2), and photon powers in
//! units of the card image's photon power unit, which is in watts.

use crate::address::LINE_BYTES;

mod affine;
mod attributes;
mod bvh_leaf;
mod bvh_node;
mod direction;
mod distant_light;
mod emitter;
mod instance;
mod irradiance_point;
mod kernel;
mod layers;
mod light_node;
mod material;
mod photon;
mod photon_grid;
mod photon_leaf;
mod photon_node;
mod sensor;
mod tangents;
mod texture;
mod wide_node;

pub use affine::{Rows, placed_normal, placed_point, placed_vector};
pub use attributes::{Attributes, LeafAttributes, NO_ATTRIBUTES};
pub use bvh_leaf::{BvhLeaf, LEAF_TRIANGLES, LEAF_VERTICES, MAX_MATERIALS, Triangle, VERTEX_LANES};
pub use bvh_node::{BvhAxis, BvhNode, NodeBox};
pub use direction::{decode_direction, decode_normal, encode_direction, encode_normal, normal_class};
pub use distant_light::DistantLight;
pub use emitter::{Emitter, EmitterKind};
pub use instance::{Instance, NO_INSTANCE, TriangleId};
pub use irradiance_point::IrradiancePoint;
pub use kernel::{encode_kernel, kernel_share};
pub use layers::{LayerTexture, Layers};
pub use light_node::{LIGHT_CHILDREN, LIGHT_TREE_LEVELS, LightChild, LightLink, LightNode};
pub use material::{
    BLENDS, COMPENSATED, DOUBLE_SIDED, HAS_ATTRIBUTES, HIDDEN, LAMP, MAX_PHONG_EXPONENT, Material,
    NARROW_ALPHA, NARROW_LOBE, NO_TEXTURE, PANE, Reflectance, THIN_WALLED,
};
pub use photon::{
    DISC_CODES, FULL_DISC, PHOTON_CONTENT_BYTES, Photon, Rgbe, disc_fraction, encode_disc, is_of_region,
};
pub use photon_grid::{GRID_BITS, PhotonGrid, power_of_two_above};
pub use photon_leaf::{LEAF_LANES, LEAF_PHOTONS, LeafCoordinates, PhotonLeaf, leaf_capacity};
pub use photon_node::{GridBox, NodeCoordinates, PhotonNode};
pub use sensor::Sensor;
pub use tangents::Tangents;
pub use texture::{TEXELS_PER_LINE, TILE_HEIGHT, TILE_WIDTH, TexelFormat, Texture, Wrap};
pub use wide_node::{Child, Links, NODE_CHILDREN, WideNode};

/// A record of fixed size in card memory.
pub trait Record: Sized {
    /// Size of the record, bytes.
    const BYTES: usize;
    /// Number of whole records in one line.
    const PER_LINE: usize = LINE_BYTES / Self::BYTES;
}

/// Three consecutive `f32` of `bytes`, the first at `offset`; 0 past the end.
#[inline(always)]
fn read_vector<const N: usize>(bytes: &[u8; N], offset: usize) -> [f32; 3] {
    [read_f32(bytes, offset), read_f32(bytes, offset + 4), read_f32(bytes, offset + 8)]
}

#[inline(always)]
fn read_u32<const N: usize>(bytes: &[u8; N], offset: usize) -> u32 {
    match bytes.get(offset..).and_then(<[u8]>::first_chunk) {
        Some(word) => u32::from_le_bytes(*word),
        None => 0,
    }
}

#[inline(always)]
fn read_f32<const N: usize>(bytes: &[u8; N], offset: usize) -> f32 {
    f32::from_bits(read_u32(bytes, offset))
}

fn write_u32<const N: usize>(bytes: &mut [u8; N], offset: usize, value: u32) {
    if let Some(word) = bytes.get_mut(offset..).and_then(<[u8]>::first_chunk_mut) {
        *word = value.to_le_bytes();
    }
}

fn write_f32<const N: usize>(bytes: &mut [u8; N], offset: usize, value: f32) {
    write_u32(bytes, offset, value.to_bits());
}

fn write_vector<const N: usize>(bytes: &mut [u8; N], offset: usize, value: [f32; 3]) {
    for (axis, component) in value.into_iter().enumerate() {
        write_f32(bytes, offset + 4 * axis, component);
    }
}

#[cfg(test)]
mod tests {
    /// Returns a generator of pseudo-random numbers (xorshift64).
    pub(super) fn random(seed: u64) -> impl FnMut() -> u64 {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state
        }
    }
}
