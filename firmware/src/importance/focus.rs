//! Foci: cones about the photons of a cell of the hemisphere, through which much of the cell's light comes.
//!
//! Light that a small bright surface reflects comes through a small part of a cell, which few rays of the
//! cell meet. Photons from there have nearly the same direction. The mean `m` of the `n` directions of a
//! cell, weighted by power, has a length below 1. Their spread is the mean of `1 - cos` about the direction
//! of `m`, which is `1 - |m|`, times `n / (n - 1)` for the freedom of the mean. The density in a focus falls
//! linearly in `1 - cos` from its axis to zero at `height`, so that the mean of `1 - cos` is `height / 3`.
//! A focus may reach beyond its cell, and below the horizon, where its rays are lost.

use core::f32::consts::TAU;

use glam::Vec3;
use photoncard_shared::layout::{decode_direction, encode_direction};

use crate::fixed_point::Sum;
use crate::vector::{about, max, sqrt, unit};

/// Number of foci of a direction table.
pub(super) const FOCI: usize = 4;

/// Minimum number of photons of a focus, weighted by their power.
const MIN_PHOTONS: f32 = 5.0;
/// Spread from which a focus has no rays. Directions that fill a cell have spreads of 0.01 around the normal
/// to 0.03 at the horizon, so that a cell that is far brighter than others is a focus as a whole.
const MAX_SPREAD: f32 = 0.06;
/// Certainty that a focus of `n` photons lacks, as a multiple of `1 / sqrt(n)`.
const DOUBT: f32 = 1.0;
/// Height of a focus divided by the spread of its directions, for the density of [`Focus::density`].
const HEIGHT_OF_SPREAD: f32 = 3.0;
/// Minimum height: about the step between the directions of photons.
const MIN_HEIGHT: f32 = 0.002;
/// Code of the height 1. Codes are square roots, about half-angles.
const WIDTH_STEPS: f32 = 255.0;

/// Cone around directions of photons, and its share of a gather point's rays; 4 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Focus {
    axis: [u8; 2],
    width: u8,
    /// Share of the rays, in the units of the table; 0 for no focus.
    pub(super) share: u8,
}

impl Focus {
    pub(super) const NONE: Self = Self { axis: [0; 2], width: 1, share: 0 };

    fn new(axis: Vec3, spread: f32) -> Self {
        let height = max(HEIGHT_OF_SPREAD * spread, MIN_HEIGHT);
        // The conversion saturates.
        let width = (sqrt(height) * WIDTH_STEPS + 0.5) as u8;
        Self { axis: encode_direction(axis.to_array()), width, share: 0 }
    }

    #[inline(always)]
    fn axis(self) -> Vec3 {
        unit(decode_direction(self.axis).into())
    }

    #[inline(always)]
    fn height(self) -> f32 {
        let root = self.width as f32 * (1.0 / WIDTH_STEPS);
        root * root
    }

    /// Maps a point of the unit square to a direction of the focus, with the density [`Self::density`].
    #[inline(never)]
    pub(super) fn sample(self, [along, across]: [f32; 2]) -> Vec3 {
        let height = self.height() * (1.0 - sqrt(max(1.0 - across, 0.0)));
        let sine = sqrt(max(height * (2.0 - height), 0.0));
        about(self.axis(), TAU * along, sine, 1.0 - height)
    }

    /// Probability density of a direction, 1/sr.
    #[inline(always)]
    pub(super) fn density(self, direction: Vec3) -> f32 {
        let per_height = 1.0 / self.height();
        let part = (1.0 - self.axis().dot(direction)) * per_height;
        max(1.0 - part, 0.0) * per_height * (2.0 / TAU)
    }
}

/// Sums over the directions of a cell's photons, weighted by power.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Directions {
    sum: [Sum; 3],
    squares: Sum,
}

impl Directions {
    #[inline(always)]
    pub(super) fn add(&mut self, direction: Vec3, power: f32) {
        for (sum, component) in self.sum.iter_mut().zip((direction * power).to_array()) {
            sum.add(component);
        }
        self.squares.add(power * power);
    }

