//! Environment light: infinitely distant light, given by an equirectangular map. To sample a direction, the
//! map is divided into a grid of cells of equal angles. A row and then a column are chosen in proportion to
//! their light; the direction is uniform in solid angle within the cell. A cell with an uneven distribution
//! of light, for example with the sun, is subdivided into parts of equal solid angle. The parts are chosen in
//! the same way.

use core::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;
use photoncard_shared::image::{SectionKind, THRESHOLDS_PER_LINE};
use photoncard_shared::message::Fault;

use super::choice::{Fraction, choose, probability};
use super::sample::LightSample;
use crate::memory::MemoryPort;
use crate::scene::{SceneImage, read_texture, sample_texture};
use crate::vector::{max, min, sqrt};

/// Coordinates of a direction on the equirectangular map, `[from the left, from the top]`, each 0 to 1. The
/// centre of the map is the direction -z; its top is +y.
pub fn environment_coordinates(direction: Vec3) -> [f32; 2] {
    let Vec3 { x, y, z } = direction;
    let across = libm::atan2f(x, -z) * (0.5 * FRAC_1_PI) + 0.5;
    [across, libm::atan2f(sqrt(x * x + z * z), y) * FRAC_1_PI]
}

/// Unit vector at a position of the equirectangular map: `across` is the horizontal coordinate, 0 to 1 from
/// the left, and `cosine` is the cosine of the angle to +y.
pub fn environment_direction(across: f32, cosine: f32) -> Vec3 {
    let angle = 2.0 * PI * (across - 0.5);
    let sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    let (x, z) = libm::sincosf(angle);
    Vec3::new(sine * x, cosine, -sine * z)
}

/// Radiance of the environment in a direction from the scene, W/(sr m^2); zero without an environment.
///
/// # Errors
/// If the card image is invalid.
pub fn environment_radiance(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    direction: Vec3,
) -> Result<Vec3, Fault> {
    let Some(index) = scene.header.lights.texture else { return Ok(Vec3::ZERO) };
    let texture = read_texture(scene, memory, index)?;
    let [red, green, blue, _] = sample_texture(scene, memory, &texture, environment_coordinates(direction))?;
    Ok(Vec3::new(red, green, blue) * Vec3::from_array(scene.header.lights.radiance))
}

/// Probability density, 1/sr, with which `sample_light` returns a direction of the environment.
///
/// # Errors
/// If the card image is invalid.
pub fn environment_density(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    direction: Vec3,
) -> Result<f32, Fault> {
    let share = scene.header.lights.environment;
    if share <= 0.0 {
        return Ok(0.0);
    }
    let cells = Cells::new(scene);
    let [across, down] = environment_coordinates(direction);
    let row = cell_at(down, cells.rows);
    let column = cell_at(across, cells.columns);
    let of_row = probability(row, |row| threshold(scene, memory, row))?;
    let first = cells.first_of_row(row);
    let of_column = probability(column, |column| threshold(scene, memory, first.wrapping_add(column)))?;
    let density = cells.density(share, row, of_row * of_column);
    let Some(parts) = Parts::of(scene, memory, &cells, (row, column))? else { return Ok(density) };
    let place = [cells.share(row, direction.y), across * cells.columns as f32 - column as f32];
    Ok(density * parts.density(scene, memory, place)?)
}

