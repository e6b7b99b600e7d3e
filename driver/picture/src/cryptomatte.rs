//! Cryptomatte 1.2 (Friedman, Jones 2015, *Fully automatic ID mattes with support for motion blur and
//! transparency*; specification at <https://github.com/Psyop/Cryptomatte>): coverage of each pixel by
//! object and by material, from which compositors make a matte for each name.
//!
//! The identifier of a name is its `MurmurHash3` with 32 bits, taken as a single-precision number. Each pixel
//! has a list of identifiers with their coverage, in the order of decreasing coverage. Channels hold the
//! list: `CryptoObject00.r` and `.g` are its first identifier and coverage, `.b` and `.a` its second ones,
//! and so on. Attributes of the file contain a manifest, JSON of the identifiers of all names.
//!
//! The hash is written here, because it is short, and crates of hashes have many others.

use std::collections::BTreeMap;

use photoncard_shared::message::{MAX_IDENTITIES, PixelSums, SampleCount};
use serde::{Deserialize, Serialize};

use crate::film::Film;
use crate::layer::{Layer, Layers};

/// Names behind the identities of a card image: numbers of pairs of object and material.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct Identities {
    /// Names of objects.
    objects: Vec<String>,
    /// Names of materials.
    materials: Vec<String>,
    /// For each identity, the indices of its object and its material.
    pairs: Vec<[u32; 2]>,
}

/// [`Identities`] of a file, whose indices are not checked yet.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    objects: Vec<String>,
    materials: Vec<String>,
    pairs: Vec<[u32; 2]>,
}

impl TryFrom<Stored> for Identities {
    type Error = &'static str;

    fn try_from(Stored { objects, materials, pairs }: Stored) -> Result<Self, Self::Error> {
        Self::new(objects, materials, pairs).ok_or("an identity has no name")
    }
}

impl Identities {
    /// Creates the names of identities; `None` if an index of a pair is past the last name.
    pub fn new(objects: Vec<String>, materials: Vec<String>, pairs: Vec<[u32; 2]>) -> Option<Self> {
        let has_names = |&[object, material]: &[u32; 2]| {
            (object as usize) < objects.len() && (material as usize) < materials.len()
        };
        pairs.iter().all(has_names).then_some(Self { objects, materials, pairs })
    }

    fn names(&self, matte: Matte) -> &[String] {
        match matte {
            Matte::Object => &self.objects,
            Matte::Material => &self.materials,
        }
    }

    /// Identifier of each identity in a matte.
    fn identifiers(&self, matte: Matte) -> Vec<u32> {
        let of_names: Vec<u32> = self.names(matte).iter().map(|name| identifier(name)).collect();
        let index = |[object, material]: [u32; 2]| match matte {
            Matte::Object => object,
            Matte::Material => material,
        };
        self.pairs.iter().filter_map(|&pair| of_names.get(index(pair) as usize).copied()).collect()
    }
}

/// A layer of coverage by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Matte {
    /// Coverage by object.
    Object,
    /// Coverage by material.
    Material,
}

/// Components of a layer's channels.
const COMPONENTS: [&str; 4] = ["r", "g", "b", "a"];
/// Number of channels of a matte: identifier and coverage of each entry.
const CHANNELS: usize = 2 * MAX_IDENTITIES;

impl Matte {
    /// The mattes among the layers of a picture.
    pub fn of(layers: &Layers) -> impl Iterator<Item = Self> {
        layers.iter().filter_map(|layer| match layer {
            Layer::Object => Some(Self::Object),
            Layer::Material => Some(Self::Material),
            _ => None,
        })
    }

