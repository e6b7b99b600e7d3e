//! Models of emulated chips: a kind by name, or a chip of one's own in a TOML file.
//!
//! The file has up to four tables. `[memory]` states capacities; those that it leaves out are the reference
//! chip's. `[caches]` describes the caches of the memory model, `[units]` the rates, and `[energy]` the
//! energies, of which the cost model computes times and joules. `docs/chip.toml` is an example.

use std::fmt;
use std::fs::File;
use std::io::{self, Read as _};
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

use photoncard_firmware::kind::Reference;
use photoncard_picture::choice::Choice;
use serde_json::Value;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::cost_model::{Energy, Rates};
use crate::emulator::memory_model::CacheSettings;
use crate::emulator::{Capacities, ChipError, Emulated, EmulatedKind};

/// Maximum size of a file, bytes.
const MAX_BYTES: u64 = 1 << 16;
/// Valid range of energies, pJ, and of areas, mm^2.
const COSTS: RangeInclusive<f64> = 0.0..=1e9;
/// Names of the tables of a file.
const TABLES: [&str; 4] = ["memory", "caches", "units", "energy"];

/// Error of a chip's file.
#[derive(Debug, thiserror::Error)]
pub enum ChipFileError {
    /// The file cannot be read, or is not text.
    #[error("{} cannot be read: {source}", path.display())]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The file is no TOML, or states what no chip can be.
    #[error("{}:{line}: {reason}", path.display())]
    Refused {
        /// Path of the file.
        path: PathBuf,
        /// Line of the mistake, from 1.
        line: usize,
        /// Mistake, with the valid values.
        reason: String,
    },
}

/// Chip of a file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ChipFile {
    /// Path of the file.
    path: PathBuf,
    /// Stated capacities.
    capacities: Capacities,
    caches: Option<CacheSettings>,
    rates: Rates,
    energy: Energy,
}

/// Model of emulated chips: a kind, and the file that describes it, if any.
#[derive(Clone, Debug, PartialEq)]
pub struct ChipModel {
    kind: EmulatedKind,
    file: Option<Arc<ChipFile>>,
    /// Capacities that replace those of kind and file.
    replaced: Capacities,
}

impl From<EmulatedKind> for ChipModel {
    fn from(kind: EmulatedKind) -> Self {
        Self { kind, file: None, replaced: Capacities::new() }
    }
}

impl ChipModel {
    /// Reads the chip of a TOML file.
    ///
    /// # Errors
    /// If the file cannot be read, is no TOML, or has a key that is unknown, of another type, out of its
    /// range or in contradiction to others.
    pub fn read(path: &Path) -> Result<Self, ChipFileError> {
        let mut text = String::new();
        let read = File::open(path).and_then(|file| file.take(MAX_BYTES + 1).read_to_string(&mut text));
        read.map_err(|source| ChipFileError::Unreadable { path: path.to_owned(), source })?;
        if text.len() as u64 > MAX_BYTES {
            let reason = format!("the file has more than {MAX_BYTES} bytes: it is no chip");
            return Err(ChipFileError::Refused { path: path.to_owned(), line: 1, reason });
        }
        Self::parse(path, &text).map_err(|(span, reason)| ChipFileError::Refused {
            path: path.to_owned(),
            line: 1 + text[..span.start.min(text.len())].matches('\n').count(),
            reason,
        })
    }

    /// Reads the chip of the text of the file `path`. The error has the place in the text.
    fn parse(path: &Path, text: &str) -> Result<Self, Refusal> {
        let syntax = |error: toml::de::Error| (error.span().unwrap_or(0..0), error.message().to_owned());
        let parsed = DeTable::parse(text).map_err(syntax)?;
        let mut file = ChipFile {
            path: path.to_owned(),
            capacities: Capacities::new(),
            caches: None,
            rates: Rates::default(),
            energy: Energy::PUBLISHED,
        };
        let mut kind = Emulated::like::<Reference>();
        let mut own_caches = None;
        for (name, table) in parsed.get_ref() {
            let Some(content) =
                table.get_ref().as_table().filter(|_| TABLES.contains(&name.get_ref().as_ref()))
            else {
                let tables = TABLES.map(|table| format!("[{table}]")).join(", ");
                return Err((name.span(), format!("{:?} is none of the tables {tables}", name.get_ref())));
            };
            match name.get_ref().as_ref() {
                "memory" => {
                    file.capacities = content.iter().map(|(name, value)| capacity(name, value)).collect();
                    let placed = |error| place(&error, content, table.span());
                    kind = kind.with_capacities(&file.capacities).map_err(placed)?;
                }
                "caches" => own_caches = Some(content),
                "units" => file.rates = rates(content)?,
                _ => file.energy = energy(content)?,
            }
        }
        let kind = EmulatedKind::File(kind);
        file.caches = own_caches.map(|content| caches(content, kind.caches())).transpose()?;
        Ok(Self { kind, file: Some(Arc::new(file)), replaced: Capacities::new() })
    }

