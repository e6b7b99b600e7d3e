//! Direction table of a gather point: the shares of its gather rays by direction.

use core::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::focus::{FOCI, Focus};
use super::hemisphere::{CELLS, direction_in};
use super::{GatherDirection, cell_of};
use crate::sampler::Pattern;
use crate::scene::Reflector;
use crate::vector::max;

/// Number of entries of a table: the cells of the hemisphere in their order, then the lobe with the foci.
pub const ENTRIES: usize = CELLS + 1;

/// Index of the entry of the lobe and the foci.
const AIMED: usize = CELLS;

/// Shares of a gather point's rays: one for each cell of the hemisphere, one for the rays sampled from the
/// lobe, and one for each focus; 50 bytes. The shares are integers, so that densities are exact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DirectionTable {
    cells: [u8; CELLS],
    lobe: u16,
    foci: [Focus; FOCI],
}

const _: () = assert!(size_of::<DirectionTable>() == 50);

/// Entry of the table that a ray is sampled from, with the lobe and the foci apart.
enum Source {
    Cell(u8),
    Lobe,
    Focus(Focus),
}

impl Default for DirectionTable {
    fn default() -> Self {
        Self::COSINE
    }
}

impl DirectionTable {
    /// Table with equal cells: the density `cos(theta) / pi`.
    pub const COSINE: Self = Self { cells: [1; CELLS], lobe: 0, foci: [Focus::NONE; FOCI] };

    /// Creates a table without foci, whose shares are in proportion to `cells` and `lobe`. These must be
    /// finite and not negative. If any cell is positive, every cell gets a share.
    pub(super) fn new(cells: &[f32; CELLS], lobe: f32) -> Self {
        Self::with_foci(cells, lobe, &[(Focus::NONE, 0.0); FOCI])
    }

    /// Creates a table as [`Self::new`], with foci and their shares.
    #[inline(never)]
    pub(super) fn with_foci(cells: &[f32; CELLS], lobe: f32, foci: &[(Focus, f32); FOCI]) -> Self {
        let shares = cells.iter().chain(foci.iter().map(|(_, share)| share));
        let greatest = shares.fold(0.0, |greatest, &share| max(share, greatest));
        if greatest <= 0.0 {
            return if lobe > 0.0 {
                Self { cells: [0; CELLS], lobe: 1, ..Self::COSINE }
            } else {
                Self::COSINE
            };
        }
        let scale = u8::MAX as f32 / greatest;
        let cells = cells.map(|cell| ((cell * scale + 0.5) as u8).max(1));
        // The conversion saturates.
        let lobe = if lobe > 0.0 { ((lobe * scale + 0.5) as u16).max(1) } else { 0 };
        let foci = foci.map(|(mut focus, share)| {
            focus.share = (share * scale + 0.5) as u8;
            focus
        });
        Self { cells, lobe, foci }
    }

    /// Share of the lobe and the foci.
    #[inline(always)]
    fn aimed(&self) -> u32 {
        self.lobe as u32 + self.foci.iter().map(|focus| focus.share as u32).sum::<u32>()
    }

    #[inline(always)]
    fn total(&self) -> u32 {
        sum(&self.cells) + self.aimed()
    }

    /// Fraction of all rays that belong to a cell's entry. Rays of the lobe and of foci that pass through the
    /// cell are not included.
    pub(crate) fn cell_share(&self, cell: usize) -> f32 {
        self.cells.get(cell).map_or(0.0, |&share| share as f32) / self.total() as f32
    }

    #[inline(always)]
    fn share(&self, entry: usize) -> u32 {
        self.cells.get(entry).map_or_else(|| self.aimed(), |&share| share as u32)
    }

    /// Sum of the shares of all entries before `entry`.
    #[inline(always)]
    fn before(&self, entry: usize) -> u32 {
        let cells = self.cells.get(..entry.min(CELLS)).unwrap_or_default();
        sum(cells) + if entry > AIMED { self.aimed() } else { 0 }
    }