    /// Name of the matte, and start of the names of its channels.
    pub fn name(self) -> &'static str {
        match self {
            Self::Object => "CryptoObject",
            Self::Material => "CryptoMaterial",
        }
    }

    /// Names of the matte's channels, in the order of [`Self::values`].
    pub fn channels(self) -> impl Iterator<Item = String> {
        (0..CHANNELS).map(move |index| format!("{}{:02}.{}", self.name(), index / 4, COMPONENTS[index % 4]))
    }

    /// Values of each channel for all pixels of a film, row by row. Identities without a name are left out.
    pub fn values(self, film: &Film, identities: &Identities) -> Vec<Vec<f32>> {
        let identifiers = identities.identifiers(self);
        let count = film.format().count();
        let mut channels = vec![Vec::new(); CHANNELS];
        for sums in film.sums() {
            let of_pixel = ranked(&sums, &identifiers, count);
            for (channel, value) in channels.iter_mut().zip(of_pixel.as_flattened()) {
                channel.push(*value);
            }
        }
        channels
    }

    /// Attributes of a file with the matte, by name.
    pub fn attributes(self, identities: &Identities) -> [(String, String); 4] {
        let name = self.name();
        let key = &format!("{:08x}", murmur(name.as_bytes()))[..7];
        let manifest: BTreeMap<&str, String> = identities
            .names(self)
            .iter()
            .map(|name| (name.as_str(), format!("{:08x}", identifier(name))))
            .collect();
        // Text and strings always have a JSON form.
        let manifest = serde_json::to_string(&manifest).unwrap_or_default();
        [
            ("conversion", "uint32_to_float32".to_owned()),
            ("hash", "MurmurHash3_32".to_owned()),
            ("manifest", manifest),
            ("name", name.to_owned()),
        ]
        .map(|(entry, value)| (format!("{PREFIX}{key}/{entry}"), value))
    }
}

/// Start of the names of all attributes of mattes.
pub(crate) const PREFIX: &str = "cryptomatte/";

/// Identifiers of a pixel's names and their coverage, the greatest coverage first. Of equal coverages, the
/// lesser identifier comes first. The coverages add up to the pixel's alpha, or to less if the pixel has seen
/// more identities than it keeps.
fn ranked(sums: &PixelSums, identifiers: &[u32], count: SampleCount) -> [[f32; 2]; MAX_IDENTITIES] {
    let identities = sums.identities.unwrap_or_default();
    // A damaged file may state identities without coverage.
    let total = f64::from(sums.coverage.unwrap_or_else(|| identities.total()).max(1));
    let alpha = f64::from(sums.alpha(count));
    let mut covered: Vec<(u32, u32)> = Vec::with_capacity(MAX_IDENTITIES);
    for (identity, coverage) in identities.iter() {
        let Some(&identifier) = identifiers.get(identity as usize) else { continue };
        match covered.iter_mut().find(|(_, other)| *other == identifier) {
            Some((sum, _)) => *sum = sum.saturating_add(coverage),
            None => covered.push((coverage, identifier)),
        }
    }
    covered.sort_unstable_by_key(|&(coverage, identifier)| (u32::MAX - coverage, identifier));
    let mut ranks = [[0.0; 2]; MAX_IDENTITIES];
    for (rank, (coverage, identifier)) in ranks.iter_mut().zip(covered) {
        *rank = [f32::from_bits(identifier), (f64::from(coverage) / total * alpha) as f32];
    }
    ranks
}

/// Bits of the identifier of a name. A hash that is no normal number has a bit of its exponent inverted.
fn identifier(name: &str) -> u32 {
    let hash = murmur(name.as_bytes());
    let exponent = hash >> 23 & 0xff;
    if exponent == 0 || exponent == 0xff { hash ^ 1 << 23 } else { hash }
}

/// `MurmurHash3_x86_32` (Appleby) with the seed 0.
fn murmur(bytes: &[u8]) -> u32 {
    const FACTORS: [u32; 2] = [0xcc9e_2d51, 0x1b87_3593];
    let mixed = |word: u32| word.wrapping_mul(FACTORS[0]).rotate_left(15).wrapping_mul(FACTORS[1]);
    let (words, rest) = bytes.as_chunks::<4>();
    let mut hash = words.iter().fold(0_u32, |hash, word| {
        let hash = (hash ^ mixed(u32::from_le_bytes(*word))).rotate_left(13);
        hash.wrapping_mul(5).wrapping_add(0xe654_6b64)
    });
    let rest = rest.iter().rev().fold(0, |word: u32, &byte| word << 8 | u32::from(byte));
    hash ^= mixed(rest) ^ bytes.len() as u32;
    hash = (hash ^ hash >> 16).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ hash >> 13).wrapping_mul(0xc2b2_ae35);
    hash ^ hash >> 16
}

#[cfg(test)]
mod tests {
    use photoncard_shared::message::{COVERAGE_STEPS, IdentityCoverage};

    use super::*;

