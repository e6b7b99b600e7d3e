//! Survey: places the irradiance records of a block, level by level of the lattice.
//!
//! At each level, records are first placed at the corners of its cells. Then survey rays, which measure
//! distances, are cast from all new records. They are cast one cell of the hemisphere after another, because
//! rays with similar directions read the same lines of the scene. Finally, cells that their corner records do
//! not cover are divided into cells of the next level.

use glam::Vec3;
use heapless::Vec;
use photoncard_shared::message::{Fault, Invariant};

use super::lattice::{Cell, LEVELS};
use super::record::Record;
use super::survey_state::{Survey, Task};
use super::{Full, IrradianceCache, LatticePoint, Window};
use crate::importance::{CELLS, direction_in};
use crate::kind::{Capacity, Map};
use crate::memory::{MemoryPort, Stage};
use crate::render::{Context, eye};
use crate::sampler::{Dimension, Pattern, unit_interval};
use crate::scene::camera::pixel_side;
use crate::scene::{BUNDLE_RAYS, Ray, RayKind, Surface, closest_hits};
use crate::vector::{min, sqrt};

/// Minimum of `radius of validity * sqrt(allowed error)`, pixels: the distance up to which a record is valid.
/// It bounds the number of records in the corners of a room.
const MIN_REACH: f32 = 3.0;
/// Error bound below which [`MIN_REACH`] shrinks in proportion to the bound. The picture thus converges to
/// the picture without records as the bound approaches 0.
const ERROR_OF_MIN_REACH: f32 = 0.1;

impl<R: Capacity> IrradianceCache<R> {
    /// Does the next piece of the survey: one lattice cell, or a bundle of rays for up to [`BUNDLE_RAYS`]
    /// records. Returns whether the survey is done.
    ///
    /// # Errors
    /// A [`Fault`] if the card image is invalid; `Ok(Err(Full))` if the records do not fit into the cache.
    pub fn survey<M: MemoryPort>(
        &mut self,
        context: &mut Context<M>,
        window: &Window,
        allowed: f32,
    ) -> Result<Result<bool, Full>, Fault> {
        match self.survey.task {
            Task::Placing => {
                if let Some(cell) = self.next_cell(window) {
                    return Ok(self.place(context, &cell, allowed)?.map(|()| false));
                }
                self.survey.task = Task::Rays;
                self.survey.index = self.survey.first;
            }
            Task::Rays => self.cast(context)?,
            Task::Division if self.survey.level + 1 >= LEVELS => {
                self.add_groups()?;
                return Ok(Ok(true));
            }
            Task::Division => match self.next_cell(window) {
                Some(cell) => {
                    if !self.is_covered(context, &cell, allowed)? {
                        self.divide(&cell);
                    }
                }
                None => {
                    self.survey =
                        Survey { level: self.survey.level + 1, first: self.survey.first, ..Survey::BEGIN }
                }
            },
        }
        Ok(Ok(false))
    }

    /// Next cell of the current level that overlaps the window; `None` after the last.
    fn next_cell(&mut self, window: &Window) -> Option<Cell> {
        let Survey { level, ref mut index, .. } = self.survey;
        let of_level = Cell::of_level(level);
        while let Some(&(root, divided)) = self.roots.get(*index / of_level) {
            let cell = Cell::in_tree(root, level, *index % of_level);
            *index += 1;
            let exists = cell.parent().is_none_or(|parent| divided >> parent.tree_number() & 1 != 0);
            if exists && cell.overlaps(window) {
                return Some(cell);
            }
        }
        None
    }

    /// Places records at those corners of a cell that have none.
    fn place<M: MemoryPort>(
        &mut self,
        context: &mut Context<M>,
        cell: &Cell,
        allowed: f32,
    ) -> Result<Result<(), Full>, Fault> {
        for corner in cell.corners() {
            if self.records.get(&corner).is_some() {
                continue;
            }
            let record = new_record(context, corner, allowed)?;
            // Each light group needs a record too.
            let has_room = (self.records.entries() + 1) * self.groups.count() <= self.records.capacity();
            if !has_room || !self.records.insert(corner, record) {
                return Ok(Err(Full));
            }
        }
        Ok(Ok(()))
    }

