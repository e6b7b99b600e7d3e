//! Model of a chip's memory: its caches, and counters of the traffic above and below them.

use std::fmt;
use std::str::FromStr;

use photoncard_firmware::memory::{
    CacheEntry, CacheShape, Counted, LineCache, LineCaches, Lines, MemoryPort, Reads, SetIndex, ShapeError,
    Traffic,
};
use photoncard_shared::address::{LINE_BYTES, Line, Structure};

use super::contents::{Contents, Inspected};
use super::trace::TraceFile;

/// Caches between a chip and its DRAM.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CacheSettings {
    /// Separate caches for the photon map and for the scene.
    Split {
        /// Cache for the photon map.
        photon: CacheSpec,
        /// Cache for the scene.
        scene: CacheSpec,
        /// Caches for everything while gathers wait in card memory; `None` for those above.
        by_work: Option<CachesByWork>,
    },
    /// One cache for everything.
    Unified(CacheSpec),
}

/// Caches for everything of a chip whose gathers wait in card memory, in the memory that each kind of work
/// leaves free.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CachesByWork {
    /// Cache while the chip casts rays and completes pixels.
    pub casting: CacheSpec,
    /// Cache while it does gathers.
    pub gathering: CacheSpec,
}

/// Shape of a cache, in text `SIZE/LINE/WAYS`, and its mapping of addresses to sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CacheSpec {
    /// Capacity, bytes.
    pub bytes: u32,
    /// Size of a cache line, bytes.
    pub line_bytes: u32,
    /// Associativity: number of lines per set.
    pub ways: u32,
    /// Mapping from a line's address to its set.
    pub index: SetIndex,
}

impl CacheSpec {
    /// Photon cache of the dissertation: 128 KB with lines of 128 bytes (section 6.5). The 4 ways are this
    /// project's choice.
    pub const PHOTON: Self = Self { bytes: 128 << 10, line_bytes: 128, ways: 4, index: SetIndex::Modulo };
    /// Ray caster cache of the dissertation: 75 KB (section 7.3.2), otherwise like [`Self::PHOTON`].
    pub const SCENE: Self = Self { bytes: 75 << 10, ..Self::PHOTON };

    fn shape(&self) -> Result<CacheShape, ShapeError> {
        CacheShape::new(self.bytes, self.line_bytes, self.ways, self.index)
    }

    /// The cache with as many whole sets as have room in its bytes.
    pub(super) fn in_whole_sets(self) -> Self {
        let set = self.line_bytes * self.ways;
        Self { bytes: self.bytes - self.bytes % set, ..self }
    }

    /// Returns whether the shape is valid; in particular, the size must be a whole number of sets.
    pub(super) fn is_possible(&self) -> bool {
        self.shape().is_ok()
    }

    fn cache(&self) -> LineCache<Vec<CacheEntry>, Vec<Line>> {
        // Parsed texts, the constants and checked budgets are valid shapes.
        let shape = self.shape().unwrap_or_else(|error| unreachable!("{self}: {error:?}"));
        let entries = vec![CacheEntry::EMPTY; shape.entries()];
        let lines = vec![Line::ZERO; shape.lines()];
        LineCache::new(shape, entries, lines).unwrap_or_else(|| unreachable!("buffers of the shape's size"))
    }
}

impl Default for CacheSettings {
    fn default() -> Self {
        Self::Split { photon: CacheSpec::PHOTON, scene: CacheSpec::SCENE, by_work: None }
    }
}

impl fmt::Display for CacheSpec {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if self.bytes.is_multiple_of(1 << 10) {
            write!(f, "{}K", self.bytes >> 10)?;
        } else {
            write!(f, "{}", self.bytes)?;
        }
        write!(f, "/{}/{}", self.line_bytes, self.ways)
    }
}

impl fmt::Display for CacheSettings {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let index = match self {
            Self::Split { photon, scene, by_work } => {
                write!(f, "photon={photon},scene={scene}")?;
                if let Some(CachesByWork { casting, gathering }) = by_work {
                    write!(f, ",casting={casting},gathering={gathering}")?;
                }
                photon.index
            }
            Self::Unified(cache) => {
                write!(f, "unified={cache}")?;
                cache.index
            }
        };
        if index == SetIndex::Hashed { f.write_str(",index=hash") } else { Ok(()) }
    }
}