    #[test]
    fn hashes_have_their_known_values() {
        for (text, hash) in [
            ("", 0),
            ("test", 0xba6b_d213),
            ("Hello, world!", 0xc036_3e43),
            ("The quick brown fox jumps over the lazy dog", 0x2e4f_f723),
        ] {
            assert_eq!(murmur(text.as_bytes()), hash, "{text}");
        }
    }

    /// Values of the specification's reference decoder (`cryptomatte_utilities_tests.py`).
    #[test]
    fn identifiers_are_those_of_the_reference_decoder() {
        for (name, number) in [
            ("hello", 6.070_562_710_24e-17_f64),
            ("cube", -4.084_619_125_19e15),
            ("sphere", 2.790_186_043_83e15),
            ("plane", 3.665_576_175_93e-11),
            ("равнина", -1.319_263_121_24e-25),
            ("mädchen", 6.236_129_821_16e25),
        ] {
            let found = f64::from(f32::from_bits(identifier(name)));
            assert!((found / number - 1.0).abs() < 1e-6, "{name}: {found}");
        }
    }

    #[test]
    fn identifiers_are_normal_numbers() {
        let names = (0..20_000).map(|number| format!("object {number}"));
        let mut changed = 0;
        for name in names {
            let identifier = identifier(&name);
            assert!(f32::from_bits(identifier).is_normal(), "{name}");
            changed += u32::from(identifier != murmur(name.as_bytes()));
        }
        // One of 128 hashes has the exponent 0 or 255.
        assert!((100..220).contains(&changed), "{changed}");
        assert_eq!(identifier(""), 1 << 23);
    }

    #[test]
    fn names_with_one_identifier_are_one_entry_and_the_greatest_coverage_is_first() {
        let names = ["a", "b"].map(str::to_owned).to_vec();
        let pairs = vec![[0, 0], [1, 0], [0, 1], [1, 1]];
        let identities = Identities::new(names.clone(), vec!["m".into(), "n".into()], pairs).unwrap();
        let mut coverage = IdentityCoverage::NONE;
        for (identity, steps) in [(0, 1), (1, 4), (2, 2), (9, 7)] {
            coverage.add(identity, steps * COVERAGE_STEPS / 8);
        }
        let count = SampleCount { samples: 1, probes: 0 };
        let covered = Some(COVERAGE_STEPS);
        let sums = PixelSums { coverage: covered, identities: Some(coverage), ..PixelSums::NOTHING };
        let of = |matte| ranked(&sums, &identities.identifiers(matte), count);
        let entry = |name: &str, share| [f32::from_bits(identifier(name)), share];
        assert_eq!(of(Matte::Object)[..3], [entry("b", 0.5), entry("a", 0.375), [0.0; 2]]);
        assert_eq!(of(Matte::Material)[..3], [entry("m", 0.625), entry("n", 0.25), [0.0; 2]]);
        assert_eq!(Identities::new(names.clone(), Vec::new(), vec![[0, 0]]), None);
        assert_eq!(Identities::new(names, vec!["m".into()], vec![[2, 0]]), None);
    }

    #[test]
    fn attributes_have_the_key_of_the_specification_and_a_whole_manifest() {
        let names = ["wall \"é\"", "lamp"].map(str::to_owned).to_vec();
        let identities = Identities::new(names, vec!["m".into()], vec![[0, 0]]).unwrap();
        let attributes = Matte::Object.attributes(&identities);
        let [conversion, hash, manifest, name] = &attributes;
        assert_eq!(conversion.0[..19], name.0[..19]);
        assert_eq!((hash.1.as_str(), conversion.1.as_str()), ("MurmurHash3_32", "uint32_to_float32"));
        assert_eq!(name.1, "CryptoObject");
        let found: BTreeMap<String, String> = serde_json::from_str(&manifest.1).unwrap();
        let hex = |name: &str| format!("{:08x}", identifier(name));
        assert_eq!(found, ["lamp", "wall \"é\""].map(|name| (name.to_owned(), hex(name))).into());
        assert!(attributes.is_sorted());
        let text = serde_json::to_string(&identities).unwrap();
        assert_eq!(serde_json::from_str::<Identities>(&text).unwrap(), identities);
        assert!(serde_json::from_str::<Identities>(&text.replace("[0,0]", "[0,1]")).is_err());
    }
}
