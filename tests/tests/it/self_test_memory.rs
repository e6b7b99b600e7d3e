//! The test of card memory finds faults of data lines, address lines, byte lanes and cells. It names the
//! first wrong word, and counts all of them.

use std::ops::Range;

use photoncard_firmware::memory::{CardMemory, MemoryPort};
use photoncard_firmware::self_test::{MemoryTester, expected};
use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::message::{
    Fault, FaultCode, MemoryPattern, MemoryTest, WORDS_PER_LINE, WrongWord, WrongWords,
};
use proptest::prelude::*;

/// Number of lines of the tested memory: several steps of the tester, of which the last is not full.
const LINES: u32 = 1000;
const WORDS: u32 = LINES * WORDS_PER_LINE;

/// Defect of a memory.
#[derive(Clone, Copy, Debug)]
enum Defect {
    None,
    /// One data line is stuck at this value.
    DataLine {
        bit: u32,
        value: bool,
    },
    /// Two data lines are shorted: each carries the AND of both.
    DataShort {
        bits: [u32; 2],
    },
    /// One address line is stuck at this value.
    AddressLine {
        bit: u32,
        value: bool,
    },
    /// Two address lines are shorted: each carries the AND of both.
    AddressShort {
        bits: [u32; 2],
    },
    /// The memory has only this number of words, and repeats them.
    Mirror {
        words: u32,
    },
    /// One bit of one word is stuck at this value.
    Cell {
        word: u32,
        bit: u32,
        value: bool,
    },
    /// Byte lanes are missing: storing a byte writes the whole word, with this byte on all lanes.
    NoByteLanes,
}

/// Sets one bit of `word` to a value.
fn with_bit(word: u32, bit: u32, value: bool) -> u32 {
    word & !(1 << bit) | u32::from(value) << bit
}

/// Replaces two bits of `word` by their AND.
fn with_conjunction(word: u32, [a, b]: [u32; 2]) -> u32 {
    let both = word >> a & word >> b & 1 == 1;
    with_bit(with_bit(word, a, both), b, both)
}

/// Memory with a defect. `lines` is what its cells hold, `shown` what each address reads.
struct DefectiveMemory {
    lines: Vec<Line>,
    shown: Vec<Line>,
    defect: Defect,
    /// Number of lines or bytes written since the last step.
    writes: u32,
}

impl DefectiveMemory {
    fn new(defect: Defect) -> Self {
        let lines = vec![Line([0x5a; LINE_BYTES]); LINES as usize];
        Self { shown: lines.clone(), lines, defect, writes: 0 }
    }

    /// Index of the word that the index on the address lines selects.
    fn selected(&self, index: u32) -> u32 {
        match self.defect {
            Defect::AddressLine { bit, value } => with_bit(index, bit, value) % WORDS,
            Defect::AddressShort { bits } => with_conjunction(index, bits),
            Defect::Mirror { words } => index % words,
            _ => index,
        }
    }

    fn store(&mut self, index: u32, value: u32) {
        let place = self.selected(index);
        let value = match self.defect {
            Defect::DataLine { bit, value: stuck } => with_bit(value, bit, stuck),
            Defect::DataShort { bits } => with_conjunction(value, bits),
            Defect::Cell { word, bit, value: stuck } if word == place => with_bit(value, bit, stuck),
            _ => value,
        };
        put(&mut self.lines, place, value);
    }

    /// Updates `shown` after a step of the tester: a write may change what any number of addresses read.
    fn show(&mut self) {
        for index in 0..WORDS {
            let value = get(&self.lines, self.selected(index));
            put(&mut self.shown, index, value);
        }
    }
}

fn put(lines: &mut [Line], index: u32, value: u32) {
    let (line, word) = (index / WORDS_PER_LINE, index % WORDS_PER_LINE);
    lines[line as usize].0.as_chunks_mut().0[word as usize] = value.to_le_bytes();
}

