//! Crossings of chords with triangles, and whether they lie outside all solids.
//!
//! Every crossing of a chord counts as surface area, with two exceptions: crossings inside a solid, and unlit
//! crossings below another crossing ([`super::evidence`]). The *depth* of a point is the number of solids
//! that contain it. It follows from the front and back faces crossed on a path from a reference point outside
//! all solids, a little above the photon.

use std::cmp::Reverse;

use photoncard_firmware::simd::{Isa, Kernel, LANES, run};
use photoncard_shared::layout::TriangleId;

use super::chords::{BATCHES, Batch, Chords};
use super::lanes::Lane;
use super::sides::Sides;
use super::surfaces::OpenSurfaces;

/// Number of layers above which the crossings are sorted chord by chord.
const MAX_LAYERS: usize = 64;

/// Crossings of sixteen chords with one triangle.
#[derive(Clone)]
pub(super) struct Layer {
    /// Sort keys of the crossings ([`key`]); 0 for a chord that does not hit the triangle.
    keys: [u32; LANES],
    /// Ratio of the surface area to its projection on the disc, `1 / cos`.
    slope: f32,
    face: u32,
    pub(super) triangle: TriangleId,
}

/// Sort key of a crossing: greater for greater heights and, at equal heights, for front faces; never 0 for
/// heights in `[-1, 1]`.
#[inline(always)]
fn key(height: f32, is_front: bool) -> u32 {
    let bits = height.to_bits();
    // As integers, the bits of positive floats ascend with the value, those of negative floats descend.
    let ascending = if bits >> 31 == 0 { bits | 1 << 31 } else { !bits };
    ascending.wrapping_sub(LOWEST) << 1 | u32::from(is_front)
}

/// Least value of `ascending` in [`key`] for heights above -2. Subtracting it frees the top bit, and a shift
/// then makes room for the bit of the face.
const LOWEST: u32 = 1 << 30;

/// Height of a crossing, decoded from its sort key.
#[inline(always)]
fn height(key: u32) -> f32 {
    let ascending = (key >> 1).wrapping_add(LOWEST);
    f32::from_bits(if ascending >> 31 == 0 { !ascending } else { ascending & !(1 << 31) })
}

/// Encodes the side of a triangle that a downward chord hits:
/// - bits 0 to 7: code of the side's normal;
/// - bit 8: set if no photons are stored there;
/// - bits 9 and 10: 1 plus the change of the chord's depth (number of solids around its point).
#[inline(always)]
fn face(sides: Sides, is_front: bool) -> u32 {
    let normal = sides.normal(is_front).map_or(1 << 8, u32::from);
    let change = match sides.is_solid {
        true if is_front => 2,
        true => 0,
        false => 1,
    };
    normal | change << 9
}

#[inline(always)]
fn change_of_depth(face: u32) -> i32 {
    (face >> 9) as i32 - 1
}

#[inline(always)]
fn stores_photons(face: u32) -> bool {
    face >> 8 & 1 == 0
}

impl Layer {
    /// Creates the crossings of a triangle, at `heights`, with the chords for which `misses` is 0.
    #[inline(always)]
    pub(super) fn new(
        (heights, misses): (&Lane, &[u32; LANES]),
        (triangle, sides, is_front): (TriangleId, Sides, bool),
        slope: f32,
    ) -> Self {
        let mut keys = [0; LANES];
        for (lane, target) in keys.iter_mut().enumerate() {
            let key = key(heights[lane], is_front);
            *target = if misses[lane] == 0 { key } else { 0 };
        }
        Self { keys, slope, face: face(sides, is_front), triangle }
    }

    /// Removes the crossings for which `keeps(lane, height)` returns false.
    pub(super) fn retain(&mut self, mut keeps: impl FnMut(usize, f32) -> bool) {
        for (lane, key) in self.keys.iter_mut().enumerate() {
            if *key != 0 && !keeps(lane, height(*key)) {
                *key = 0;
            }
        }
    }
}