impl FromStr for CacheSettings {
    type Err = String;

    /// Parses `photon=128K/128/4,scene=75K/128/4,index=hash` or `unified=256K/128/8,index=hash`. Parts that
    /// are left out have default values. The parts `casting` and `gathering` ([`CachesByWork`]) come
    /// together, and there are none by default.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut stated: Vec<(&str, &str)> = Vec::new();
        for part in text.split(',') {
            let known = part.split_once('=').filter(|(name, _)| Self::PARTS.contains(name));
            let (name, value) = known.ok_or_else(|| usage(part))?;
            if stated.iter().any(|(other, _)| *other == name) {
                return Err(format!("{name} is given twice"));
            }
            stated.push((name, value));
        }
        let states = |name: &str| stated.iter().any(|(stated, _)| *stated == name);
        if states("casting") != states("gathering") {
            return Err("casting and gathering are two kinds of work: give a cache for each".into());
        }
        let placeholder = CachesByWork { casting: CacheSpec::PHOTON, gathering: CacheSpec::PHOTON };
        let by_work = states("casting").then_some(placeholder);
        let base = Self::Split { photon: CacheSpec::PHOTON, scene: CacheSpec::SCENE, by_work };
        stated.sort_by_key(|(name, _)| Self::rank(name));
        stated.into_iter().try_fold(base, |caches, (name, value)| {
            caches.with_part(name, value).unwrap_or_else(|| Err(usage(name)))
        })
    }
}

fn usage(part: &str) -> String {
    format!(
        "{part:?} is no part of a cache; use photon=SIZE/LINE/WAYS, scene=SIZE/LINE/WAYS or unified=SIZE/LINE/WAYS, \
         casting and gathering for gathers that wait in card memory, and index=modulo or index=hash, such as photon=128K/128/4,scene=75K/128/4"
    )
}

fn set_index(text: &str) -> Result<SetIndex, String> {
    match text {
        "modulo" => Ok(SetIndex::Modulo),
        "hash" => Ok(SetIndex::Hashed),
        _ => Err(format!("{text:?} is no index of sets; use modulo or hash")),
    }
}

fn cache(text: &str) -> Result<CacheSpec, String> {
    let parts: Vec<&str> = text.split('/').collect();
    let &[size, line, ways] = parts.as_slice() else {
        return Err(format!("{text:?} is no cache; use SIZE/LINE/WAYS, such as 128K/128/4"));
    };
    let number =
        |text: &str| text.parse::<u32>().map_err(|_| format!("{text:?} is no number of bytes or ways"));
    let bytes = match size.strip_suffix(['K', 'M']) {
        Some(digits) => {
            let shift = if size.ends_with('K') { 10 } else { 20 };
            number(digits)?.checked_mul(1 << shift).ok_or_else(|| format!("{size} is too large"))?
        }
        None => number(size)?,
    };
    let spec = CacheSpec { bytes, line_bytes: number(line)?, ways: number(ways)?, index: SetIndex::Modulo };
    match spec.shape() {
        Ok(_) => Ok(spec),
        Err(ShapeError::LineBytes) => Err(format!(
            "a cache's line is {LINE_BYTES} bytes, as card memory's, or a multiple up to {}; {line} is none",
            CacheShape::MAX_LINE_BYTES
        )),
        Err(ShapeError::Ways) => Err(format!("a cache of {text} has no {ways} ways; use 1 to all its lines")),
        Err(ShapeError::Bytes) => Err(format!(
            "{size} is no whole number of sets of {ways} lines of {line} bytes, or above {} bytes",
            CacheShape::MAX_BYTES
        )),
    }
}

/// A memory behind caches. The traffic above and below the caches is counted, and so are the contents of the
/// lines that the chip reads.
pub type ModelledMemory<M> = Inspected<Counted<LineCaches<Counted<M>, Vec<CacheEntry>, Vec<Line>>>>;

