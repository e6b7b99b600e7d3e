//! Chains: records in lines of card memory, each of which has the address of the next older line. A chain is
//! written from its oldest line on and read from its newest line on.

use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::{Fault, Invariant};

use crate::memory::{MemoryPort, Room};

/// Bytes of a line that hold records. The address of the older line, the number of records and their format
/// follow.
pub(super) const RECORD_BYTES: usize = 120;

/// Address that stands for no line: a card image has at least this line.
pub(super) const NONE: u32 = 0;

/// Appends a line with encoded records of one format to the chain whose newest line is `newest`. The line
/// becomes the newest.
pub(super) fn append<const N: usize>(
    memory: &mut impl MemoryPort,
    room: &mut Room,
    newest: &mut u32,
    format: u8,
    records: impl Iterator<Item = [u8; N]>,
) -> Result<(), Fault> {
    let mut line = Line::ZERO;
    let mut count = 0;
    let (bytes, end) = line.0.split_at_mut(RECORD_BYTES);
    for (place, record) in bytes.as_chunks_mut().0.iter_mut().zip(records) {
        *place = record;
        count += 1;
    }
    if let Some((older, rest)) = end.split_first_chunk_mut() {
        *older = newest.to_le_bytes();
        rest.iter_mut().zip([count, format]).for_each(|(byte, value)| *byte = value);
    }
    *newest = room.write(memory, &line)?;
    Ok(())
}

/// Records of a line.
pub(super) struct Records<'a> {
    bytes: &'a [u8],
    count: usize,
    /// Format with which the line was appended.
    pub(super) format: u8,
}

impl Records<'_> {
    /// Calls `take` with each record.
    pub(super) fn each<const N: usize>(
        &self,
        take: impl FnMut(&[u8; N]) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        self.bytes.as_chunks().0.iter().take(self.count).try_for_each(take)
    }
}

/// Reads the newest line of a chain, whose next older line becomes the newest. Lines are written upwards, so
/// that a chain ends whatever the memory holds.
///
/// # Errors
/// [`Invariant::Room`] if the older line does not lie before the newest.
pub(super) fn read<'a>(memory: &'a mut impl MemoryPort, newest: &mut u32) -> Result<Records<'a>, Fault> {
    let line = memory.read(Structure::Waiting, LineAddress(*newest), 0..LINE_BYTES as u32)?;
    let (bytes, end) = line.0.split_at(RECORD_BYTES);
    let (older, rest) = end.split_first_chunk().unwrap_or((&[0; 4], &[]));
    let [count, format] = rest.first_chunk().copied().unwrap_or_default();
    let older = u32::from_le_bytes(*older);
    if older >= *newest {
        return Err(Invariant::Room.fault());
    }
    *newest = older;
    Ok(Records { bytes, count: count.into(), format })
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;
    use crate::memory::Dram;

    /// Lines before the room.
    const FIRST: u32 = 2;

    proptest! {
        /// Two chains in one room, whose lines alternate at random.
        #[test]
        fn chains_are_read_from_the_newest_line_to_the_oldest(
            written in prop::collection::vec((0..2_usize, prop::collection::vec(any::<[u8; 24]>(), 1..=5)), 0..12),
        ) {
            let mut lines = std::vec![Line([0xa5; LINE_BYTES]); FIRST as usize + written.len()];
            let (mut memory, mut room) = (Dram::new(&mut lines), Room::new(FIRST, written.len() as u32));
            let mut newest = [NONE; 2];
            for (chain, records) in &written {
                let records = records.iter().copied();
                let format = *chain as u8;
                prop_assert_eq!(append(&mut memory, &mut room, &mut newest[*chain], format, records), Ok(()));
            }
            prop_assert_eq!(room.next(), room.end());
            for (chain, newest) in newest.iter_mut().enumerate() {
                for (_, records) in written.iter().rev().filter(|(of_chain, _)| *of_chain == chain) {
                    let mut found: Vec<[u8; 24]> = Vec::new();
                    let line = read(&mut memory, newest).unwrap();
                    prop_assert_eq!(usize::from(line.format), chain);
                    prop_assert_eq!(line.each(|record| { found.push(*record); Ok(()) }), Ok(()));
                    prop_assert_eq!(&found, records);
                }
                prop_assert_eq!(*newest, NONE);
            }
        }
    }

    #[test]
    fn a_line_without_room_is_a_fault_and_leaves_the_chain() {
        let mut lines = [Line::ZERO; 4];
        let (mut memory, mut room, mut newest) = (Dram::new(&mut lines), Room::new(FIRST, 1), NONE);
        assert_eq!(append(&mut memory, &mut room, &mut newest, 0, [[1; 15]].into_iter()), Ok(()));
        let second = append(&mut memory, &mut room, &mut newest, 0, [[2; 15]].into_iter());
        assert_eq!((second, newest), (Err(Invariant::Room.fault()), FIRST));
    }

    #[test]
    fn a_damaged_chain_ends_in_a_fault() {
        for older in [FIRST, FIRST + 1, u32::MAX] {
            let mut lines = [Line::ZERO; 4];
            lines[FIRST as usize].0[RECORD_BYTES..RECORD_BYTES + 4].copy_from_slice(&older.to_le_bytes());
            let (mut memory, mut newest) = (Dram::new(&mut lines), FIRST);
            let result = read(&mut memory, &mut newest).map(|line| line.format);
            assert_eq!(result, Err(Invariant::Room.fault()), "{older}");
        }
    }
}
