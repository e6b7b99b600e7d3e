//! Passes of a block's irradiance records.

use photoncard_shared::message::{Fault, FrameParameters, Invariant};

use super::buffers::Shared;
use super::flight::{Flight, allowed_error};
use super::position::{Pass, Position};
use super::stored_point::StoredPoint;
use crate::gather::PointIndex;
use crate::irradiance_cache::{Full, Recalled};
use crate::kind::ChipKind;
use crate::light_groups::LightGroups;
use crate::memory::MemoryPort;
use crate::render::{RenderJob, final_gather};

impl<K: ChipKind> Flight<K> {
    /// Reads the block's records back if an earlier frame kept them.
    pub(super) fn read_kept<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        shared: &mut Shared<K>,
    ) -> Result<(), Fault> {
        let window = self.window();
        match shared.store.read_kept(&mut job.context(&mut self.counters), &window, &mut self.cache)? {
            Recalled::Records => {
                self.position = Position::at(Pass::CompletePlain);
            }
            Recalled::TooMany => self.divide_block()?,
            Recalled::Nothing => self.begin_records(job.frame)?,
        }
        Ok(())
    }

    /// Begins the survey, which places the block's irradiance records.
    pub(super) fn begin_records(&mut self, frame: &FrameParameters) -> Result<(), Fault> {
        self.position = Position::at(Pass::Survey);
        match self.cache.begin(&self.window(), LightGroups::of(frame)) {
            Ok(()) => Ok(()),
            Err(Full) => self.divide_block(),
        }
    }

    /// Does the next step of the survey.
    pub(super) fn survey<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        shared: &mut Shared<K>,
    ) -> Result<(), Fault> {
        let Some(allowed) = allowed_error(job.frame) else {
            return self.do_without_records();
        };
        let window = self.window();
        match self.cache.survey(&mut job.context(&mut self.counters), &window, allowed)? {
            Ok(true) => {
                shared.points.clear();
                self.position = Position::at(Pass::RecordPoints);
            }
            Ok(false) => {}
            Err(Full) => {
                if job.frame.keep_records {
                    shared.store.keep_full(job.memory, &window);
                }
                self.divide_block()?;
            }
        }
        Ok(())
    }

    /// Chooses the direction table for the gather rays of the next record.
    pub(super) fn choose_record_point<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        shared: &mut Shared<K>,
    ) -> Result<(), Fault> {
        let index = self.position.index;
        if let Some(mut point) = self.cache.point(job.frame, index) {
            point.choose_directions(&mut job.context(&mut self.counters), shared.gathers.candidates())?;
            self.cache.begin_gather(index, &point)?;
            // An index fits 15 bits, by the check of the kind's capacities.
            let stored = StoredPoint::of_record(&point);
            shared.points.push(index as u16, stored, stored.first_bin(point.pattern, job.frame.bins))?;
        }
        if self.position.next_index(self.cache.lattice_points()) {
            self.position = Position::at(Pass::RecordRays);
        }
        Ok(())
    }

    /// Casts gather rays of the next record that has rays in the current direction bin.
    pub(super) fn cast_for_record<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        shared: &mut Shared<K>,
        flight: usize,
    ) -> Result<(), Fault> {
        let Shared { points, gathers, rounds, .. } = shared;
        let bins = job.frame.bins;
        let Some((index, record)) = points.next(&self.position) else {
            if self.position.end_bin(bins) {
                self.position = Position::at(Pass::WaitForRecords);
            }
            return Ok(());
        };
        let target = self.target(flight, PointIndex::Record(record));
        let Self { cache, counters, position, waiting, .. } = self;
        let mut point = cache.point(job.frame, record.into()).ok_or(Invariant::Record.fault())?;
        let rays = points.take_rays(position, index, point.pattern, job.frame)?;
        point.directions = points.get(index)?.1.directions;
        let context = &mut job.context(counters);
        let mut ends = final_gather::GatherRayEnds::new();
        for bundle in final_gather::bundles(rays) {
            final_gather::cast(context, &point, target, bundle, &mut ends)?;
            for end in &ends {
                cache.add(record, end.cell, &end.light)?;
                if let Some(request) = end.request {
                    match gathers.submit(context, rounds, request)? {
                        None => *waiting += 1,
                        Some(brought) => cache.add(record, end.cell, &brought)?,
                    }
                }
            }
        }
        Ok(())
    }

    /// Converts the gathered light of the block's records to irradiance. Keeps the records in card memory if
    /// the frame asks for it.
    pub(super) fn end_records<M: MemoryPort>(
        &mut self,
        job: &mut RenderJob<M>,
        shared: &mut Shared<K>,
    ) -> Result<(), Fault> {
        // Only frames with an error bound gather records.
        let allowed = allowed_error(job.frame).ok_or(Invariant::Record.fault())?;
        self.cache.end_gather(&mut job.context(&mut self.counters), allowed)?;
        if job.frame.keep_records {
            shared.store.keep(job.memory, &self.window(), &self.cache);
        }
        Ok(())
    }
}
