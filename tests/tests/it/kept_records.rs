//! Irradiance records that a chip keeps for later passes of a picture: they are gathered once while there is
//! room, and no pixel depends on that.

use photoncard_driver::emulator::EmulatedKind;
use photoncard_driver::emulator::direct::{RenderedTile, render_tiles};
use photoncard_driver::pack::PackedScene;
use photoncard_driver::photon_map::{MappedImage, map_photons};
use photoncard_driver::render::RenderSettings;
use photoncard_driver::scheduler::tiles;
use photoncard_firmware::chip::{Chip, MicroChip};
use photoncard_firmware::kind::{ChipKind, MICRO};
use photoncard_firmware::memory::{Counted, Dram, MemoryPort, Stage};
use photoncard_firmware::render::RenderJob;
use photoncard_firmware::sampler::hash;
use photoncard_firmware::scene::SceneImage;
use photoncard_shared::address::{Line, Structure};
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{Fault, FrameParameters, PixelForm, PixelSums, Tile};
use photoncard_tests::everything::everything;
use photoncard_tests::with_room_for_a_card;

/// Number of lines of the directory, which precedes the kept records.
const DIRECTORY: usize = 128;
/// Number of lines in which all records of the picture have room.
const PLENTY: usize = 4000;

/// Card image, and a picture's frame and tiles.
struct World {
    scene: SceneImage,
    image: Vec<Line>,
    frame: FrameParameters,
    tiles: Vec<Tile>,
}

/// Sums of all pixels, and counters of all tiles.
type Picture = (Vec<PixelSums>, Counters);

impl World {
    fn new() -> Self {
        let scene = everything();
        let settings = RenderSettings::default().with(|s| {
            (s.picture.width, s.picture.height) = (18, 16);
            (s.photons.count, s.photons.neighbors) = (2000, 20);
            (s.photons.caustic_photons, s.photons.caustic_neighbors) = (Some(500), 20);
            (s.integrator.gather_rays, s.integrator.shadow_rays) = (8, 2);
            (s.integrator.irradiance_error, s.integrator.planned_samples) = (Some(0.1), Some(4));
            s.schedule.keep_records = true;
        });
        let packed = PackedScene::new(&scene).expect("packs");
        let mapped = map_photons(packed, &settings.photon_settings(&scene), &|_| true).expect("maps");
        let MappedImage { image, gathers, .. } = mapped;
        let camera = settings.camera(&scene).expect("a camera");
        let tiles = tiles(settings.window(), settings.tile_side(&[MICRO]), settings.schedule.order);
        let (scene, _) = image.view();
        let frame = settings.frame(&camera, &gathers);
        Self { scene, image: image.lines().to_vec(), frame, tiles }
    }

    /// Card memory with the image and `room` further lines.
    fn memory(&self, room: usize) -> Vec<Line> {
        let mut lines = self.image.clone();
        lines.resize(self.image.len() + room, Line([0xa5; 128]));
        lines
    }

    fn samples(&self, first_sample: u32, samples: u32) -> FrameParameters {
        FrameParameters { first_sample, samples, ..self.frame }
    }

    /// Renders all tiles of a frame on a chip whose memory has `room` lines after the image.
    fn render<K: ChipKind>(
        &self,
        chip: &mut Chip<K>,
        memory: &mut impl MemoryPort,
        (frame, room): (&FrameParameters, usize),
    ) -> Result<Picture, Fault> {
        let first = self.image.len() as u32;
        chip.begin_frame(frame, first..first + room as u32);
        let mut counters = Counters::ZERO;
        let mut parts: Vec<(u32, RenderedTile)> = Vec::new();
        let job = &mut RenderJob { scene: &self.scene, memory, frame, outlet: None };
        render_tiles(chip, job, &self.tiles, |tile, rendered| {
            counters.add(&rendered.counters);
            parts.push((tile.id, rendered));
            true
        })?;
        parts.sort_by_key(|(id, _)| *id);
        let sums = |(_, part): &(u32, RenderedTile)| {
            let pixels = part.views.iter().zip(&part.sums);
            pixels.map(|(view, light)| view.sums(PixelForm::PLAIN, &[*light])).collect::<Vec<_>>()
        };
        Ok((parts.iter().flat_map(sums).collect(), counters))
    }

