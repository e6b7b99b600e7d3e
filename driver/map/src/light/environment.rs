//! Environment light in the format of a card: an `RGB9_E5` texture, and a grid of cells for importance
//! sampling of directions.

use std::f64::consts::PI;

use photoncard_scene::{Environment, shared_exponent};
use photoncard_shared::layout::{self, TexelFormat, Wrap};
use rayon::prelude::*;

use super::environment_parts::{Parts, SIDE, luminance};
use super::thresholds::thresholds;

/// Maximum number of columns of cells.
const MAX_COLUMNS: u32 = 128;
/// Maximum number of rows of cells.
const MAX_ROWS: u32 = 64;
/// Fraction of the samples that is uniform over the sphere, so that cells with hardly any light are sampled
/// too.
const EVEN: f64 = 1.0 / 64.0;
/// Upper bound of the brightest texel after scaling. The format's maximum is 65408.
const BRIGHTEST: f32 = 32768.0;

/// Environment map in the format of a card.
#[derive(Clone, Debug)]
pub(crate) struct EnvironmentMap {
    /// Width and height of the map, texels.
    size: [u32; 2],
    /// Texels in rows from the top.
    texels: Vec<[u8; 4]>,
    /// Radiance of a texel with value 1, W/(sr m^2).
    pub(crate) radiance: [f32; 3],
    /// Cells for importance sampling.
    pub(crate) cells: Cells,
    /// Fluence rate, W/m^2: the integral of the radiance over the sphere, averaged over channels.
    pub(crate) fluence: f64,
    /// Maximum radiance over all channels and texels, W/(sr m^2).
    pub(crate) brightest: f32,
}

/// Grid of equally large cells of the equirectangular map, weighted by the light that comes through each
/// cell.
#[derive(Clone, Debug)]
pub(crate) struct Cells {
    pub(crate) columns: u32,
    pub(crate) rows: u32,
    /// Weights of the cells in row-major order, W/m^2: radiance averaged over channels, times solid angle.
    /// All are above 0.
    pub(crate) weights: Vec<f64>,
    /// Parts of the subdivided cells, sorted by [`Parts::cell`].
    pub(crate) divided: Vec<Parts>,
}

impl EnvironmentMap {
    /// Map of an environment; `None` if the environment is black or not finite.
    pub(super) fn new(environment: &Environment) -> Option<Self> {
        let scaled;
        let environment = match environment.strength {
            1.0 => environment,
            strength => {
                let texels =
                    environment.texels.par_iter().map(|texel| texel.map(|channel| channel * strength));
                scaled = Environment { texels: texels.collect(), strength: 1.0, ..*environment };
                &scaled
            }
        };
        let brightest = environment.texels.as_flattened().iter().copied().fold(0.0, f32::max);
        if !(brightest > 0.0 && brightest.is_finite()) {
            return None;
        }
        let cells = Cells::new(environment);
        let (texels, radiance) = match environment.texels[..] {
            // A constant environment keeps its exact radiance.
            [texel] => (vec![shared_exponent([1.0; 3])], texel),
            _ => {
                let scale = scale(brightest);
                let stored = |texel: &[f32; 3]| shared_exponent(texel.map(|channel| channel / scale));
                (environment.texels.par_iter().map(stored).collect(), [scale; 3])
            }
        };
        Some(Self {
            size: [environment.width, environment.height],
            texels,
            radiance,
            fluence: cells.weights.iter().sum(),
            cells,
            brightest,
        })
    }

    /// Record of the map's texture. Its texels begin at line `first_line` of their section.
    pub(crate) fn texture(&self, first_line: u32) -> layout::Texture {
        layout::Texture {
            first_line,
            size: self.size.map(|side| side as u16),
            wrap: [Wrap::Repeat, Wrap::Clamp],
            nearest: false,
            set: 0,
            format: TexelFormat::SharedExponent,
            matrix: [[1.0, 0.0], [0.0, 1.0]],
            offset: [0.0; 2],
        }
    }

