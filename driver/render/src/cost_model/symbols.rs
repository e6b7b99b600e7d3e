//! Symbols of the cost model: those of the dissertation's Table 7.1, and a few that it implies or leaves
//! open.

use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::frame::MAX_FRAME;
use photoncard_shared::layout::{Photon, Record};
use photoncard_shared::message::PIXEL_BYTES;

/// Source of a symbol's nominal value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// Value from Table 7.1 of the dissertation.
    Table,
    /// Value from the dissertation or one of its papers, outside the table.
    Published,
    /// Value chosen by this project, because no publication states it.
    Ours,
}

/// Values of the cost model's symbols. Counts and ratios are `f64`, because they only occur in products.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Symbols {
    /// `P`: number of pixels of a tile.
    pub tile_pixels: f64,
    /// `T`: number of tiles of a picture.
    pub tiles: f64,
    /// `F`: frames per second.
    pub frames_per_second: f64,
    /// `N_FG`: number of final gather rays of a pixel that is not interpolated.
    pub gather_rays: f64,
    /// `k`: number of photons that a gather searches for.
    pub neighbors: f64,
    /// `N_S`: number of shadow rays per pixel.
    pub shadow_rays: f64,
    /// `C_J`: number of cells of an importance table, 4x8.
    pub table_cells: f64,
    /// `N_PM`: number of photons in the indirect map.
    pub photons: f64,
    /// `R_IC`: fraction of the pixels that the irradiance cache interpolates, 0 to 1.
    pub interpolated_share: f64,
    /// `L_IC`: number of irradiance records that an interpolated pixel uses.
    pub records_per_pixel: f64,
    /// `C_B1`: FLOPs of the reflection function's first stage, per gather and channel.
    pub reflection_stage_1: f64,
    /// `C_B2`: FLOPs of the reflection function's second stage, per photon and channel.
    pub reflection_stage_2: f64,
    /// `C_RayCast`: FLOPs to intersect a ray with the scene.
    pub ray_cast: f64,
    /// `C_G`: FLOPs of a search for the nearest 100 photons. It is a constant and does not scale with `k`.
    pub gather: f64,
    /// `S_B`: bytes of a partially evaluated reflection function.
    pub reflection_bytes: f64,
    /// `S_P`: bytes of a photon in card memory.
    pub photon_bytes: f64,
    /// `S_L`: bytes of a line of card memory.
    pub line_bytes: f64,
    /// `B_G`: bytes of the photon map read from DRAM per gather, with reordering of gathers.
    pub gather_dram: f64,
    /// `B_N`: bytes of the photon map read from DRAM per gather, without reordering of gathers.
    pub naive_gather_dram: f64,
    /// `B_R`: bytes of the scene read from DRAM per ray.
    pub ray_dram: f64,
    /// `C_IC`: FLOPs per record in an interpolation.
    pub interpolation: f64,
    /// `C_IR`: additional FLOPs per final gather ray of an irradiance record.
    pub record_ray: f64,
    /// `C_T1`: FLOPs per photon in an importance table.
    pub table_photon: f64,
    /// `C_T2`: FLOPs per cell of an importance table.
    pub table_cell: f64,
    /// `B_P`: bytes per pixel on the host's link.
    pub pixel_bytes: f64,
    /// `B_T`: bytes per tile command on the host's link.
    pub command_bytes: f64,
    /// `f`: number of links from a switch towards the chips, in the tree of switches between host and chips.
    pub fan_out: f64,
    /// `S_F`: number of bytes that a switch receives before it forwards them.
    pub frame_bytes: f64,
}