    /// Index of the first ray, out of `count` rays, in direction bin `bin` or a later bin; `count` if there
    /// is none. The `bins` bins divide the sequence of entries into equal parts, so that the rays of a bin
    /// are consecutive.
    ///
    /// `count` is at most [`MAX_GATHER_RAYS`](photoncard_shared::budget::MAX_GATHER_RAYS), `bins` at most
    /// [`MAX_BINS`](photoncard_shared::budget::MAX_BINS).
    #[inline(always)]
    pub fn first_ray(&self, pattern: Pattern, count: u32, bin: u32, bins: u32) -> u32 {
        if bin == 0 || bins == 0 {
            return 0;
        }
        let place = bin * ENTRIES as u32;
        let (entry, part) = ((place / bins) as usize, place % bins);
        // The total is at least 1 in every table, which the compiler cannot prove.
        let total = (self.total() * bins).max(1);
        // Sum of the shares before the bin, times `bins`, so that it is an integer.
        let beginning = self.before(entry) * bins + self.share(entry) * part;
        first_ray(pattern, count, beginning, total)
    }

    /// Direction bin of ray `index` out of `count` rays, from 0 to `bins - 1`.
    #[inline(always)]
    pub fn bin(&self, pattern: Pattern, index: u32, count: u32, bins: u32) -> u32 {
        if bins <= 1 {
            return 0;
        }
        let Place { entry, offset, size } = self.place(pattern, index, count);
        // Index of the part that contains the ray when the entry is divided into `bins` parts. It is
        // estimated in `f32` to within 1 and corrected, because a division of 64-bit integers takes long.
        let mut part = (self::part(offset, size) * bins as f32) as u32;
        let begins = |part: u32| part as u64 * size <= offset * bins as u64;
        if !begins(part) {
            part = part.saturating_sub(1);
        } else if begins(part + 1) {
            part += 1;
        }
        (entry as u32 * bins + part) / ENTRIES as u32
    }

    /// Position of ray `index` of `count` in the sequence of entries.
    #[inline(always)]
    fn place(&self, pattern: Pattern, index: u32, count: u32) -> Place {
        let target = stratum_point(pattern, index) * self.total() as u64;
        // Number of the share that contains the ray, below the sum of the shares. Entries end at whole
        // shares, so that the position within the share does not matter.
        let shares = (target >> JITTER_BITS) as u32 / count.max(1);
        let (entry, before) = self.entry_at(shares);
        let [before, size] = [before, self.share(entry)].map(|shares| shares as u64 * whole(count));
        Place { entry, offset: target - before, size }
    }

    /// Entry that contains share number `shares`, and the sum of the shares before that entry.
    #[inline(always)]
    fn entry_at(&self, shares: u32) -> (usize, u32) {
        let (mut first, mut before) = (0, 0);
        for word in self.cells.as_chunks::<4>().0 {
            let with_word = before + sum(word);
            if shares < with_word {
                break;
            }
            (first, before) = (first + word.len(), with_word);
        }
        for (cell, &share) in self.cells.iter().enumerate().skip(first) {
            if shares < before + share as u32 {
                return (cell, before);
            }
            before += share as u32;
        }
        (AIMED, before)
    }

    /// Source of ray `index` of `count`, and the ray's two coordinates in [0, 1] within it, in the order of
    /// [`direction_in`].
    #[inline(always)]
    fn source(&self, pattern: Pattern, index: u32, count: u32) -> (Source, [f32; 2]) {
        let Place { entry, mut offset, mut size } = self.place(pattern, index, count);
        let mut source = Source::Cell(entry as u8);
        if entry == AIMED {
            source = Source::Lobe;
            size = self.lobe as u64 * whole(count);
            let mut foci = self.foci.iter();
            while offset >= size
                && let Some(&focus) = foci.next()
            {
                offset -= size;
                size = focus.share as u64 * whole(count);
                source = Source::Focus(focus);
            }
        }
        (source, [part(offset, size), pattern.radical_inverse(index)])
    }

