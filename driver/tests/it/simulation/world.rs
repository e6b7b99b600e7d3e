//! Shared state of all runs: a scene, its image, and cards that were just switched on.

use std::ops::Range;
use std::sync::Arc;

use glam::Vec3;
use photoncard_driver::emulator::{Emulated, EmulatedChip, EmulatedKind};
use photoncard_driver::film::Film;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::photon_map::map_photons;
use photoncard_driver::render::{Integrator, PhotonMaps, Picture, RenderSettings, Schedule};
use photoncard_driver::scene::{Camera, Material, Scene, SceneContents, Triangle};
use photoncard_driver::scheduler::{GatherOrder, Scheduler, tiles};
use photoncard_driver::session::{Job, PixelLimits, Upload};
use photoncard_firmware::card::Card;
use photoncard_firmware::kind::MICRO;
use photoncard_firmware::memory::{CardMemory, MemoryPort, copy_lines};
use photoncard_shared::address::{LINE_BYTES, Line, LineAddress, Structure};
use photoncard_shared::budget::Budget;
use photoncard_shared::message::{Fault, FaultCode, FrameParameters};

use super::line::Random;

/// A corner of floor and wall under a lamp.
fn scene() -> Scene {
    let quad = |a: Vec3, u: Vec3, v: Vec3, material| {
        [[a, a + u, a + u + v], [a, a + u + v, a + v]].map(|vertices| Triangle::new(vertices, material))
    };
    let material = |diffuse: f32, emission: f32| Material {
        emission: Vec3::splat(emission),
        double_sided: true,
        ..Material::lambertian("material", Vec3::splat(diffuse))
    };
    let quads = [
        quad(Vec3::new(-1.0, -1.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0, 0),
        quad(Vec3::new(-1.0, -1.0, -1.0), Vec3::X * 2.0, Vec3::Y * 2.0, 0),
        quad(Vec3::new(-0.3, 0.9, -0.3), Vec3::X * 0.6, Vec3::Z * 0.6, 1),
    ];
    let camera =
        Camera::perspective("camera", Vec3::new(0.0, 0.0, 2.0), [Vec3::X, Vec3::Y, Vec3::NEG_Z], 1.0, None);
    Scene::from(SceneContents {
        triangles: quads.concat(),
        materials: vec![material(0.7, 0.0), material(0.0, 5.0)],
        cameras: vec![camera],
        ..SceneContents::default()
    })
}

fn settings() -> RenderSettings {
    RenderSettings {
        picture: Picture { width: 12, height: 10, ..Picture::default() },
        photons: PhotonMaps { count: 60, neighbors: 8, ..PhotonMaps::default() },
        integrator: Integrator { gather_rays: 2, shadow_rays: 1, ..Integrator::default() },
        schedule: Schedule { tile: Some(3), ..Schedule::default() },
        ..RenderSettings::default()
    }
}

/// Lines of a card's memory: room for the image of any frame, and for gathers and blocks that wait.
const DRAM_LINES: usize = 4096;

/// Card memory with a buffer of its own.
pub(crate) struct Memory {
    lines: Vec<Line>,
}

impl Memory {
    /// Inverts a bit of a line.
    pub(crate) fn damage(&mut self, line: usize) {
        self.lines[line].0[77] ^= 4;
    }
}

impl MemoryPort for Memory {
    fn read(&mut self, _: Structure, address: LineAddress, _: Range<u32>) -> Result<&Line, Fault> {
        let fault = Fault { code: FaultCode::LineRange, detail: address.0 };
        self.lines.get(address.0 as usize).ok_or(fault)
    }

    fn write(&mut self, _: Structure, first: LineAddress, lines: &[[u8; LINE_BYTES]]) -> Option<()> {
        copy_lines(lines, self.lines.get_mut(first.0 as usize..first.0 as usize + lines.len())?);
        Some(())
    }
}

impl CardMemory for Memory {
    fn lines(&self) -> u32 {
        self.lines.len() as u32
    }

    fn stored(&mut self, first: LineAddress, count: u32) -> Option<&[Line]> {
        self.lines.get(first.0 as usize..first.0 as usize + count as usize)
    }
}

/// Number of tiles in flight of a chip.
pub(crate) const IN_FLIGHT: u32 = 3;

/// Budget of the cards: that of a micro chip, with several tiles in flight.
pub(crate) const BUDGET: Budget = Budget {
    sram_bytes: 512 << 10,
    dram_bytes: (DRAM_LINES * LINE_BYTES) as u64,
    tiles: 4,
    in_flight: IN_FLIGHT,
    waiting_blocks: 4,
    ..MICRO
};

fn chip() -> EmulatedChip {
    EmulatedKind::Micro.emulated().with_budget(BUDGET).chip()
}

/// Shared state of all runs.
pub(crate) struct Fixture {
    scene: Scene,
    settings: RenderSettings,
    pub(crate) upload: Arc<Upload>,
    limits: PixelLimits,
    frame: FrameParameters,
}

impl Fixture {
    pub(crate) fn new() -> Self {
        Self::of(&scene(), settings())
    }

    /// Frames whose gather queues fill within a tile: of any order with a queue, or in card memory, with
    /// irradiance records, with layers.
    pub(crate) fn crowded() -> [Self; 5] {
        let frame = |order, queue, irradiance_error, layers: &str| {
            let settings = settings().with(|s| {
                s.integrator.irradiance_error = irradiance_error;
                s.picture.layers = layers.parse().unwrap();
                (s.schedule.order, s.schedule.queue) = (order, Some(queue));
            });
            Self::of(&scene(), settings)
        };
        [
            frame(GatherOrder::Sort, 7, None, "none"),
            frame(GatherOrder::Hash, 1, Some(0.2), "none"),
            frame(GatherOrder::Sort, 20, Some(0.05), "all"),
            frame(GatherOrder::Buckets, 20, Some(0.05), "none"),
            frame(GatherOrder::Buckets, 1000, None, "all"),
        ]
    }

    /// A frame with adaptive sampling.
    pub(crate) fn adaptive() -> Self {
        let settings = settings().with(|s| {
            s.integrator.samples = 6;
            s.integrator.adaptive_threshold = Some(0.01);
        });
        Self::of(&scene(), settings)
    }

    /// A frame with this number of photons, some ten to a line.
    pub(crate) fn of_photons(count: usize) -> Self {
        Self::of(&scene(), settings().with(|s| s.photons.count = count))
    }

    /// This frame without a queue, one tile after another.
    pub(crate) fn in_sequence(&self) -> Self {
        let settings = self.settings.clone().with(|s| {
            (s.schedule.order, s.schedule.queue, s.schedule.in_flight) = (GatherOrder::Tiled, None, Some(1));
        });
        Self::of(&self.scene, settings)
    }

    /// Another frame of the scene after this one: another camera, and other photons, or a brighter lamp.
    pub(crate) fn changed(&self, random: &mut Random) -> Self {
        let (mut scene, mut settings) = (self.scene.clone(), self.settings.clone());
        match random.below(4) {
            0 => {}
            1 => settings.integrator.seed += 1,
            2 => settings.photons.count = 40 + random.below(40),
            _ => scene.materials[1].emission = Vec3::splat(1.0 + random.below(8) as f32),
        }
        scene.cameras[0].origin.x = 0.1 * random.below(8) as f32;
        let changed = Self::of(&scene, settings);
        let upload = Upload::new(Arc::new(changed.upload.lines().to_vec())).after(&self.upload);
        Self { upload: Arc::new(upload), ..changed }
    }

    /// This frame with irradiance records, which cards keep as far as their memory has room.
    pub(crate) fn of_passes(&self) -> Self {
        let settings = self.settings.clone().with(|s| {
            (s.integrator.irradiance_error, s.integrator.planned_samples) = (Some(0.2), Some(4));
            s.schedule.keep_records = true;
        });
        Self::of(&self.scene, settings)
    }

    /// Further samples of this frame.
    pub(crate) fn next_pass(&self, samples: u32) -> Self {
        let next = Self::of(&self.scene, self.settings.clone().with(|s| s.integrator.samples = samples));
        let first_sample = self.frame.first_sample + self.frame.samples;
        Self { frame: FrameParameters { first_sample, ..next.frame }, ..next }
    }

    fn of(scene: &Scene, settings: RenderSettings) -> Self {
        let packed = match settings.picture.layers.have_mattes() {
            true => PackedScene::with_identities(scene).unwrap(),
            false => PackedScene::new(scene).unwrap(),
        };
        let mapped = map_photons(packed, &settings.photon_settings(scene), &|_| true).unwrap();
        let frame = settings.frame(&scene.cameras[0], &mapped.gathers);
        let limits = PixelLimits::new(&mapped.image.view().0.header, &frame);
        let upload = Arc::new(Upload::new(Arc::new(mapped.image)));
        Self { scene: scene.clone(), settings, upload, limits, frame }
    }

    pub(crate) fn job(&self) -> Job {
        Job { upload: self.upload.clone(), frame: self.frame, limits: self.limits }
    }

    /// Card that was just switched on.
    pub(crate) fn card(&self) -> Box<Card<Emulated, Memory>> {
        Box::new(Card::with_chip(chip(), Memory { lines: vec![Line::ZERO; DRAM_LINES] }))
    }

    pub(crate) fn film(&self) -> Film {
        self.settings.film(self.limits.format().scale).unwrap()
    }

    /// Scheduler of the picture's tiles, a share of which is verified.
    pub(crate) fn scheduler(&self, cards: usize, verify: Option<f64>, seed: u32) -> Scheduler {
        let tiles = tiles(self.settings.window(), self.settings.tile_side(&[]), self.settings.schedule.order);
        let deals_shares = self.settings.schedule.order == GatherOrder::Buckets;
        let scheduler = Scheduler::new(tiles, cards).with_helpers().in_shares(deals_shares);
        match verify {
            Some(share) => scheduler.verifying(share, seed),
            None => scheduler,
        }
    }
}
