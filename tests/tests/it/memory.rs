//! Model of a chip's memory: it counts reads and cache misses, and leaves the picture as it is.

use photoncard_driver::emulator::contents::Inspected;
use photoncard_driver::emulator::direct::{RenderedTile, render_tile};
use photoncard_driver::emulator::memory_model::{CacheSettings, MeasuredMemory, MemoryTraffic};
use photoncard_driver::emulator::{EmulatedChip, EmulatedKind};
use photoncard_driver::pack::PackedScene;
use photoncard_driver::photon_map::{MappedImage, PhotonLayout, map_photons};
use photoncard_driver::render::{
    CardSet, Integrator, MemoryStatistics, PhotonMaps, Picture, Radiance, ReadStatistics, RenderSettings,
    Schedule, Statistics,
};
use photoncard_driver::scene::{Scene, gltf};
use photoncard_driver::scheduler::{GatherOrder, tiles};
use photoncard_firmware::kind::REFERENCE;
use photoncard_firmware::memory::{
    CacheEntry, CacheShape, Counted, LineCache, LineCaches, Lines, MemoryPort, SetIndex, Stage,
};
use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::layout::{Material, Photon, Record};
use photoncard_shared::message::{Fault, Tile};
use photoncard_tests::lru::LruOracle;
use photoncard_tests::{radiances, render_or_panic, with_room_for_a_card};

fn glossy() -> Scene {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/cornell-glossy.gltf");
    gltf::load(path.as_ref()).expect("a shipped scene loads")
}

fn settings() -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 21, height: 18, ..Picture::default() },
        photons: PhotonMaps { count: 5000, neighbors: 30, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 8, shadow_rays: 2, ..Integrator::default() },
        // With several tiles in flight, misses depend on which tiles a chip has together.
        schedule: Schedule { tile: Some(8), in_flight: Some(1), ..Schedule::default() },
        cards: CardSet { addresses: vec!["emulated:1".parse().unwrap()], ..CardSet::default() },
        ..RenderSettings::default()
    }
}

fn caches(text: &str) -> CacheSettings {
    text.parse().unwrap()
}

/// Caches that are so small that reads often miss.
const SPLIT: &str = "photon=16K/128/4,scene=16K/128/4";
const BY_WORK: &str = "casting=9K/128/4,gathering=6K/128/4";
const UNIFIED: &str = "unified=9K/384/3,index=hash";

/// Card image of a scene, and a picture's frame and tiles.
struct Frame {
    mapped: MappedImage,
    frame: photoncard_shared::message::FrameParameters,
    tiles: Vec<Tile>,
}

impl Frame {
    fn new(settings: &RenderSettings) -> Self {
        let scene = glossy();
        let packed = PackedScene::new(&scene).unwrap();
        let mapped = map_photons(packed, &settings.photon_settings(&scene), &|_| true).unwrap();
        let frame = settings.frame(scene.camera(None).unwrap(), &mapped.gathers);
        Self {
            mapped,
            frame,
            tiles: tiles(settings.window(), settings.tile_side(&[REFERENCE]), settings.schedule.order),
        }
    }

    fn lines(&self) -> Lines<'_> {
        self.mapped.image.view().1
    }

    fn tile(&self, chip: &mut EmulatedChip, memory: impl MeasuredMemory, tile: Tile) -> RenderedTile {
        let (scene, _) = self.mapped.image.view();
        render_tile(chip, &scene, memory, &self.frame, tile, None).expect("a sound image")
    }
}

/// Memory that records which lines are read, and compares each with that of the card image.
struct Recorder<'a, M> {
    memory: M,
    image: &'a [Line],
    reads: &'a mut Vec<(Structure, u32)>,
}

impl<M: MemoryPort> MemoryPort for Recorder<'_, M> {
    fn read(
        &mut self,
        structure: Structure,
        address: LineAddress,
        used: std::ops::Range<u32>,
    ) -> Result<&Line, Fault> {
        self.reads.push((structure, address.0));
        let line = self.memory.read(structure, address, used)?;
        assert_eq!(*line, self.image[address.0 as usize]);
        Ok(line)
    }

    fn enter(&mut self, stage: Stage) {
        self.memory.enter(stage);
    }

    fn begin_tile(&mut self) {
        self.reads.clear();
        self.memory.begin_tile();
    }
}