/// Crossings of all chords with the triangles in a ball.
pub(super) struct Crossings {
    /// Crossings of each batch of chords, in one layer per triangle.
    pub(super) layers: [Vec<Layer>; BATCHES],
    /// For each chord, the number of solids that contain its point at [`Self::height`], minus the number that
    /// contain the reference point.
    pub(super) depths: [[i32; LANES]; BATCHES],
    /// Height of the reference point, in radii of the ball.
    height: f32,
    /// Working memory of [`OpenAll`].
    levels: Vec<Level>,
}

impl Crossings {
    pub(super) fn new() -> Self {
        let layers = [const { Vec::new() }; BATCHES];
        Self { layers, depths: [[0; LANES]; BATCHES], height: 0.0, levels: Vec::new() }
    }

    pub(super) fn clear(&mut self, height: f32) {
        self.layers.iter_mut().for_each(Vec::clear);
        self.depths = [[0; LANES]; BATCHES];
        self.height = height;
    }

    pub(super) fn set_depth(&mut self, chord: usize, depth: i32) {
        self.depths[chord / LANES][chord % LANES] = depth;
    }

    /// Collects the crossings outside all solids. `surfaces` receives each crossing that is the highest of
    /// its chord, `covered` all others.
    pub(super) fn open_surfaces(
        &mut self,
        chords: &Chords,
        surfaces: &mut OpenSurfaces,
        covered: &mut Vec<Covered>,
    ) {
        surfaces.clear();
        covered.clear();
        run(OpenAll { crossings: self, chords, surfaces, covered });
    }
}

/// The n-th crossing from above of each of sixteen chords.
#[derive(Clone, Copy)]
struct Level {
    /// Sort keys; 0 for a chord with fewer than n crossings.
    keys: [u32; LANES],
    /// For each crossing, the bits (`f32::to_bits`) of the ratio of surface area to its projection on the
    /// disc, `1 / cos`.
    slopes: [u32; LANES],
    faces: [u32; LANES],
    /// Bit mask of the crossings outside all solids.
    open: u32,
}

impl Level {
    const NONE: Self = Self { keys: [0; LANES], slopes: [0; LANES], faces: [0; LANES], open: 0 };

    #[inline(always)]
    fn of(layer: &Layer) -> Self {
        let Layer { keys, slope, face, .. } = *layer;
        Self { keys, slopes: [slope.to_bits(); LANES], faces: [face; LANES], open: 0 }
    }

    /// For each chord, moves the upper of the crossings of `self` and `other` to `self`, and the lower to
    /// `other`. Crossings with equal keys are exchanged.
    #[inline(always)]
    fn sort(&mut self, other: &mut Self) {
        for lane in 0..LANES {
            let [a, b] = [self.keys[lane], other.keys[lane]];
            // The values are exchanged by a masked XOR. A choice between two addresses would write the lanes
            // one by one, and they would be read back slowly.
            let exchange = if b >= a { u32::MAX } else { 0 };
            let slopes = (self.slopes[lane] ^ other.slopes[lane]) & exchange;
            let faces = (self.faces[lane] ^ other.faces[lane]) & exchange;
            (self.keys[lane], other.keys[lane]) = (a.max(b), a.min(b));
            self.slopes[lane] ^= slopes;
            other.slopes[lane] ^= slopes;
            self.faces[lane] ^= faces;
            other.faces[lane] ^= faces;
        }
    }
}

/// Sorts the crossings of each chord into levels, the highest first. Crossings with equal keys keep the order
/// of their layers.
#[inline(always)]
fn sort(isa: impl Isa, layers: &[Layer], levels: &mut Vec<Level>) {
    levels.clear();
    if layers.len() > MAX_LAYERS {
        return sort_each(layers, levels);
    }
    // Insertion starts with the last layer, because an inserted crossing goes before those with equal keys.
    for layer in layers.iter().rev() {
        let mut inserted = Level::of(layer);
        for level in levels.iter_mut() {
            level.sort(&mut inserted);
        }
        if isa.below(&inserted.keys, 1).count_ones() < LANES as u32 {
            levels.push(inserted);
        }
    }
}