    /// Renders a frame on a new chip that keeps no records.
    fn alone(&self, frame: &FrameParameters) -> Picture {
        let mut lines = self.memory(0);
        let frame = FrameParameters { keep_records: false, ..*frame };
        self.render(&mut MicroChip::new(), &mut Dram::new(&mut lines), (&frame, 0)).expect("sound")
    }
}

/// Renders two passes on one chip, for several numbers of lines after the image, and checks pixels and
/// counters.
fn check_passes<K: ChipKind>(world: &World, new_chip: impl Fn() -> Box<Chip<K>>) {
    let passes = [world.samples(0, 2), world.samples(2, 1)];
    let alone = passes.map(|frame| world.alone(&frame));
    let mut kept = Vec::new();
    for room in [0, DIRECTORY, DIRECTORY + 1, DIRECTORY + 40, DIRECTORY + 100, PLENTY] {
        let mut chip = new_chip();
        let mut lines = world.memory(room);
        for (frame, (expected, alone)) in passes.iter().zip(&alone) {
            let memory = &mut Dram::new(&mut lines);
            let (sums, work) = world.render(&mut chip, memory, (frame, room)).expect("sound");
            assert!(sums == *expected, "{room} lines");
            assert_eq!(work.records + work.kept_records, alone.records, "{room} lines");
            kept.push(work.kept_records);
        }
        assert!(lines[..world.image.len()] == world.image, "the image is written");
    }
    let (first, second): (Vec<_>, Vec<_>) = kept.chunks(2).map(|pair| (pair[0], pair[1])).unzip();
    assert!(first.iter().all(|&records| records == 0), "{first:?}");
    assert!(second.is_sorted() && second[1] == 0 && second[3] > 0, "{second:?}");
    assert!(second[3] < second[5] && second[5] == alone[1].1.records, "{second:?}");
}

#[test]
fn a_chip_keeps_records_while_there_is_room_and_gathers_others_again() {
    with_room_for_a_card(|| {
        let world = World::new();
        check_passes(&world, || Box::new(MicroChip::new()));
        check_passes(&world, || Box::new(EmulatedKind::Micro.emulated().chip()));
        // With several tiles in flight, blocks of different tiles are written in turn.
        check_passes(&world, || Box::new(EmulatedKind::Large.emulated().chip()));
    });
}

#[test]
fn all_passes_together_do_the_work_of_one_frame() {
    with_room_for_a_card(|| {
        let world = World::new();
        let mut chip = Box::new(MicroChip::new());
        let mut lines = world.memory(PLENTY);
        let mut sum = Counters::ZERO;
        for (first, samples) in [(0, 1), (1, 1), (2, 2)] {
            let memory = &mut Dram::new(&mut lines);
            let frame = world.samples(first, samples);
            sum.add(&world.render(&mut chip, memory, (&frame, PLENTY)).expect("sound").1);
        }
        let (_, whole) = world.alone(&world.samples(0, 4));
        assert_eq!(sum.kept_records, 2 * whole.records);
        // The number of drains depends on which gathers wait together. To find pixels with gather rays a chip
        // looks at samples, of which each pass has its own.
        let Counters { drains, most_waiting, eye_rays, shadow_rays, .. } = whole;
        let Counters { specular_rays, caustic_gathers, normals_decoded, .. } = whole;
        let by_pass = Counters {
            kept_records: 0,
            drains,
            most_waiting,
            eye_rays,
            shadow_rays,
            specular_rays,
            caustic_gathers,
            normals_decoded,
            ..sum
        };
        assert_eq!(by_pass, whole);
    });
}

