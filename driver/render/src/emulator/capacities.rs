//! Kinds of emulated chips with stated capacities, and the on-chip memory that these need.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::RangeInclusive;

use photoncard_firmware::card::{Card, MAX_TILES};
use photoncard_firmware::chip::Chip;
use photoncard_firmware::gather::REQUEST_BYTES;
use photoncard_firmware::kind::{
    ChipKind, Entries, FixedKind, MIN_RECORDS, REFERENCE, Reference, TechniqueMemory, cache_bytes, tag_bytes,
};
use photoncard_firmware::memory::Dram;
use photoncard_shared::budget::{
    Budget, MAX_DRAM_BYTES, MAX_GATHER_RAYS, MAX_IN_FLIGHT, MAX_SUMS, MAX_TILE_PIXELS, MAX_WAITING_BLOCKS,
    MAX_WAITING_POINTS, gather_buckets, gather_candidates, places_of_buckets, places_of_gathering,
};
use serde_json::{Value, json};

use super::emulated::Emulated;
use super::memory_model::CacheSpec;

/// Maximum on-chip memory of a kind, bytes. Each emulated chip takes as much host memory.
const MAX_SRAM: u64 = 16 << 20;
/// Minimum memory of an emulated card, bytes.
pub const MIN_DRAM_BYTES: u64 = 1 << 20;

/// Names and ranges of the capacities that can be stated.
const RANGES: [(&str, RangeInclusive<u64>); 16] = [
    ("sram_bytes", 1..=MAX_SRAM),
    ("dram_bytes", MIN_DRAM_BYTES..=MAX_DRAM_BYTES),
    ("photon_cache_bytes", 1..=MAX_SRAM),
    ("scene_cache_bytes", 1..=MAX_SRAM),
    ("stack_bytes", 0..=MAX_SRAM),
    ("tile_pixels", MAX_SUMS as u64..=MAX_TILE_PIXELS as u64),
    ("neighbors", 2..=REFERENCE.neighbors as u64),
    ("gather_rays", 1..=MAX_GATHER_RAYS as u64),
    ("gather_queue", 1..=1 << 20),
    ("irradiance_records", MIN_RECORDS as u64..=MAX_TILE_PIXELS as u64),
    ("shadow_rays", 1..=REFERENCE.shadow_rays as u64),
    ("samples", 1..=REFERENCE.samples as u64),
    ("tiles", 1..=MAX_TILES as u64),
    ("in_flight", 1..=MAX_IN_FLIGHT as u64),
    ("waiting_blocks", 0..=MAX_WAITING_BLOCKS as u64),
    ("gather_points", MIN_RECORDS as u64..=MAX_TILE_PIXELS as u64),
];

/// Stated capacities: values by name.
pub type Capacities = BTreeMap<String, Value>;

/// Error of stated capacities.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ChipError {
    /// A name is none of a capacity.
    #[error("{name:?} is none of the capacities {}", RANGES.map(|(name, _)| name).join(", "))]
    Unknown {
        /// The name.
        name: String,
    },
    /// A capacity is out of its range, or no number.
    #[error("{name} is {value}; use a whole number from {least} to {most}")]
    OutOfRange {
        /// Name of the capacity.
        name: &'static str,
        /// Stated value.
        value: Value,
        /// Smallest value.
        least: u64,
        /// Largest value.
        most: u64,
    },
    /// A capacity contradicts others.
    #[error("{name} is {value}; use {rule}")]
    Contradictory {
        /// Name of the capacity.
        name: &'static str,
        /// Value of the capacity.
        value: u32,
        /// Description of the values that are possible.
        rule: String,
    },
    /// A capacity is missing.
    #[error("the capacities are incomplete: {0}")]
    Incomplete(String),
    /// The parts of on-chip memory exceed it.
    #[error("sram_bytes is {most}, and its parts take {}: {parts}; use as much, or lower a capacity", parts.sum())]
    TooLarge {
        /// On-chip memory, bytes.
        most: u32,
        /// Parts of it.
        parts: SramParts,
    },
}

impl ChipError {
    /// Name of the capacity that the error is about.
    pub fn capacity(&self) -> &str {
        match self {
            Self::Unknown { name } => name,
            Self::OutOfRange { name, .. } | Self::Contradictory { name, .. } => name,
            Self::Incomplete(_) | Self::TooLarge { .. } => "sram_bytes",
        }
    }
}