impl Symbols {
    /// Nominal values of Table 7.1. For `N_PM` the public excerpts of the table give only a range. Its lower
    /// end is used, which is also the default of the driver.
    pub const NOMINAL: Self = Self {
        tile_pixels: 256.0,
        tiles: 1024.0,
        frames_per_second: 30.0,
        gather_rays: 100.0,
        neighbors: 100.0,
        shadow_rays: 8.0,
        table_cells: 32.0,
        photons: 500_000.0,
        interpolated_share: 0.6,
        records_per_pixel: 4.0,
        reflection_stage_1: 12.0,
        reflection_stage_2: 10.0,
        ray_cast: 330.0,
        gather: 2389.0,
        reflection_bytes: 13.0,
        photon_bytes: Photon::BYTES as f64,
        line_bytes: LINE_BYTES as f64,
        // 24 GB a frame, and 11 TB/s at 30 frames/s, divided by the 512 x 512 x 100 gathers of a frame.
        gather_dram: 24e9 / GATHERS,
        naive_gather_dram: 11e12 / 30.0 / GATHERS,
        // 1 GB/s for 100 M rays/s.
        ray_dram: 10.0,
        interpolation: 80.0,
        record_ray: 40.0,
        table_photon: 35.0,
        table_cell: 12.0,
        pixel_bytes: PIXEL_BYTES as f64,
        command_bytes: 32.0,
        fan_out: 4.0,
        frame_bytes: MAX_FRAME as f64,
    };

    /// `R_FG = 1 - R_IC`: fraction of the pixels with a final gather.
    pub(crate) fn gathering_share(&self) -> f64 {
        1.0 - self.interpolated_share
    }

    /// `T P`: number of pixels of a picture.
    pub fn pixels(&self) -> f64 {
        self.tiles * self.tile_pixels
    }

    /// `ceil(N_PM / floor(S_L / S_P)) S_L`: bytes of the photon map in card memory, in whole lines.
    pub fn photon_map_bytes(&self) -> f64 {
        let photons_per_line = (self.line_bytes / self.photon_bytes).floor().max(1.0);
        (self.photons / photons_per_line).ceil() * self.line_bytes
    }

    /// All symbols with their values, in the table's order.
    pub fn rows(&self) -> impl Iterator<Item = (&'static Symbol, f64)> + '_ {
        SYMBOLS.iter().map(|symbol| (symbol, (symbol.get)(self)))
    }

    /// Sets one symbol by an assignment such as `R_IC=0.5`.
    ///
    /// # Errors
    /// If the text does not have the form `NAME=VALUE`, names no symbol, or has a value outside the symbol's
    /// [range](Symbol::range).
    pub fn set(&mut self, assignment: &str) -> Result<(), SymbolError> {
        let Some((name, value)) = assignment.split_once('=') else {
            return Err(SymbolError::Form(assignment.to_owned()));
        };
        let (name, value) = (name.trim(), value.trim());
        let symbol = SYMBOLS.iter().find(|symbol| symbol.notation == name).ok_or_else(|| {
            let valid: Vec<_> = SYMBOLS.iter().map(|symbol| symbol.notation).collect();
            SymbolError::Unknown { name: name.to_owned(), valid: valid.join(", ") }
        })?;
        let [least, most] = symbol.range;
        let number = value.parse().ok().filter(|number| (least..=most).contains(number));
        let number = number.ok_or_else(|| SymbolError::Value {
            name: symbol.notation,
            value: value.to_owned(),
            least,
            most,
        })?;
        (symbol.set)(self, number);
        Ok(())
    }
}

/// Number of gathers per frame to which the published bandwidths refer: 512 x 512 pixels with 100 rays each.
const GATHERS: f64 = 512.0 * 512.0 * 100.0;

/// Error of [`Symbols::set`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SymbolError {
    /// The text does not have the form `NAME=VALUE`.
    #[error("{0:?} sets no symbol; write it as in R_IC=0.5")]
    Form(String),
    /// No symbol has this name.
    #[error("there is no symbol {name:?}; the symbols are {valid}")]
    Unknown {
        /// The unknown name.
        name: String,
        /// Names of all symbols.
        valid: String,
    },
    /// The value is not a number, or outside the symbol's range.
    #[error("{name} cannot be {value:?}; give a number from {least} to {most}")]
    Value {
        /// Notation of the symbol.
        name: &'static str,
        /// The value as given.
        value: String,
        /// Minimum of the range.
        least: f64,
        /// Maximum of the range.
        most: f64,
    },
}

/// Description of one symbol.
#[derive(Debug)]
pub struct Symbol {
    /// Notation of the dissertation, with subscripts after `_`.
    pub notation: &'static str,
    /// Meaning of the symbol.
    pub description: &'static str,
    /// Unit of the value; empty for a ratio.
    pub unit: &'static str,
    /// Chapter, publication or code that discusses the nominal value.
    pub reference: &'static str,
    /// Source of the nominal value.
    pub origin: Origin,
    /// Minimum and maximum of the value.
    pub range: [f64; 2],
    get: fn(&Symbols) -> f64,
    set: fn(&mut Symbols, f64),
}

