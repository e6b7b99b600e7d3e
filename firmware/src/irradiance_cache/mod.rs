//! The parallel irradiance cache: indirect irradiance is gathered at few points, with its gradients, and interpolated
//! between them (Ward, Rubinstein, Clear 1988; Ward, Heckbert 1992; neighbour clamping after Křivánek 2006, among the
//! corners of a cell).
//!
//! The published caches are filled on demand, so that each pixel depends on the pixels before it. The dissertation
//! makes the cache parallel by removing this dependence, without giving the method; this is a reconstruction. The
//! positions of the records depend only on the geometry seen in one cell of a lattice over the picture:
//!
//! - Records are at the corners of the cells, 16 pixels apart. A survey determines the surface that each record sees,
//!   and the harmonic mean of its distances to surrounding surfaces along a few rays, without a gather.
//! - A cell is divided in four, down to a side of 2 pixels, unless its corners cover it: every corner, and every point
//!   that a division would add, is within the allowed error of all four corner records.
//! - A sample interpolates the up to four corner records of its undivided cell that are valid at the surface it sees,
//!   with weights that are continuous across cells of one size. Without a valid record it casts gather rays of its own.
//! - All records are gathered. The coefficients of their gradients are known from the survey, so that their gathers may
//!   be reordered like all others. Hardly any record is wasted: each is a corner of an undivided cell.
//!
//! Two tiles with a common lattice point therefore compute the same record, and there are no seams. A tile whose
//! records do not fit into the cache is rendered in smaller blocks: more records are computed twice, and no pixel
//! changes.
//!
//! Direct light is divided between shadow rays and gather rays ([`crate::render::direct`]): the gather rays' part,
//! mostly light of large emitters, is in the records.

mod gradient;
mod interpolation;
mod lattice;
mod record;
mod survey;
mod survey_state;

pub use interpolation::SeenSample;
pub use lattice::{LatticePoint, Window};

use glam::Vec3;
use heapless::Vec;
use photoncard_shared::message::FrameParameters;

use self::gradient::{coefficients, rotation};
use self::record::{Content, Irradiance, Record};
use self::survey_state::Survey;
use crate::fixed_point::ColourSum;
use crate::importance::CELLS;
use crate::kind::{Buffer, Capacity, Map};
use crate::render::{Context, GatherPoint};
use crate::sampler::{Dimension, Pattern};
use crate::vector::{from_upper_half, max, upper_half};

/// Maximum number of coarsest cells that a block may overlap.
const MAX_ROOTS: usize = 16;
/// Maximum number of records of a block of one pixel: 4 corners, and 5 more for each division.
const MIN_RECORDS: usize = 4 + 5 * (lattice::LEVELS as usize - 1);

/// Irradiance records of a block: up to `R`, a power of two, of which up to `G` are gathered at once.
pub struct IrradianceCache<R: Capacity, G: Capacity> {
    /// Records by lattice point; `None` where no surface with a Lambertian part is seen.
    records: R::Map<LatticePoint, Option<Record>>,
    /// Coarsest cells, each with a bit mask of the divided cells in its quadtree ([`lattice::Cell::tree_number`]).
    roots: Vec<(LatticePoint, u32), MAX_ROOTS>,
    survey: Survey,
    gathered: G::Buffer<GatheredRecord>,
    /// Index of the first record that is not yet gathered or being gathered.
    next: usize,
}

/// Sums of a record that is being gathered.
struct GatheredRecord {
    /// Index of the record.
    record: usize,
    /// Coefficients of each cell for the translational gradient, bfloat16.
    coefficients: [[u16; 2]; CELLS],
    mean: ColourSum,
    translation: [ColourSum; 2],
    rotation: [ColourSum; 2],
}

/// Error: the cache's buffers do not suffice for the block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Full;

impl<R: Capacity, G: Capacity> Default for IrradianceCache<R, G> {
    fn default() -> Self {
        Self::new()
    }
}

impl<R: Capacity, G: Capacity> IrradianceCache<R, G> {
    const SUFFICES: () = {
        assert!(R::ENTRIES >= MIN_RECORDS, "a block of one pixel must fit");
        assert!(G::ENTRIES > 0 && G::ENTRIES <= 1 << 16, "a gather's target is told in 16 bits");
    };