/// Parts of the on-chip memory that firmware takes, bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SramParts {
    /// Lines of the photon map's cache.
    pub photon_cache: usize,
    /// Lines of the scene's cache.
    pub scene_cache: usize,
    /// Tags of both caches.
    pub cache_tags: usize,
    /// Call stack.
    pub stack: usize,
    /// Gather queue, and tables of what waits in card memory.
    pub reordering: usize,
    /// Irradiance records of all tiles in flight.
    pub irradiance_cache: usize,
    /// Direction tables of gather points.
    pub importance_sampling: usize,
    /// Sums of pixels, and the other buffers.
    pub others: usize,
}

impl SramParts {
    /// Names and sizes of the parts.
    fn rows(&self) -> [(&'static str, usize); 8] {
        [
            ("photon cache", self.photon_cache),
            ("scene cache", self.scene_cache),
            ("cache tags", self.cache_tags),
            ("stack", self.stack),
            ("gathers that wait", self.reordering),
            ("irradiance records", self.irradiance_cache),
            ("tables of directions", self.importance_sampling),
            ("other buffers", self.others),
        ]
    }

    /// Sum of the parts, bytes.
    pub fn sum(&self) -> usize {
        self.rows().iter().map(|(_, bytes)| bytes).sum()
    }
}

impl fmt::Display for SramParts {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.rows().map(|(name, bytes)| format!("{name} {bytes}")).join(" + "))
    }
}

impl Emulated {
    /// Replaces the stated capacities. But no block waits, unless it is stated, if the capacities have no
    /// room for it.
    ///
    /// # Errors
    /// The first capacity that is unknown, out of its range or contradicts others.
    pub fn with_capacities(self, stated: &Capacities) -> Result<Self, ChipError> {
        let mut capacities = self.to_json();
        for (name, value) in stated {
            let Some((name, range)) = RANGES.into_iter().find(|(known, _)| known == name) else {
                return Err(ChipError::Unknown { name: name.clone() });
            };
            if !value.as_u64().is_some_and(|number| range.contains(&number)) {
                let (least, most) = range.into_inner();
                return Err(ChipError::OutOfRange { name, value: value.clone(), least, most });
            }
            capacities[name] = value.clone();
        }
        let mut kind = Self::of(capacities)?;
        if !stated.contains_key("waiting_blocks")
            && (kind.points_of_block() > MAX_WAITING_POINTS || kind.buckets() == 0)
        {
            kind.budget.waiting_blocks = 0;
        }
        kind.check()?;
        Ok(kind)
    }

