//! Interpolation between irradiance records at the corners of a lattice cell.

use glam::Vec3;

use super::lattice::Cell;
use super::record::{Content, Record};
use super::{IrradianceCache, LatticePoint};
use crate::kind::{Capacity, Map};
use crate::light_groups::GroupedLight;
use crate::scene::Surface;
use crate::vector::{max, min, sqrt};

/// Minimum sum of the records' weights at which a sample is interpolated.
const MIN_WEIGHT: f32 = 0.05;

/// Records at the corners of a cell; `None` for a corner without a record.
pub(super) struct Corners<'a>([Option<&'a Record>; 4]);

impl<'a> Corners<'a> {
    pub(super) fn records(&self) -> impl Iterator<Item = &'a Record> {
        self.0.into_iter().flatten()
    }

    /// Error of each corner's record at a surface point; infinite for a corner without a record. Each radius
    /// of validity is clamped by those of the other corners, `R_i <= R_j + |p_i - p_j|` (Křivánek 2006).
    pub(super) fn errors(&self, allowed: f32, position: Vec3, normal: Vec3) -> impl Iterator<Item = f32> {
        let mut errors = [f32::INFINITY; 4];
        for (error, record) in errors.iter_mut().zip(self.0) {
            // The error without a record is infinite.
            let Some(record) = record else { continue };
            let radius = self.records().fold(record.radius, |radius, other| {
                let distance = sqrt((other.position - record.position).length_squared());
                min(other.radius + distance, radius)
            });
            *error = record.error(radius, allowed, position, normal);
        }
        errors.into_iter()
    }
}

/// A sample: its position in the picture, and the surface that it sees.
#[derive(Clone, Copy, Debug)]
pub struct SeenSample<'a> {
    /// Column and row of the sample's pixel.
    pub pixel: [u32; 2],
    /// Position in the picture, pixels from the upper left corner.
    pub film: [f32; 2],
    /// Surface that the sample sees.
    pub surface: &'a Surface,
}

/// Weights of the records at the four corners of a sample's cell.
struct Weights {
    cell: Cell,
    weights: [f32; 4],
}

impl<R: Capacity> IrradianceCache<R> {
    pub(super) fn corners(&self, cell: &Cell) -> Corners<'_> {
        let mut records = [None; 4];
        for (record, corner) in records.iter_mut().zip(cell.corners()) {
            *record = self.records.get(&corner).and_then(Option::as_ref);
        }
        Corners(records)
    }

    /// The undivided cell that contains a pixel; `None` outside the block.
    fn undivided_cell(&self, [x, y]: [u32; 2]) -> Option<Cell> {
        let mut cell = Cell::coarsest(x, y);
        let (_, divided) = self.roots.iter().find(|(corner, _)| *corner == cell.corner)?;
        while !cell.is_finest() && divided >> cell.tree_number() & 1 != 0 {
            cell = cell.child_at(x, y);
        }
        Some(cell)
    }

    /// Weights of the records for a sample; `None` if their sum is below [`MIN_WEIGHT`].
    fn weights(&self, sample: &SeenSample, allowed: f32) -> Option<Weights> {
        let SeenSample { pixel, film, surface } = *sample;
        // The cell is that of the pixel, because the pixel filter may move `film` out of the pixel.
        let cell = self.undivided_cell(pixel)?;
        let part = |at: f32, from: u32| min(max((at - from as f32) / cell.side() as f32, 0.0), 1.0);
        let [x, y] = [part(film[0], cell.corner.x), part(film[1], cell.corner.y)];
        let bilinear = [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y];
        let corners = self.corners(&cell);
        let errors = corners.errors(allowed, surface.position, surface.normal);
        let mut weights = bilinear;
        for (weight, error) in weights.iter_mut().zip(errors) {
            // The weight falls continuously to 0 at the error bound.
            *weight *= if error < allowed { 1.0 - error / allowed } else { 0.0 };
        }
        (weights.iter().sum::<f32>() >= MIN_WEIGHT).then_some(Weights { cell, weights })
    }

    /// Returns true if the records suffice to interpolate a sample. The result depends on the records'
    /// geometry alone: it is the same before and after their light is gathered.
    pub fn covers(&self, sample: &SeenSample, allowed: f32) -> bool {
        self.weights(sample, allowed).is_some()
    }

    /// Interpolated indirect irradiance over pi, `E / pi`, at a sample, W/(sr m^2), by light group; `None` if
    /// the sample needs a final gather.
    pub fn interpolate(&self, sample: &SeenSample, allowed: f32) -> Option<GroupedLight> {
        let Weights { cell, weights } = self.weights(sample, allowed)?;
        let of_all = 1.0 / weights.iter().sum::<f32>();
        let corners = cell.corners();
        Some(GroupedLight::of_groups(self.groups, |group| {
            let of_corners = corners.iter().zip(weights);
            let sum = of_corners.fold(Vec3::ZERO, |sum, (corner, weight)| {
                sum + self.gathered(corner.of_group(group), sample.surface) * weight
            });
            sum * of_all
        }))
    }

    /// Irradiance over pi that a record extrapolates to a surface; 0 if it is not gathered.
    #[inline(always)]
    fn gathered(&self, point: LatticePoint, surface: &Surface) -> Vec3 {
        match self.records.get(&point) {
            Some(Some(Record { content: Content::Gathered(irradiance), position, normal, .. })) => {
                irradiance.at(*position, *normal, surface.position, surface.normal)
            }
            _ => Vec3::ZERO,
        }
    }
}
