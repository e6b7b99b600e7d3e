//! Line caches hit and miss as an LRU oracle does, and return what the memory holds.

use std::ops::Range;

use photoncard_firmware::memory::{
    CacheEntry, CacheShape, Counted, Dram, LineCache, LineCaches, Lines, MemoryPort, SetIndex, Stage, Work,
};
use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::{Fault, FaultCode};
use photoncard_tests::lru::LruOracle;
use proptest::prelude::*;

/// Lines that all have different contents.
fn numbered(count: u32) -> Vec<Line> {
    (0..count)
        .map(|number| {
            let mut line = Line::ZERO;
            line.0[..4].copy_from_slice(&number.to_le_bytes());
            line.0[124..].copy_from_slice(&number.to_be_bytes());
            line
        })
        .collect()
}

fn cache(shape: CacheShape) -> LineCache<Vec<CacheEntry>, Vec<Line>> {
    let entries = vec![CacheEntry::EMPTY; shape.entries()];
    LineCache::new(shape, entries, vec![Line::ZERO; shape.lines()]).expect("buffers of its size")
}

/// Shapes of caches: number of sets, number of ways, lines of card memory in a cache line, index of sets.
fn shapes() -> impl Strategy<Value = (u32, u32, u32, SetIndex)> {
    let sets = prop_oneof![Just(1), Just(4), 1_u32..14];
    let ways = prop_oneof![Just(1), Just(4), 1_u32..10];
    (sets, ways, 1_u32..=8, prop_oneof![Just(SetIndex::Modulo), Just(SetIndex::Hashed)])
}