    /// Names of the capacities that can be stated.
    pub fn capacities() -> impl Iterator<Item = &'static str> {
        RANGES.iter().map(|(name, _)| *name)
    }

    /// Kind with the capacities in a JSON object that has all of them.
    fn of(mut capacities: Value) -> Result<Self, ChipError> {
        let incomplete = |error: serde_json::Error| ChipError::Incomplete(error.to_string());
        let points = serde_json::from_value(capacities["gather_points"].take()).map_err(incomplete)?;
        Ok(Self { budget: serde_json::from_value(capacities).map_err(incomplete)?, points })
    }

    /// JSON object with all capacities.
    pub fn to_json(self) -> Value {
        let mut fields = json!(self.budget);
        fields["gather_points"] = self.points.into();
        fields
    }

    /// Checks capacities that depend on each other. The firmware has the same checks for chips whose kind is
    /// a Rust type.
    fn check(&self) -> Result<(), ChipError> {
        let Budget { photon_cache_bytes, scene_cache_bytes, irradiance_records, in_flight, tiles, .. } =
            self.budget;
        let waiting_blocks = self.budget.waiting_blocks;
        let contradictory =
            |name, value, rule: &str| Err(ChipError::Contradictory { name, value, rule: rule.to_owned() });
        for (name, bytes) in
            [("photon_cache_bytes", photon_cache_bytes), ("scene_cache_bytes", scene_cache_bytes)]
        {
            if !(CacheSpec { bytes, ..CacheSpec::PHOTON }).is_possible() {
                return contradictory(name, bytes, "a multiple of 512: sets of four lines of 128 bytes");
            }
        }
        if !irradiance_records.is_power_of_two() {
            return contradictory("irradiance_records", irradiance_records, "a power of two");
        }
        if in_flight > tiles {
            return contradictory("in_flight", in_flight, &format!("at most {tiles}, the number of tiles"));
        }
        if waiting_blocks > 0 && self.points_of_block() > MAX_WAITING_POINTS {
            let rule = format!("0, or at most {MAX_WAITING_POINTS} tile_pixels and irradiance_records");
            return contradictory("waiting_blocks", waiting_blocks, &rule);
        }
        if waiting_blocks > 0 && self.buckets() == 0 {
            let rule = "0, or a gather_queue of 8 gathers or more";
            return contradictory("waiting_blocks", waiting_blocks, rule);
        }
        if self.points < irradiance_records as usize {
            let rule = format!("at least {irradiance_records}, the number of irradiance_records");
            return contradictory("gather_points", self.points as u32, &rule);
        }
        let (parts, most) = (self.sram_parts(), self.budget.sram_bytes);
        if parts.sum() > most as usize { Err(ChipError::TooLarge { most, parts }) } else { Ok(()) }
    }

    /// Maximum number of points of a block whose gathers wait.
    fn points_of_block(&self) -> u32 {
        self.budget.tile_pixels.max(self.budget.irradiance_records)
    }

    /// Number of buckets of waiting gathers for which the queue has room.
    fn buckets(&self) -> usize {
        gather_buckets(self.budget.gather_queue)
    }

    /// On-chip memory of the firmware, including caches and stack, bytes.
    pub fn sram_bytes(&self) -> usize {
        self.sizes()[0] + cache_bytes(&self.budget) + self.budget.stack_bytes as usize
    }

    /// Parts of the on-chip memory of the firmware. Their sum is [`Self::sram_bytes`].
    pub fn sram_parts(&self) -> SramParts {
        let [all, reordering, irradiance_cache, importance_sampling, _] = self.sizes();
        SramParts {
            photon_cache: self.budget.photon_cache_bytes as usize,
            scene_cache: self.budget.scene_cache_bytes as usize,
            cache_tags: tag_bytes(&self.budget),
            stack: self.budget.stack_bytes as usize,
            reordering,
            irradiance_cache,
            importance_sampling,
            others: all - reordering - irradiance_cache - importance_sampling,
        }
    }

    /// On-chip memory, bytes, that reordering, irradiance cache and importance sampling each add.
    pub fn techniques(&self) -> TechniqueMemory {
        let [_, reordering, irradiance_cache, importance_sampling, _] = self.sizes();
        TechniqueMemory { reordering, irradiance_cache, importance_sampling }
    }

    /// On-chip memory, bytes, that a chip whose gathers wait in card memory leaves free for caches while it
    /// casts rays, and while it does gathers.
    pub(super) fn free_bytes(&self) -> [usize; 2] {
        let queue = self.budget.gather_queue;
        let empty = |places: usize| (queue as usize).saturating_sub(places) * REQUEST_BYTES;
        let [.., others] = self.sizes();
        [empty(places_of_buckets(queue)), empty(places_of_gathering(queue)) + others]
    }

    /// Sizes, bytes, with these capacities: of the whole memory of the firmware, of its parts for reordering,
    /// irradiance cache and importance sampling, and of the buffers that are empty while gathers are done
    /// that have waited in card memory. They are extrapolated from probes: the size
    /// of a buffer is linear in its number of entries, and the size of the chip in its number of tiles in
    /// flight.
    fn sizes(&self) -> [usize; 5] {
        let Budget { tile_pixels, neighbors, gather_queue, irradiance_records, in_flight, .. } = self.budget;
        let blocks = self.budget.waiting_blocks as usize;
        let [pixels, queue, records, flights] =
            [tile_pixels, gather_queue, irradiance_records, in_flight].map(|entries| entries as usize);
        let buckets = if blocks == 0 { 0 } else { self.buckets() };
        let entries = [pixels, gather_candidates(neighbors), queue, records, self.points, buckets, blocks];
        let [one, two] = [extrapolated(&entries, &probes::<1>()), extrapolated(&entries, &probes::<2>())];
        std::array::from_fn(|i| {
            let bytes = one[i] + (two[i] - one[i]) * (flights as i64 - 1);
            (bytes as usize).next_multiple_of(ALIGNMENT)
        })
    }
}

/// Alignment of the chip's buffers, bytes.
const ALIGNMENT: usize = 8;
/// Number of entries of each buffer in the smallest `Probe`. Each other probe doubles one buffer.
const PROBED: usize = 64;

