//! Flux of indirect light through the cells of the hemisphere, estimated from the nearest photons, and the
//! direction tables that follow from it.
//!
//! Photons straight from a light are excluded, because shadow rays account for that light. With k = 100
//! photons, only a few pass through each cell, and the flux of a cell is estimated with a relative error of
//! about one half. Where light comes from all around, a table of these estimates would add more variance than
//! it removes. The estimates are therefore shrunk towards their mean (James, Stein 1961, *Estimation with
//! quadratic loss*) by the factor `max(0, 1 - noise / spread)`: `spread` is the sum of squared deviations,
//! `noise` its expectation for uniform flux, given the photons' number and powers. Pure noise thus gives all
//! cells the same flux; light through few cells keeps its distribution.

use glam::Vec3;
use photoncard_shared::layout::decode_direction;
use photoncard_shared::message::Sampling;

use super::cell_of;
use super::focus::{Directions, FOCI, Focus};
use super::hemisphere::CELLS;
use super::table::DirectionTable;
use crate::fixed_point::Sum;
use crate::photon::{NearestPhotons, SameSurface};
use crate::sampler::radical_inverse;
use crate::scene::Reflector;
use crate::vector::{max, unit};

/// Fraction of the flux in a product table that is spread evenly over the cells (defensive sampling). Light
/// varies within a cell, and may come through a cell without photons. The even part bounds the weight of a
/// ray by about twice the albedo, and with foci by five times. `docs/techniques.md` has the measurement.
const EVEN_SHARE: f32 = 0.55;
/// Maximum share of a focus, as a multiple of its cell's.
const FOCUSED: f32 = 4.0;
/// Minimum flux of a cell in a photon table, as a fraction of the mean flux (Jensen 1995).
const EMPTY_CELL: f32 = 0.1;
/// Number of directions sampled from the lobe to distribute it over the cells.
const LOBE_POINTS: u32 = 32;
/// Sharpness ([`Reflector::lobe_sharpness`]) of a lobe with about the solid angle of two cells. In a product
/// table, the cells get half of the light that such a lobe reflects, and the lobe's own entry gets the other
/// half.
const HALF_HELD_SHARPNESS: f32 = 16.0;
/// Minimum share of the rays for the lobe's own entry, as a multiple of
/// `lobe albedo / (diffuse albedo + lobe albedo)`, of the rays that foci leave.
const LOBE_PART: f32 = 0.25;

/// Flux through the cells of the hemisphere: photon power weighted by a colour, in photon power units.
#[derive(Default)]
pub struct IncidentFlux {
    cells: [Sum; CELLS],
    /// Directions of the photons of each cell, for foci.
    directions: [Directions; CELLS],
    /// Sum of the squared photon powers.
    squares: Sum,
}

impl IncidentFlux {
    /// Flux of the nearest photons on the point's surface, without photons straight from a light. `colour`,
    /// at most about 1, weights the channels of their power. `normal` is the shading normal, the axis of the
    /// hemisphere; `normal_code` is the code of the geometric normal, by which photons of the surface are
    /// recognised.
    pub fn new(
        nearest: &NearestPhotons,
        sampling: Sampling,
        normal: Vec3,
        normal_code: u8,
        colour: Vec3,
    ) -> Self {
        let mut flux = Self::default();
        let mut same_surface = SameSurface::new(normal_code);
        for photon in nearest.candidates() {
            if photon.is_direct() || !same_surface.holds(photon.normal()) {
                continue;
            }
            let direction = unit(decode_direction(photon.direction()).into());
            // Light from below the surface reaches no cell of the hemisphere.
            let Some(cell) = cell_of(normal, direction) else { continue };
            let power = Vec3::from_array(photon.power().decode()).dot(colour);
            if let Some(sum) = flux.cells.get_mut(cell as usize) {
                sum.add(power);
                flux.squares.add(power * power);
            }
            if sampling == Sampling::Focused
                && let Some(directions) = flux.directions.get_mut(cell as usize)
            {
                directions.add(direction, power);
            }
        }
        flux
    }