    /// Number of rays, out of `count`, that each cell's entry gets. Rays of the lobe and of foci are not
    /// included.
    pub fn rays_in_cells(&self, pattern: Pattern, count: u32) -> [u16; CELLS] {
        let mut rays = [0; CELLS];
        for index in 0..count {
            let Place { entry, .. } = self.place(pattern, index, count);
            if let Some(rays) = rays.get_mut(entry) {
                *rays += 1;
            }
        }
        rays
    }

    /// Samples the direction of ray `index` of `count`; `None` if it lies below the surface.
    #[inline(always)]
    pub fn sample(
        &self,
        reflector: &Reflector,
        pattern: Pattern,
        index: u32,
        count: u32,
    ) -> Option<GatherDirection> {
        let (source, point) = self.source(pattern, index, count);
        let Reflector { normal, .. } = reflector;
        let [along, across] = point;
        let direction = match source {
            Source::Cell(cell) => direction_in(*normal, cell, point),
            Source::Lobe => reflector.sample_lobe([across, along]),
            Source::Focus(focus) => focus.sample(point),
        };
        let cosine = normal.dot(direction);
        // The cell is that of the entry, because the rounded direction may lie in another cell.
        let cell = if let Source::Cell(cell) = source { cell } else { cell_of(*normal, direction)? };
        if cosine <= 0.0 {
            return None;
        }
        let (value, lobe_density) = reflector.sampled(direction);
        let density = self.mixture_density(cell, cosine, lobe_density) + self.focused_density(direction);
        let weight = value * (cosine / density);
        (density > 0.0).then_some(GatherDirection { direction, weight, density, cell })
    }

    /// Probability density, 1/sr, with which `sample` returns a direction above the surface.
    #[inline(always)]
    pub fn density(&self, reflector: &Reflector, direction: Vec3) -> f32 {
        let Some(cell) = cell_of(reflector.normal, direction) else { return 0.0 };
        let cosine = reflector.normal.dot(direction);
        self.mixture_density(cell, cosine, reflector.lobe_density(direction))
            + self.focused_density(direction)
    }

    #[inline(always)]
    fn mixture_density(&self, cell: u8, cosine: f32, lobe_density: f32) -> f32 {
        let per_share = 1.0 / self.total() as f32;
        let cell_share = self.share(cell as usize) as f32 * per_share;
        let lobe_share = self.lobe as f32 * per_share;
        cell_share * CELLS as f32 * FRAC_1_PI * cosine + lobe_share * lobe_density
    }

    /// Part of the density that is that of the foci, 1/sr.
    #[inline(always)]
    fn focused_density(&self, direction: Vec3) -> f32 {
        if self.aimed() == self.lobe as u32 { 0.0 } else { self.density_of_foci(direction) }
    }

    #[inline(never)]
    fn density_of_foci(&self, direction: Vec3) -> f32 {
        let of = |focus: &Focus| focus.share as f32 * focus.density(direction);
        let density: f32 = self.foci.iter().filter(|focus| focus.share > 0).map(of).sum();
        density / self.total() as f32
    }
}

/// Position of a ray in the sequence of entries: the entry, the offset in the entry, and the size of the
/// entry. One share is `whole(count)` units long.
struct Place {
    entry: usize,
    offset: u64,
    size: u64,
}

/// Number of bits of a point's offset in its stratum.
const JITTER_BITS: u32 = 24;

/// Length of all `count` strata together, `2^JITTER_BITS` each.
#[inline(always)]
fn whole(count: u32) -> u64 {
    (count as u64) << JITTER_BITS
}

/// Position of a ray's point on the line of all strata, each `2^JITTER_BITS` long.
#[inline(always)]
fn stratum_point(pattern: Pattern, index: u32) -> u64 {
    (index as u64) << JITTER_BITS | jitter(pattern, index) as u64
}

/// Offset of a ray's point in its stratum.
#[inline(always)]
fn jitter(pattern: Pattern, index: u32) -> u32 {
    pattern.jitter(index) >> (u32::BITS - JITTER_BITS)
}