/// Samples a direction of the environment. `share` is the probability with which the caller has chosen the
/// environment among all lights.
pub(super) fn sample(
    scene: &SceneImage,
    memory: &mut impl MemoryPort,
    share: f32,
    [across, down]: [Fraction; 2],
) -> Result<LightSample, Fault> {
    let cells = Cells::new(scene);
    let row = choose(down, cells.rows, |row| threshold(scene, memory, row))?;
    let first = cells.first_of_row(row.index);
    let column =
        choose(across, cells.columns, |column| threshold(scene, memory, first.wrapping_add(column)))?;
    let mut place = [row.rest.value(), column.rest.value()];
    let mut density = cells.density(share, row.index, row.probability * column.probability);
    if let Some(parts) = Parts::of(scene, memory, &cells, (row.index, column.index))? {
        let (part, of_part) = parts.sample(scene, memory, [row.rest, column.rest])?;
        (place, density) = (part, density * of_part);
    }
    let across = (column.index as f32 + place[1]) / cells.columns as f32;
    let direction = environment_direction(across, cells.cosine(row.index, place[0]));
    let radiance = environment_radiance(scene, memory, direction)?;
    Ok(LightSample {
        direction,
        distance: f32::INFINITY,
        irradiance: radiance / density,
        density: Some(density),
        light_group: scene.header.lights.light_group,
    })
}

/// Index of the interval that contains a coordinate, where [0, 1] is divided into `cells` equal intervals.
fn cell_at(coordinate: f32, cells: u32) -> u32 {
    ((coordinate * cells as f32) as u32).min(cells - 1)
}

/// Grid of cells from which directions are sampled. The cumulative distribution functions of its rows and
/// cells are tables of thresholds in [`SectionKind::EnvironmentCells`].
struct Cells {
    columns: u32,
    rows: u32,
}

impl Cells {
    fn new(scene: &SceneImage) -> Self {
        let [columns, rows] = scene.header.lights.cells.map(|cells| u32::from(cells.max(1)));
        Self { columns, rows }
    }

    /// Index of the first threshold of the cells of row `row`, in [`SectionKind::EnvironmentCells`].
    fn first_of_row(&self, row: u32) -> u32 {
        self.rows.wrapping_add(row.wrapping_mul(self.columns))
    }

    /// Cosine of the angle between +y and the circle of latitude that has the fraction `share` of the row's
    /// solid angle above it.
    fn cosine(&self, row: u32, share: f32) -> f32 {
        let border = |row: u32| libm::cosf(PI * row as f32 / self.rows as f32);
        let [upper, lower] = [border(row), border(row + 1)];
        min(max(upper + (lower - upper) * share, -1.0), 1.0)
    }

    /// Fraction of a row's solid angle that lies above the circle of latitude whose angle to +y has the
    /// cosine `cosine`: the inverse of [`Self::cosine`].
    fn share(&self, row: u32, cosine: f32) -> f32 {
        let border = |row: u32| libm::cosf(PI * row as f32 / self.rows as f32);
        let [upper, lower] = [border(row), border(row + 1)];
        (upper - cosine) / (upper - lower)
    }

    /// Density, 1/sr, of a sampled direction in a cell of row `row`. The environment is chosen with the
    /// probability `share`, and then the cell with the probability `probability`.
    fn density(&self, share: f32, row: u32, probability: f32) -> f32 {
        // The difference cos(upper border) - cos(lower border) is computed as a product, to avoid
        // cancellation.
        let half = 0.5 * PI / self.rows as f32;
        let height = 2.0 * libm::sinf((2 * row + 1) as f32 * half) * libm::sinf(half);
        let solid_angle = 2.0 * PI / self.columns as f32 * height;
        share * probability / solid_angle
    }
}

/// Parts of a subdivided cell: a grid of `side` by `side` parts of equal solid angle.
struct Parts {
    /// Index of the first threshold of the cell's parts, in [`SectionKind::EnvironmentCells`]. The thresholds
    /// of the rows of parts come first, then those of the parts in each row.
    first: u32,
    side: u32,
}