    /// Text that lists the valid forms of a model, for help and errors.
    pub fn forms() -> String {
        let kinds: Vec<_> = EmulatedKind::ALL.iter().map(|kind| kind.name()).collect();
        format!("{}, or {FILE_FORM}", kinds.join(", "))
    }

    /// Kind of the chips.
    pub fn kind(&self) -> EmulatedKind {
        self.kind
    }

    /// Replaces a capacity, whose value is in text form.
    ///
    /// # Errors
    /// If the capacity is unknown, or the value out of its range or in contradiction to other capacities.
    pub fn with_capacity(mut self, name: &str, value: &str) -> Result<Self, ChipError> {
        let number = value.parse::<u64>().map_or_else(|_| Value::from(value), Value::from);
        self.replaced.insert(name.to_owned(), number);
        let base = match self.kind {
            EmulatedKind::File(_) => Emulated::like::<Reference>(),
            named => named.emulated(),
        };
        let mut stated = self.file.as_ref().map(|file| file.capacities.clone()).unwrap_or_default();
        stated.extend(self.replaced.clone());
        Ok(Self { kind: EmulatedKind::File(base.with_capacities(&stated)?), ..self })
    }

    /// Caches of the file, or of the kind with four ways.
    pub fn caches(&self) -> CacheSettings {
        self.file.as_ref().and_then(|file| file.caches).unwrap_or_else(|| self.kind.caches())
    }

    /// Rates that the file states.
    pub fn rates(&self) -> Rates {
        self.file.as_ref().map_or_else(Rates::default, |file| file.rates)
    }

    /// Energies that the file states, and published ones for the others.
    pub fn energy(&self) -> Energy {
        self.file.as_ref().map_or(Energy::PUBLISHED, |file| file.energy)
    }
}

/// Form of a model with a file.
pub(crate) const FILE_FORM: &str = "emulated:CHIP.toml";

impl fmt::Display for ChipModel {
    /// Writes the text that [`ChipModel::from_str`] reads, without replaced capacities.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match &self.file {
            Some(file) => write!(f, "{}:{}", EmulatedKind::Reference.name(), file.path.display()),
            None => f.write_str(self.kind.name()),
        }
    }
}

impl FromStr for ChipModel {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            Some((kind, path)) if kind == EmulatedKind::Reference.name() && is_file(path) => {
                Self::read(path.as_ref()).map_err(|error| error.to_string())
            }
            _ => EmulatedKind::of_name(text)
                .map(Self::from)
                .map_err(|_| format!("{text:?} is no kind of chip; use {}", Self::forms())),
        }
    }
}

/// Returns whether a part of an address names a file of a chip.
pub(crate) fn is_file(text: &str) -> bool {
    Path::new(text).extension().is_some_and(|ending| ending.eq_ignore_ascii_case("toml"))
}

/// Place in a text, and what is wrong there.
type Refusal = (Range<usize>, String);
type Name<'a> = Spanned<std::borrow::Cow<'a, str>>;

/// Name and value of a capacity. A value of another type is kept as text, which no range contains.
fn capacity(name: &Name, value: &Spanned<DeValue>) -> (String, Value) {
    let number = value.get_ref().as_integer();
    let number = number.and_then(|number| i64::from_str_radix(number.as_str(), number.radix()).ok());
    let value = number.map_or_else(|| Value::from(shown(value.get_ref())), Value::from);
    (name.get_ref().clone().into_owned(), value)
}

/// Value in a message: text of a number, or of a string; otherwise the name of the type.
fn shown(value: &DeValue) -> String {
    match value {
        DeValue::String(text) => text.clone().into_owned(),
        DeValue::Integer(number) => number.as_str().to_owned(),
        DeValue::Float(number) => number.as_str().to_owned(),
        other => other.type_str().to_owned(),
    }
}