impl<M: MeasuredMemory> MeasuredMemory for Recorder<'_, M> {
    fn traffic(&self) -> MemoryTraffic {
        self.memory.traffic()
    }
}

#[test]
fn a_tile_hits_and_misses_by_the_definition_of_its_caches() {
    with_room_for_a_card(|| {
        let mut chip = EmulatedKind::Reference.emulated().chip();
        let split = |_| LruOracle::new(32, 4, 1, |block| block % 32);
        let shape = CacheShape::new(9 << 10, 384, 3, SetIndex::Hashed).unwrap();
        for layout in [PhotonLayout::Jensen, PhotonLayout::Lines] {
            let frame = Frame::new(&settings().with(|s| s.photons.layout = layout));
            for text in [SPLIT, UNIFIED] {
                let mut reads = Vec::new();
                let image = frame.mapped.image.lines();
                let memory = Recorder { memory: caches(text).over(frame.lines()), image, reads: &mut reads };
                let traffic = frame.tile(&mut chip, memory, frame.tiles[4]).traffic;
                let mut oracles = match text {
                    SPLIT => Vec::from([0, 1].map(split)),
                    _ => vec![LruOracle::new(8, 3, 3, move |block| shape.set(block))],
                };
                let mut misses = [0; Structure::ALL.len()];
                for &(structure, line) in &reads {
                    let oracle = usize::from(structure.is_photon_map()) % oracles.len();
                    misses[structure as usize] += u64::from(!oracles[oracle].hits(line));
                }
                for structure in Structure::ALL {
                    let count = reads.iter().filter(|(read, _)| *read == structure).count() as u64;
                    let [requested, fetched] = traffic.of(|other| other == structure);
                    let counted = [requested.requests, fetched.misses];
                    assert_eq!(counted, [count, misses[structure as usize]], "{structure:?}, {text}");
                }
                let of_photons = misses[Structure::Photons as usize];
                assert!(of_photons > 100 && of_photons < reads.len() as u64 / 2, "{of_photons}");
            }
        }
    });
}

/// Caches of boards are arrays, those of emulated chips vectors.
#[test]
fn caches_in_arrays_and_in_vectors_are_equal() {
    with_room_for_a_card(|| {
        let mut chip = EmulatedKind::Reference.emulated().chip();
        let frame = Frame::new(&settings());
        let shape = CacheShape::new(16 << 10, 128, 4, SetIndex::Modulo).unwrap();
        let in_array = || LineCache::new(shape, [CacheEntry::EMPTY; 128], [Line::ZERO; 128]).unwrap();
        for tile in &frame.tiles[..3] {
            let dram = Counted::new(frame.lines());
            let board = Inspected::new(Counted::new(LineCaches::new(dram, in_array(), in_array())));
            let board = frame.tile(&mut chip, board, *tile);
            let emulated = frame.tile(&mut chip, caches(SPLIT).over(frame.lines()), *tile);
            let direct = frame.tile(&mut chip, frame.lines(), *tile);
            assert_eq!(board.traffic, emulated.traffic);
            assert_eq!(direct.traffic, MemoryTraffic::ZERO);
            assert!(board.sums == direct.sums && emulated.sums == direct.sums);
            assert_eq!([board.counters, emulated.counters], [direct.counters; 2]);
        }
    });
}

