//! Irradiance records that a chip keeps in card memory, past the card image, from one frame of a picture to
//! the next.
//!
//! Records depend on the scene and the camera, not on the samples of a frame or its order of work. The
//! gathered records of a block are written together with the division of its cells. A frame with other
//! samples reads them back instead of surveying and gathering. The store also notes blocks whose records do
//! not fit into the cache, so that their survey is not repeated. Blocks that are not found are surveyed and
//! gathered again, with the same bits: blocks for which there was no room, and all blocks after a change of
//! the card image or of another parameter of the frame.
//!
//! | lines | contents |
//! |---|---|
//! | 128 | directory: for each hash of a window, address of the newest block's head; 0 for none |
//! | 1 per block | [`BlockHead`] |
//! | 1 per record | [`KeptRecord`], after the head of its block |

use core::ops::Range;

use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::{self, Drain, Fault, FrameParameters, Invariant};

use super::kept_line::{BlockHead, KeptRecord};
use super::{IrradianceCache, MAX_ROOTS, Window};
use crate::kind::{Capacity, Map};
use crate::light_groups::LightGroups;
use crate::memory::{MemoryPort, Stage, WORDS, line_of, words_of};
use crate::render::Context;
use crate::sampler::hash;

const DIRECTORY_LINES: u32 = 128;
/// Upper bound of the length of a frame's encoded parameters, bytes.
const KEY_BYTES: usize = 192;

/// Encoded parameters of a frame, with constants in place of the parameters that no record depends on. Floats
/// are compared by their bits.
type Key = [u8; KEY_BYTES];

/// Location of the kept records of one picture in the lines past the card image.
pub struct RecordStore {
    /// Parameters on which the kept records depend; `None` if no records are kept.
    key: Option<Key>,
    /// First of the lines reserved for kept records. `limit` is the line past the last of them.
    first: u32,
    limit: u32,
    /// End of the lines in use; equal to `first` if there is no directory.
    end: u32,
}

/// Result of a search for a block's records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Recalled {
    /// The records were found and are now in the cache.
    Records,
    /// The block was found, but its records do not fit into the cache.
    TooMany,
    /// The block was not found.
    Nothing,
}

// Functions are not inlined, because the lines that they hold would enlarge the stack frames of rays and
// gathers.
impl RecordStore {
    /// Store that keeps no records.
    pub const EMPTY: Self = Self { key: None, first: 0, limit: 0, end: 0 };

    /// Begins a frame. `room` is the range of lines past the card image where records may be kept. Keeps the
    /// records of earlier frames if these had the same `room` and differ only in samples and order of work;
    /// else drops them. If the card image has changed, [`Self::forget`] must be called.
    #[inline(never)]
    pub fn begin_frame(&mut self, frame: &FrameParameters, room: Range<u32>) {
        let key = key(frame);
        if key.is_none() || key != self.key || [room.start, room.end] != [self.first, self.limit] {
            *self = Self { key, first: room.start, limit: room.end, end: room.start };
        }
    }

    /// Forgets all records.
    pub fn forget(&mut self) {
        *self = Self::EMPTY;
    }

    /// Fills a cache with the kept records of a window, if there are any.
    ///
    /// # Errors
    /// If the memory is shorter than when the records were written.
    #[inline(never)]
    pub fn read_kept<M: MemoryPort, R: Capacity>(
        &self,
        context: &mut Context<M>,
        window: &Window,
        cache: &mut IrradianceCache<R>,
    ) -> Result<Recalled, Fault> {
        context.memory.enter(Stage::Survey);
        let Some((at, head)) = self.find(context.memory, window)? else { return Ok(Recalled::Nothing) };
        let Some(count) = head.records else { return Ok(Recalled::TooMany) };
        if cache.begin(window, LightGroups::of(context.frame)).is_err()
            || count as usize > cache.records.capacity()
        {
            return Ok(Recalled::Nothing);
        }
        for address in (at..).skip(1).take(count as usize) {
            if let Some(KeptRecord { point, record }) = KeptRecord::read(read(context.memory, address)?)
                && !cache.records.insert(point, Some(record))
            {
                return Err(Invariant::Record.fault());
            }
        }
        for ((_, divided), kept) in cache.roots.iter_mut().zip(head.divided) {
            *divided = kept;
        }
        // The records of all light groups at a lattice point count as one.
        context.counters.kept_records += u64::from(count) / LightGroups::of(context.frame).count() as u64;
        Ok(Recalled::Records)
    }

    /// Writes the gathered records of a window, if there is room.
    #[inline(never)]
    pub fn keep<M: MemoryPort, R: Capacity>(
        &mut self,
        memory: &mut M,
        window: &Window,
        cache: &IrradianceCache<R>,
    ) {
        let records = || {
            let entries = (0..cache.records.entries()).filter_map(|index| cache.records.entry(index));
            entries.filter_map(|(&point, record)| KeptRecord { point, record: (*record)? }.line())
        };
        let mut divided = [0; MAX_ROOTS];
        for (kept, (_, mask)) in divided.iter_mut().zip(&cache.roots) {
            *kept = *mask;
        }
        let count = records().count() as u32;
        let head = BlockHead { window: *window, older: 0, records: Some(count), divided };
        // Without room the next frame gathers the records again.
        let _ = self.append(memory, &head, records());
    }

    /// Notes, if there is room, that the irradiance records of a window do not fit into the cache.
    #[inline(never)]
    pub fn keep_full<M: MemoryPort>(&mut self, memory: &mut M, window: &Window) {
        let head = BlockHead { window: *window, older: 0, records: None, divided: [0; MAX_ROOTS] };
        // Without room the next frame surveys the window again.
        let _ = self.append(memory, &head, core::iter::empty());
    }