/// Extrapolates sizes linearly to buffers with the numbers of entries `entries`. The second argument has the
/// sizes of the smallest probe, then of seven probes that each have twice as many entries in one buffer.
fn extrapolated(entries: &[usize; 7], [base, doubled @ ..]: &[[usize; 5]; 8]) -> [i64; 5] {
    std::array::from_fn(|i| {
        let size = |sizes: &[usize; 5]| sizes[i] as i64;
        let slopes = doubled.iter().map(|sizes| size(sizes) - size(base));
        let more = entries.iter().map(|&entries| entries as i64 - PROBED as i64);
        size(base) + slopes.zip(more).map(|(slope, more)| slope * more / PROBED as i64).sum::<i64>()
    })
}

/// Sizes of the smallest probe with `FLIGHTS` tiles in flight, and of probes with twice as many entries of
/// one buffer.
const fn probes<const FLIGHTS: usize>() -> [[usize; 5]; 8] {
    const ONE: usize = PROBED;
    const TWO: usize = 2 * PROBED;
    [
        sizes_of::<Probe<ONE, ONE, ONE, ONE, ONE, ONE, ONE, FLIGHTS>>(),
        sizes_of::<Probe<TWO, ONE, ONE, ONE, ONE, ONE, ONE, FLIGHTS>>(),
        sizes_of::<Probe<ONE, TWO, ONE, ONE, ONE, ONE, ONE, FLIGHTS>>(),
        sizes_of::<Probe<ONE, ONE, TWO, ONE, ONE, ONE, ONE, FLIGHTS>>(),
        sizes_of::<Probe<ONE, ONE, ONE, TWO, ONE, ONE, ONE, FLIGHTS>>(),
        sizes_of::<Probe<ONE, ONE, ONE, ONE, TWO, ONE, ONE, FLIGHTS>>(),
        sizes_of::<Probe<ONE, ONE, ONE, ONE, ONE, TWO, ONE, FLIGHTS>>(),
        sizes_of::<Probe<ONE, ONE, ONE, ONE, ONE, ONE, TWO, FLIGHTS>>(),
    ]
}