/// Place of an error: the capacity, or the table if it does not state that capacity.
fn place(error: &ChipError, content: &DeTable, table: Range<usize>) -> Refusal {
    let stated = content.keys().find(|name| name.get_ref() == error.capacity());
    (stated.map_or(table, Spanned::span), format!("[memory] {error}"))
}

/// The caches `own`, with the stated ones in their place.
fn caches(content: &DeTable, own: CacheSettings) -> Result<CacheSettings, Refusal> {
    let mut caches = own;
    let mut stated: Vec<_> = content.iter().collect();
    stated.sort_by_key(|(name, _)| CacheSettings::rank(name.get_ref()));
    for (name, value) in stated {
        let refused = |reason| (value.span(), format!("[caches] {}: {reason}", name.get_ref()));
        let Some(text) = value.get_ref().as_str() else {
            return Err(refused("it is no text; use \"SIZE/LINE/WAYS\"".to_owned()));
        };
        caches = match caches.with_part(name.get_ref(), text) {
            Some(replaced) => replaced.map_err(refused)?,
            None => return Err(unknown("caches", name, &CacheSettings::PARTS)),
        };
    }
    Ok(caches)
}

fn rates(content: &DeTable) -> Result<Rates, Refusal> {
    let mut rates = Rates::default();
    for (name, value) in content {
        let number = |range: &RangeInclusive<f64>| number("units", name, value, range);
        match name.get_ref().as_ref() {
            "bandwidth_gb_s" => rates.bandwidth_gb_s = Some(number(&Rates::GIGA)?),
            "gflops" => rates.gflops = Some(number(&Rates::GIGA)?),
            "latency_ns" => rates.latency_ns = Some(number(&Rates::LATENCY)?),
            "tasks" => rates.tasks = Some(whole("units", name, value, &Rates::TASKS)?),
            _ => return Err(unknown("units", name, &["bandwidth_gb_s", "gflops", "latency_ns", "tasks"])),
        }
    }
    Ok(rates)
}

fn energy(content: &DeTable) -> Result<Energy, Refusal> {
    let mut energy = Energy::PUBLISHED;
    for (name, value) in content {
        let number = number("energy", name, value, &COSTS);
        match name.get_ref().as_ref() {
            "sram_pj_per_byte" => energy.sram_pj_per_byte = Some(number?),
            "dram_pj_per_byte" => energy.dram_pj_per_byte = number?,
            "flop_pj" => energy.flop_pj = number?,
            "sram_mm2_per_mb" => energy.sram_mm2_per_mb = number?,
            _ => {
                let known = ["sram_pj_per_byte", "dram_pj_per_byte", "flop_pj", "sram_mm2_per_mb"];
                return Err(unknown("energy", name, &known));
            }
        }
    }
    Ok(energy)
}

fn unknown(table: &str, name: &Name, known: &[&str]) -> Refusal {
    (name.span(), format!("[{table}] {:?} is none of {}", name.get_ref(), known.join(", ")))
}

/// Number in a range; the number may be whole.
fn number(
    table: &str,
    name: &Name,
    value: &Spanned<DeValue>,
    range: &RangeInclusive<f64>,
) -> Result<f64, Refusal> {
    let parsed = match value.get_ref() {
        DeValue::Float(number) => number.as_str().parse().ok(),
        DeValue::Integer(number) if number.radix() == 10 => number.as_str().parse().ok(),
        _ => None,
    };
    let found = parsed.filter(|number| range.contains(number));
    found.ok_or_else(|| out_of_range(table, name, value, "a number", range))
}

/// Whole number in a range.
fn whole(
    table: &str,
    name: &Name,
    value: &Spanned<DeValue>,
    range: &RangeInclusive<u32>,
) -> Result<u32, Refusal> {
    let number = value.get_ref().as_integer();
    let number = number.and_then(|number| u32::from_str_radix(number.as_str(), number.radix()).ok());
    let found = number.filter(|number| range.contains(number));
    found.ok_or_else(|| out_of_range(table, name, value, "a whole number", range))
}