    /// Flux of each cell; 1 for all cells if there is no flux.
    fn raw(&self) -> [f32; CELLS] {
        let cells = self.cells.map(Sum::value);
        if cells.iter().any(|&cell| cell > 0.0) { cells } else { [1.0; CELLS] }
    }

    /// Flux of each cell, shrunk towards the mean by the module's formula.
    fn shrunk(&self) -> [f32; CELLS] {
        let cells = self.raw();
        let mean = mean(&cells);
        let spread: f32 = cells.iter().map(|cell| (cell - mean) * (cell - mean)).sum();
        let noise = self.squares.value() * (1.0 - 1.0 / CELLS as f32);
        let known = if spread > 0.0 { max(1.0 - noise / spread, 0.0) } else { 0.0 };
        cells.map(|cell| mean + known * (cell - mean))
    }

    /// Foci of the cells with the greatest shares of foci, and these shares in the units of `shares`. A cell
    /// that is not much brighter than others has a small one.
    fn foci(&self, shares: &Shares) -> [(Focus, f32); FOCI] {
        let mut foci = [(Focus::NONE, 0.0_f32); FOCI];
        let cells = self.cells.iter().zip(&self.directions).zip(shares.cells.iter().zip(&shares.uneven));
        for ((power, directions), (share, uneven)) in cells {
            let Some((focus, certainty)) = directions.focus(power.value()) else { continue };
            let share = FOCUSED * certainty * uneven * uneven * uneven * share;
            let least = foci.iter_mut().min_by(|(_, a), (_, b)| a.total_cmp(b));
            if let Some(least) = least.filter(|(_, least)| share > *least) {
                *least = (focus, share);
            }
        }
        foci
    }

    /// Direction table of the sampling method `sampling`. The reflection must not be black.
    pub fn table(&self, sampling: Sampling, reflector: &Reflector) -> DirectionTable {
        match sampling {
            Sampling::Reflection => DirectionTable::of_reflection(reflector),
            Sampling::Photon => {
                let cells = self.raw();
                let least = EMPTY_CELL * mean(&cells);
                DirectionTable::new(&cells.map(|cell| max(cell, least)), 0.0)
            }
            // `Product` sums no directions, and so has no foci.
            Sampling::Product | Sampling::Focused => {
                let shares = product(&self.shrunk(), reflector);
                DirectionTable::with_foci(&shares.cells, shares.lobe, &self.foci(&shares))
            }
            Sampling::Mixture => mixture(&self.shrunk(), reflector),
        }
    }
}

impl DirectionTable {
    /// Direction table that depends on the reflection only, not on photons.
    pub fn of_reflection(reflector: &Reflector) -> Self {
        let [diffuse, lobe] = reflector.albedos();
        Self::new(&[diffuse * (1.0 / CELLS as f32); CELLS], lobe)
    }
}

fn mean(cells: &[f32; CELLS]) -> f32 {
    cells.iter().sum::<f32>() * (1.0 / CELLS as f32)
}

/// Shares of a product table.
struct Shares {
    cells: [f32; CELLS],
    /// Fraction of each cell's share that is not spread evenly over the cells.
    uneven: [f32; CELLS],
    lobe: f32,
}