/// Sorts many layers into levels, chord by chord.
fn sort_each(layers: &[Layer], levels: &mut Vec<Level>) {
    let mut order = Vec::new();
    for lane in 0..LANES {
        order.clear();
        order.extend(layers.iter().map(|layer| Reverse(layer.keys[lane])).zip(0..));
        order.retain(|(Reverse(key), _)| *key != 0);
        order.sort_unstable();
        levels.resize(levels.len().max(order.len()), Level::NONE);
        for (level, &(Reverse(key), layer)) in levels.iter_mut().zip(&order) {
            let layer: &Layer = &layers[layer];
            level.keys[lane] = key;
            (level.slopes[lane], level.faces[lane]) = (layer.slope.to_bits(), layer.face);
        }
    }
}

/// Kernel that collects the crossings outside all solids.
struct OpenAll<'a> {
    crossings: &'a mut Crossings,
    chords: &'a Chords,
    surfaces: &'a mut OpenSurfaces,
    covered: &'a mut Vec<Covered>,
}

impl Kernel for OpenAll<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self, isa: impl Isa) {
        let Self { crossings, chords, surfaces, covered } = self;
        let Crossings { layers, depths, height, levels } = crossings;
        // Adding 0.0 turns -0.0 into 0.0.
        let reference = key(*height + 0.0, false) >> 1;
        for (batch, (layers, depths)) in chords.batches.iter().zip(layers.iter().zip(depths)) {
            sort(isa, layers, levels);
            open(isa, levels, depths, reference);
            collect(batch, levels, surfaces, covered);
        }
    }
}

/// Marks the crossings outside all solids, in [`Level::open`]. `depths` are the chords' depths at the height
/// of the reference point; `reference` is the [`key`] of that height without the bit of the face.
#[inline(always)]
fn open(isa: impl Isa, levels: &mut [Level], depths: &mut [i32; LANES], reference: u32) {
    for level in levels.iter() {
        for (lane, depth) in depths.iter_mut().enumerate() {
            let above = if level.keys[lane] >> 1 > reference { -1 } else { 0 };
            *depth -= change_of_depth(level.faces[lane]) & above;
        }
    }
    for level in levels {
        let mut closed = [0; LANES];
        for (lane, depth) in depths.iter_mut().enumerate() {
            let face = level.faces[lane];
            // The depth is negative if the chord crossed the back of an open (non-manifold) surface.
            let is_open = (level.keys[lane] != 0) & stores_photons(face) & (*depth <= 0);
            closed[lane] = if is_open { 0 } else { 1 };
            *depth += change_of_depth(face);
        }
        level.open = isa.below(&closed, 1);
    }
}

/// Crossing below another crossing of its chord.
pub(super) struct Covered {
    pub(super) place: [f32; 3],
    pub(super) slope: f32,
    /// Code of the surface normal.
    pub(super) normal: u8,
    /// Distance to the crossing above, in radii of the ball.
    pub(super) gap: f32,
    /// Interval of heights that are nearer to this crossing than to the crossings above and below it.
    pub(super) heights: [f32; 2],
}

/// Adds the crossings outside all solids to the surfaces, or to `covered` if they are below others.
#[inline(always)]
fn collect(batch: &Batch, levels: &[Level], surfaces: &mut OpenSurfaces, covered: &mut Vec<Covered>) {
    let mut left = levels.iter().fold(0, |open, level| open | level.open);
    while left != 0 {
        let lane = left.trailing_zeros() as usize % LANES;
        left &= left - 1;
        for (index, level) in levels.iter().enumerate().filter(|(_, level)| level.open >> lane & 1 != 0) {
            let place = [batch.x[lane], batch.y[lane], height(level.keys[lane])];
            let (slope, normal) = (f32::from_bits(level.slopes[lane]), level.faces[lane] as u8);
            match index.checked_sub(1) {
                None => surfaces.push(place, slope, normal),
                Some(above) => {
                    let [.., at] = place;
                    let above = height(levels[above].keys[lane]);
                    let below = levels.get(index + 1).map_or(0, |level| level.keys[lane]);
                    let below = if below != 0 { height(below) } else { -1.0 };
                    let heights = [0.5 * (at + below), 0.5 * (at + above)];
                    covered.push(Covered { place, slope, normal, gap: above - at, heights });
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