impl CacheSettings {
    /// Names of the parts of a text.
    pub(crate) const PARTS: [&'static str; 6] =
        ["photon", "scene", "unified", "casting", "gathering", "index"];

    /// Order in which parts are replaced: a cache for everything comes first, so that others beside it are
    /// refused, and the index of all caches last.
    pub(crate) fn rank(name: &str) -> u8 {
        match name {
            "unified" => 0,
            "index" => 2,
            _ => 1,
        }
    }

    /// Replaces the part `name` by the one in `text`; `None` if there is no such part.
    pub(crate) fn with_part(mut self, name: &str, text: &str) -> Option<Result<Self, String>> {
        if !Self::PARTS.contains(&name) {
            return None;
        }
        let replaced = match (name, &mut self) {
            ("index", _) => set_index(text).map(|index| self.specs().for_each(|spec| spec.index = index)),
            ("unified", _) => cache(text).map(|spec| self = Self::Unified(spec)),
            ("photon", Self::Split { photon, .. }) => cache(text).map(|spec| *photon = spec),
            ("scene", Self::Split { scene, .. }) => cache(text).map(|spec| *scene = spec),
            ("casting", Self::Split { by_work: Some(caches), .. }) => {
                cache(text).map(|spec| caches.casting = spec)
            }
            ("gathering", Self::Split { by_work: Some(caches), .. }) => {
                cache(text).map(|spec| caches.gathering = spec)
            }
            (_, Self::Split { .. }) => Err("no block waits on this chip: leave it out".to_owned()),
            _ => Err("unified replaces all other caches: give unified, or the others".to_owned()),
        };
        Some(replaced.map(|()| self))
    }

    /// Each of the caches.
    fn specs(&mut self) -> impl Iterator<Item = &mut CacheSpec> {
        let (first, scene, by_work) = match self {
            Self::Split { photon, scene, by_work } => (photon, Some(scene), by_work.as_mut()),
            Self::Unified(both) => (both, None, None),
        };
        let by_work = by_work.into_iter().flat_map(|caches| [&mut caches.casting, &mut caches.gathering]);
        [first].into_iter().chain(scene).chain(by_work)
    }

    /// Greatest sum, bytes, of the caches that are in use together.
    pub fn bytes(&self) -> u64 {
        let sizes = match *self {
            Self::Unified(both) => [u64::from(both.bytes); 3],
            Self::Split { photon, scene, by_work } => {
                let split = u64::from(photon.bytes) + u64::from(scene.bytes);
                let of_work = |cache: fn(&CachesByWork) -> CacheSpec| {
                    by_work.as_ref().map_or(0, |caches| u64::from(cache(caches).bytes))
                };
                [split, of_work(|caches| caches.casting), of_work(|caches| caches.gathering)]
            }
        };
        sizes.into_iter().max().unwrap_or(0)
    }

    /// Wraps a memory in these caches.
    pub fn over<M: MemoryPort>(&self, memory: M) -> ModelledMemory<M> {
        let dram = Counted::new(memory);
        Inspected::new(Counted::new(match self {
            Self::Split { photon, scene, by_work } => {
                let caches = LineCaches::new(dram, photon.cache(), scene.cache());
                match by_work {
                    Some(CachesByWork { casting, gathering }) => {
                        caches.with_work(casting.cache(), gathering.cache())
                    }
                    None => caches,
                }
            }
            Self::Unified(cache) => LineCaches::unified(dram, cache.cache()),
        }))
    }
}

/// Memory traffic of a chip, above and below its caches.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MemoryTraffic {
    /// Reads requested by the chip, above the caches. Each is a range of bytes in one line of card memory.
    pub requested: Traffic,
    /// Reads from DRAM, below the caches. Each is a whole line of card memory.
    pub fetched: Traffic,
    /// Contents of the lines that the chip read.
    pub contents: Contents,
}

impl MemoryTraffic {
    /// No traffic.
    pub const ZERO: Self =
        Self { requested: Traffic::ZERO, fetched: Traffic::ZERO, contents: Contents::ZERO };

    /// Adds the traffic of another chip.
    pub fn add(&mut self, other: &Self) {
        self.requested.add(&other.requested);
        self.fetched.add(&other.fetched);
        self.contents.add(&other.contents);
    }

