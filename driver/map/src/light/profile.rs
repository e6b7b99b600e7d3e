//! Sampling of directions by the intensity of a light's profile.
//!
//! Between the texels of the profile's image lie cells. A row of cells and then a cell are chosen in
//! proportion to their flux; the direction is uniform in solid angle within the cell.

use std::f64::consts::PI;

use glam::Vec3;
use photoncard_firmware::scene::light::environment_direction;
use photoncard_scene::Image;

use super::thresholds::{ALL, thresholds};

/// Directions from a light with a profile, as a probability distribution.
#[derive(Debug)]
pub(crate) struct ProfileDirections {
    columns: usize,
    /// Cosines of the borders of the rows.
    cosines: Vec<f64>,
    /// Cumulative probabilities of the rows, and of the cells of each row.
    rows: Vec<u32>,
    cells: Vec<u32>,
    /// Flux of a light whose peak has the intensity 1, sr.
    pub(crate) flux: f64,
    /// Maximum of intensity over probability density, sr, of a light whose peak has the intensity 1.
    pub(crate) strongest: f64,
    /// Greatest and least angle gamma with light, radians.
    pub(crate) lit: [f64; 2],
}

/// A direction, in the frame of the profile, and its probability density, 1/sr.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ProfileDirection {
    pub(crate) local: Vec3,
    pub(crate) density: f32,
}

impl ProfileDirections {
    /// Directions of a profile's image; it has two rows at least.
    pub(crate) fn new(image: &Image) -> Self {
        let (columns, rows) = (image.width as usize, image.height as usize);
        let value = |row: usize, column: usize| {
            let [low, high, ..] = image.texels[row * columns + column % columns];
            f64::from(u16::from_le_bytes([low, high])) / 65_535.0
        };
        let step = PI / (rows - 1) as f64;
        let cosines: Vec<f64> = (0..rows).map(|row| libm::cos(step * row as f64)).collect();
        let lit = (0..rows).filter(|&row| (0..columns).any(|column| value(row, column) > 0.0));
        let (first, last) = lit.fold((rows, 0), |(first, last), row| (first.min(row), last.max(row)));
        let mut weights = Vec::with_capacity((rows - 1) * columns);
        let mut greatest = Vec::with_capacity(weights.capacity());
        for row in 0..rows - 1 {
            let [top, bottom] = [row, row + 1].map(|row| step * row as f64);
            // Integrals of sine, and of sine times the share of the way, from top to bottom.
            let whole = cosines[row] - cosines[row + 1];
            let rising = (libm::sin(bottom) - libm::sin(top)) / step - cosines[row + 1];
            for column in 0..columns {
                let [upper, lower] = [row, row + 1].map(|row| [value(row, column), value(row, column + 1)]);
                let mean = |[a, b]: [f64; 2]| 0.5 * (a + b);
                weights.push(mean(upper) * (whole - rising) + mean(lower) * rising);
                greatest.push([upper, lower].as_flattened().iter().copied().fold(0.0, f64::max));
            }
        }
        let of_rows: Vec<f64> = weights.chunks(columns).map(|row| row.iter().sum()).collect();
        let mut directions = Self {
            columns,
            rows: thresholds(&of_rows),
            cells: weights.chunks(columns).flat_map(thresholds).collect(),
            flux: of_rows.iter().sum::<f64>() * 2.0 * PI / columns as f64,
            strongest: 0.0,
            lit: [(last + 1).min(rows - 1), first.saturating_sub(1)].map(|row| step * row as f64),
            cosines,
        };
        let ratios = greatest.iter().enumerate().filter(|(_, greatest)| **greatest > 0.0);
        directions.strongest = ratios
            .map(|(cell, greatest)| greatest / directions.cell_density(cell / columns, cell % columns))
            .fold(0.0, f64::max);
        directions
    }

    /// Probability density of the directions in a cell, 1/sr.
    fn cell_density(&self, row: usize, column: usize) -> f64 {
        let [_, of_row] = share(&self.rows, row);
        let [_, of_cell] = share(self.cells_of(row), column);
        let height = self.cosines[row] - self.cosines[row + 1];
        of_row * of_cell * self.columns as f64 / (2.0 * PI * height)
    }

    fn cells_of(&self, row: usize) -> &[u32] {
        &self.cells[row * self.columns..(row + 1) * self.columns]
    }

