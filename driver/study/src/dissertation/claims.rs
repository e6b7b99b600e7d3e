//! List of the claims.

use super::claim::Condition::{AtLeast, AtMost, Between};
use super::claim::{Claim, Evidence, FigureOf};

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

/// A figure of all three scenes.
const fn in_scenes(name: &'static str, unit: &'static str) -> [FigureOf; 3] {
    [
        figure("Cornell", name, CORNELL, unit),
        figure("glossy", name, GLOSSY, unit),
        figure("atrium", name, ATRIUM, unit),
    ]
}

const fn measured(
    figures: &'static [FigureOf],
    holds: super::claim::Condition,
    otherwise: &'static str,
) -> Evidence {
    Evidence::Measured { figures, holds, otherwise }
}

pub(super) const CLAIMS: &[Claim] = &[
    Claim {
        place: "GI",
        claim: "a frame of 512x512 pixels of a simple scene requests of the kd-tree, naively",
        published: "over 196 GB, 7.5 KB for each of 26.2 million gathers",
        evidence: measured(
            &[FigureOf {
                label: "",
                name: "reordering.raw-bytes-of-a-gather.naive",
                scene: CORNELL,
                factor: 1e-3,
                unit: "KB a gather",
            }],
            Between(5600.0, 9400.0),
            "the search and its tree differ",
        ),
    },
    Claim {
        place: "GI",
        claim: "two practical reorderings, with about 1 MB of storage, fetch",
        published: "about 24 GB",
        evidence: measured(
            &[
                figure("dirbin", "reordering.gigabytes.dirbin", CORNELL, "GB"),
                figure("hash", "reordering.gigabytes.hash", CORNELL, "GB"),
                figure("sort", "reordering.gigabytes.sort", CORNELL, "GB"),
            ],
            AtMost(30.0),
            "bins of directions alone leave too few photons in common; the number of bins there is not known",
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
            AtMost(0.019),
            "neighbouring photons of Jensen's array lie in different lines, so that each gather reads lines of its own",
        ),
    },
    Claim {
        place: "GI, TVCG",
        claim: "the picture is the same in every order",
        published: "exactly",
        evidence: Evidence::Built(
            "byte for byte, with any tiles, chips and links (`tests/tests/it/exactness.rs`)",
        ),
    },
    Claim {
        place: "GI, TVCG",
        claim: "a data structure alone does not give the reduction",
        published: "",
        evidence: measured(
            &const { in_scenes("techniques.factor.lines", "times less than naive") },
            AtMost(2.0),
            "leaves that fill a line are read by fewer requests",
        ),
    },
    Claim {
        place: "chapter 5",
        claim: "the irradiance cache saves of a diffuse scene of low complexity",
        published: "40 % or more",
        evidence: measured(
            &[FigureOf {
                label: "",
                name: "techniques.saved-share.irradiance-cache",
                scene: CORNELL,
                factor: 100.0,
                unit: "% of the bytes, tiled",
            }],
            AtLeast(0.4),
            "tiles of 16x16 pixels share few records",
        ),
    },
    Claim {
        place: "chapter 5",
        claim: "the cache is made parallel: no pixel depends on the pixels before it",
        published: "",
        evidence: Evidence::Built(
            "records on a lattice depend on their position alone (`tests/tests/it/irradiance_cache.rs`); the dissertation's rule is not known",
        ),
    },
    Claim {
        place: "chapter 6, IS",
        claim: "combined importance sampling cuts the rays of equal quality",
        published: "by up to an order of magnitude, 10 of 100",
        evidence: measured(
            &const { in_scenes("techniques.rays-at-equal-quality.combined-sampling", "rays") },
            AtMost(12.5),
            "the light that gather rays meet here comes from everywhere, and a table of 4x8 cells has little to choose",
        ),
    },
    Claim {
        place: "section 6.6",
        claim: "it is compatible with reordering and irradiance caching: all techniques against reordering alone, at equal quality",
        published: "fewer bytes",
        evidence: measured(
            &const { in_scenes("techniques.factor-over-exact-reordering.all-techniques", "times fewer") },
            AtLeast(1.0),
            "the cache's survey rays and the tables cost more than they save",
        ),
    },
    Claim {
        place: "figure 6.16",
        claim: "pictures of a glossy floor, n = 1 to 128",
        published: "eight pictures",
        evidence: Evidence::None(
            "a picture is no figure; `photoncard render scenes/cornell-glossy.gltf --set floor.exponent=N` renders each",
        ),
    },
    Claim {
        place: "figure 6.17 a",
        claim: "the bytes of the naive order fall as n grows from 1 to 128",
        published: "last over first below 1",
        evidence: measured(
            &[
                figure("whole picture", "figure-6.17.last-over-first.without-cache.naive", GLOSSY, ""),
                figure("floor alone", "figure-6.17.last-over-first.floor-alone.naive", GLOSSY, ""),
            ],
            AtMost(1.0),
            "rays of a narrow lobe leave the open box less often than those of a wide one, so that there are more gathers",
        ),
    },
    Claim {
        place: "figure 6.17 a",
        claim: "the bytes of reordered gathers do not depend on n",
        published: "nearly flat, here greatest over least",
        evidence: measured(
            &[
                figure("dirbin", "figure-6.17.greatest-over-least.without-cache.dirbin", GLOSSY, ""),
                figure("hash", "figure-6.17.greatest-over-least.without-cache.hash", GLOSSY, ""),
                figure(
                    "dirbin, combined",
                    "figure-6.17.greatest-over-least.without-cache.dirbin-combined",
                    GLOSSY,
                    "",
                ),
                figure(
                    "hash, combined",
                    "figure-6.17.greatest-over-least.without-cache.hash-combined",
                    GLOSSY,
                    "",
                ),
            ],
            AtMost(1.1),
            "bins of the hemisphere do not follow a lobe, and the number of gathers varies with n",
        ),
    },
    Claim {
        place: "figure 6.17 b",
        claim: "with the irradiance cache the bytes of the naive order fall too",
        published: "last over first below 1",
        evidence: measured(
            &[figure("", "figure-6.17.last-over-first.with-cache.naive", GLOSSY, "")],
            AtMost(1.0),
            "",
        ),
    },
    Claim {
        place: "figure 6.17 b",
        claim: "with the irradiance cache the bytes of reordered gathers do not depend on n",
        published: "nearly flat, here greatest over least",
        evidence: measured(
            &[
                figure("dirbin", "figure-6.17.greatest-over-least.with-cache.dirbin", GLOSSY, ""),
                figure("hash", "figure-6.17.greatest-over-least.with-cache.hash", GLOSSY, ""),
                figure(
                    "dirbin, combined",
                    "figure-6.17.greatest-over-least.with-cache.dirbin-combined",
                    GLOSSY,
                    "",
                ),
                figure(
                    "hash, combined",
                    "figure-6.17.greatest-over-least.with-cache.hash-combined",
                    GLOSSY,
                    "",
                ),
            ],
            AtMost(1.1),
            "fewer pixels of a floor with a wide lobe are interpolated than of one with a narrow lobe",
        ),
    },
    Claim {
        place: "figure 6.17",
        claim: "the tiled curve lies within the plot",
        published: "below 180 GB",
        evidence: measured(
            &[figure("", "figure-6.17.mean-gigabytes.without-cache.tiled", GLOSSY, "GB")],
            AtMost(180.0),
            "lines of 128 bytes are counted, of which Jensen's tree uses few",
        ),
    },
    Claim {
        place: "section 6.5",
        claim: "narrow rays save little, compared with reordering: what `hash` saves over what n saves, tiled",
        published: "minor",
        evidence: measured(
            &[figure("", "figure-6.17.reordering-over-exponent", GLOSSY, "times")],
            AtLeast(2.0),
            "",
        ),
    },
    Claim {
        place: "section 7.1, goal 1",
        claim: "expansion cards for a workstation",
        published: "",
        evidence: Evidence::None(
            "no card is built: cards are emulated, run in QEMU, or are boards on a serial port",
        ),
    },
    Claim {
        place: "section 7.1, goal 2",
        claim: "one design of a chip",
        published: "",
        evidence: Evidence::Built(
            "one firmware, whose budgets are constants of a kind of chip (`firmware::kind`)",
        ),
    },
    Claim {
        place: "section 7.1, goal 3",
        claim: "no communication between chips",
        published: "",
        evidence: Evidence::Built("a card has one link, to its host ([protocol](protocol.md))"),
    },
    Claim {
        place: "section 7.1, goal 4",
        claim: "technology of 2010",
        published: "",
        evidence: Evidence::None("nothing is synthesized"),
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
            "a ray meets a hierarchy of many small triangles, and C_RayCast is that of a simple scene; distances and selection are counted too",
        ),
    },
    Claim {
        place: "section 7.1",
        claim: "30 naive frames a second of Sponza read",
        published: "11 TB/s",
        evidence: measured(
            &[figure("atrium", "table-7.1.terabytes.naive", ATRIUM, "TB/s")],
            Between(8.25, 13.75),
            "a gather ray that leaves the scene gathers nothing",
        ),
    },
    Claim {
        place: "section 7.1",
        claim: "chips for that bandwidth",
        published: "twelve dozen",
        evidence: measured(
            &[figure("atrium", "table-7.1.chips-by-bandwidth.naive", ATRIUM, "chips")],
            Between(108.0, 180.0),
            "11 TB/s over 90 GB/s are 122, and the atrium here reads less",
        ),
    },
    Claim {
        place: "chapter 7",
        claim: "the three techniques together cut the bandwidth, at equal quality",
        published: "almost two orders of magnitude",
        evidence: measured(
            &const { in_scenes("techniques.factor-at-equal-quality.all-techniques-lines", "times") },
            AtLeast(80.0),
            "floors and walls of a large scene share less",
        ),
    },
    Claim {
        place: "beyond",
        claim: "the same with gathers that wait in card memory, whole frames, all bytes",
        published: "",
        evidence: measured(
            &const {
                in_scenes(
                    "techniques.factor-at-equal-quality.all-techniques-lines-gathers-in-card-memory",
                    "times",
                )
            },
            AtLeast(100.0),
            "",
        ),
    },
    Claim {
        place: "section 7.1",
        claim: "a desktop machine renders 30 frames a second: chips with all techniques, by counted arithmetic and bandwidth",
        published: "less than 16",
        evidence: Evidence::Modelled {
            figures: &const { in_scenes("table-7.1.chips-by-count.all-techniques", "chips") },
            model: "units never wait for each other",
        },
    },
    Claim {
        place: "section 7.1",
        claim: "memory bandwidth is the limiting factor: chips by bandwidth alone, with all techniques",
        published: "",
        evidence: Evidence::Modelled {
            figures: &const { in_scenes("table-7.1.chips-by-bandwidth.all-techniques", "chips") },
            model: "with the techniques, arithmetic limits",
        },
    },
    Claim {
        place: "section 7.1",
        claim: "most computation is parallel, with few dependences, in deep pipelines",
        published: "",
        evidence: Evidence::None("there is no description in registers and gates"),
    },
    Claim {
        place: "section 7.1",
        claim: "a tree of links to the host suffices",
        published: "",
        evidence: Evidence::None("trees exist in the cost model alone ([scaling](scaling.md#upload))"),
    },
    Claim {
        place: "section 7.1, chapter 7",
        claim: "a functional simulation verifies the pictures",
        published: "",
        evidence: Evidence::Built(
            "the firmware runs in the host's process, and pictures are compared with path-traced references (`tests/tests/it/references.rs`)",
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
        evidence: Evidence::Built(
            "an argument ([scaling](scaling.md)), and simulated machines with losses (`driver/tests/it/simulation`)",
        ),
    },
];

