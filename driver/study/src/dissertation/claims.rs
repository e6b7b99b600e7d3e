//! List of the claims.

use super::claim::Condition::{AtLeast, AtMost, Between};
use super::claim::{Claim, Condition, Evidence, FigureOf, Scope};

const CORNELL: &str = "cornell";
const GLOSSY: &str = "cornell-glossy";
const ATRIUM: &str = "atrium";

const fn figure(
    label: &'static str,
    name: &'static str,
    scene: &'static str,
    unit: &'static str,
) -> FigureOf {
    FigureOf { label, name, scene, factor: 1.0, unit }
}

const fn percent(
    label: &'static str,
    name: &'static str,
    scene: &'static str,
    unit: &'static str,
) -> FigureOf {
    FigureOf { label, name, scene, factor: 100.0, unit }
}

/// A figure of all three scenes.
const fn in_scenes(name: &'static str, unit: &'static str) -> [FigureOf; 3] {
    [
        figure("Cornell", name, CORNELL, unit),
        figure("glossy", name, GLOSSY, unit),
        figure("atrium", name, ATRIUM, unit),
    ]
}

/// Change over the exponent of a line in a panel of figure 6.17.
macro_rules! change {
    ($label:literal, $panel:literal, $line:literal) => {
        figure($label, concat!("figure-6.17.last-over-first.", $panel, ".", $line), GLOSSY, "")
    };
}

/// Changes over the exponent of the reordered lines in a panel of figure 6.17.
macro_rules! reordered {
    ($panel:literal) => {
        [
            change!("dirbin", $panel, "dirbin"),
            change!("hash", $panel, "hash"),
            change!("dirbin, combined", $panel, "dirbin-combined"),
            change!("hash, combined", $panel, "hash-combined"),
        ]
    };
}

/// Evidence of all figures.
const fn measured(figures: &'static [FigureOf], holds: Condition, otherwise: &'static str) -> Evidence {
    Evidence::Measured { figures, scope: Scope::All, holds, otherwise }
}

/// Evidence of the figure that meets the condition best.
const fn best(figures: &'static [FigureOf], holds: Condition, otherwise: &'static str) -> Evidence {
    Evidence::Measured { figures, scope: Scope::Best, holds, otherwise }
}

/// A property of the design, which a file shows.
const fn built(shown: &'static str, file: &'static str) -> Evidence {
    Evidence::Built { shown, file }
}