#[test]
fn counting_changes_no_picture() {
    let scene = glossy();
    let expected = radiances(&render_or_panic(&scene, &settings()).film);
    let orders = [
        GatherOrder::Naive,
        GatherOrder::Tiled,
        GatherOrder::DirectionBins,
        GatherOrder::Hash,
        GatherOrder::Sort,
        GatherOrder::Buckets,
    ];
    for order in orders {
        for photon_layout in [PhotonLayout::Jensen, PhotonLayout::Lines] {
            for (card, text) in [
                ("emulated:2", SPLIT),
                ("emulated-micro:2", UNIFIED),
                ("emulated:2", UNIFIED),
                ("emulated:2", BY_WORK),
            ] {
                let caches = Some(caches(text));
                let cards = vec![card.parse().unwrap()];
                let counted = settings().with(|s| {
                    s.photons.layout = photon_layout;
                    s.schedule.order = order;
                    s.cards.caches = caches;
                    s.cards.addresses = cards;
                });
                let counted_picture = render_or_panic(&scene, &counted);
                assert!(radiances(&counted_picture.film) == expected, "{counted:?}");
                let direct = counted.clone().with(|s| s.cards.caches = None);
                let direct = render_or_panic(&scene, &direct);
                assert!(radiances(&direct.film) == expected, "{order:?}");
                let counted = counted_picture.statistics;
                // Gathers that wait in card memory are those of the tiles that a card has, which depend on
                // time.
                let drains = |s: &Statistics| if order == GatherOrder::Buckets { 0 } else { s.drains };
                let work = |s: &Statistics| (s.rays, s.gathers, s.photons_tested, s.photons_taken, drains(s));
                assert_eq!(work(&counted), work(&direct.statistics));
                assert!(direct.statistics.memory.is_none() && counted.memory.is_some());
            }
        }
    }
}

fn measured(settings: &RenderSettings) -> (MemoryStatistics, Statistics) {
    let statistics = render_or_panic(&glossy(), settings).statistics;
    (statistics.memory.clone().expect("memory is modelled"), statistics)
}

#[test]
fn counts_do_not_depend_on_the_assignment_of_tiles() {
    let irradiance_cache = (Some(0.05), GatherOrder::Sort);
    for (irradiance_error, order) in [(None, GatherOrder::Sort), (None, GatherOrder::Naive), irradiance_cache]
    {
        let with = |cards: &str| {
            settings().with(|s| {
                s.integrator.irradiance_error = irradiance_error;
                s.schedule.order = order;
                s.cards.caches = Some(caches(SPLIT));
                s.cards.addresses = vec![cards.parse().unwrap()];
            })
        };
        let (one, statistics) = measured(&with("emulated:1"));
        assert_eq!(one.written_bytes, statistics.image_bytes);
        for chips in 2..4 {
            let (several, statistics) = measured(&with(&format!("emulated:{chips}")));
            // A chip may not be loaded before the others have rendered all tiles.
            let written = statistics.image_bytes..=chips * statistics.image_bytes;
            assert!(written.contains(&several.written_bytes), "{}", several.written_bytes);
            assert_eq!(MemoryStatistics { written_bytes: one.written_bytes, ..several }, one);
        }
        // One chip without a card renders all tiles in reverse order.
        with_room_for_a_card(|| {
            let frame = Frame::new(&with("emulated:1"));
            let mut chip = EmulatedKind::Reference.emulated().chip();
            let mut traffic = MemoryTraffic::ZERO;
            for tile in frame.tiles.iter().rev() {
                traffic.add(&frame.tile(&mut chip, caches(SPLIT).over(frame.lines()), *tile).traffic);
            }
            assert_eq!(traffic.photon_map_bytes(), one.photon_map.dram_bytes);
            assert_eq!(traffic.scene_bytes(), one.scene.dram_bytes);
        });
    }
}

#[test]
fn tiles_in_flight_fetch_less_of_the_photon_map_for_equal_requests() {
    let with = |cards: &str, in_flight| {
        measured(&settings().with(|s| {
            s.integrator.irradiance_error = Some(0.05);
            s.schedule.in_flight = in_flight;
            s.cards.caches = Some(caches(SPLIT));
            s.cards.addresses = vec![cards.parse().unwrap()];
        }))
    };
    let requests = |memory: &MemoryStatistics| {
        let stages = &memory.stages;
        [stages.eye, stages.survey, stages.table, stages.shadow, stages.gather_ray, stages.gather]
            .map(|reads| (reads.requests, reads.raw_bytes))
    };
    let (one, of_one) = with("emulated-large:1", Some(1));
    let mut before = (of_one.drains, one.photon_map.dram_bytes);
    for in_flight in [Some(2), None] {
        let (several, of_several) = with("emulated-large:1", in_flight);
        assert_eq!(requests(&several), requests(&one));
        assert_eq!(of_several.gathers, of_one.gathers);
        let after = (of_several.drains, several.photon_map.dram_bytes);
        assert!(after.0 < before.0 && after.1 < before.1, "{in_flight:?}: {after:?} instead of {before:?}");
        // The counts depend on no timing: a second render has the same.
        assert_eq!(with("emulated-large:1", in_flight).0, several);
        before = after;
    }
    for cards in ["emulated:3", "emulated-large:2"] {
        assert_eq!(requests(&with(cards, None).0), requests(&one));
    }
}