    /// Focus of a cell with the flux `power`, and its certainty, 0 to 1.
    #[inline(never)]
    pub(super) fn focus(&self, power: f32) -> Option<(Focus, f32)> {
        let photons = power * power / self.squares.value();
        // NaN in a cell without photons.
        if photons.is_nan() || photons < MIN_PHOTONS {
            return None;
        }
        let sum = Vec3::from_array(self.sum.map(Sum::value));
        let length = sqrt(sum.length_squared());
        let spread = max(1.0 - length / power, 0.0) * photons / (photons - 1.0);
        let certainty = 1.0 - spread / MAX_SPREAD - DOUBT / sqrt(photons);
        (certainty > 0.0).then(|| (Focus::new(sum, spread), certainty))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::importance::{CELLS, direction_in};
    use crate::sampler::{hash, radical_inverse, unit_interval};

    /// Focus of photons of equal power from the given directions.
    fn focus_of(directions: impl Iterator<Item = Vec3>) -> Option<(Focus, f32)> {
        let mut sums = Directions::default();
        let mut power = Sum::ZERO;
        for direction in directions {
            sums.add(direction, 0.5);
            power.add(0.5);
        }
        sums.focus(power.value())
    }

    /// Directions of `count` photons in a part of a cell, `part` of its length and of its width.
    fn in_part(cell: u8, part: f32, count: u32) -> impl Iterator<Item = Vec3> {
        (0..count).map(move |index| {
            let point = [unit_interval(hash(index)), radical_inverse(index)].map(|x| 0.5 + part * (x - 0.5));
            direction_in(Vec3::Y, cell, point)
        })
    }

    #[test]
    fn the_density_integrates_to_one_and_is_that_of_the_samples() {
        for spread in [0.0, 0.002, 0.02, 0.05] {
            let focus = Focus::new(Vec3::new(0.6, 0.8, 0.0), spread);
            let steps = 2000_u32;
            let mut integral = 0.0;
            for step in 0..steps {
                let height = focus.height() * (step as f32 + 0.5) / steps as f32;
                let sine = sqrt(height * (2.0 - height));
                let direction = about(focus.axis(), 1.0, sine, 1.0 - height);
                integral += focus.density(direction) * TAU * focus.height() / steps as f32;
            }
            assert!((integral - 1.0).abs() < 1e-3, "{spread}: {integral}");
            // With the density p, the mean of 1 / p is the solid angle of the cone.
            let samples = 10_000_u32;
            let inverse = (0..samples).map(|index| {
                let across = 0.999 * (index as f32 + 0.5) / samples as f32;
                1.0 / focus.density(focus.sample([radical_inverse(index), across]))
            });
            let angle = inverse.sum::<f32>() / samples as f32 * 0.999;
            let expected = TAU * focus.height() * (1.0 - sqrt(0.001));
            assert!((angle / expected - 1.0).abs() < 0.01, "{spread}: {angle} {expected}");
        }
    }

    #[test]
    fn photons_from_one_direction_have_a_narrow_focus_there() {
        let direction = Vec3::new(1.0, 2.0, -0.5).normalize();
        let (focus, known) = focus_of((0..50).map(|_| direction)).expect("a focus");
        assert!(focus.axis().dot(direction) > 0.9998 && focus.height() < 0.0025 && known > 0.8, "{focus:?}");
    }

    #[test]
    fn the_closer_photons_arrive_the_better_a_focus_is_known() {
        for cell in 0..CELLS as u8 {
            let known = |part: f32| focus_of(in_part(cell, part, 30)).map_or(0.0, |(_, known)| known);
            let [narrow, half, whole] = [known(0.1), known(0.5), known(1.0)];
            assert!(narrow > 0.78 && narrow > half && half > whole, "{cell}: {narrow} {half} {whole}");
        }
    }

    #[test]
    fn few_photons_and_wide_spreads_have_no_focus() {
        assert_eq!(focus_of(core::iter::empty()), None);
        assert_eq!(focus_of((0..4).map(|_| Vec3::Y)), None);
        assert_eq!(focus_of([Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X].into_iter().cycle().take(40)), None);
        // One photon has nearly all power.
        let mut sums = Directions::default();
        sums.add(Vec3::Y, 10.0);
        (0..20).for_each(|_| sums.add(Vec3::Y, 0.01));
        assert_eq!(sums.focus(10.2), None);
    }
}