    /// A cache without records.
    pub const fn new() -> Self {
        let () = Self::SUFFICES;
        Self {
            records: Map::EMPTY,
            roots: Vec::new(),
            survey: Survey::BEGIN,
            gathered: Buffer::EMPTY,
            next: 0,
        }
    }

    /// Removes all records and begins with the coarsest cells of a window of the picture.
    ///
    /// # Errors
    /// [`Full`] if the window overlaps too many cells.
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

    /// Removes all cells and records: nothing is interpolated.
    pub fn forget(&mut self) {
        self.records.clear();
        self.roots.clear();
        self.survey = Survey::BEGIN;
        self.gathered.view_mut().clear();
        self.next = 0;
    }

    /// Begins the gather of the next records, up to `most`. Returns their number; 0 if all records are gathered.
    pub fn begin_gather(&mut self, most: usize) -> u32 {
        self.gathered.view_mut().clear();
        while self.gathered.view().len() < most.min(G::ENTRIES) {
            let Some((_, record)) = self.records.entry(self.next) else { break };
            if let Some(Record { content: Content::Surveyed(_), .. }) = record {
                let gathered = GatheredRecord {
                    record: self.next,
                    coefficients: [[0; 2]; CELLS],
                    mean: ColourSum::ZERO,
                    translation: [ColourSum::ZERO; 2],
                    rotation: [ColourSum::ZERO; 2],
                };
                // Always fits: the loop ends at its capacity.
                let _ = self.gathered.view_mut().push(gathered);
            }
            self.next += 1;
        }
        self.gathered.view().len() as u32
    }

    /// Gather point of record `index` of the records being gathered, without directions; `None` if there is no such
    /// record.
    #[inline(always)]
    pub fn point(&self, frame: &FrameParameters, index: u32) -> Option<GatherPoint> {
        let gathered = self.gathered.view().get(index as usize)?;
        let (&LatticePoint { x, y }, record) = self.records.entry(gathered.record)?;
        let pattern = Pattern::new(frame.seed, x, y, 0, Dimension::Irradiance);
        Some(GatherPoint::record(record.as_ref()?.surface(), pattern, frame.gather_rays))
    }

    /// Number of records being gathered.
    pub fn being_gathered(&self) -> u32 {
        self.gathered.view().len() as u32
    }

    /// Sets the directions of record `index` of the records being gathered, which determine its gradient's
    /// coefficients.
    pub fn set_point(&mut self, index: u32, point: &GatherPoint) {
        let Some(gathered) = self.gathered.view_mut().get_mut(index as usize) else { return };
        let record = self.records.entry(gathered.record).and_then(|(_, record)| record.as_ref());
        if let Some(Record { content: Content::Surveyed(distances), .. }) = record {
            gathered.coefficients = coefficients(point, distances).map(|cell| cell.map(upper_half));
        }
    }

    /// Adds the radiance of a gather ray in a cell of the hemisphere to record `index` of the records being gathered.
    #[inline]
    pub fn add(&mut self, index: u16, cell: u8, brought: Vec3) {
        let Some(gathered) = self.gathered.view_mut().get_mut(index as usize) else { return };
        gathered.mean.add(brought);
        if let Some(coefficients) = gathered.coefficients.get(cell as usize) {
            for (sum, coefficient) in gathered.translation.iter_mut().zip(coefficients) {
                sum.add(brought * from_upper_half(*coefficient));
            }
        }
        for (sum, coefficient) in gathered.rotation.iter_mut().zip(rotation(cell)) {
            sum.add(brought * coefficient);
        }
    }

    /// Ends the gather of the records: turns their sums into irradiance over pi, W/(sr m^2).
    pub fn end_gather<M>(&mut self, context: &mut Context<M>, allowed: f32) {
        let unit = context.scene.header.radiance_unit;
        for gathered in self.gathered.view() {
            context.counters.records += 1;
            let record = self.records.entry_mut(gathered.record);
            let Some((_, Some(record))) = record else { continue };
            let irradiance = Irradiance {
                mean: gathered.mean.value() * unit,
                translation: gathered.translation.map(|sum| sum.value() * (unit / record.distance)),
                rotation: gathered.rotation.map(|sum| sum.value() * unit),
            };
            let reach = libm::sqrtf(allowed) * record.radius;
            record.content = Content::Gathered(irradiance.limited(max(reach, record.distance)));
        }
        self.gathered.view_mut().clear();
    }
}