pub(super) const CLAIMS: &[Claim] = &[
    Claim {
        place: "GI",
        claim: "a frame of 512x512 pixels of a simple scene requests of the kd-tree, naively, for each gather",
        published: "over 196 GB; 7.5 KB, if all of 26.2 million rays gather",
        evidence: measured(
            &[FigureOf {
                label: "",
                name: "reordering.raw-bytes-of-a-gather.naive",
                scene: CORNELL,
                factor: 1e-3,
                unit: "KB",
            }],
            AtLeast(5600.0),
            "photons of 20 bytes and nodes are read by fewer requests",
        ),
    },
    Claim {
        place: "GI",
        claim: "the two practical reorderings, with about 1 MB of storage, fetch",
        published: "about 24 GB",
        evidence: measured(
            &[
                figure("dirbin", "reordering.gigabytes.dirbin", CORNELL, "GB"),
                figure("hash", "reordering.gigabytes.hash", CORNELL, "GB"),
                figure("hash, cache of 32 ways", "reordering.gigabytes.hash-32-ways-hashed", CORNELL, "GB"),
            ],
            Between(18.0, 30.0),
            "number of bins and associativity are not known there: with 4 ways, conflicts add to the bytes of hash, and bins of directions alone leave gathers far apart",
        ),
    },
    Claim {
        place: "GI",
        claim: "all gathers along a Hilbert curve fetch",
        published: "15 MB",
        evidence: measured(
            &[
                FigureOf {
                    label: "Jensen's tree",
                    name: "reordering.gigabytes.hilbert",
                    scene: CORNELL,
                    factor: 1e3,
                    unit: "MB",
                },
                FigureOf {
                    label: "line layout",
                    name: "reordering.gigabytes.hilbert-lines",
                    scene: CORNELL,
                    factor: 1e3,
                    unit: "MB",
                },
            ],
            AtMost(0.0188),
            "neighbouring photons of Jensen's array lie in different lines, so that each gather reads lines of its own",
        ),
    },
    Claim {
        place: "GI, TVCG",
        claim: "the picture is the same in every order",
        published: "exactly",
        evidence: built("byte for byte, with any tiles, chips and links", "tests/tests/it/exactness.rs"),
    },
    Claim {
        place: "GI, TVCG",
        claim: "a data structure alone does not give the reduction: naive bytes in the line layout over bytes with reordering too",
        published: "",
        evidence: measured(
            &const { in_scenes("techniques.lines-over-reordering", "times") },
            AtLeast(4.0),
            "the line layout alone reads nearly as little",
        ),
    },
    Claim {
        place: "chapter 5",
        claim: "the irradiance cache saves of a diffuse scene of low complexity",
        published: "40 % or more",
        evidence: measured(
            &[percent("", "techniques.saved-share.irradiance-cache", CORNELL, "% of all bytes, tiled")],
            AtLeast(0.4),
            "tiles of 16x16 pixels share few records",
        ),
    },
    Claim {
        place: "chapter 5",
        claim: "the cache is made parallel: no pixel depends on the pixels before it",
        published: "",
        evidence: built(
            "records depend on their position alone, and pictures on no order of tiles; the dissertation's own rule is not known",
            "tests/tests/it/exactness.rs",
        ),
    },
    Claim {
        place: "chapter 6, IS",
        claim: "combined importance sampling cuts the rays of equal quality",
        published: "by up to an order of magnitude: 10 of 100",
        evidence: best(
            &const { in_scenes("techniques.rays-at-equal-quality.combined-sampling", "rays") },
            AtMost(12.5),
            "the light that gather rays meet in these scenes comes from everywhere; the best scene measured is lit by one spot, with 44 rays for 200 ([techniques](techniques.md))",
        ),
    },
    Claim {
        place: "section 6.6",
        claim: "it is compatible with reordering and irradiance caching, and their benefits build on each other: all techniques against reordering alone, at equal quality",
        published: "fewer bytes",
        evidence: measured(
            &const { in_scenes("techniques.factor-over-exact-reordering.all-techniques", "times fewer") },
            AtLeast(1.0),
            "survey rays and tables cost more than they save",
        ),
    },
    Claim {
        place: "section 6.6",
        claim: "sharp lobes are not well represented by a table",
        published: "",
        evidence: built(
            "the lobe is sampled apart from the cells of a table",
            "firmware/src/importance/mod.rs",
        ),
    },
    Claim {
        place: "figure 6.16",
        claim: "pictures of a glossy floor, n = 1 to 128",
        published: "eight pictures",
        evidence: Evidence::None(
            "a picture is no figure; `photoncard render scenes/cornell-glossy.gltf --camera floor --set floor.exponent=N` renders each",
        ),
    },
    Claim {
        place: "figure 6.17 a",
        claim: "bytes of the tiled order at n = 128 over those at n = 1",
        published: "falls",
        evidence: measured(&[change!("", "without-cache", "tiled")], AtMost(1.0), "it does not fall"),
    },
    Claim {
        place: "figure 6.17 a",
        claim: "the same of reordered gathers",
        published: "minor or no reduction: 0.9 or more",
        evidence: measured(
            &reordered!("without-cache"),
            AtLeast(0.9),
            "fewer lines of the map are read for gathers of a narrow lobe in these orders too",
        ),
    },
    Claim {
        place: "figure 6.17 b",
        claim: "bytes of the tiled order at n = 128 over those at n = 1",
        published: "falls",
        evidence: measured(&[change!("", "with-cache", "tiled")], AtMost(1.0), "it does not fall"),
    },
    Claim {
        place: "figure 6.17 b",
        claim: "the same of reordered gathers",
        published: "minor or no reduction: 0.9 or more",
        evidence: measured(
            &reordered!("with-cache"),
            AtLeast(0.9),
            "fewer lines of the map are read for gathers of a narrow lobe in these orders too",
        ),
    },
    Claim {
        place: "figure 6.17",
        claim: "the highest value of a curve, tiled",
        published: "below 180 GB",
        evidence: measured(
            &[figure("", "figure-6.17.greatest-gigabytes.without-cache.tiled", GLOSSY, "GB")],
            AtMost(180.0),
            "associativity, layout of the tree and view are not known there",
        ),
    },
    Claim {
        place: "section 6.5",
        claim: "narrow rays save little, compared with reordering: what hash saves over what n saves, tiled",
        published: "minor",
        evidence: measured(
            &[figure("", "figure-6.17.reordering-over-exponent", GLOSSY, "times")],
            AtLeast(2.0),
            "narrow rays save as much",
        ),
    },
    Claim {
        place: "section 7.1, goal 1",
        claim: "expansion cards for a standard workstation",
        published: "",
        evidence: Evidence::None(
            "no card is built: cards are emulated, run in QEMU, or are boards on a serial port",
        ),
    },
    Claim {
        place: "section 7.1, goal 2",
        claim: "one design of a chip",
        published: "",
        evidence: built(
            "one firmware, whose budgets are constants of a kind of chip; nothing is synthesized",
            "firmware/src/kind/mod.rs",
        ),
    },
    Claim {
        place: "section 7.1, goal 3",
        claim: "no communication between chips",
        published: "",
        evidence: built(
            "a card has one link, to its host ([protocol](protocol.md))",
            "firmware/src/serve/mod.rs",
        ),
    },
    Claim {
        place: "section 7.1, goal 4",
        claim: "technology of 2010",
        published: "",
        evidence: Evidence::None("nothing is synthesized"),
    },
    Claim {
        place: "section 7.1",
        claim: "a simple tree of links to the host suffices",
        published: "",
        evidence: built(
            "`photoncard emulate --relay`: trees of hosts, whose pictures are one card's ([scaling](scaling.md#trees-of-hosts))",
            "driver/tests/it/simulation/relay/mod.rs",
        ),
    },
    Claim {
        place: "section 7.1",
        claim: "a chip of 2010",
        published: "500 GFLOPS, 90 GB/s",
        evidence: Evidence::Modelled { figures: &[], model: "an input of the cost model" },
    },
    Claim {
        place: "section 7.1",
        claim: "30 naive frames a second of Sponza take",
        published: "7.4 TFLOPS",
        evidence: measured(
            &[figure("atrium, counted", "table-7.1.teraflops.naive", ATRIUM, "TFLOPS")],
            Between(5.55, 9.25),
            "a ray meets a hierarchy of many small triangles, and C_RayCast is that of a simple scene; distances and comparisons of the search are counted too",
        ),
    },
    Claim {
        place: "section 7.1",
        claim: "chips for that arithmetic",
        published: "less than sixteen",
        evidence: measured(
            &const { in_scenes("table-7.1.chips-by-arithmetic.naive", "chips") },
            AtMost(15.0),
            "of the same counts",
        ),
    },
    Claim {
        place: "section 7.1",
        claim: "30 naive frames a second of Sponza read",
        published: "11 TB/s, twelve dozen chips of 90 GB/s",
        evidence: measured(
            &[figure("atrium", "table-7.1.terabytes.naive", ATRIUM, "TB/s")],
            Between(8.25, 13.75),
            "a gather ray that leaves the scene gathers nothing",
        ),
    },
    Claim {
        place: "section 7.1",
        claim: "memory bandwidth is the limiting factor: time of the bytes over time of the arithmetic, naive",
        published: "above 1",
        evidence: measured(
            &const { in_scenes("table-7.1.bandwidth-over-arithmetic.naive", "") },
            AtLeast(1.0),
            "arithmetic limits",
        ),
    },
    Claim {
        place: "section 7.1",
        claim: "the same with all techniques",
        published: "above 1",
        evidence: measured(
            &const { in_scenes("table-7.1.bandwidth-over-arithmetic.all-techniques", "") },
            AtLeast(1.0),
            "the techniques cut bytes more than arithmetic, which then limits",
        ),
    },
    Claim {
        place: "chapter 7",
        claim: "the three techniques together cut the bandwidth, at equal quality, in Jensen's tree",
        published: "almost two orders of magnitude",
        evidence: measured(
            &const { in_scenes("techniques.factor-at-equal-quality.all-techniques-jensen", "times") },
            AtLeast(75.0),
            "a large scene has more photons and records that differ from tile to tile",
        ),
    },
    Claim {
        place: "chapter 7",
        claim: "they impose no significant computation: counted arithmetic with all techniques over naive, at equal rays",
        published: "",
        evidence: measured(
            &const { in_scenes("table-7.1.arithmetic-over-naive", "") },
            AtMost(1.1),
            "more rays are cast for records than are saved",
        ),
    },
    Claim {
        place: "beyond",
        claim: "the three techniques with photons in lines, at equal quality",
        published: "",
        evidence: measured(
            &const { in_scenes("techniques.factor-at-equal-quality.all-techniques-lines", "times") },
            AtLeast(75.0),
            "a large scene has more photons and records that differ from tile to tile",
        ),
    },
    Claim {
        place: "beyond",
        claim: "the same with gathers that wait in card memory: whole frames, all bytes",
        published: "",
        evidence: measured(
            &const {
                in_scenes(
                    "techniques.factor-at-equal-quality.all-techniques-lines-gathers-in-card-memory",
                    "times",
                )
            },
            AtLeast(75.0),
            "the scene is most of what is read",
        ),
    },
    Claim {
        place: "section 7.1",
        claim: "a desktop machine renders difficult indirect light at 30 frames a second: chips with all techniques, by bandwidth and counted arithmetic",
        published: "a small number of cards",
        evidence: Evidence::Modelled {
            figures: &const { in_scenes("table-7.1.chips-by-count.all-techniques", "chips") },
            model: "units never wait for each other",
        },
    },
    Claim {
        place: "section 7.1",
        claim: "internal storage is within the technology's",
        published: "",
        evidence: built(
            "all buffers of the reference chip take 1 MB, by an assertion of the build",
            "firmware/src/card/mod.rs",
        ),
    },
    Claim {
        place: "section 7.1",
        claim: "most computation is parallel, with few dependences, in deep pipelines",
        published: "",
        evidence: Evidence::None("there is no description in registers and gates"),
    },
    Claim {
        place: "chapter 7",
        claim: "a functional simulation verifies the pictures, under a variety of conditions",
        published: "",
        evidence: built(
            "the firmware runs in the host's process, and pictures are compared with path-traced references",
            "tests/tests/it/references.rs",
        ),
    },
    Claim {
        place: "section 7.4.3",
        claim: "performance scales with chips: speed-up of 16",
        published: "",
        evidence: Evidence::Modelled {
            figures: &const { in_scenes("table-7.1.speed-up-of-16-chips", "times") },
            model: "measured tiles of 16x16 pixels, dealt by the real scheduler in simulated time",
        },
    },
    Claim {
        place: "chapter 7",
        claim: "no deadlock",
        published: "",
        evidence: built(
            "no run of simulated machines with losses blocked; why none can is argued in [scaling](scaling.md)",
            "driver/tests/it/simulation/mod.rs",
        ),
    },
];