    /// Reads, for tiles, of the structures that `chosen` selects. The first element is the reads that the
    /// chip requested, the second is the reads from DRAM.
    pub fn of(&self, chosen: impl Fn(Structure) -> bool) -> [Reads; 2] {
        [self.requested.of_tiles(&chosen), self.fetched.of_tiles(&chosen)]
    }

    /// Bytes of the photon map fetched from DRAM for tiles.
    pub fn photon_map_bytes(&self) -> u64 {
        self.fetched.of_tiles(Structure::is_photon_map).bytes
    }

    /// Bytes of the scene fetched from DRAM for tiles.
    pub fn scene_bytes(&self) -> u64 {
        self.fetched.of_tiles(Structure::is_scene).bytes
    }
}

/// Memory that reports its traffic.
pub trait MeasuredMemory: MemoryPort {
    /// Traffic since the memory was created; zero if the memory is not modelled.
    fn traffic(&self) -> MemoryTraffic;

    /// Takes the unfinished trace of the reads, if there is one.
    fn take_trace(&mut self) -> Option<TraceFile> {
        None
    }
}

impl MeasuredMemory for Lines<'_> {
    fn traffic(&self) -> MemoryTraffic {
        MemoryTraffic::ZERO
    }
}

impl<M: MeasuredMemory, E, L> MeasuredMemory for Inspected<Counted<LineCaches<Counted<M>, E, L>>>
where
    E: AsRef<[CacheEntry]> + AsMut<[CacheEntry]>,
    L: AsRef<[Line]> + AsMut<[Line]>,
{
    fn traffic(&self) -> MemoryTraffic {
        MemoryTraffic {
            requested: self.below().traffic().clone(),
            fetched: self.below().below().below().traffic().clone(),
            contents: *self.contents(),
        }
    }

    fn take_trace(&mut self) -> Option<TraceFile> {
        // Below `Inspected`, `Counted` of requests, the caches, and `Counted` of fetches.
        self.below_mut().below_mut().below_mut().below_mut().take_trace()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn caches_are_read_as_they_are_written() {
        let default = CacheSettings::default();
        assert_eq!("photon=128K/128/4,scene=75K/128/4".parse(), Ok(default));
        for text in [
            "photon=64K/256/2,scene=75K/128/4,index=hash",
            "unified=1024K/128/16",
            "unified=2304/128/3",
            "photon=64K/256/2,scene=75K/128/4,casting=512K/128/4,gathering=600K/128/4,index=hash",
        ] {
            let settings: CacheSettings = text.parse().unwrap();
            assert_eq!(settings.to_string(), text);
            settings.over(Lines(&[]));
        }
        assert_eq!("scene=75K/128/4".parse(), Ok(default));
        assert_eq!("unified=1M/128/16".parse::<CacheSettings>().unwrap().to_string(), "unified=1024K/128/16");
    }

    #[test]
    fn invalid_caches_are_refused_with_the_valid_forms() {
        for (text, said) in [
            ("", "SIZE/LINE/WAYS"),
            ("photon", "SIZE/LINE/WAYS"),
            ("photon=128K", "SIZE/LINE/WAYS"),
            ("photon=128K/128/four", "no number"),
            ("photon=128K/64/4", "128"),
            ("photon=128K/0/4", "128"),
            ("photon=128K/192/4", "128"),
            ("photon=128K/128/0", "ways"),
            ("photon=128K/128/2000", "ways"),
            ("photon=0/128/1", "whole number"),
            ("photon=128K/128/3", "whole number"),
            ("photon=99999M/128/4", "too large"),
            ("photon=1000M/128/4", "above"),
            ("photon=128K/128/4,photon=128K/128/4", "twice"),
            ("unified=128K/128/4,scene=128K/128/4", "unified replaces all other caches"),
            ("casting=128K/128/4", "a cache for each"),
            ("unified=128K/128/4,casting=128K/128/4,gathering=128K/128/4", "unified replaces"),
            ("index=random", "modulo or hash"),
            ("texture=1K/128/1", "photon=SIZE"),
        ] {
            let error = text.parse::<CacheSettings>().unwrap_err();
            assert!(error.contains(said), "{text}: {error}");
        }
    }
}