impl Parts {
    /// Looks up the parts of a cell; returns `None` if the cell is not subdivided. Section
    /// [`SectionKind::EnvironmentCells`] holds, after the thresholds of all cells, the number of subdivided
    /// cells, the value of `side`, and the sorted numbers of the subdivided cells.
    fn of(
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        cells: &Cells,
        (row, column): (u32, u32),
    ) -> Result<Option<Self>, Fault> {
        let end = cells.first_of_row(cells.rows);
        if scene.header.section(SectionKind::EnvironmentCells).records <= end {
            return Ok(None);
        }
        let mut read = |index: u32| threshold(scene, memory, index);
        let [count, side] = [read(end)?, read(end.wrapping_add(1))?];
        let numbers = end.wrapping_add(2);
        let cell = row.wrapping_mul(cells.columns).wrapping_add(column);
        let (mut low, mut high) = (0, count);
        while low < high {
            let middle = low + (high - low) / 2;
            let found = read(numbers.wrapping_add(middle))?;
            if found == cell {
                let size = side.wrapping_mul(side.wrapping_add(1));
                let first = numbers.wrapping_add(count).wrapping_add(middle.wrapping_mul(size));
                return Ok(Some(Self { first, side: side.max(1) }));
            }
            (low, high) = if found < cell { (middle + 1, high) } else { (low, middle) };
        }
        Ok(None)
    }

    /// Index of the first threshold of the parts in row `row`, in [`SectionKind::EnvironmentCells`].
    fn first_of_row(&self, row: u32) -> u32 {
        self.first.wrapping_add(self.side.wrapping_mul(row.wrapping_add(1)))
    }

    /// Samples a position in the cell. Returns its coordinates `[down, across]`, each 0 to 1, and its
    /// probability density divided by that of a uniform position.
    fn sample(
        &self,
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        [down, across]: [Fraction; 2],
    ) -> Result<([f32; 2], f32), Fault> {
        let mut read = |index: u32| threshold(scene, memory, index);
        let row = choose(down, self.side, |row| read(self.first.wrapping_add(row)))?;
        let first = self.first_of_row(row.index);
        let column = choose(across, self.side, |column| read(first.wrapping_add(column)))?;
        let side = self.side as f32;
        let place = [&row, &column].map(|part| (part.index as f32 + part.rest.value()) / side);
        Ok((place, row.probability * column.probability * (side * side)))
    }

    /// Density of [`Self::sample`] at a position in the cell, divided by that of a uniform position.
    fn density(
        &self,
        scene: &SceneImage,
        memory: &mut impl MemoryPort,
        place: [f32; 2],
    ) -> Result<f32, Fault> {
        let [row, column] = place.map(|share| cell_at(share, self.side));
        let mut read = |index: u32| threshold(scene, memory, index);
        let of_row = probability(row, |row| read(self.first.wrapping_add(row)))?;
        let first = self.first_of_row(row);
        let of_column = probability(column, |column| read(first.wrapping_add(column)))?;
        let side = self.side as f32;
        Ok(of_row * of_column * (side * side))
    }
}

fn threshold(scene: &SceneImage, memory: &mut impl MemoryPort, index: u32) -> Result<u32, Fault> {
    let bytes = scene.record::<4, THRESHOLDS_PER_LINE>(memory, SectionKind::EnvironmentCells, index)?;
    Ok(u32::from_le_bytes(*bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_and_coordinates_are_each_others_inverse() {
        for column in 0..40 {
            for row in 0..20 {
                let (across, down) = ((column as f32 + 0.5) / 40.0, (row as f32 + 0.5) / 20.0);
                let direction = environment_direction(across, libm::cosf(PI * down));
                let [u, v] = environment_coordinates(direction);
                assert!((u - across).abs() < 1e-6 && (v - down).abs() < 1e-6, "{across} {down}: {u} {v}");
            }
        }
    }

    #[test]
    fn the_map_has_minus_z_in_its_centre_x_on_the_right_and_y_at_the_top() {
        let near = |direction: Vec3, expected: [f32; 2]| {
            let found = environment_coordinates(direction);
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{direction}: {found:?}");
        };
        near(Vec3::NEG_Z, [0.5, 0.5]);
        near(Vec3::X, [0.75, 0.5]);
        near(Vec3::NEG_X, [0.25, 0.5]);
        assert_eq!(environment_coordinates(Vec3::Y)[1], 0.0);
        assert_eq!(environment_coordinates(Vec3::NEG_Y)[1], 1.0);
    }
}