/// Shares of a product table, in proportion to flux times reflection. The light that the lobe reflects is
/// divided between the cells and the lobe's own entry. For a lobe narrower than two cells, most of it goes to
/// that entry.
fn product(flux: &[f32; CELLS], reflector: &Reflector) -> Shares {
    let [diffuse, specular] = reflector.albedos();
    let even = EVEN_SHARE * mean(flux);
    let flux = flux.map(|flux| even + (1.0 - EVEN_SHARE) * flux);
    let uneven = flux.map(|flux| 1.0 - even / flux);
    let mut cells = flux.map(|flux| flux * diffuse);
    if specular <= 0.0 {
        return Shares { cells, uneven, lobe: 0.0 };
    }
    let held = HALF_HELD_SHARPNESS / (HALF_HELD_SHARPNESS + reflector.lobe_sharpness());
    let mut lobe = 0.0;
    let scale = specular * (CELLS as f32 / LOBE_POINTS as f32);
    for (cell, direction) in lobe_points(reflector) {
        let (Some(reflected), Some(flux)) = (cells.get_mut(cell as usize), flux.get(cell as usize)) else {
            continue;
        };
        // Reflected flux at the sampled direction, weighted by f / p.
        let cosine = reflector.normal.dot(direction);
        let brought = scale * flux * cosine * reflector.lobe_gain(direction);
        *reflected += held * brought;
        lobe += (1.0 - held) * brought;
    }
    let all: f32 = cells.iter().sum::<f32>() + lobe;
    let least = LOBE_PART * specular / (diffuse + specular) * all;
    Shares { cells, uneven, lobe: max(lobe, least) }
}

/// Directions sampled from the lobe, each with its cell. Directions below the shading horizon are omitted.
fn lobe_points(reflector: &Reflector) -> impl Iterator<Item = (u8, Vec3)> {
    (0..LOBE_POINTS).filter_map(move |index| {
        let point = [radical_inverse(index), (index as f32 + 0.5) / LOBE_POINTS as f32];
        let direction = reflector.sample_lobe(point);
        cell_of(reflector.normal, direction).map(|cell| (cell, direction))
    })
}

/// Table that draws half of the rays from the reflection and half from the flux.
fn mixture(flux: &[f32; CELLS], reflector: &Reflector) -> DirectionTable {
    let all: f32 = flux.iter().sum();
    let diffuse_share = reflector.diffuse_share();
    let even = diffuse_share * (1.0 / CELLS as f32);
    DirectionTable::new(&flux.map(|flux| 0.5 * (even + flux / all)), 0.5 * (1.0 - diffuse_share))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Reflection;

    fn flux_of(cells: [f32; CELLS], photons: u32) -> IncidentFlux {
        let all: f32 = cells.iter().sum();
        let mut flux = IncidentFlux::default();
        flux.cells.iter_mut().zip(cells).for_each(|(sum, cell)| sum.add(cell));
        flux.squares.add(all * all / photons as f32);
        flux
    }

    #[test]
    fn flux_whose_spread_is_noise_is_shrunk_to_the_mean() {
        let mut cells = [1.0; CELLS];
        cells[3] = 1.5;
        cells[20] = 0.5;
        let shrunk = flux_of(cells, 100).shrunk();
        assert!(shrunk.iter().all(|cell| (cell - 1.0).abs() < 1e-6), "{shrunk:?}");
    }

    #[test]
    fn light_from_one_cell_keeps_its_cell() {
        let mut cells = [0.0; CELLS];
        cells[7] = 1.0;
        let shrunk = flux_of(cells, 100).shrunk();
        assert!(shrunk[7] > 0.98 && shrunk[8] > 0.0, "{shrunk:?}");
    }

    #[test]
    fn a_lobe_in_the_dark_gets_few_rays_and_a_lobe_in_the_light_many() {
        let reflector = |exponent| Reflector {
            geometric_normal: Vec3::Y,
            normal: Vec3::Y,
            outgoing: Vec3::Y,
            reflection: Reflection::phong(Vec3::splat(0.3), Vec3::splat(0.3), exponent),
        };
        // The first row is around the normal, where the lobe points.
        let mut bright = [0.1; CELLS];
        bright[..8].fill(1.0);
        let mut dark = [1.0; CELLS];
        dark[..8].fill(0.01);
        for exponent in [50.0, 1000.0] {
            let share = |flux: &[f32; CELLS]| {
                let Shares { cells, lobe, .. } = product(flux, &reflector(exponent));
                let table = DirectionTable::new(&cells, lobe);
                let density = table.density(&reflector(exponent), Vec3::Y);
                density / DirectionTable::COSINE.density(&reflector(exponent), Vec3::Y)
            };
            assert!(share(&bright) > 1.5 * share(&dark), "{} {}", share(&bright), share(&dark));
        }
    }
}
