//! Direction bins: gather rays grouped by their stratum, neighbouring bins one after the other.
//!
//! Ray `i` of every sample lies in the same cell of the unit square ([`crate::sampler`]), and the square's neighbours are
//! neighbours on the hemisphere. A bin is a cell of a coarser grid; the bins are walked like a field is ploughed, one row
//! there and the next one back.

use heapless::Vec;
use photoncard_shared::budget::MOST_GATHER_RAYS;

use crate::sampler::Cell;

/// The rays of a sample in the order of their bins.
pub struct DirectionBins {
    /// Ray numbers, those of one bin together.
    rays: Vec<u16, MOST_GATHER_RAYS>,
    /// Where each bin ends in `rays`.
    ends: Vec<u16, MOST_GATHER_RAYS>,
}

impl Default for DirectionBins {
    fn default() -> Self {
        Self::new()
    }
}

impl DirectionBins {
    /// No rays.
    pub const fn new() -> Self {
        Self { rays: Vec::new(), ends: Vec::new() }
    }

    /// Groups `rays` rays in up to `bins` bins, of which the empty ones are left out; both are at most
    /// [`MOST_GATHER_RAYS`].
    pub fn set(&mut self, rays: u32, bins: u32) {
        self.rays.clear();
        self.ends.clear();
        let mut ordered: Vec<(u16, u16), MOST_GATHER_RAYS> = Vec::new();
        for ray in 0..rays.min(MOST_GATHER_RAYS as u32) {
            // There is room for MOST_GATHER_RAYS.
            let _ = ordered.push((walk_position(ray, rays, bins) as u16, ray as u16));
        }
        ordered.sort_unstable();
        let mut last = None;
        for (bin, ray) in ordered {
            if last.is_some_and(|last| last != bin) {
                let _ = self.ends.push(self.rays.len() as u16);
            }
            last = Some(bin);
            let _ = self.rays.push(ray);
        }
        if last.is_some() {
            let _ = self.ends.push(self.rays.len() as u16);
        }
    }

    /// Number of bins.
    pub fn len(&self) -> u32 {
        self.ends.len() as u32
    }

    /// Whether there is no bin.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// The rays of a bin; none past the last.
    pub fn rays(&self, bin: u32) -> &[u16] {
        let bin = bin as usize;
        let start = bin.checked_sub(1).and_then(|before| self.ends.get(before)).copied().unwrap_or(0);
        let end = self.ends.get(bin).copied().unwrap_or(start);
        self.rays.get(start as usize..end as usize).unwrap_or(&[])
    }
}

/// The place of a ray's bin in the walk over all bins.
fn walk_position(ray: u32, rays: u32, bins: u32) -> u32 {
    let bins = bins.clamp(1, MOST_GATHER_RAYS as u32);
    let [x, y] = Cell::new(ray, rays).centre(rays);
    let row = Cell::new(((y * bins as f32) as u32).min(bins - 1), bins);
    let column = ((x * row.columns as f32) as u32).min(row.columns - 1);
    row.first + if row.row.is_multiple_of(2) { column } else { row.columns - 1 - column }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_ray_is_in_one_bin() {
        for (rays, bins) in
            [(1, 1), (100, 1), (100, 100), (100, 16), (200, 32), (7, 256), (256, 256), (211, 50)]
        {
            let mut order = DirectionBins::new();
            order.set(rays, bins);
            assert!(order.len() <= bins.min(rays));
            let mut seen = [false; MOST_GATHER_RAYS];
            for bin in 0..order.len() {
                assert!(!order.rays(bin).is_empty());
                for &ray in order.rays(bin) {
                    assert!(!core::mem::replace(&mut seen[ray as usize], true));
                }
            }
            assert!(seen[..rays as usize].iter().all(|&seen| seen));
            assert!(order.rays(order.len()).is_empty());
        }
    }

    #[test]
    fn one_bin_keeps_the_samplers_order_and_as_many_as_rays_walk_between_neighbours() {
        let mut order = DirectionBins::new();
        order.set(100, 1);
        assert!(order.rays(0).iter().copied().eq(0..100));
        order.set(100, 100);
        let walk = (0..100).map(|bin| order.rays(bin)[0]);
        assert!(walk.take(20).eq((0..10).chain((10..20).rev())));
    }

    #[test]
    fn no_rays_are_no_bins() {
        let mut order = DirectionBins::new();
        order.set(0, 10);
        assert!(order.is_empty());
    }
}