const fn sizes_of<K: FixedKind>() -> [usize; 5] {
    let TechniqueMemory { reordering, irradiance_cache, importance_sampling } = Chip::<K>::TECHNIQUES;
    let empty = Chip::<K>::EMPTY_WHILE_GATHERING;
    [size_of::<Card<K, Dram<'static>>>(), reordering, irradiance_cache, importance_sampling, empty]
}

/// Kind of chip that is measured by `size_of` and never built. The parameters are the numbers of pixels,
/// candidates, gathers, irradiance records, gather points, buckets, waiting blocks and tiles in flight.
#[rustfmt::skip]
struct Probe<const T: usize, const C: usize, const G: usize, const R: usize, const P: usize, const B: usize, const W: usize, const F: usize>;

#[rustfmt::skip]
impl<const T: usize, const C: usize, const G: usize, const R: usize, const P: usize, const B: usize, const W: usize, const F: usize>
    ChipKind for Probe<T, C, G, R, P, B, W, F>
{
    type TilePixels = Entries<T>;
    type Candidates = Entries<C>;
    type GatherQueue = Entries<G>;
    type IrradianceRecords = Entries<R>;
    type Points = Entries<P>;
    type Buckets = Entries<B>;
    type WaitingBlocks = Entries<W>;
    type Flights = Entries<F>;

    fn budget(&self) -> &Budget {
        &REFERENCE
    }
}

#[rustfmt::skip]
impl<const T: usize, const C: usize, const G: usize, const R: usize, const P: usize, const B: usize, const W: usize, const F: usize>
    FixedKind for Probe<T, C, G, R, P, B, W, F>
{
    const KIND: Self = Self;
    const BUDGET: Budget = REFERENCE;
    const TECHNIQUE_LIMITS: TechniqueMemory = Reference::TECHNIQUE_LIMITS;
}

#[cfg(test)]
mod tests {
    use photoncard_firmware::card::sram_bytes;
    use photoncard_firmware::kind::{FixedKind, Large, Micro, Nano};
    use proptest::prelude::{ProptestConfig, any, prop, prop_assert, proptest};

    use super::*;

    /// Reference chip with the capacities of a JSON object.
    fn read(stated: Value) -> Result<Emulated, ChipError> {
        Emulated::like::<Reference>().with_capacities(&serde_json::from_value(stated).unwrap())
    }

    fn check_sizes<K: FixedKind>() {
        let kind = Emulated::like::<K>();
        assert_eq!((kind.sram_bytes(), kind.techniques()), (sram_bytes::<K>(), Chip::<K>::TECHNIQUES));
        assert_eq!(kind.sram_parts().sum(), kind.sram_bytes());
        assert_eq!(read(kind.to_json()), Ok(kind));
    }

    #[test]
    fn kinds_are_read_as_they_are_written_and_take_what_their_types_take() {
        check_sizes::<Reference>();
        check_sizes::<Large>();
        check_sizes::<Micro>();
        check_sizes::<Nano>();
        assert_eq!(read(json!({})), Ok(Emulated::like::<Reference>()));
        let names = RANGES.map(|(name, _)| name);
        let fields = Emulated::like::<Reference>().to_json();
        assert!(fields.as_object().unwrap().keys().all(|name| names.contains(&name.as_str())));
    }

    #[test]
    fn impossible_chips_are_refused_with_field_and_range() {
        for (stated, words) in [
            (json!({"pixels": 1}), ["\"pixels\" is none of", "tile_pixels"]),
            (json!({"gather_queue": 0}), ["gather_queue is 0", "1 to 1048576"]),
            (json!({"gather_queue": -1}), ["gather_queue is -1", "1 to 1048576"]),
            (json!({"gather_queue": "9"}), ["gather_queue is \"9\"", "1 to 1048576"]),
            (json!({"in_flight": 4_294_967_297_u64}), ["in_flight is 4294967297", "1 to 8"]),
            (json!({"neighbors": 257}), ["neighbors is 257", "2 to 256"]),
            (json!({"scene_cache_bytes": 1000}), ["scene_cache_bytes is 1000", "multiple of 512"]),
            (json!({"irradiance_records": 100}), ["irradiance_records is 100", "power of two"]),
            (json!({"in_flight": 5}), ["in_flight is 5", "at most 4"]),
            (json!({"tile_pixels": 8192, "waiting_blocks": 64}), ["waiting_blocks is 64", "at most 4096"]),
            (json!({"gather_queue": 4, "waiting_blocks": 1}), ["waiting_blocks is 1", "8 gathers"]),
            (json!({"gather_points": 256}), ["gather_points is 256", "at least 512"]),
            (json!({"gather_queue": 1_000_000}), ["sram_bytes is 1048576", "photon cache 131072 + "]),
        ] {
            let said = read(stated.clone()).unwrap_err().to_string();
            assert!(words.iter().all(|word| said.contains(word)), "{stated}: {said}");
        }
        assert_eq!(read(json!({"gather_queue": 4})).unwrap().budget.waiting_blocks, 0);
    }

    #[test]
    fn the_parts_in_a_refusal_add_up_to_the_stated_sum() {
        let refused = read(json!({"gather_queue": 100_000})).unwrap_err();
        let said = refused.to_string();
        let (sum, parts) = said.split_once("parts take ").unwrap().1.split_once(": ").unwrap();
        let sum: usize = sum.parse().unwrap();
        let parts = parts.split_once(';').unwrap().0.split(" + ");
        let bytes = parts.map(|part| part.rsplit_once(' ').unwrap().1.parse::<usize>().unwrap());
        assert_eq!(bytes.sum::<usize>(), sum, "{said}");
        // The sum fits itself: the buffers do not depend on the memory that they are in.
        let fitting = json!({"gather_queue": 100_000, "sram_bytes": sum});
        assert_eq!(read(fitting).unwrap().sram_bytes(), sum);
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        /// Half of the tested capacities are near the ends of their ranges.
        #[test]
        fn a_chip_that_is_not_refused_fits_and_can_be_built(
            stated in prop::collection::vec((0..RANGES.len(), any::<u64>(), 0..4_u64, any::<bool>()), 0..6),
        ) {
            let mut fields = json!({});
            for (field, number, step, is_near) in stated {
                let (name, range) = &RANGES[field];
                let near = if number % 2 == 0 { range.start() + step } else { range.end() - step.min(*range.end()) };
                fields[*name] = (if is_near { near } else { number >> (number % 64) }).into();
            }
            if let Ok(kind) = read(fields) {
                prop_assert!(kind.sram_bytes() <= kind.budget.sram_bytes as usize);
                prop_assert!(read(kind.to_json()) == Ok(kind));
                drop(kind.chip());
            }
        }
    }
}