fn get(lines: &[Line], index: u32) -> u32 {
    let (line, word) = (index / WORDS_PER_LINE, index % WORDS_PER_LINE);
    u32::from_le_bytes(lines[line as usize].0.as_chunks().0[word as usize])
}

impl MemoryPort for DefectiveMemory {
    fn read(&mut self, _: Structure, address: LineAddress, _: Range<u32>) -> Result<&Line, Fault> {
        Ok(&self.shown[address.0 as usize])
    }

    fn write(&mut self, _: Structure, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()> {
        let words = lines.as_flattened().as_chunks().0;
        for (index, bytes) in (first.0 * WORDS_PER_LINE..).zip(words) {
            self.store(index, u32::from_le_bytes(*bytes));
        }
        self.writes += lines.len() as u32;
        Some(())
    }
}

impl CardMemory for DefectiveMemory {
    fn lines(&self) -> u32 {
        LINES
    }

    fn stored(&mut self, first: LineAddress, count: u32) -> Option<&[Line]> {
        self.shown.get(first.0 as usize..(first.0 + count) as usize)
    }

    fn write_byte(&mut self, address: LineAddress, place: usize, byte: u8) -> Option<()> {
        let index = address.0 * WORDS_PER_LINE + place as u32 / 4;
        let mut bytes = get(&self.lines, self.selected(index)).to_le_bytes();
        bytes[place % 4] = byte;
        if let Defect::NoByteLanes = self.defect {
            bytes = [byte; 4];
        }
        self.store(index, u32::from_le_bytes(bytes));
        self.writes += 1;
        Some(())
    }
}

/// Wrong words of each pattern, as the tester reports them.
fn tested(defect: Defect) -> Vec<WrongWords> {
    let mut memory = DefectiveMemory::new(defect);
    let mut tester = MemoryTester::new(&memory).unwrap();
    let mut last: Option<MemoryTest> = None;
    let mut found = Vec::new();
    while last.is_none_or(|progress| !progress.is_over()) {
        memory.writes = 0;
        last = tester.step(&mut memory).unwrap().or(last);
        assert!(memory.writes <= 64 * WORDS_PER_LINE, "a step writes {} times", memory.writes);
        if memory.writes > 0 {
            memory.show();
        }
        if let Some(progress) = last.filter(|progress| found.len() == progress.pattern as usize)
            && progress.is_end_of_pattern()
        {
            found.push(progress.wrong);
        }
    }
    found
}

/// Wrong words of each pattern, from what each address reads after all writes in order.
fn foreseen(defect: Defect) -> Vec<WrongWords> {
    let mut memory = DefectiveMemory::new(defect);
    MemoryPattern::ALL
        .map(|pattern| {
            for index in 0..WORDS {
                match pattern {
                    MemoryPattern::ByteLanes => {
                        let lane = index as usize % 4;
                        let byte = expected(pattern, index).to_le_bytes()[lane];
                        let place = 4 * (index % WORDS_PER_LINE) as usize + lane;
                        memory.write_byte(LineAddress(index / WORDS_PER_LINE), place, byte).unwrap();
                    }
                    pattern => memory.store(index, expected(pattern, index)),
                }
            }
            memory.show();
            let mut wrong = WrongWords::default();
            for index in 0..WORDS {
                let (expected, found) = (expected(pattern, index), get(&memory.shown, index));
                if found != expected {
                    wrong.count += 1;
                    wrong.bits |= expected ^ found;
                    wrong.first.get_or_insert(WrongWord { index, expected, found });
                }
            }
            wrong
        })
        .to_vec()
}

fn defects() -> impl Strategy<Value = Defect> {
    let pair = |end: u32| (0..end, 1..end).prop_map(move |(a, step)| [a, (a + step) % end]);
    prop_oneof![
        Just(Defect::NoByteLanes),
        (0_u32..32, any::<bool>()).prop_map(|(bit, value)| Defect::DataLine { bit, value }),
        pair(32).prop_map(|bits| Defect::DataShort { bits }),
        (0_u32..14, any::<bool>()).prop_map(|(bit, value)| Defect::AddressLine { bit, value }),
        pair(14).prop_map(|bits| Defect::AddressShort { bits }),
        (5_u32..15).prop_map(|bits| Defect::Mirror { words: 1 << bits }),
        (0..WORDS, 0_u32..32, any::<bool>()).prop_map(|(word, bit, value)| Defect::Cell { word, bit, value }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    #[test]
    fn every_defect_is_found_at_its_addresses(defect in defects()) {
        let found = tested(defect);
        prop_assert!(found.iter().any(|wrong| wrong.count > 0), "{:?} is not found", defect);
        prop_assert_eq!(found, foreseen(defect));
    }
}

#[test]
fn a_sound_memory_passes() {
    assert_eq!(tested(Defect::None), vec![WrongWords::default(); MemoryPattern::ALL.len()]);
}

/// The first wrong word and its wrong bits identify the defective line.
#[test]
fn a_report_identifies_the_defective_line() {
    let [ones, zeros, address, complement, lanes] = tested(Defect::DataLine { bit: 9, value: true })[..]
    else {
        panic!("five patterns");
    };
    for wrong in [ones, zeros, address, complement, lanes] {
        assert_eq!(wrong.bits, 1 << 9);
    }
    assert_eq!((ones.count, zeros.count), (WORDS / 32 * 31, WORDS / 32));
    assert_eq!(ones.first, Some(WrongWord { index: 0, expected: 1, found: 1 | 1 << 9 }));

    // Half of the words read what was written last to the other half.
    let found = tested(Defect::AddressLine { bit: 8, value: false });
    assert_eq!(found[..2], [WrongWords::default(); 2], "lines 32 words apart hold the same walking bits");
    let [address, complement] = [found[2], found[3]];
    assert_eq!((address.bits, complement.bits), (1 << 8, 1 << 8));
    assert_eq!(address.first, Some(WrongWord { index: 0, expected: 0, found: 1 << 8 }));
    assert_eq!(complement.first, Some(WrongWord { index: 0, expected: !0, found: !(1 << 8) }));

    // The memory repeats after 8192 words, a quarter of its size.
    let address = tested(Defect::Mirror { words: 8192 })[2];
    assert_eq!(address.bits, 3 << 13);
    assert_eq!(address.count, WORDS - 8192);

    let cell = tested(Defect::Cell { word: 777, bit: 3, value: true });
    let counts: Vec<u32> = cell.iter().map(|wrong| wrong.count).collect();
    assert_eq!(cell[0].first.map(|word| word.index), Some(777));
    assert!(counts.iter().all(|&count| count <= 1), "{counts:?}");

    let found = tested(Defect::NoByteLanes);
    assert_eq!(found[..4], [WrongWords::default(); 4]);
    assert!(found[4].count > WORDS / 2);
}

/// The memory has fewer lines than it says, or none.
#[test]
fn a_memory_without_its_lines_is_a_fault() {
    struct Short(Vec<Line>, u32);
    impl MemoryPort for Short {
        fn read(&mut self, _: Structure, address: LineAddress, _: Range<u32>) -> Result<&Line, Fault> {
            Err(Fault { code: FaultCode::LineRange, detail: address.0 })
        }

        fn write(&mut self, _: Structure, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()> {
            self.0.get_mut(first.0 as usize..first.0 as usize + lines.len()).map(drop)
        }
    }
    impl CardMemory for Short {
        fn lines(&self) -> u32 {
            self.1
        }

        fn stored(&mut self, first: LineAddress, count: u32) -> Option<&[Line]> {
            self.0.get(first.0 as usize..(first.0 + count) as usize)
        }
    }
    let fault = |detail| Fault { code: FaultCode::LineRange, detail };
    assert_eq!(MemoryTester::new(&Short(Vec::new(), 0)).err(), Some(fault(0)));
    let mut memory = Short(vec![Line::ZERO; 3], 5);
    assert_eq!(MemoryTester::new(&memory).unwrap().step(&mut memory), Err(fault(3)));
}