/// Index of the first of `count` rays at or after the fraction `beginning / total` of the sequence of
/// entries. Both numbers are at most 2^25.
#[inline(always)]
fn first_ray(pattern: Pattern, count: u32, beginning: u32, total: u32) -> u32 {
    let (ray, remainder) = divide([beginning, count], total);
    // The share begins with a stratum: no ray of this stratum is before it.
    if remainder == 0 {
        return ray;
    }
    let is_before = jitter(pattern, ray) as u64 * (total as u64) < (remainder as u64) << JITTER_BITS;
    ray + u32::from(is_before)
}

/// Quotient and remainder of `a b / divisor`. The quotient is below 2^20, the divisor at most 2^25. The
/// quotient is estimated in `f32`, to within 1, and corrected, because 32-bit processors need hundreds of
/// instructions for a 64-bit division.
#[inline(always)]
fn divide([a, b]: [u32; 2], divisor: u32) -> (u32, u32) {
    let estimate = (a as f32 * b as f32 / divisor as f32) as u32;
    // In the interval [-divisor, 2 divisor).
    let remainder = (a as u64 * b as u64).wrapping_sub(estimate as u64 * divisor as u64) as i32;
    if remainder < 0 {
        (estimate - 1, remainder.wrapping_add(divisor as i32) as u32)
    } else if remainder as u32 >= divisor {
        (estimate + 1, remainder as u32 - divisor)
    } else {
        (estimate, remainder as u32)
    }
}

/// Sum of shares, computed four at a time.
#[inline(always)]
fn sum(shares: &[u8]) -> u32 {
    let (words, rest) = shares.as_chunks::<4>();
    let pairs = words.iter().fold(0, |pairs, &word| {
        let word = u32::from_le_bytes(word);
        // There are at most eight words, so that no 16-bit half overflows.
        pairs + (word & 0x00ff_00ff) + (word >> 8 & 0x00ff_00ff)
    });
    (pairs & 0xffff) + (pairs >> 16) + rest.iter().map(|&share| share as u32).sum::<u32>()
}

#[inline(always)]
fn part(of: u64, size: u64) -> f32 {
    of as f32 / size.max(1) as f32
}

#[cfg(test)]
mod tests {
    use core::f32::consts::PI;

    use photoncard_shared::budget::MAX_GATHER_RAYS;

    use super::super::focus::Directions;
    use super::*;
    use crate::sampler::Dimension;
    use crate::scene::Reflection;

    fn pattern(seed: u32) -> Pattern {
        Pattern::new(seed, 3, 4, 0, Dimension::Gather)
    }

    fn reflector(diffuse: f32, specular: f32, exponent: f32, outgoing: Vec3) -> Reflector {
        let reflection = Reflection::phong(Vec3::splat(diffuse), Vec3::splat(specular), exponent);
        Reflector { normal: Vec3::Y, geometric_normal: Vec3::Y, outgoing: outgoing.normalize(), reflection }
    }

    /// A table with pseudo-random shares of the cells, 1 to 255, and a lobe.
    fn uneven(seed: u32, lobe: f32) -> DirectionTable {
        let mut cells = [0.0; CELLS];
        for (cell, share) in cells.iter_mut().enumerate() {
            *share = (crate::sampler::hash(seed * 64 + cell as u32) % 1000) as f32;
        }
        DirectionTable::new(&cells, lobe)
    }

    /// A table with pseudo-random shares of the cells and of foci about directions above `Y` and close to its
    /// horizon, one of them without a share.
    fn focused(seed: u32, lobe: f32) -> DirectionTable {
        let mut foci = [(Focus::NONE, 0.0); FOCI];
        for (index, (focus, share)) in foci.iter_mut().enumerate() {
            let [x, z] = [index as f32 - 1.5, 1.0 - index as f32];
            let mut directions = Directions::default();
            let near = (0..20).map(|i| Vec3::new(x, 0.2 + index as f32, z + 0.02 * i as f32).normalize());
            near.for_each(|direction| directions.add(direction, 1.0));
            *focus = directions.focus(20.0).expect("a focus").0;
            *share = if index == 1 { 0.0 } else { 700.0 * index as f32 + 300.0 };
        }
        let cells = uneven(seed, 0.0).cells.map(f32::from);
        DirectionTable::with_foci(&cells.map(|cell| 3.0 * cell), lobe, &foci)
    }