#[test]
fn counts_are_of_whole_records_and_whole_lines() {
    for (photon_layout, irradiance_error, radiance) in [
        (PhotonLayout::Jensen, None, Radiance::Density),
        (PhotonLayout::Lines, Some(0.05), Radiance::Density),
        (PhotonLayout::Jensen, None, Radiance::Precomputed),
        (PhotonLayout::Lines, None, Radiance::Precomputed),
    ] {
        let caches = Some(caches(SPLIT));
        let settings = settings().with(|s| {
            s.photons.layout = photon_layout;
            s.photons.radiance = radiance;
            s.integrator.irradiance_error = irradiance_error;
            s.cards.caches = caches;
        });
        let (memory, statistics) = measured(&settings);
        let structures = &memory.structures;
        let is_jensen = photon_layout == PhotonLayout::Jensen;
        let of_photon = if is_jensen { Photon::BYTES } else { LINE_BYTES };
        for (reads, record) in [
            (structures.nodes, LINE_BYTES),
            (structures.materials, Material::BYTES),
            (structures.photon_nodes, LINE_BYTES),
            (structures.photons, of_photon),
            (structures.irradiance_nodes, LINE_BYTES),
            (structures.irradiance_points, LINE_BYTES),
        ] {
            assert_eq!(reads.raw_bytes, reads.requests * record as u64, "{record}");
        }
        // A ray that visits a leaf reads all 128 bytes; to read the surface at its hit, the last byte is not
        // needed.
        let triangles = structures.triangles;
        let surfaces = triangles.requests * LINE_BYTES as u64 - triangles.raw_bytes;
        assert!((1..triangles.requests).contains(&surfaces), "{surfaces} of {}", triangles.requests);
        let all = [
            structures.nodes,
            structures.triangles,
            structures.materials,
            structures.emitters,
            structures.photon_nodes,
            structures.photons,
            structures.irradiance_nodes,
            structures.irradiance_points,
            structures.caustic_nodes,
            structures.caustic_photons,
            structures.attributes,
            structures.textures,
        ];
        for reads in all {
            assert_eq!(reads.line_hits + reads.line_misses, reads.requests);
            assert_eq!(reads.dram_bytes, reads.line_misses * LINE_BYTES as u64);
        }
        let requests = |parts: &[ReadStatistics]| parts.iter().map(|reads| reads.requests).sum::<u64>();
        let halves = requests(&[memory.photon_map, memory.scene]);
        assert_eq!(requests(&all), halves);
        let stages = memory.stages;
        let of_rays = [stages.eye, stages.survey, stages.shadow, stages.gather_ray];
        assert_eq!(requests(&of_rays), memory.scene.requests);
        assert_eq!(requests(&[stages.table, stages.gather]), memory.photon_map.requests);
        assert!(structures.nodes.requests > 0 && structures.triangles.requests > 0);
        assert_eq!(structures.photons.requests == statistics.photons_tested, is_jensen);
        assert_eq!(structures.photon_nodes.requests == 0, is_jensen);
        let is_precomputed = radiance == Radiance::Precomputed;
        for reads in [structures.irradiance_nodes, structures.irradiance_points] {
            assert_eq!(reads.requests > 0, is_precomputed);
        }
        assert_eq!(statistics.lookups > 0, is_precomputed);
        assert!(statistics.points_tested >= structures.irradiance_points.requests);
    }
}