    /// Maps a point of the unit square to a direction.
    pub(crate) fn sample(&self, [c, d]: [f32; 2]) -> ProfileDirection {
        let (row, down) = chosen(&self.rows, c.into());
        let (column, across) = chosen(self.cells_of(row), d.into());
        let cosine = self.cosines[row] + (self.cosines[row + 1] - self.cosines[row]) * down;
        let turn = (column as f64 + across) / self.columns as f64;
        // The middle of the map, 0.5, is C = 0.
        let local = environment_direction((turn + 0.5) as f32, cosine.clamp(-1.0, 1.0) as f32);
        ProfileDirection { local, density: self.cell_density(row, column) as f32 }
    }

    /// Probability density of a direction in the frame of the profile, 1/sr.
    pub(crate) fn density(&self, local: Vec3) -> f32 {
        let cosine = f64::from(local.y);
        let row = self.cosines.partition_point(|&border| border >= cosine).saturating_sub(1);
        let turn = libm::atan2(f64::from(local.x), f64::from(-local.z)) / (2.0 * PI);
        let column = (turn.rem_euclid(1.0) * self.columns as f64) as usize;
        self.cell_density(row.min(self.rows.len() - 1), column.min(self.columns - 1)) as f32
    }
}

/// Index that a number in [0, 1) chooses, and the number's place in the index's interval.
fn chosen(thresholds: &[u32], number: f64) -> (usize, f64) {
    let target = (number * ALL) as u32;
    let index = thresholds.partition_point(|&threshold| threshold < target).min(thresholds.len() - 1);
    let [lower, width] = share(thresholds, index);
    (index, ((number - lower) / width).clamp(0.0, 1.0))
}

/// Lower end and width of an index's interval in [0, 1].
fn share(thresholds: &[u32], index: usize) -> [f64; 2] {
    let lower = index.checked_sub(1).map_or(0, |before| thresholds[before]);
    [f64::from(lower) / ALL, f64::from(thresholds[index] - lower).max(1.0) / ALL]
}

#[cfg(test)]
mod tests {
    use photoncard_scene::Encoding;

    use super::*;

    fn directions(width: u32, height: u32, value: impl Fn(u32, u32) -> u16) -> ProfileDirections {
        let texels = (0..height).flat_map(|row| (0..width).map(move |column| (column, row)));
        let texels = texels.map(|(column, row)| {
            let [low, high] = value(column, row).to_le_bytes();
            [low, high, low, high]
        });
        let texels = texels.collect();
        let name = "web".into();
        ProfileDirections::new(&Image { name, width, height, texels, encoding: Encoding::LinearPair })
    }

    #[test]
    fn an_even_profile_sends_its_flux_to_all_sides_alike() {
        for (width, height) in [(1, 2), (1, 19), (24, 13)] {
            let even = directions(width, height, |_, _| u16::MAX);
            assert!((even.flux / (4.0 * PI) - 1.0).abs() < 1e-9, "{}", even.flux);
            assert!((even.strongest / (4.0 * PI) - 1.0).abs() < 1e-6);
            let mut sum = Vec3::ZERO;
            for step in 0..4096 {
                let square = [(step % 64) as f32 + 0.5, (step / 64) as f32 + 0.5].map(|place| place / 64.0);
                let ProfileDirection { local, density } = even.sample(square);
                assert!((density * 4.0 * std::f32::consts::PI - 1.0).abs() < 1e-5);
                sum += local / 4096.0;
            }
            assert!(sum.length() < 1e-3, "{width} x {height}: {sum}");
        }
    }

    #[test]
    fn directions_have_the_density_that_is_stated_for_them() {
        let uneven = directions(12, 19, |column, row| 3000 * (column as u16 % 5) + 2000 * (row as u16 % 7));
        // Expectation of 1 / density over the cells with light: their solid angle.
        let mut solid_angle = 0.0;
        for step in 0..40_000_u32 {
            let square = [(step % 200) as f32 + 0.5, (step / 200) as f32 + 0.5].map(|place| place / 200.0);
            let ProfileDirection { local, density } = uneven.sample(square);
            let found = uneven.density(local);
            // Rounding may carry a direction over the border of its cell.
            solid_angle +=
                if (found / density - 1.0).abs() < 1e-3 { 1.0 / f64::from(density) / 40_000.0 } else { 0.0 };
        }
        assert!((solid_angle / (4.0 * PI) - 1.0).abs() < 0.02, "{solid_angle}");
    }
}