pub(super) const SYMBOLS: &[Claim] = &[
    Claim {
        place: "P",
        claim: "pixels of a tile",
        published: "16x16",
        evidence: Evidence::Built(
            "`--tile`: 16x16 where studies say nothing else, up to 64x64 on the reference chip",
        ),
    },
    Claim {
        place: "T",
        claim: "tiles of a picture of 512x512 pixels",
        published: "1024",
        evidence: Evidence::Built("follows from P"),
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
        evidence: Evidence::Built("`--gather-rays`: 100 in studies"),
    },
    Claim {
        place: "k",
        claim: "photons that a gather searches for",
        published: "100",
        evidence: Evidence::Built("`--neighbors`: 100 in studies"),
    },
    Claim {
        place: "N_S",
        claim: "shadow rays",
        published: "8",
        evidence: Evidence::Built("`--shadow-rays`: 8 in studies"),
    },
    Claim {
        place: "C_J",
        claim: "importance sampling bins",
        published: "4x8",
        evidence: Evidence::Built(
            "the cells of a direction table, with one more for the lobe (`firmware::importance`)",
        ),
    },
    Claim {
        place: "N_PM",
        claim: "photons of the indirect map",
        published: "0.5 to 6 million",
        evidence: Evidence::Built("`--photons`: 500,000 in studies; 2 and 6 million in `scaling`"),
    },
    Claim {
        place: "R_IC",
        claim: "share of pixels that use the irradiance cache",
        published: "0, **60**, 95 %",
        evidence: measured(
            &const {
                let name = "table-7.1.interpolated-share.all-techniques";
                [
                    FigureOf { label: "Cornell", name, scene: CORNELL, factor: 100.0, unit: "%" },
                    FigureOf { label: "glossy", name, scene: GLOSSY, factor: 100.0, unit: "%" },
                    FigureOf { label: "atrium", name, scene: ATRIUM, factor: 100.0, unit: "%" },
                ]
            },
            Between(0.0, 0.95),
            "records are gathered at corners of cells, and nearly every pixel of a diffuse surface interpolates",
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
        evidence: Evidence::Built("the corners of a cell (`firmware::irradiance_cache`)"),
    },
    Claim {
        place: "C_B1, C_B2",
        claim: "evaluation of the reflection: once, and of each photon",
        published: "12 and 10 FLOPs",
        evidence: Evidence::Modelled { figures: &[], model: "within the counted FLOPs of a gather (C_G)" },
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
        claim: "a gather with the reflection of its photons, C_G + 3 (C_B1 + k C_B2)",
        published: "2389 + 3036 = 5425 FLOPs",
        evidence: measured(
            &const { in_scenes("table-7.1.flops-of-a-gather.naive", "FLOPs") },
            Between(4069.0, 6781.0),
            "each photon of a tested leaf has a distance, and microfacets take more operations than a Phong lobe",
        ),
    },
    Claim {
        place: "S_B",
        claim: "a partially evaluated BRDF that waits",
        published: "13 bytes",
        evidence: Evidence::Modelled {
            figures: &[],
            model: "a gather with its position and all that it needs takes 24 bytes in the queue, a Lambertian one 15 in card memory ([memory](memory.md))",
        },
    },
];