    #[test]
    fn bins_follow_the_rays_and_hold_only_rays_of_their_entries() {
        for seed in 0..20 {
            let lobe = 2000.0 * (seed % 3) as f32;
            let table = if seed % 2 == 0 { uneven(seed, lobe) } else { focused(seed, lobe) };
            for (count, bins) in [(100, 33), (7, 33), (200, 66), (1, 256), (256, 11), (5000, 100)] {
                let mut last = 0;
                for ray in 0..count {
                    let bin = table.bin(pattern(seed), ray, count, bins);
                    for begun in last + 1..=bin {
                        assert_eq!(table.first_ray(pattern(seed), count, begun, bins), ray);
                    }
                    assert!(last <= bin && bin < bins);
                    last = bin;
                    let Place { entry, offset, size } = table.place(pattern(seed), ray, count);
                    let place = (entry as f32 + part(offset, size)) * bins as f32 / ENTRIES as f32;
                    assert!(place > bin as f32 - 1e-3 && place < bin as f32 + 1.001, "{place} {bin}");
                }
                assert_eq!(table.first_ray(pattern(seed), count, 0, bins), 0);
                for empty in last + 1..bins {
                    assert_eq!(table.first_ray(pattern(seed), count, empty, bins), count);
                }
            }
        }
    }

    #[test]
    fn divide_agrees_with_integer_division() {
        for seed in 0..100_000 {
            let divisor = crate::sampler::hash(seed) % (1 << 25) + 1;
            let beginning = crate::sampler::hash(seed + 1_000_000) % (divisor + 1);
            let count = crate::sampler::hash(seed + 2_000_000) % (MAX_GATHER_RAYS + 1);
            // Multiples of the divisor, and their neighbours, too.
            let multiple = divisor * (beginning % 64);
            for factors in
                [[beginning, count], [multiple, 1], [multiple + 1, 1], [multiple.saturating_sub(1), 1]]
            {
                let [a, b] = factors.map(u64::from);
                let expected = (a * b / divisor as u64, a * b % divisor as u64);
                let (quotient, remainder) = divide(factors, divisor);
                assert_eq!((quotient as u64, remainder as u64), expected, "{factors:?} / {divisor}");
            }
        }
    }

    #[test]
    fn an_entry_gets_its_share_of_the_rays() {
        let table = uneven(5, 1500.0);
        let rays = table.rays_in_cells(pattern(1), 10_000);
        for (cell, &rays) in rays.iter().enumerate() {
            let expected = 10_000.0 * table.share(cell) as f32 / table.total() as f32;
            assert!((rays as f32 - expected).abs() < 2.0, "{cell}: {rays} of {expected}");
        }
    }

    /// Mean weight of a direction over many patterns.
    fn mean_weight(table: &DirectionTable, reflector: &Reflector) -> f32 {
        let [patterns, count] = [50, 2000];
        let rays = (0..patterns).flat_map(|seed| (0..count).map(move |index| (seed, index)));
        let weights = rays.filter_map(|(seed, index)| table.sample(reflector, pattern(seed), index, count));
        (weights.map(|sampled| sampled.weight.x as f64).sum::<f64>() / (patterns * count) as f64) as f32
    }