pub(super) const SYMBOLS: &[Claim] = &[
    Claim {
        place: "P",
        claim: "pixels of a tile",
        published: "16x16",
        evidence: built(
            "`--tile`: 16x16 where studies say nothing else, up to 64x64 on the reference chip",
            "driver/study/src/scale.rs",
        ),
    },
    Claim {
        place: "T",
        claim: "tiles of a picture of 512x512 pixels",
        published: "1024",
        evidence: built("follows from P", "driver/study/src/scale.rs"),
    },
    Claim {
        place: "F",
        claim: "frames a second",
        published: "30",
        evidence: Evidence::Modelled { figures: &[], model: "an input of the cost model" },
    },
    Claim {
        place: "N_FG",
        claim: "final gather rays",
        published: "33, **100**, 200",
        evidence: built("`--gather-rays`: 100 in studies", "driver/study/src/scale.rs"),
    },
    Claim {
        place: "k",
        claim: "photons that a gather searches for",
        published: "100",
        evidence: built("`--neighbors`: 100 in studies", "driver/study/src/scale.rs"),
    },
    Claim {
        place: "N_S",
        claim: "shadow rays",
        published: "8",
        evidence: built("`--shadow-rays`: 8 in studies", "driver/study/src/scale.rs"),
    },
    Claim {
        place: "C_J",
        claim: "importance sampling bins",
        published: "4x8",
        evidence: built(
            "the cells of a direction table, with one more for the lobe",
            "firmware/src/importance/mod.rs",
        ),
    },
    Claim {
        place: "N_PM",
        claim: "photons of the indirect map",
        published: "0.5 to 6 million",
        evidence: built(
            "`--photons`: 500,000 in studies; 2 and 6 million in `scaling`",
            "driver/study/src/scale.rs",
        ),
    },
    Claim {
        place: "R_IC",
        claim: "share of pixels that use the irradiance cache, with the error 0.025",
        published: "0 to 95 %, 60 for calculations",
        evidence: measured(
            &const {
                let name = "table-7.1.interpolated-share.all-techniques";
                [
                    percent("Cornell", name, CORNELL, "%"),
                    percent("glossy", name, GLOSSY, "%"),
                    percent("atrium", name, ATRIUM, "%"),
                ]
            },
            Between(0.0, 0.95),
            "records stand at the corners of cells, so that nearly every pixel of large surfaces interpolates",
        ),
    },
    Claim {
        place: "R_FG",
        claim: "share of pixels that gather",
        published: "100 % - R_IC",
        evidence: Evidence::Modelled {
            figures: &[],
            model: "records are no pixels here: `table-7.1` counts them",
        },
    },
    Claim {
        place: "L_IC",
        claim: "records interpolated for a pixel",
        published: "4",
        evidence: built("the corners of a cell", "firmware/src/irradiance_cache/interpolation.rs"),
    },
    Claim {
        place: "C_B1, C_B2",
        claim: "evaluation of the reflection, once and of each photon, of a gather in three channels: 3 (C_B1 + k C_B2)",
        published: "12 and 10 FLOPs; 3,036",
        evidence: measured(
            &const { in_scenes("table-7.1.flops-of-reflection.naive", "FLOPs") },
            Between(2277.0, 3795.0),
            "most photons lie on surfaces without a lobe, whose sum is in fixed point and is multiplied once",
        ),
    },
    Claim {
        place: "C_RayCast",
        claim: "a ray",
        published: "330 FLOPs",
        evidence: measured(
            &const { in_scenes("table-7.1.flops-of-a-ray.naive", "FLOPs") },
            Between(248.0, 412.0),
            "nodes have boxes of several children, which are all tested",
        ),
    },
    Claim {
        place: "C_G",
        claim: "a naive gather with the reflection of its photons, C_G + 3 k (C_B1 + C_B2)",
        published: "2,389 FLOPs; 8,989",
        evidence: measured(
            &const { in_scenes("table-7.1.flops-of-a-gather.naive", "FLOPs") },
            Between(6742.0, 11236.0),
            "search and selection take more comparisons",
        ),
    },
    Claim {
        place: "C_G",
        claim: "a gather of all techniques, C_G + 3 (C_B1 + k C_B2)",
        published: "2,389 FLOPs; 5,425",
        evidence: measured(
            &const { in_scenes("table-7.1.flops-of-a-gather.all-techniques", "FLOPs") },
            Between(4069.0, 6781.0),
            "search and selection take more comparisons",
        ),
    },
    Claim {
        place: "S_B",
        claim: "a partially evaluated BRDF",
        published: "13 bytes",
        evidence: built(
            "13 bytes; with position and target 24 in the queue",
            "firmware/src/scene/reflection/record.rs",
        ),
    },
];