/// Addresses below `end`: runs of random start, stride and length.
fn addresses(end: u32) -> impl Strategy<Value = Vec<u32>> {
    let run = (0..end, 1_u32..5, 1_usize..40);
    let runs = proptest::collection::vec(run, 1..60);
    runs.prop_map(move |runs| {
        let of_run = |(first, stride, count)| (0..count as u32).map(move |i| (first + i * stride) % end);
        runs.into_iter().flat_map(of_run).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    #[test]
    fn a_cache_hits_and_misses_as_its_definition_does(
        (sets, ways, lines, index) in shapes(),
        (count, addresses) in (1_u32..700).prop_flat_map(|count| (Just(count), addresses(count))),
        clear_every in 50_usize..400,
    ) {
        let line_bytes = lines * LINE_BYTES as u32;
        let shape = CacheShape::new(sets * ways * line_bytes, line_bytes, ways, index).unwrap();
        let of_block = move |block| match index {
            SetIndex::Modulo => block % sets,
            SetIndex::Hashed => shape.set(block),
        };
        let content = numbered(count);
        let mut memory = LineCaches::unified(Counted::new(Lines(&content)), cache(shape));
        let mut oracle = LruOracle::new(sets, ways, lines, of_block);
        let [mut misses, mut fetched] = [0, 0];
        for (access, &address) in addresses.iter().enumerate() {
            if access % clear_every == 0 {
                memory.begin_tile();
                oracle = LruOracle::new(sets, ways, lines, of_block);
            }
            if !oracle.hits(address) {
                misses += 1;
                let first = address / lines * lines;
                fetched += u64::from(lines.min(count - first));
            }
            let read = *memory.read(Structure::Photons, LineAddress(address), 0..20).unwrap();
            prop_assert_eq!(read, content[address as usize]);
            let reads = memory.below().traffic().reads(Stage::Begin, Structure::Photons);
            prop_assert_eq!([reads.misses, reads.requests], [misses, fetched], "access {} of {}", access, address);
            prop_assert_eq!(reads.bytes, fetched * LINE_BYTES as u64);
        }
    }

    /// Each kind of work has a cache of its own for all structures, which is empty when the work begins.
    #[test]
    fn a_kind_of_work_has_its_own_empty_cache(
        sizes in prop::array::uniform4(1_u32..20),
        parts in prop::collection::vec((0_usize..3, addresses(60)), 1..12),
    ) {
        let content = numbered(60);
        let [photon, scene, casting, gathering] = sizes;
        let of = |ways: u32| cache(CacheShape::new(ways * 128, 128, ways, SetIndex::Modulo).unwrap());
        let oracle = |ways| LruOracle::new(1, ways, 1, |_| 0);
        let memory = LineCaches::new(Counted::new(Lines(&content)), of(photon), of(scene));
        let mut memory = memory.with_work(of(casting), of(gathering));
        let mut misses = 0;
        for (kind, addresses) in parts {
            let mut oracles = match kind {
                0 => vec![oracle(photon), oracle(scene)],
                1 => vec![oracle(casting)],
                _ => vec![oracle(gathering)],
            };
            match kind {
                0 => memory.begin_tile(),
                1 => memory.begin_work(Work::Casting),
                _ => memory.begin_work(Work::Gathering),
            }
            for address in addresses {
                let half = address as usize % 2;
                let structure = [Structure::Photons, Structure::Nodes][half];
                let place = half % oracles.len();
                misses += u64::from(!oracles[place].hits(address));
                let read = *memory.read(structure, LineAddress(address), 0..128).unwrap();
                prop_assert_eq!(read, content[address as usize]);
                prop_assert_eq!(memory.below().traffic().sum(|_, _| true).requests, misses);
            }
        }
    }

    /// A read inside the memory returns its line, a read outside a fault, in any order.
    #[test]
    fn a_cache_returns_only_lines_of_its_memory(
        (sets, ways, lines, index) in shapes(),
        count in 1_u32..60,
        addresses in addresses(80),
    ) {
        let line_bytes = lines * LINE_BYTES as u32;
        let shape = CacheShape::new(sets * ways * line_bytes, line_bytes, ways, index).unwrap();
        let content = numbered(count);
        let mut memory = LineCaches::unified(Lines(&content), cache(shape));
        for address in addresses {
            let read = memory.read(Structure::Nodes, LineAddress(address), 0..128).copied();
            let fault = Fault { code: FaultCode::LineRange, detail: address };
            prop_assert_eq!(read, content.get(address as usize).copied().ok_or(fault));
        }
    }
}

#[test]
fn hashed_sets_are_used_evenly() {
    let shape = CacheShape::new(100 * 128, 128, 1, SetIndex::Hashed).unwrap();
    let mut blocks = [0; 100];
    (0..100_000).for_each(|block| blocks[shape.set(block * 64) as usize] += 1);
    assert!(blocks.iter().all(|count| (850..1150).contains(count)), "{blocks:?}");
}

#[test]
fn a_read_after_a_write_returns_the_written_line() {
    let mut lines = vec![Line::ZERO; 8];
    let shape = CacheShape::new(1024, 512, 2, SetIndex::Modulo).unwrap();
    let mut memory = LineCaches::new(Dram::new(&mut lines), cache(shape), cache(shape));
    for value in 1..4 {
        for structure in [Structure::Photons, Structure::Nodes] {
            for first in [0, 5] {
                memory.write(Structure::Header, LineAddress(first), &[[value; LINE_BYTES]; 2]).unwrap();
                let read = memory.read(structure, LineAddress(first + 1), 0..128).unwrap();
                assert_eq!(read.0, [value; LINE_BYTES]);
            }
        }
    }
    assert!(memory.write(Structure::Header, LineAddress(7), &[[0; LINE_BYTES]; 2]).is_none());
}

#[test]
fn a_write_and_a_kept_record_take_the_place_of_no_other_line() {
    let mut lines = vec![Line::ZERO; 64];
    let shape = CacheShape::new(1024, 512, 2, SetIndex::Modulo).unwrap();
    let mut memory = LineCaches::unified(Counted::new(Dram::new(&mut lines)), cache(shape));
    for address in [0, 4, 1, 5] {
        memory.read(Structure::Nodes, LineAddress(address), 0..128).unwrap();
    }
    let fetched =
        |memory: &LineCaches<Counted<Dram>, _, _>| memory.below().traffic().sum(|_, _| true).requests;
    assert_eq!(fetched(&memory), 8);
    memory.write(Structure::IrradianceRecords, LineAddress(20), &[[7; LINE_BYTES]]).unwrap();
    for _ in 0..2 {
        let kept = memory.read(Structure::IrradianceRecords, LineAddress(20), 0..128).unwrap();
        assert_eq!(kept.0, [7; LINE_BYTES]);
    }
    assert_eq!(fetched(&memory), 10);
    for address in [0, 4] {
        memory.read(Structure::Nodes, LineAddress(address), 0..128).unwrap();
    }
    assert_eq!(fetched(&memory), 10);
}

/// Memory that ends with the last line written.
struct Growing(Vec<Line>);

impl MemoryPort for Growing {
    fn read(&mut self, _: Structure, address: LineAddress, _: Range<u32>) -> Result<&Line, Fault> {
        self.0.get(address.0 as usize).ok_or(Fault { code: FaultCode::LineRange, detail: address.0 })
    }

    fn write(&mut self, _: Structure, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()> {
        self.0.truncate(first.0 as usize);
        self.0.extend(lines.iter().map(|line| Line(*line)));
        Some(())
    }
}

#[test]
fn lines_are_read_from_a_memory_that_grows() {
    let shape = CacheShape::new(1024, 512, 2, SetIndex::Modulo).unwrap();
    let mut memory = LineCaches::unified(Growing(Vec::new()), cache(shape));
    for value in 0..20 {
        memory.write(Structure::Header, LineAddress(value), &[[value as u8; LINE_BYTES]]).unwrap();
        for address in 0..value + 3 {
            let read = memory.read(Structure::Nodes, LineAddress(address), 0..128).map(|line| line.0[0]);
            let expected = (address <= value).then_some(address as u8);
            assert_eq!(read.ok(), expected, "line {address} of {value}");
        }
    }
}