    pub(crate) fn texel(&self, column: u32, row: u32) -> [u8; 4] {
        self.texels[row as usize * self.size[0] as usize + column as usize]
    }
}

/// Power of two by which texels are divided, so that the brightest is between 2^14 and [`BRIGHTEST`].
fn scale(brightest: f32) -> f32 {
    // A division by a power of two is exact unless its result is subnormal.
    let exponent = libm::ilogbf(brightest / BRIGHTEST).clamp(-126, 126) + 1;
    libm::ldexpf(1.0, exponent.clamp(-126, 127))
}

impl Cells {
    /// Cells of an environment that is not black.
    fn new(environment: &Environment) -> Self {
        let Environment { width, height, .. } = *environment;
        let [columns, rows] = [width.min(MAX_COLUMNS), height.min(MAX_ROWS)];
        // Two samples per texel in each direction reach every texel that interpolation brings into a cell.
        let [across, down] = [width.div_ceil(columns), height.div_ceil(rows)].map(|texels| 2 * texels);
        let mut weights: Vec<f64> = (0..rows)
            .into_par_iter()
            .flat_map_iter(|row| {
                let height = solid_angle_of_row(row, rows) / f64::from(columns);
                (0..columns).map(move |column| {
                    let place = |cell: u32, cells: u32, sample: u32, samples: u32| {
                        (f64::from(cell) + (f64::from(sample) + 0.5) / f64::from(samples)) / f64::from(cells)
                    };
                    let sum: f64 = (0..down)
                        .flat_map(|j| (0..across).map(move |i| (i, j)))
                        .map(|(i, j)| {
                            let v = place(row, rows, j, down);
                            luminance(environment, [place(column, columns, i, across), v])
                        })
                        .sum();
                    sum / f64::from(across * down) * height
                })
            })
            .collect();
        let divided = Parts::of_cells(environment, [columns, rows], &weights);
        let total: f64 = weights.iter().sum();
        for (weight, index) in weights.iter_mut().zip(0..) {
            let even = solid_angle_of_row(index / columns, rows) / (4.0 * PI * f64::from(columns));
            *weight = *weight * (1.0 - EVEN) + total * EVEN * even;
        }
        Self { columns, rows, weights, divided }
    }

    /// Cumulative probabilities ([`thresholds`]) of the rows, then of the cells in each row. If cells are
    /// subdivided, four items follow: the number of these cells, [`SIDE`], the cells' indices, and the
    /// thresholds of their parts.
    pub(super) fn thresholds(&self) -> Vec<u32> {
        let mut all = of_grid(&self.weights, self.columns);
        if !self.divided.is_empty() {
            all.extend([self.divided.len() as u32, SIDE]);
            all.extend(self.divided.iter().map(|parts| parts.cell));
            all.extend(self.divided.iter().flat_map(|parts| of_grid(&parts.weights, SIDE)));
        }
        all
    }

    /// Parts of a cell; `None` if it is not subdivided.
    pub(crate) fn parts(&self, row: u32, column: u32) -> Option<&Parts> {
        let cell = row * self.columns + column;
        self.divided.binary_search_by_key(&cell, |parts| parts.cell).ok().map(|index| &self.divided[index])
    }

    /// Solid angle of each cell in a row, sr.
    pub(crate) fn solid_angle(&self, row: u32) -> f64 {
        solid_angle_of_row(row, self.rows) / f64::from(self.columns)
    }
}

/// Thresholds of the rows of a grid, then of the cells in each row.
fn of_grid(weights: &[f64], columns: u32) -> Vec<u32> {
    let rows = weights.chunks(columns as usize);
    let sums: Vec<f64> = rows.clone().map(|row| row.iter().sum()).collect();
    let mut all = thresholds(&sums);
    all.extend(rows.flat_map(thresholds));
    all
}