/// Range of a cost, size or count that may be zero.
const ANY: [f64; 2] = [0.0, 1e15];
/// Range of a count that is at least one.
const SOME: [f64; 2] = [1.0, 1e15];
/// Range of the fan-out of a switch.
const FAN_OUT: [f64; 2] = [2.0, 1e15];
/// Range of a share of a whole.
const RATIO: [f64; 2] = [0.0, 1.0];

macro_rules! symbol {
    (
        $notation:literal, $field:ident, $range:ident, $unit:literal, $description:literal, $origin:ident,
        $reference:literal
    ) => {
        Symbol {
            notation: $notation,
            description: $description,
            unit: $unit,
            reference: $reference,
            origin: Origin::$origin,
            range: $range,
            get: |symbols| symbols.$field,
            set: |symbols, value| symbols.$field = value,
        }
    };
}

const GATHERING_SHARE: Symbol = Symbol {
    notation: "R_FG",
    description: "share of pixels with a full final gather, 1 - R_IC",
    unit: "",
    reference: "chapter 5",
    origin: Origin::Table,
    range: RATIO,
    get: Symbols::gathering_share,
    set: |symbols, value| symbols.interpolated_share = 1.0 - value,
};

#[rustfmt::skip] // One symbol a line, as in the table.
static SYMBOLS: [Symbol; 29] = [
    symbol!("P", tile_pixels, SOME, "pixels", "pixels in a tile, 16x16", Table, "chapter 3"),
    symbol!("T", tiles, SOME, "tiles", "tiles in a 512x512 picture", Table, "chapter 1"),
    symbol!("F", frames_per_second, ANY, "frames/s", "frames a second", Table, "chapter 1"),
    symbol!("N_FG", gather_rays, ANY, "rays", "final gather rays, 33 to 200", Table, "chapter 2"),
    symbol!("k", neighbors, ANY, "photons", "photons searched for", Table, "chapter 2"),
    symbol!("N_S", shadow_rays, ANY, "rays", "shadow rays", Table, "chapter 2"),
    symbol!("C_J", table_cells, ANY, "cells", "importance sampling bins, 4x8", Table, "chapter 6"),
    symbol!("N_PM", photons, ANY, "photons", "photons in the indirect map, 0.5 to 6 million", Table, "chapter 2"),
    symbol!("R_IC", interpolated_share, RATIO, "", "share of pixels using the irradiance cache, 0 to 0.95", Table, "chapter 5"),
    GATHERING_SHARE,
    symbol!("L_IC", records_per_pixel, ANY, "records", "irradiance records interpolated per pixel", Table, "section 7.3.3"),
    symbol!("C_B1", reflection_stage_1, ANY, "FLOPs", "partial evaluation of f_r, stage 1", Table, "section 7.3.2"),
    symbol!("C_B2", reflection_stage_2, ANY, "FLOPs", "partial evaluation of f_r, stage 2", Table, "section 7.3.2"),
    symbol!("C_RayCast", ray_cast, ANY, "FLOPs", "intersecting a ray with the scene", Table, "section 7.3.2"),
    symbol!("C_G", gather, ANY, "FLOPs", "gathering the k nearest photons, k = 100", Table, "section 7.3.4"),
    symbol!("S_B", reflection_bytes, ANY, "bytes", "size of a partially evaluated f_r", Table, "section 7.4"),
    symbol!("S_P", photon_bytes, SOME, "bytes", "size of a photon", Published, "Jensen's record; fits the raw bytes of Graphics Interface 2005"),
    symbol!("S_L", line_bytes, SOME, "bytes", "line of card memory", Published, "figure 6.17"),
    symbol!("B_G", gather_dram, ANY, "bytes", "photon map from DRAM per gather, reordered", Published, "Graphics Interface 2005: 24 GB a frame"),
    symbol!("B_N", naive_gather_dram, ANY, "bytes", "photon map from DRAM per gather, naive", Published, "section 7.1: 11 TB/s"),
    symbol!("B_R", ray_dram, ANY, "bytes", "scene from DRAM per ray", Published, "ray caster: 1 GB/s at 100 M rays/s"),
    symbol!("C_IC", interpolation, ANY, "FLOPs", "one record in an interpolation", Ours, "rounded count by hand of firmware::irradiance_cache"),
    symbol!("C_IR", record_ray, ANY, "FLOPs", "gradients of a record, per ray", Ours, "rounded count by hand of firmware::irradiance_cache"),
    symbol!("C_T1", table_photon, ANY, "FLOPs", "one photon in an importance table", Ours, "rounded count by hand of firmware::importance"),
    symbol!("C_T2", table_cell, ANY, "FLOPs", "one cell of an importance table", Ours, "rounded count by hand of firmware::importance"),
    symbol!("B_P", pixel_bytes, ANY, "bytes", "pixel on the host link", Ours, "shared::message"),
    symbol!("B_T", command_bytes, ANY, "bytes", "tile command on the host link", Ours, "shared::message, in its frame"),
    symbol!("f", fan_out, FAN_OUT, "links", "links below a switch of the host's tree", Ours, "figure 7.1 draws a tree, without a number"),
    symbol!("S_F", frame_bytes, ANY, "bytes", "bytes that a switch holds before it forwards them", Ours, "shared::frame"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn symbols_have_table_7_1s_values() {
        let nominal = Symbols::NOMINAL;
        let table = [
            ("P", 256.0),
            ("T", 1024.0),
            ("F", 30.0),
            ("N_FG", 100.0),
            ("k", 100.0),
            ("N_S", 8.0),
            ("C_J", 32.0),
            ("N_PM", 500_000.0),
            ("R_IC", 0.6),
            ("R_FG", 0.4),
            ("L_IC", 4.0),
            ("C_B1", 12.0),
            ("C_B2", 10.0),
            ("C_RayCast", 330.0),
            ("C_G", 2389.0),
            ("S_B", 13.0),
        ];
        let rows: Vec<_> = nominal.rows().filter(|(symbol, _)| symbol.origin == Origin::Table).collect();
        assert_eq!(rows.iter().map(|(symbol, value)| (symbol.notation, *value)).collect::<Vec<_>>(), table);
        assert_eq!([nominal.photon_bytes, nominal.line_bytes], [20.0, 128.0]);
    }

    #[test]
    fn every_symbol_can_be_set_by_name_and_by_itself() {
        for (symbol, value) in Symbols::NOMINAL.rows() {
            let mut symbols = Symbols::NOMINAL;
            let other = if symbol.range == RATIO { 0.25 } else { value + 7.0 };
            symbols.set(&format!("{}={other}", symbol.notation)).unwrap();
            for ((row, before), (_, after)) in Symbols::NOMINAL.rows().zip(symbols.rows()) {
                let is_pair = symbol.range == RATIO && row.range == RATIO;
                let expected = if row.notation == symbol.notation { other } else { before };
                assert!(is_pair || after == expected, "{} changed {}", symbol.notation, row.notation);
            }
            assert_eq!(symbols.gathering_share() + symbols.interpolated_share, 1.0);
        }
    }

    #[test]
    fn a_wrong_assignment_is_an_error_and_changes_nothing() {
        let mut symbols = Symbols::NOMINAL;
        let mut error = |text: &str| symbols.set(text).unwrap_err().to_string();
        assert!(error("R_IC").contains("R_IC=0.5"));
        let unknown = error("r_ic=0.5");
        assert!(unknown.contains("\"r_ic\"") && unknown.contains("R_IC, R_FG, L_IC"), "{unknown}");
        assert_eq!(error("R_IC=1.5"), "R_IC cannot be \"1.5\"; give a number from 0 to 1");
        for wrong in ["T=0", "k=NaN", "k=inf", "k=-1", "k=", "k=many"] {
            assert!(error(wrong).contains("cannot be"), "{wrong}");
        }
        assert_eq!(symbols, Symbols::NOMINAL);
    }

    #[test]
    fn photon_map_bytes_are_whole_lines_of_six_photons() {
        assert_eq!(Symbols { photons: 13.0, ..Symbols::NOMINAL }.photon_map_bytes(), 3.0 * 128.0);
    }
}