fn out_of_range<T: fmt::Display>(
    table: &str,
    name: &Name,
    value: &Spanned<DeValue>,
    of: &str,
    range: &RangeInclusive<T>,
) -> Refusal {
    let (least, most) = (range.start(), range.end());
    let (name, shown) = (name.get_ref(), shown(value.get_ref()));
    (value.span(), format!("[{table}] {name} is {shown}; use {of} from {least} to {most}"))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::{ProptestConfig, proptest};

    use super::*;

    fn parse(text: &str) -> Result<ChipModel, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("chip.toml");
        std::fs::write(&path, text).unwrap();
        ChipModel::read(&path).map_err(|error| {
            let said = error.to_string();
            said.strip_prefix(&format!("{}:", path.display())).unwrap_or(&said).to_owned()
        })
    }

    #[test]
    fn caches_that_are_not_stated_are_those_of_the_stated_memory() {
        let memory = "[memory]\nphoton_cache_bytes = 16384\nscene_cache_bytes = 8192\n";
        let own = parse(memory).unwrap().caches().to_string();
        assert!(own.starts_with("photon=16K/128/4,scene=8K/128/4,casting="), "{own}");
        for (stated, expected) in [
            ("", own.clone()),
            ("index = \"hash\"", format!("{own},index=hash")),
            ("scene = \"4K/128/2\"", own.replace("scene=8K/128/4", "scene=4K/128/2")),
            ("unified = \"9K/384/3\"", "unified=9K/384/3".to_owned()),
        ] {
            let caches = parse(&format!("[caches]\n{stated}\n{memory}")).unwrap().caches();
            assert_eq!(caches.to_string(), expected);
        }
    }

    #[test]
    fn a_file_that_is_too_long_is_no_chip() {
        let refused = parse(&format!("{}[memory]\n", "\n".repeat(1 << 16))).unwrap_err();
        assert!(refused.contains("more than 65536 bytes"), "{refused}");
    }

    #[test]
    fn an_empty_file_is_the_reference_chip_by_published_figures() {
        let model = parse("# Nothing is stated.\n").unwrap();
        assert_eq!(model.kind().emulated(), EmulatedKind::Reference.emulated());
        assert_eq!(model.caches(), EmulatedKind::Reference.caches());
        assert_eq!((model.rates(), model.energy()), (Rates::default(), Energy::PUBLISHED));
    }

    #[test]
    fn each_table_states_its_part_of_the_chip() {
        let model = parse(
            "[memory]\ngather_queue = 4_096\nsram_bytes = 0x10_0000\n\
             [caches]\nphoton = \"64K/256/2\"\nscene = \"32K/128/4\"\nindex = \"hash\"\n\
             [units]\ngflops = 40\nbandwidth_gb_s = 12.8\nlatency_ns = 60.5\ntasks = 16\n\
             [energy]\nsram_pj_per_byte = 1.5\ndram_pj_per_byte = 160\nflop_pj = 1\nsram_mm2_per_mb = 0.4\n",
        )
        .unwrap();
        assert_eq!(model.kind().budget().gather_queue, 4096);
        let caches = model.caches().to_string();
        assert!(caches.starts_with("photon=64K/256/2,scene=32K/128/4,casting="), "{caches}");
        assert!(caches.ends_with(",index=hash"), "{caches}");
        let rates =
            Rates { bandwidth_gb_s: Some(12.8), gflops: Some(40.0), latency_ns: Some(60.5), tasks: Some(16) };
        assert_eq!(model.rates(), rates);
        let energy = Energy {
            sram_pj_per_byte: Some(1.5),
            dram_pj_per_byte: 160.0,
            flop_pj: 1.0,
            sram_mm2_per_mb: 0.4,
        };
        assert_eq!(model.energy(), energy);
    }

    #[test]
    fn what_is_wrong_is_refused_with_line_key_and_range() {
        for (text, words) in [
            ("[memory", ["1: ", "unclosed table"]),
            ("\n[memroy]\n", ["2: \"memroy\" is none of", "[memory], [caches]"]),
            ("memory = 1", ["1: \"memory\" is none of", "[units]"]),
            ("[memory]\n\npixels = 1", ["3: [memory] \"pixels\" is none of", "tile_pixels"]),
            ("[memory]\ngather_queue = 0", ["2: [memory] gather_queue is 0", "1 to 1048576"]),
            ("[memory]\ngather_queue = \"9\"", ["gather_queue is \"9\"", "a whole number from 1"]),
            ("[memory]\ngather_queue = 4.0", ["gather_queue is \"4.0\"", "a whole number from 1"]),
            ("[memory]\ngather_queue = true", ["gather_queue is \"boolean\"", "a whole number from 1"]),
            ("[memory]\ngather_queue = 1\ngather_queue = 2", ["3: ", "duplicate key"]),
            ("[memory]\ngather_queue = 9000000000000000000000", ["gather_queue is", "1 to 1048576"]),
            ("[memory]\ngather_queue = 1_000_000", ["1: [memory] sram_bytes is 1048576", "other buffers"]),
            ("[caches]\nl1 = \"8K/128/4\"", ["2: [caches] \"l1\" is none of", "photon, scene, unified"]),
            ("[caches]\nphoton = 8192", ["2: [caches] photon: it is no text", "SIZE/LINE/WAYS"]),
            ("[caches]\nphoton = \"8K\"", ["2: [caches]", "SIZE/LINE/WAYS"]),
            ("[caches]\nphoton = \"8K/128/4\"\nscene = \"1K/128/3\"", ["3: [caches] scene", "whole number"]),
            ("[caches]\nphoton = \"8K/128/4,scene=1K/128/1\"", ["2: [caches] photon", "is no cache"]),
            (
                "[caches]\nunified = \"8K/128/4\"\nscene = \"1K/128/4\"",
                ["3: [caches] scene", "unified replaces all other caches"],
            ),
            (
                "[memory]\nwaiting_blocks = 0\n[caches]\ncasting = \"8K/128/4\"",
                ["4: [caches] casting", "no block waits"],
            ),
            ("[units]\nwatts = 1", ["2: [units] \"watts\" is none of", "bandwidth_gb_s, gflops"]),
            ("[units]\ngflops = 0", ["2: [units] gflops is 0", "a number from 0.1 to 1000000"]),
            ("[units]\nlatency_ns = nan", ["latency_ns is nan", "a number from 0 to 10000"]),
            ("[units]\ntasks = 1.5", ["tasks is 1.5", "a whole number from 1 to 65536"]),
            ("[energy]\nflop_pj = -1", ["2: [energy] flop_pj is -1", "a number from 0 to"]),
            ("[energy]\nflops = 1", ["2: [energy] \"flops\" is none of", "flop_pj"]),
        ] {
            let said = parse(text).unwrap_err();
            assert!(words.iter().all(|word| said.contains(word)), "{text}: {said}");
        }
        assert!(matches!(ChipModel::read("absent.toml".as_ref()), Err(ChipFileError::Unreadable { .. })));
        assert!(matches!(ChipModel::read("/dev/zero".as_ref()), Err(ChipFileError::Refused { .. })));
    }

    #[test]
    fn replaced_capacities_leave_the_others_as_the_file_states_them() {
        let model = parse("[memory]\ngather_queue = 4096\nin_flight = 2\n").unwrap();
        let replaced = model.clone().with_capacity("gather_queue", "512").unwrap();
        let budget = replaced.kind().budget();
        assert_eq!((budget.gather_queue, budget.in_flight), (512, 2));
        let both = replaced.with_capacity("in_flight", "1").unwrap().kind().budget();
        assert_eq!((both.gather_queue, both.in_flight), (512, 1));
        let named = ChipModel::from(EmulatedKind::Large).with_capacity("gather_queue", "512").unwrap();
        assert_eq!(named.kind().budget().sram_bytes, EmulatedKind::Large.budget().sram_bytes);
        for (name, value, word) in
            [("pixels", "1", "none of"), ("in_flight", "x", "\"x\""), ("in_flight", "9", "1 to 8")]
        {
            let said = model.clone().with_capacity(name, value).unwrap_err().to_string();
            assert!(said.contains(word), "{said}");
        }
    }

    #[test]
    fn a_model_is_read_as_it_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("my chip.TOML");
        std::fs::write(&path, "[memory]\nin_flight = 1\n").unwrap();
        let own = format!("emulated:{}", path.display());
        for text in ["emulated", "emulated-large", "emulated-micro", "emulated-nano", &own] {
            let model: ChipModel = text.parse().unwrap();
            assert_eq!(model.to_string(), text);
        }
        for text in ["", "abacus", "emulated:2", "emulated-micro:chip.toml", "serial:chip.toml"] {
            let said = text.parse::<ChipModel>().unwrap_err();
            assert!(said.contains("emulated-nano, or emulated:CHIP.toml"), "{said}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn texts_are_read_or_refused(text in r#"(\[(memory|units|caches|energy)\]\n)?([a-z_]{1,9} ?= ?["0-9a-fx.é]{1,9}\n)*.*"#) {
            drop(ChipModel::parse("chip.toml".as_ref(), &text));
        }
    }
}
