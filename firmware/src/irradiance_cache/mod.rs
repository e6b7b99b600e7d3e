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

use glam::Vec3;
use heapless::Vec;
use photoncard_shared::message::{Fault, FrameParameters, Invariant};

use self::gradient::coefficients;
use self::record::{Content, GatherSums, Record, Strongest};
use self::survey_state::Survey;
use crate::kind::{Capacity, Map};
use crate::render::{Context, GatherPoint};
use crate::sampler::{Dimension, Pattern};
use crate::vector::max;

/// Maximum number of coarsest cells that a block may overlap.
const MAX_ROOTS: usize = 16;
/// Minimum capacity of a cache: a block of one pixel has up to 4 corners, and 5 further points per division.
pub const MIN_RECORDS: usize = 4 + 5 * (lattice::LEVELS as usize - 1);

/// Irradiance records of a block.
pub struct IrradianceCache<R: Capacity> {
    /// Records by lattice point; `None` where the eye does not see a surface with a Lambertian part directly.
    records: R::Map<LatticePoint, Option<Record>>,
    /// Upper left corners of the coarsest cells, each with a bit mask of the divided cells in the cell's
    /// quadtree ([`lattice::Cell::tree_number`]).
    roots: Vec<(LatticePoint, u32), MAX_ROOTS>,
    survey: Survey,
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
        Self { records: Map::EMPTY, roots: Vec::new(), survey: Survey::BEGIN }
    }

    /// Sets the capacity to `records` records, a power of two, if the type leaves it open.
    pub fn reserve(&mut self, records: usize) {
        self.records.reserve(records);
    }

    /// Removes all records and sets up the coarsest cells of a window of the picture.
    ///
    /// # Errors
    /// [`Full`] if the window overlaps too many coarsest cells.
    pub fn begin(&mut self, window: &Window) -> Result<(), Full> {
        self.forget();
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
    }

    /// Number of lattice points that the cache holds, with or without a record.
    pub fn lattice_points(&self) -> u32 {
        self.records.entries() as u32
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
        if let Some((_, Some(record))) = self.records.entry_mut(index as usize)
            && let Content::Surveyed(distances) = &record.content
        {
            let sums = GatherSums::new(&coefficients(point, distances));
            record.content = Content::Gathering(Strongest::NONE, sums);
            return Ok(());
        }
        Err(Invariant::Record.fault())
    }

    /// Adds the weighted radiance of a gather ray in cell `cell` of the hemisphere, in the card image's
    /// radiance units, to record `index`.
    ///
    /// # Errors
    /// [`Invariant::Record`] if the record is not being gathered.
    #[inline]
    pub fn add(&mut self, index: u16, cell: u8, brought: Vec3) -> Result<(), Fault> {
        if let Some((_, Some(record))) = self.records.entry_mut(index as usize)
            && let Content::Gathering(strongest, sums) = &mut record.content
        {
            strongest.add(cell, brought);
            sums.add(cell, brought);
            return Ok(());
        }
        Err(Invariant::Record.fault())
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
            context.counters.records += 1;
            let irradiance = sums.limited(&strongest).irradiance(unit, record.distance);
            let reach = libm::sqrtf(allowed) * record.radius;
            record.content = Content::Gathered(irradiance.limited(max(reach, record.distance)));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kind::Entries;
    use crate::scene::Surface;

    #[test]
    fn light_of_a_record_that_is_not_being_gathered_is_a_fault() {
        let broken = Err(Invariant::Record.fault());
        let surface = Surface::white(Vec3::ZERO, Vec3::Y, 1.0);
        let mut cache = std::boxed::Box::new(IrradianceCache::<Entries<64>>::new());
        let point = GatherPoint::record(surface, Pattern::new(0, 0, 0, 0, Dimension::Irradiance), 1);
        assert_eq!(cache.add(0, 0, Vec3::ONE), broken, "there is none");
        let record = Some(Record::new(&surface, 0.1));
        assert!(cache.records.insert(LatticePoint { x: 0, y: 0 }, record).is_ok());
        assert_eq!(cache.add(0, 0, Vec3::ONE), broken, "it is being surveyed");
        assert_eq!(cache.begin_gather(0, &point), broken, "it is being surveyed");
        let mut record = Record::new(&surface, 0.1);
        assert_eq!(record.set_distance(0, 1.0), Ok(()));
        assert_eq!(record.end_survey(), Ok(()));
        assert_eq!(record.set_distance(0, 1.0), broken);
        assert_eq!(record.end_survey(), broken);
    }
}