    /// Finds a window's block. Returns the line address of the block's head, and the head; `None` if the
    /// block is not kept.
    fn find<M: MemoryPort>(
        &self,
        memory: &mut M,
        window: &Window,
    ) -> Result<Option<(u32, BlockHead)>, Fault> {
        if self.end == self.first {
            return Ok(None);
        }
        let blocks = self.first + DIRECTORY_LINES;
        let (line, word) = self.place(window);
        let mut newer = self.end;
        let mut at = words_of(read(memory, line)?).get(word).copied().unwrap_or(0);
        // Each block lies before the newer one, so that the search ends whatever the memory holds.
        while (blocks..newer).contains(&at) {
            let head = BlockHead::read(read(memory, at)?);
            if head.window == *window {
                return Ok(Some((at, head)));
            }
            (newer, at) = (at, head.older);
        }
        Ok(None)
    }

    /// Line address of a window's directory entry, and the index of its word in that line.
    fn place(&self, window: &Window) -> (u32, usize) {
        let hash = hash(window.x0 ^ hash(window.y0));
        (self.first + hash % DIRECTORY_LINES, (hash / DIRECTORY_LINES) as usize % WORDS)
    }

    /// Appends a block and enters it into the directory; `None` if there is no room.
    fn append<M: MemoryPort>(
        &mut self,
        memory: &mut M,
        head: &BlockHead,
        records: impl Iterator<Item = Line>,
    ) -> Option<()> {
        let directory = if self.end == self.first { DIRECTORY_LINES } else { 0 };
        let at = self.end.checked_add(directory)?;
        let end = at.checked_add(1)?.checked_add(head.records.unwrap_or(0))?;
        if self.key.is_none() || end > self.limit {
            return None;
        }
        for address in self.end..at {
            write(memory, address, &Line::ZERO)?;
        }
        let (line, word) = self.place(&head.window);
        let mut newest = words_of(read(memory, line).ok()?);
        let older = newest.get(word).copied()?;
        *newest.get_mut(word)? = at;
        write(memory, at, &BlockHead { older, ..*head }.line())?;
        for (address, record) in (at..end).skip(1).zip(records) {
            write(memory, address, &record)?;
        }
        write(memory, line, &line_of(newest))?;
        self.end = end;
        Some(())
    }
}

fn read<M: MemoryPort>(memory: &mut M, address: u32) -> Result<&Line, Fault> {
    memory.read(Structure::IrradianceRecords, LineAddress(address), 0..LINE_BYTES as u32)
}

fn write<M: MemoryPort>(memory: &mut M, address: u32, line: &Line) -> Option<()> {
    memory.write(Structure::IrradianceRecords, LineAddress(address), &[line.0])
}

/// Key of a frame; `None` if the frame keeps no records.
fn key(frame: &FrameParameters) -> Option<Key> {
    let of_records = FrameParameters {
        first_sample: 0,
        samples: 1,
        bins: 1,
        drain: Drain::Immediate,
        queue: 1,
        in_flight: 1,
        adaptive_threshold: None,
        transparent: false,
        position: false,
        coverage: false,
        identities: false,
        ..*frame
    };
    let mut key = [0; KEY_BYTES];
    frame.keep_records.then(|| message::encode(&of_records, &mut key)).flatten()?;
    Some(key)
}

#[cfg(test)]
mod tests {
    use photoncard_shared::message::{Camera, CausticGather, Filter, Projection, Radiance, Sampling};

    use super::*;

    /// Frame whose encoding is as long as any.
    fn longest() -> FrameParameters {
        let axis = [f32::MAX; 3];
        let projection = Projection::ThinLens { right: axis, up: axis, focus: 1.0 };
        FrameParameters {
            width: u32::MAX,
            height: u32::MAX,
            camera: Camera { projection, ..Camera::pinhole(axis, axis, axis, axis) },
            seed: u32::MAX,
            first_sample: u32::MAX,
            samples: u32::MAX,
            planned_samples: u32::MAX,
            gather_rays: u32::MAX,
            shadow_rays: u32::MAX,
            neighbors: u32::MAX,
            max_distance: 1.0,
            sampling: Sampling::Mixture,
            irradiance_error: Some(1.0),
            bins: u32::MAX,
            drain: Drain::Buckets,
            queue: u32::MAX,
            radiance: Radiance::Precomputed,
            caustics: Some(CausticGather { neighbors: u32::MAX, max_distance: 1.0 }),
            layers: true,
            light_groups: 4,
            filter: Filter::BlackmanHarris,
            in_flight: u32::MAX,
            keep_records: true,
            adaptive_threshold: Some(1.0),
            transparent: true,
            position: true,
            coverage: true,
            identities: true,
            irradiance: true,
            near_distance: 1.0,
        }
    }

    #[test]
    fn the_longest_frame_has_a_key_of_what_records_depend_on() {
        let longest = longest();
        assert!(key(&longest).is_some());
        let is_kept = |change: &dyn Fn(&mut FrameParameters)| {
            let mut changed = longest;
            change(&mut changed);
            key(&changed) == key(&longest)
        };
        assert!(is_kept(&|frame| frame.transparent = false) && is_kept(&|frame| frame.identities = false));
        assert!(!is_kept(&|frame| frame.camera.shift[0] = 1.0) && !is_kept(&|frame| frame.seed = 1));
    }
}