    #[test]
    fn the_mean_weight_is_the_albedo_whatever_the_shares() {
        let lambertian = reflector(0.7, 0.0, 0.0, Vec3::new(1.0, 1.0, 0.0));
        assert!((mean_weight(&DirectionTable::COSINE, &lambertian) - 0.7).abs() < 1e-5);
        for seed in 0..5 {
            for table in [uneven(seed, 0.0), focused(seed, 0.0)] {
                let mean = mean_weight(&table, &lambertian);
                assert!((mean - 0.7).abs() < 4e-3, "{mean}");
            }
        }
        // The integral of (n + 2) / (2 pi) cos^n cos is 1 where the lobe's axis is the normal.
        for exponent in [1.0, 8.0, 128.0, 1000.0] {
            for lobe in [3000.0, 30_000.0] {
                for table in [uneven(3, lobe), focused(3, lobe)] {
                    let mean = mean_weight(&table, &reflector(0.4, 0.35, exponent, Vec3::Y));
                    assert!((mean - 0.75).abs() < 5e-3, "{exponent}: {mean}");
                }
            }
        }
        let without_lobe = mean_weight(&uneven(4, 0.0), &reflector(0.4, 0.35, 8.0, Vec3::Y));
        assert!((without_lobe - 0.75).abs() < 5e-3, "{without_lobe}");
    }

    /// The reflector on a triangle with another normal, so that a part of the lobe lies below the triangle.
    fn on_another_triangle(reflector: Reflector) -> Reflector {
        Reflector { geometric_normal: Vec3::new(-0.5, 1.0, 0.2).normalize(), ..reflector }
    }

    #[test]
    fn the_density_of_a_sampled_direction_is_the_one_it_was_sampled_with() {
        let flat = reflector(0.3, 0.5, 20.0, Vec3::new(2.0, 1.0, 0.5));
        let tilted = on_another_triangle(reflector(0.3, 0.5, 20.0, Vec3::new(-2.0, 1.0, 0.5)));
        let tables = [uneven(9, 4000.0), focused(9, 4000.0)];
        for (reflector, table) in [flat, tilted].into_iter().flat_map(|r| tables.map(|table| (r, table))) {
            let mut others = 0;
            for index in 0..1000 {
                let Some(sampled) = table.sample(&reflector, pattern(1), index, 1000) else { continue };
                let density = table.density(&reflector, sampled.direction);
                // Near the border of two cells, rounding of the direction may select the other cell.
                others += u32::from((density / sampled.density - 1.0).abs() > 1e-4);
            }
            assert!(others <= 2, "{others}");
        }
    }

    #[test]
    fn the_density_above_the_triangle_integrates_to_the_fraction_of_directions_there() {
        let flat = reflector(0.3, 0.5, 20.0, Vec3::new(0.2, 1.0, 0.1));
        let tilted = on_another_triangle(reflector(0.3, 0.5, 20.0, Vec3::new(-1.0, 1.0, 0.1)));
        let tables = [uneven(2, 4000.0), focused(2, 4000.0)];
        for (reflector, table) in [flat, tilted].into_iter().flat_map(|r| tables.map(|table| (r, table))) {
            let is_above = |direction: Vec3| reflector.geometric_normal.dot(direction) > 0.0;
            let side = 1000;
            let mut integral = 0.0_f64;
            for i in 0..side {
                for j in 0..2 * side {
                    let cosine = (i as f32 + 0.5) / side as f32;
                    let azimuth = (j as f32 + 0.5) * PI / side as f32;
                    let sine = (1.0 - cosine * cosine).sqrt();
                    let direction = Vec3::new(sine * libm::cosf(azimuth), cosine, sine * libm::sinf(azimuth));
                    let solid_angle = PI / (side * side) as f32;
                    if is_above(direction) {
                        integral += (table.density(&reflector, direction) * solid_angle) as f64;
                    }
                }
            }
            let rays = (0..10_000).filter_map(|index| table.sample(&reflector, pattern(1), index, 10_000));
            let above = rays.filter(|sampled| is_above(sampled.direction)).count() as f64 / 10_000.0;
            assert!((integral - above).abs() < 5e-3, "{integral} {above}");
        }
    }

    #[test]
    fn no_cell_is_empty_unless_all_are() {
        let mut cells = [0.0; CELLS];
        cells[3] = 1e6;
        assert!(DirectionTable::new(&cells, 0.0).cells.iter().all(|&share| share >= 1));
        assert_eq!(DirectionTable::new(&[0.0; CELLS], 0.0), DirectionTable::COSINE);
        assert_eq!(DirectionTable::new(&[0.0; CELLS], 1.0).share(AIMED), 1);
    }
}