/// Solid angle of a row of cells, sr.
fn solid_angle_of_row(row: u32, rows: u32) -> f64 {
    let half = 0.5 * PI / f64::from(rows);
    4.0 * PI * libm::sin(f64::from(2 * row + 1) * half) * libm::sin(half)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn texels_of_any_brightness_are_stored_accurately() {
        for brightest in [1e-30_f32, 1e-3, 1.0, 3e4, 1e20, f32::MAX] {
            let scaled = brightest / scale(brightest);
            assert!((1.0..=65_408.0).contains(&scaled) || brightest < 1e-29, "{brightest}: {scaled}");
        }
    }

    #[test]
    fn weights_of_cells_are_the_light_through_them() {
        // A bright texel at the border of the map, whose light is spread over both sides.
        let mut texels = vec![[0.0; 3]; 512 * 256];
        texels[100 * 512] = [3.0, 6.0, 9.0];
        let environment = Environment { width: 512, height: 256, texels, strength: 1.0 };
        let cells = Cells::new(&environment);
        assert_eq!([cells.columns, cells.rows], [128, 64]);
        let total: f64 = cells.weights.iter().sum();
        let angle = PI * 100.5 / 256.0;
        let expected = 6.0 * angle.sin() * (PI / 256.0) * (2.0 * PI / 512.0);
        assert!((total / expected - 1.0).abs() < 0.05, "{total} {expected}");
        let share = |column: usize| cells.weights[25 * 128 + column] / total;
        assert!(share(0) > 0.5 && share(127) > 0.05, "{} {}", share(0), share(127));
        assert!(cells.weights.iter().all(|&weight| weight > 0.0));
    }

    #[test]
    fn a_constant_environment_is_one_cell_of_exact_radiance() {
        let map = EnvironmentMap::new(&Environment::constant(Vec3::new(0.3, 0.2, 0.1))).expect("lit");
        assert_eq!(map.radiance, [0.3, 0.2, 0.1]);
        assert_eq!(map.texel(0, 0), shared_exponent([1.0; 3]));
        assert!((map.fluence / (4.0 * PI * 0.2) - 1.0).abs() < 1e-6);
        assert!(EnvironmentMap::new(&Environment::constant(Vec3::ZERO)).is_none());
    }

    fn sky(width: u32, sun: impl Fn(u32, u32) -> f32) -> Environment {
        let height = width / 2;
        let texels = (0..height).flat_map(|row| (0..width).map(move |column| (column, row)));
        let texels = texels.map(|(column, row)| [1.0 + sun(column, row); 3]).collect();
        Environment { width, height, texels, strength: 1.0 }
    }

    fn divided(environment: &Environment) -> Vec<Parts> {
        EnvironmentMap::new(environment).expect("lit").cells.divided
    }

    #[test]
    fn only_cells_with_a_sun_are_subdivided() {
        let found = divided(&sky(1024, |column, row| if (column, row) == (300, 101) { 1e6 } else { 0.0 }));
        let [parts] = &found[..] else { panic!("{} cells are divided", found.len()) };
        assert_eq!(parts.cell, 101 / 8 * 128 + 300 / 8);
        let greatest = parts.weights.iter().copied().fold(0.0, f64::max);
        assert!(
            greatest > 0.02 * parts.weights.iter().sum::<f64>()
                && parts.weights.iter().all(|weight| *weight > 0.0)
        );
        assert!(divided(&sky(1024, |_, _| 0.0)).is_empty());
        assert!(divided(&sky(1024, |_, row| row as f32)).is_empty());
        assert!(divided(&sky(128, |column, row| if (column, row) == (9, 9) { 1e6 } else { 0.0 })).is_empty());
    }

    #[test]
    fn subdivided_cells_do_not_exceed_their_maximum() {
        let found =
            divided(&sky(1024, |column, row| if column % 32 == 4 && row % 32 == 4 { 1e6 } else { 0.0 }));
        assert!(found.len() <= 16 && found.is_sorted_by_key(|parts| parts.cell));
    }
}
