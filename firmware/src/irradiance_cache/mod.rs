//! Parallel irradiance cache. Indirect irradiance and its gradients are gathered at few points and
//! interpolated between them (Ward, Rubinstein, Clear 1988; Ward, Heckbert 1992). Each radius of validity is
//! clamped by the radii at the other corners of a lattice cell (Křivánek 2006).
//!
//! The published caches are filled on demand, so that each pixel depends on the pixels before it.
//! Steinhurst's dissertation (2007) makes the cache parallel by removing this dependence, but does not give
//! the method; this module reconstructs it. The positions of the records depend only on the geometry seen in
//! one cell of a lattice over the picture:
//!
//! - Records are at the corners of the cells, 16 pixels apart. A survey determines the surface that the eye
//!   sees at each corner, and the harmonic mean of the distances to surrounding surfaces along a few rays,
//!   without a gather.
//! - A cell is divided in four, down to a side of 2 pixels, unless its corners cover it: every corner, and
//!   every point that a division would add, is within the allowed error of all four corner records.
//! - A sample interpolates the corner records of its undivided cell, as far as they are valid at the surface
//!   that the sample sees. Weights are continuous across cells of one size. If the sum of the weights is too
//!   small, the sample casts gather rays.
//! - All records are gathered. The survey determines the coefficients of their gradients, so that gathers of
//!   records can be reordered like all others and wait together with those of pixels. Geometry alone decides
//!   which samples are interpolated; their light is added when all gathers of the block's records are done.
//!   Hardly any record is wasted, because each is a corner of an undivided cell.
//!
//! Two tiles with a common lattice point therefore compute the same record, and there are no seams. A tile
//! whose records do not fit into the cache is rendered in smaller blocks. More records are then computed
//! twice, but no pixel changes.
//!
//! Frames of one picture that differ in samples share their records, which [`RecordStore`] keeps in card
//! memory.
//!
//! Direct light is divided between shadow rays and gather rays ([`crate::render::direct`]). The records
//! contain the part that gather rays find, mostly light of large emitters.

mod gradient;
mod interpolation;
mod kept_line;
mod lattice;
mod packed_normal;
mod record;
mod saved;
mod store;
mod survey;
mod survey_state;

pub use interpolation::SeenSample;
pub use lattice::{LatticePoint, Window};
pub use saved::most_cache_words;
pub use store::{Recalled, RecordStore};

use heapless::Vec;
use photoncard_shared::message::{Fault, FrameParameters, Invariant};

use self::gradient::coefficients;
use self::record::{Content, GatherSums, Record, Strongest};
use self::survey_state::Survey;
use crate::kind::{Capacity, Map};
use crate::light_groups::{GroupedLight, LightGroups};
use crate::render::{Context, GatherPoint};
use crate::sampler::{Dimension, Pattern};
use crate::vector::{max, sqrt};

/// Maximum number of coarsest cells that a block may overlap.
const MAX_ROOTS: usize = 16;
/// Minimum capacity of a cache: a block of one pixel has up to 4 corners, and 5 further points per division.
pub const MIN_RECORDS: usize = 4 + 5 * (lattice::LEVELS as usize - 1);

/// Irradiance records of a block.
pub struct IrradianceCache<R: Capacity> {
    /// Records by lattice point and light group; `None` where the eye does not see a surface with a
    /// Lambertian part directly. The records of the first group come first, and all survey it. Those of the
    /// other groups follow, group by group of one lattice point.
    records: R::Map<LatticePoint, Option<Record>>,
    /// Upper left corners of the coarsest cells, each with a bit mask of the divided cells in the cell's
    /// quadtree ([`lattice::Cell::tree_number`]).
    roots: Vec<(LatticePoint, u32), MAX_ROOTS>,
    survey: Survey,
    /// Light groups, each of which has records of its own.
    groups: LightGroups,
    /// Number of lattice points; set when the survey ends.
    points: usize,
}

/// Error: the cache's buffers are too small for the block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Full;

impl<R: Capacity> Default for IrradianceCache<R> {
    fn default() -> Self {
        Self::new()
    }
}

impl<R: Capacity> IrradianceCache<R> {
    /// Creates a cache without records.
    pub const fn new() -> Self {
        Self {
            records: Map::EMPTY,
            roots: Vec::new(),
            survey: Survey::BEGIN,
            groups: LightGroups::ONE,
            points: 0,
        }
    }

    /// Sets the capacity to `records` records, a power of two, if the type leaves it open.
    pub fn reserve(&mut self, records: usize) {
        self.records.reserve(records);
    }

    /// Removes all records and sets up the coarsest cells of a window of the picture.
    ///
    /// # Errors
    /// [`Full`] if the window overlaps too many coarsest cells.
    pub fn begin(&mut self, window: &Window, groups: LightGroups) -> Result<(), Full> {
        self.forget();
        self.groups = groups;
        let steps = |from: u32, to: u32| {
            let first = from - from % lattice::COARSEST_SIDE;
            (first..to).step_by(lattice::COARSEST_SIDE as usize)
        };
        for y in steps(window.y0, window.y1) {
            for x in steps(window.x0, window.x1) {
                self.roots.push((LatticePoint { x, y }, 0)).map_err(|_| Full)?;
            }
        }
        Ok(())
    }

    /// Removes all cells and records, so that nothing is interpolated.
    pub fn forget(&mut self) {
        self.records.clear();
        self.roots.clear();
        self.survey = Survey::BEGIN;
        self.points = 0;
    }

