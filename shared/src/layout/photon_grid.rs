//! Grid on which the positions of photons lie, so that every layout of the photon map stores them without
//! rounding.

/// Number of bits of a grid coordinate.
pub const GRID_BITS: u32 = 20;
pub(super) const GRID_MASK: u32 = (1 << GRID_BITS) - 1;
/// Maximum magnitude of `origin + q` in `PhotonGrid`, because integers up to 2^24 are exact in `f32`.
const MAX_COORDINATE: f64 = (1 << 24) as f64;

/// Grid of the photons' positions. Grid coordinates `q`, each below 2^20, stand for the position `(origin +
/// q) * cell`, which is exact in `f32`. The longest side of the box that the grid covers spans at least half
/// of the 2^20 cells, but fewer far from the origin, where `f32` is coarser.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PhotonGrid {
    /// Minimum corner of the grid, in cells.
    pub origin: [i32; 3],
    /// Side of a cell, metres: a power of two.
    pub cell: f32,
}

impl PhotonGrid {
    /// Grid whose cells have a side of 1 m and begin at the origin.
    pub const UNIT: Self = Self { origin: [0; 3], cell: 1.0 };

    /// Returns the finest grid that covers the box from `lower` to `upper`, metres.
    pub fn around(lower: [f32; 3], upper: [f32; 3]) -> Self {
        let mut least = f64::from(f32::MIN_POSITIVE);
        for (lower, upper) in lower.into_iter().zip(upper) {
            let [lower, upper] = [f64::from(lower), f64::from(upper)];
            // Two cells are left for rounding at either end.
            let by_side = (upper - lower) / f64::from(GRID_MASK - 2);
            let by_place = lower.abs().max(upper.abs()) / (MAX_COORDINATE - f64::from(1 << GRID_BITS));
            least = [by_side, by_place].into_iter().filter(|c| c.is_finite()).fold(least, f64::max);
        }
        let cell = power_of_two_above(least);
        let origin = lower.map(|lower| floor(f64::from(lower) / f64::from(cell)));
        Self { origin, cell }
    }

    /// Returns the grid point nearest to a position, metres. Positions outside the grid are clamped to it.
    #[inline]
    pub fn nearest(&self, place: [f32; 3]) -> [u32; 3] {
        let [x, y, z] = place;
        let [a, b, c] = self.origin;
        [self.nearest_on_axis(x, a), self.nearest_on_axis(y, b), self.nearest_on_axis(z, c)]
    }

    #[inline]
    fn nearest_on_axis(&self, coordinate: f32, origin: i32) -> u32 {
        let relative = f64::from(coordinate) / f64::from(self.cell) - f64::from(origin);
        ((relative + 0.5) as u32).min(GRID_MASK)
    }

    /// Position of a grid point, metres.
    #[inline(always)]
    pub fn position(&self, point: [u32; 3]) -> [f32; 3] {
        let [x, y, z] = point;
        let [a, b, c] = self.origin;
        [self.metres(a, x), self.metres(b, y), self.metres(c, z)]
    }

    /// One coordinate of a grid point's position, metres.
    #[inline(always)]
    pub fn coordinate(&self, axis: u8, point: u32) -> f32 {
        let [a, b, c] = self.origin;
        let origin = match axis {
            0 => a,
            1 => b,
            _ => c,
        };
        self.metres(origin, point)
    }

    #[inline(always)]
    fn metres(&self, origin: i32, point: u32) -> f32 {
        // The sum wraps in unsound card images only.
        origin.wrapping_add(point as i32) as f32 * self.cell
    }
}

fn floor(value: f64) -> i32 {
    let towards_zero = value as i32;
    if f64::from(towards_zero) > value { towards_zero - 1 } else { towards_zero }
}

/// Returns the smallest power of two that is at least `value`, clamped to the normal range of `f32`.
pub fn power_of_two_above(value: f64) -> f32 {
    // Computed from the exponent bits, because the last digit of a logarithm differs between platforms.
    let bits = value.max(f64::MIN_POSITIVE).to_bits();
    let is_power = bits & ((1 << 52) - 1) == 0;
    let exponent = (bits >> 52) as i32 - 1023 + i32::from(!is_power);
    f32::from_bits(((exponent.clamp(-126, 127) + 127) as u32) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_on_the_grid_are_exact_and_the_nearest_is_half_a_cell_away() {
        let boxes = [
            ([0.0; 3], [0.5528, 0.5488, 0.5592]),
            ([-20.0, 0.0, -7.5], [20.0, 12.0, 7.5]),
            ([1e6; 3], [1e6 + 1.0; 3]),
            ([-1e-20; 3], [1e-20; 3]),
            ([3.0; 3], [3.0; 3]),
            ([-1e37; 3], [1e37; 3]),
        ];
        for (lower, upper) in boxes {
            let grid = PhotonGrid::around(lower, upper);
            for sample in 0..1000 {
                let place: [f32; 3] = [0, 1, 2].map(|axis: usize| {
                    let t = (sample * 37 + axis * 101) as f32 % 1000.0 / 1000.0;
                    (lower[axis] * (1.0 - t) + upper[axis] * t).clamp(lower[axis], upper[axis])
                });
                let point = grid.nearest(place);
                let snapped = grid.position(point);
                assert_eq!(grid.nearest(snapped), point, "{place:?} of {grid:?}");
                for axis in 0..3 {
                    let error = f64::from(snapped[axis]) - f64::from(place[axis]);
                    assert!(error.abs() <= 0.5 * f64::from(grid.cell), "{place:?} {snapped:?} {grid:?}");
                    let exact =
                        (f64::from(grid.origin[axis]) + f64::from(point[axis])) * f64::from(grid.cell);
                    assert_eq!(f64::from(snapped[axis]), exact);
                    assert_eq!(snapped[axis], grid.coordinate(axis as u8, point[axis]));
                }
            }
        }
    }

    #[test]
    fn units_are_the_next_power_of_two() {
        for (value, unit) in [(1.0, 1.0), (1.1, 2.0), (0.3, 0.5), (0.25, 0.25), (1e6, 1_048_576.0)] {
            assert_eq!(power_of_two_above(value), unit);
        }
        for extreme in [0.0, 1e-300, 1e300, f64::INFINITY] {
            assert!(power_of_two_above(extreme).is_normal());
        }
    }
}