#[test]
fn records_of_another_frame_are_not_used() {
    with_room_for_a_card(|| {
        let world = World::new();
        let mut chip = Box::new(MicroChip::new());
        let mut lines = world.memory(PLENTY);
        let base = world.samples(0, 1);
        let mut camera = base.camera;
        camera.origin[1] = -camera.origin[1];
        let others = [
            FrameParameters { seed: 1, ..base },
            FrameParameters { camera, ..base },
            FrameParameters { gather_rays: 9, ..base },
            FrameParameters { irradiance_error: Some(0.11), ..base },
            FrameParameters { neighbors: 21, ..base },
            FrameParameters { planned_samples: 5, ..base },
        ];
        for other in others {
            for (frame, kept) in [(base, 0), (other, 0), (FrameParameters { bins: 1, ..other }, 1), (base, 0)]
            {
                let memory = &mut Dram::new(&mut lines);
                let (sums, work) = world.render(&mut chip, memory, (&frame, PLENTY)).expect("sound");
                assert!(sums == world.alone(&frame).0, "{frame:?}");
                assert_eq!(work.kept_records.min(1), kept, "{frame:?}");
            }
            chip.forget_records();
        }
    });
}

#[test]
fn a_single_frame_writes_nothing_and_accesses_of_passes_are_counted() {
    with_room_for_a_card(|| {
        let world = World::new();
        let mut chip = Box::new(MicroChip::new());
        let mut lines = world.memory(PLENTY);
        let mut render = |frame: FrameParameters| {
            let mut memory = Counted::new(Dram::new(&mut lines));
            let (_, work) = world.render(&mut chip, &mut memory, (&frame, PLENTY)).expect("sound");
            let reads = memory.traffic().sum(|_, structure| structure == Structure::IrradianceRecords);
            let survey = memory.traffic().reads(Stage::Survey, Structure::IrradianceRecords);
            (memory.traffic().written_bytes(|_| true), reads.requests, survey.requests, work.kept_records)
        };
        let alone = FrameParameters { keep_records: false, ..world.samples(0, 1) };
        assert_eq!(render(alone), (0, 0, 0, 0));
        let (written, ..) = render(world.samples(0, 1));
        assert!(written > 128 * DIRECTORY as u64);
        let (written, reads, of_survey, kept) = render(world.samples(1, 1));
        assert_eq!(written, 0);
        assert!(reads > kept && reads == of_survey, "{reads} {of_survey} {kept}");
    });
}

/// The memory of kept records may fail: whatever it contains, a frame ends.
#[test]
fn damaged_records_do_not_stop_a_chip() {
    with_room_for_a_card(|| {
        let world = World::new();
        let mut chip = Box::new(MicroChip::new());
        let mut intact = world.memory(PLENTY);
        let keep = world.samples(0, 1);
        world.render(&mut chip, &mut Dram::new(&mut intact), (&keep, PLENTY)).expect("sound");
        let used = intact.iter().rposition(|line| *line != Line([0xa5; 128])).expect("written") + 1;
        for seed in 0..40 {
            let mut lines = intact.clone();
            for change in 0..200 {
                let random = hash(hash(seed) ^ change);
                let line = world.image.len() + random as usize % (used - world.image.len());
                let word = &mut lines[line].0.as_chunks_mut::<4>().0[(random >> 24) as usize % 26];
                let number = hash(!random);
                *word = [0, 1, u32::MAX, used as u32 - 1, number, number % used as u32][number as usize % 6]
                    .to_le_bytes();
            }
            // Damage may link blocks in a circle, or make records invalid.
            let result = world.render(&mut chip, &mut Dram::new(&mut lines), (&world.samples(1, 1), PLENTY));
            assert!(result.is_ok(), "{result:?}");
        }
    });
}