    /// Ends the survey: adds the records of the other light groups, copies of those of the first.
    fn add_groups(&mut self) -> Result<(), Fault> {
        self.points = self.records.entries();
        for index in 0..self.points {
            let Some((&point, &record)) = self.records.entry(index) else { continue };
            for group in 1..self.groups.count() {
                if !self.records.insert(point.of_group(group), record) {
                    return Err(Invariant::Record.fault());
                }
            }
        }
        Ok(())
    }

    /// Index of the record of a light group at the lattice point with index `index`.
    #[inline(always)]
    fn index_of(&self, index: usize, group: usize) -> usize {
        match group.checked_sub(1) {
            None => index,
            Some(further) => self.points + index * (self.groups.count() - 1) + further,
        }
    }

    /// Number of lattice points that the cache holds, with or without a record; 0 before the survey ends.
    pub fn lattice_points(&self) -> u32 {
        self.points as u32
    }

    /// Gather point of the record at lattice point number `index`, its direction table not chosen yet; `None`
    /// without a record.
    #[inline(always)]
    pub fn point(&self, frame: &FrameParameters, index: u32) -> Option<GatherPoint> {
        let (&LatticePoint { x, y }, record) = self.records.entry(index as usize)?;
        let pattern = Pattern::new(frame.seed, x, y, 0, Dimension::Irradiance);
        Some(GatherPoint::record(record.as_ref()?.surface(), pattern, frame.gather_rays))
    }

    /// Begins the gather of record `index`. The direction table of `point`, the record's gather point,
    /// determines the coefficients of the record's translational gradient.
    ///
    /// # Errors
    /// [`Invariant::Record`] if the record was not surveyed.
    pub fn begin_gather(&mut self, index: u32, point: &GatherPoint) -> Result<(), Fault> {
        let broken = Invariant::Record.fault();
        let Some((_, Some(record))) = self.records.entry(index as usize) else { return Err(broken) };
        let Content::Surveyed(distances) = &record.content else { return Err(broken) };
        let sums = GatherSums::new(&coefficients(point, distances));
        for group in 0..self.groups.count() {
            let of_group = self.index_of(index as usize, group);
            let Some((_, Some(record))) = self.records.entry_mut(of_group) else { return Err(broken) };
            record.content = Content::Gathering(Strongest::NONE, sums);
        }
        Ok(())
    }

    /// Adds the weighted radiance, by light group, of a gather ray in cell `cell` of the hemisphere, in the
    /// card image's radiance units, to record `index`.
    ///
    /// # Errors
    /// [`Invariant::Record`] if the record is not being gathered.
    #[inline]
    pub fn add(&mut self, index: u16, cell: u8, brought: &GroupedLight) -> Result<(), Fault> {
        for (group, brought) in brought.groups(self.groups).enumerate() {
            let of_group = self.index_of(index.into(), group);
            if let Some((_, Some(record))) = self.records.entry_mut(of_group)
                && let Content::Gathering(strongest, sums) = &mut record.content
            {
                strongest.add(cell, brought);
                sums.add(cell, brought);
            } else {
                return Err(Invariant::Record.fault());
            }
        }
        Ok(())
    }

    /// Ends the gather of all records: converts their sums to irradiance over pi, W/(sr m^2). `allowed` is
    /// the error bound of interpolation.
    ///
    /// # Errors
    /// [`Invariant::Record`] if a record is not being gathered.
    pub fn end_gather<M>(&mut self, context: &mut Context<M>, allowed: f32) -> Result<(), Fault> {
        let unit = context.scene.header.radiance_unit;
        for index in 0..self.records.entries() {
            // A lattice point without a record has nothing to gather.
            let Some((_, Some(record))) = self.records.entry_mut(index) else { continue };
            let Content::Gathering(strongest, sums) = record.content else {
                return Err(Invariant::Record.fault());
            };
            // The records of all light groups at a lattice point count as one.
            context.counters.records += u64::from(index < self.points);
            let irradiance = sums.limited(&strongest).irradiance(unit, record.distance);
            let reach = sqrt(allowed) * record.radius;
            record.content = Content::Gathered(irradiance.limited(max(reach, record.distance)));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::kind::Entries;
    use crate::scene::Surface;

    #[test]
    fn light_of_a_record_that_is_not_being_gathered_is_a_fault() {
        let broken = Err(Invariant::Record.fault());
        let surface = Surface::white(Vec3::ZERO, Vec3::Y, 1.0);
        let mut cache = std::boxed::Box::new(IrradianceCache::<Entries<64>>::new());
        let point = GatherPoint::record(surface, Pattern::new(0, 0, 0, 0, Dimension::Irradiance), 1);
        let light = &LightGroups::ONE.light(0, Vec3::ONE);
        assert_eq!(cache.add(0, 0, light), broken, "there is none");
        let record = Some(Record::new(&surface, 0.1));
        assert!(cache.records.insert(LatticePoint { x: 0, y: 0 }, record).is_ok());
        assert_eq!(cache.add(0, 0, light), broken, "it is being surveyed");
        assert_eq!(cache.begin_gather(0, &point), broken, "it is being surveyed");
        let mut record = Record::new(&surface, 0.1);
        assert_eq!(record.set_distance(0, 1.0), Ok(()));
        assert_eq!(record.end_survey(), Ok(()));
        assert_eq!(record.set_distance(0, 1.0), broken);
        assert_eq!(record.end_survey(), broken);
    }
}
