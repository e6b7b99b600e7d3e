//! The passes of a block's irradiance records.

use photoncard_shared::message::Fault;

use super::position::{Pass, Position};
use super::{Chip, MAX_BLOCKS, allowed_error};
use crate::irradiance_cache::{Full, Window};
use crate::kind::{Buffer, ChipKind};
use crate::memory::MemoryPort;
use crate::render::{Context, GatherPoint, final_gather};

impl<K: ChipKind> Chip<K> {
    fn window(&self) -> Window {
        let [x0, y0] = [self.tile.x + self.block.x, self.tile.y + self.block.y];
        Window { x0, x1: x0 + self.block.width, y0, y1: y0 + self.block.height }
    }

    /// Begins the survey of the block's records.
    pub(super) fn begin_records(&mut self) {
        self.position = Position::at(Pass::Survey);
        if self.cache.begin(&self.window()).is_err() {
            self.divide_block();
        }
    }

    /// Replaces the block, whose records do not fit into the cache, by its two halves. A block of one pixel always
    /// fits.
    fn divide_block(&mut self) {
        let Some([first, second]) = self.block.halves().filter(|_| self.blocks.len() + 2 <= MAX_BLOCKS)
        else {
            // Never reached: the cache has room for one pixel, and the stack of blocks for all halvings of a tile.
            // Every sample would then do its own final gather.
            return self.do_without_records();
        };
        for half in [second, first] {
            let _ = self.blocks.push(half);
        }
        self.position = Position::DONE;
    }

    fn do_without_records(&mut self) {
        self.cache.forget();
        self.position = Position::at(Pass::Eye);
    }

    /// Does the next step of the survey.
    pub(super) fn survey<M: MemoryPort>(&mut self, context: &mut Context<M>) -> Result<(), Fault> {
        let Some(allowed) = allowed_error(context.frame) else {
            self.do_without_records();
            return Ok(());
        };
        match self.cache.survey(context, &self.window(), allowed)? {
            Ok(true) => self.begin_gather(),
            Ok(false) => {}
            Err(Full) => self.divide_block(),
        }
        Ok(())
    }

    /// Begins the gather of the next records, or the eye rays if all records are gathered.
    fn begin_gather(&mut self) {
        let count = self.cache.begin_gather(self.points.view().len());
        self.position = Position::at(if count > 0 { Pass::RecordPoints } else { Pass::Eye });
    }

    /// Chooses the directions of one record's gather rays.
    pub(super) fn choose_record_point<M: MemoryPort>(
        &mut self,
        context: &mut Context<M>,
    ) -> Result<(), Fault> {
        let index = self.position.index;
        let point = self.cache.point(context.frame, index);
        if let (Some(mut point), Some(stored)) = (point, self.points.view_mut().get_mut(index as usize)) {
            point.choose_directions(context, self.gathers.candidates())?;
            self.cache.set_point(index, &point);
            stored.directions = point.directions;
        }
        if self.position.next_index(self.cache.being_gathered()) {
            self.position = Position::at(Pass::RecordRays);
        }
        Ok(())
    }

    /// Casts gather rays of the current direction bin for one record.
    pub(super) fn cast_for_record<M: MemoryPort>(&mut self, context: &mut Context<M>) -> Result<(), Fault> {
        let Self { points, cache, gathers, position, .. } = self;
        let index = position.index;
        let point = cache.point(context.frame, index);
        if let (Some(point), Some(stored)) = (point, points.view().get(index as usize)) {
            let point = &GatherPoint { directions: stored.directions, ..point };
            let of_bin = point.directions.rays(point.pattern, point.rays, position.bin, context.frame.bins);
            let (rays, is_last) = position.next_rays(of_bin);
            for ray in rays {
                // `index` fits 16 bits: it is below GATHERED.
                let end = final_gather::cast(context, point, index as u16, 1.0, ray)?;
                let Some(end) = end else { continue };
                cache.add(index as u16, end.cell, end.direct);
                if let Some(request) = end.request {
                    gathers.submit(context, request, &mut |request, brought| {
                        cache.add(request.target, request.cell, brought);
                    })?;
                }
            }
            if !is_last {
                return Ok(());
            }
        }
        if position.next_index(cache.being_gathered()) && position.next_bin(context.frame.bins) {
            self.position = Position::at(Pass::RecordSums);
        }
        Ok(())
    }

    /// Turns the sums of the gathered records into their irradiance, and begins the next records.
    pub(super) fn end_records<M: MemoryPort>(&mut self, context: &mut Context<M>) {
        if let Some(allowed) = allowed_error(context.frame) {
            self.cache.end_gather(context, allowed);
        }
        self.begin_gather();
    }
}