    /// Casts a bundle of survey rays: for each of the next new records, one ray in the current cell of the
    /// hemisphere. After its ray in the last cell, the survey of a record ends.
    fn cast<M: MemoryPort>(&mut self, context: &mut Context<M>) -> Result<(), Fault> {
        let Survey { index, direction, first, .. } = self.survey;
        let is_last = direction as usize + 1 >= CELLS;
        let end = self.records.entries().min(index + BUNDLE_RAYS);
        let mut rays = Vec::<Ray, BUNDLE_RAYS>::new();
        let mut is_aimed = [false; BUNDLE_RAYS];
        for (index, is_aimed) in (index..end).zip(&mut is_aimed) {
            if let Some((point, Some(record))) = self.records.entry(index)
                && let Some(ray) = survey_ray(context, point, &record.surface(), direction)
            {
                rays.push(ray).map_err(|_| Invariant::Bundle.fault())?;
                *is_aimed = true;
            }
        }
        context.memory.enter(Stage::Survey);
        context.counters.survey_rays += rays.len() as u64;
        let mut hits = [None; BUNDLE_RAYS];
        closest_hits(context.scene, context.memory, &rays, &mut hits)?;
        let mut distances =
            hits.iter().map(|hit| hit.as_ref().map_or(f32::INFINITY, |hit| hit.intersection.distance));
        for (index, is_aimed) in (index..end).zip(is_aimed) {
            // A lattice point without a record has no rays.
            let Some((_, Some(record))) = self.records.entry_mut(index) else { continue };
            let distance = if is_aimed { distances.next() } else { None };
            record.set_distance(direction, distance.unwrap_or(f32::INFINITY))?;
            if is_last {
                record.end_survey()?;
            }
        }
        let survey = &mut self.survey;
        survey.index = end;
        if survey.index >= self.records.entries() {
            survey.index = first;
            survey.direction += 1;
            if is_last || first >= self.records.entries() {
                *survey = Survey { task: Task::Division, index: 0, first: self.records.entries(), ..*survey };
            }
        }
        Ok(())
    }

    /// Returns whether the corner records suffice for a cell: there are four, and each has an error below
    /// `allowed` at every corner and at every point that a division would add.
    fn is_covered<M: MemoryPort>(
        &self,
        context: &mut Context<M>,
        cell: &Cell,
        allowed: f32,
    ) -> Result<bool, Fault> {
        let corners = self.corners(cell);
        let mut surfaces = corners.records().map(|record| (record.position, record.normal));
        let covers = |position: Vec3, normal: Vec3| {
            corners.errors(allowed, position, normal).all(|error| error < allowed)
        };
        if corners.records().count() < 4 || !surfaces.all(|(position, normal)| covers(position, normal)) {
            return Ok(false);
        }
        for point in cell.middles() {
            let seen = eye::see(context, point.film_position())?;
            if !seen.is_some_and(|surface| covers(surface.position, surface.normal)) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn divide(&mut self, cell: &Cell) {
        let root = Cell::coarsest(cell.corner.x, cell.corner.y).corner;
        let divided = self.roots.iter_mut().find(|(corner, _)| *corner == root);
        if let Some((_, divided)) = divided {
            *divided |= 1 << cell.tree_number();
        }
    }
}

/// Creates the record of a lattice point, before its survey. Returns `None` if the eye ray there does not see
/// a surface with a Lambertian part directly.
fn new_record<M: MemoryPort>(
    context: &mut Context<M>,
    point: LatticePoint,
    allowed: f32,
) -> Result<Option<Record>, Fault> {
    let seen = eye::see(context, point.film_position())?;
    // Records lie where eye rays meet surfaces, not behind mirrors and glass.
    let surface = seen.filter(|surface| surface.reflection.has_lambertian() && surface.specular.is_none());
    Ok(surface.map(|surface| {
        let reach =
            MIN_REACH * min(allowed / ERROR_OF_MIN_REACH, 1.0) * pixel_side(context.frame, surface.position);
        let least = reach / sqrt(allowed);
        Record::new(&surface, least)
    }))
}

/// Random ray from a record's surface through a cell of its hemisphere; `None` if it points below the
/// triangle.
fn survey_ray<M>(context: &Context<M>, point: &LatticePoint, surface: &Surface, cell: u8) -> Option<Ray> {
    let pattern = Pattern::new(context.frame.seed, point.x, point.y, 0, Dimension::Survey);
    let square = [unit_interval(pattern.jitter(cell as u32)), pattern.radical_inverse(cell as u32)];
    let direction = direction_in(surface.normal, cell, square);
    surface.is_above(direction).then(|| Ray::new(RayKind::Radiance, surface.offset_origin(), direction))
}
