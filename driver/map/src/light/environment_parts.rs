//! Subdivided cells of an environment: cells whose light comes through small parts of them, such as a sun of
//! one texel.

use std::f64::consts::PI;

use photoncard_scene::Environment;
use rayon::prelude::*;

/// Number of rows and of columns into which a cell is subdivided.
pub(crate) const SIDE: u32 = 32;
/// Maximum number of subdivided cells. The thresholds of each take 4.2 kB.
const MAX_DIVIDED: usize = 16;
/// Minimum of `L w / P` for a cell to be subdivided, where L is the radiance of its brightest texel, w its
/// solid angle, and P the light of all cells. This ratio is the variance that the cell adds to a light
/// sample, relative to the squared mean.
const LEAST_VARIANCE: f64 = 1.0 / 16.0;
/// Minimum contrast of a subdivided cell: the light of its brightest part divided by the mean of its parts.
const LEAST_CONTRAST: f64 = 4.0;
/// Fraction of the samples within a cell that is uniform, so that parts with hardly any light are sampled
/// too.
const EVEN: f64 = 1.0 / 64.0;

/// Parts of a cell. They have equal solid angle and are weighted by the light that comes through each.
#[derive(Clone, Debug)]
pub(crate) struct Parts {
    /// Row-major number of the cell.
    pub(crate) cell: u32,
    /// Weights in row-major order, W/m^2. Their sum is the weight of the cell; all are above 0.
    pub(crate) weights: Vec<f64>,
    /// Maximum radiance found in each part, averaged over channels, W/(sr m^2).
    pub(crate) brightest: Vec<f64>,
}

impl Parts {
    /// Parts of the cells to be subdivided, in the order of the cells' numbers. `weights` are the weights of
    /// all cells.
    pub(super) fn of_cells(
        environment: &Environment,
        [columns, rows]: [u32; 2],
        weights: &[f64],
    ) -> Vec<Self> {
        // A cell of one texel needs no parts.
        if environment.width <= columns && environment.height <= rows {
            return Vec::new();
        }
        let total: f64 = weights.iter().sum();
        let brightest = brightest(environment, [columns, rows]);
        let mut strong: Vec<(f64, u32)> = weights.iter().copied().zip(0..).collect();
        strong.retain(|(_, cell)| {
            let row = f64::from(cell / columns);
            let [upper, lower] = [row, row + 1.0].map(|row| libm::cos(PI * row / f64::from(rows)));
            let solid_angle = 2.0 * PI / f64::from(columns) * (upper - lower);
            brightest[*cell as usize] * solid_angle >= LEAST_VARIANCE * total
        });
        let mut divided: Vec<(f64, Self)> = strong
            .into_par_iter()
            .map(|(weight, cell)| Self::new(environment, [columns, rows], (cell, weight)))
            .filter(|(contrast, _)| *contrast >= LEAST_CONTRAST)
            .collect();
        divided.sort_by(|(one, a), (other, b)| {
            (other * b.sum()).total_cmp(&(one * a.sum())).then(a.cell.cmp(&b.cell))
        });
        divided.truncate(MAX_DIVIDED);
        divided.sort_by_key(|(_, parts)| parts.cell);
        divided.into_iter().map(|(_, parts)| parts).collect()
    }

    /// Divides a cell with a given weight into parts. Also returns the contrast: the light of the brightest
    /// part divided by the mean of the parts.
    fn new(environment: &Environment, [columns, rows]: [u32; 2], (cell, weight): (u32, f64)) -> (f64, Self) {
        let [row, column] = [cell / columns, cell % columns];
        let border = |row: u32| libm::cos(PI * f64::from(row) / f64::from(rows));
        let [upper, lower] = [border(row), border(row + 1)];
        // Two samples per texel along each axis, as for whole cells.
        let samples = |texels: u32, cells: u32| (2 * texels.div_ceil(cells)).div_ceil(SIDE).max(2);
        let [across, down] = [samples(environment.width, columns), samples(environment.height, rows)];
        let (mut means, mut brightest) = (Vec::new(), Vec::new());
        for (part_row, part_column) in (0..SIDE).flat_map(|row| (0..SIDE).map(move |column| (row, column))) {
            let share = |part: u32, sample: u32, samples: u32| {
                (f64::from(part) + (f64::from(sample) + 0.5) / f64::from(samples)) / f64::from(SIDE)
            };
            let (mut sum, mut greatest) = (0.0, 0.0_f64);
            for (i, j) in (0..across).flat_map(|i| (0..down).map(move |j| (i, j))) {
                let u = (f64::from(column) + share(part_column, i, across)) / f64::from(columns);
                let cosine = upper + (lower - upper) * share(part_row, j, down);
                let radiance = luminance(environment, [u, libm::acos(cosine.clamp(-1.0, 1.0)) / PI]);
                sum += radiance;
                greatest = greatest.max(radiance);
            }
            means.push(sum / f64::from(across * down));
            brightest.push(greatest);
        }
        let mean = means.iter().sum::<f64>() / means.len() as f64;
        let contrast = means.iter().copied().fold(0.0, f64::max) / mean;
        let of_part = |part: f64| weight * ((1.0 - EVEN) * part / mean + EVEN) / means.len() as f64;
        let weights = means.iter().map(|&part| of_part(part)).collect();
        (if contrast.is_finite() { contrast } else { 0.0 }, Self { cell, weights, brightest })
    }

    fn sum(&self) -> f64 {
        self.weights.iter().sum()
    }
}

/// Maximum radiance, averaged over channels, of the texels of each cell. Texels that interpolation carries
/// into the cell count too.
fn brightest(environment: &Environment, [columns, rows]: [u32; 2]) -> Vec<f64> {
    let Environment { width, height, .. } = *environment;
    let mut brightest = vec![0.0_f64; (columns * rows) as usize];
    let cell = |texel: u32, texels: u32, cells: u32| {
        (u64::from(texel) * u64::from(cells) / u64::from(texels)) as usize
    };
    for (texel, index) in environment.texels.iter().zip(0_u32..) {
        let [x, y] = [index % width, index / width];
        let radiance = texel.iter().copied().map(f64::from).sum::<f64>() / 3.0;
        let across = [(x + width - 1) % width, x, (x + 1) % width].map(|x| cell(x, width, columns));
        let down = [y.saturating_sub(1), y, (y + 1).min(height - 1)].map(|y| cell(y, height, rows));
        for (row, column) in down.iter().flat_map(|row| across.iter().map(move |column| (row, column))) {
            let greatest = &mut brightest[row * columns as usize + column];
            *greatest = greatest.max(radiance);
        }
    }
    brightest
}

/// Radiance at texture coordinates `(u, v)`, averaged over channels and interpolated bilinearly as on a card,
/// W/(sr m^2).
pub(super) fn luminance(environment: &Environment, [u, v]: [f64; 2]) -> f64 {
    let [width, height] = [environment.width, environment.height].map(i64::from);
    let [x, y] = [u * width as f64 - 0.5, v * height as f64 - 0.5];
    let [column, row] = [x.floor(), y.floor()];
    let texel = |column: i64, row: i64| {
        let [column, row] = [column.rem_euclid(width), row.clamp(0, height - 1)];
        let texel = environment.texels[(row * width + column) as usize];
        texel.into_iter().map(f64::from).sum::<f64>() / 3.0
    };
    let [right, below] = [x - column, y - row];
    let row_at = |row: i64| texel(column as i64, row) * (1.0 - right) + texel(column as i64 + 1, row) * right;
    row_at(row as i64) * (1.0 - below) + row_at(row as i64 + 1) * below
}
