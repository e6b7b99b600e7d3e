//! Scene whose photon map several frames share, so that they differ only in their gathers.

use glam::Vec3;
use photoncard_driver::emulator::direct::render_tile_of;
use photoncard_driver::emulator::{EmulatedChip, EmulatedKind};
use photoncard_driver::film::{SumFormat, Window};
use photoncard_driver::pack::{CardImage, PackedScene};
use photoncard_driver::photon_map::{GatherParameters, MappedImage, map_photons};
use photoncard_driver::render::RenderSettings;
use photoncard_driver::scene::Scene;
use photoncard_driver::scheduler::tiles;
use photoncard_firmware::gather::{GatherTarget, PointIndex};
use photoncard_firmware::kind::REFERENCE;
use photoncard_firmware::light_groups::LightGroups;
use photoncard_firmware::photon::CandidateBuffer;
use photoncard_firmware::render::eye::see;
use photoncard_firmware::render::final_gather::{GatherRayEnds, bundles, cast, gathered};
use photoncard_firmware::render::{Context, GatherPoint};
use photoncard_firmware::sampler::{Dimension, Pattern};
use photoncard_firmware::scene::Surface;
use photoncard_shared::counters::Counters;
use photoncard_shared::message::{FrameParameters, Sampling, Tile};
use rayon::prelude::*;

/// Scene with its card image, photon map included.
pub struct MappedScene {
    scene: Scene,
    image: CardImage,
    gathers: GatherParameters,
}

/// Pixels of a frame's window, and the counted work of all its tiles.
pub struct Frame {
    /// Radiance of the pixels, row by row, W/(sr m^2).
    pub radiance: Vec<Vec3>,
    /// Counters of all tiles.
    pub counters: Counters,
}

impl MappedScene {
    /// Traces photons and packs the card image, as a render with these settings does.
    ///
    /// # Panics
    /// If the scene cannot be packed, or its photons cannot be traced.
    pub fn new(scene: Scene, settings: &RenderSettings) -> Self {
        let packed = PackedScene::new(&scene).expect("packs");
        let MappedImage { image, gathers, .. } =
            map_photons(packed, &settings.photon_settings(&scene), &|_| true).expect("maps");
        Self { scene, image, gathers }
    }

    /// Renders the window of a frame on reference chips in this process, one per thread.
    ///
    /// # Panics
    /// If the scene has no camera of the settings' name, the card image is malformed, or threads cannot be
    /// started.
    pub fn frame(&self, settings: &RenderSettings) -> Frame {
        let window = settings.window();
        let camera = settings.camera(&self.scene).expect("a camera");
        let frame = settings.frame(&camera, &self.gathers);
        let tiles = tiles(window, settings.tile_side(&[REFERENCE]), settings.schedule.order);
        let pool = rayon::ThreadPoolBuilder::new().build().expect("threads");
        let parts: Vec<(Tile, Vec<Vec3>, Counters)> = pool.install(|| {
            let new_chip = || EmulatedKind::Reference.emulated().chip();
            tiles.into_par_iter().map_init(new_chip, |chip, tile| self.tile(chip, &frame, tile)).collect()
        });
        collect(window, &parts)
    }

    fn tile(
        &self,
        chip: &mut EmulatedChip,
        frame: &FrameParameters,
        tile: Tile,
    ) -> (Tile, Vec<Vec3>, Counters) {
        let rendered = render_tile_of(chip, &self.image, None, frame, tile, None).expect("sound");
        let pixels = rendered.pixels(SumFormat::new(&self.image.view().0.header, frame));
        let radiance = pixels.map(|pixel| Vec3::from(pixel.pixel.radiance)).collect();
        (tile, radiance, rendered.counters)
    }
}

/// Indirect light at single surface points, without a picture.
pub struct IndirectLight<'a> {
    mapped: &'a MappedScene,
    frame: FrameParameters,
    /// Surface points that are seen through the centres of a grid's cells. Points with black reflection are
    /// left out.
    pub points: Vec<Surface>,
}

impl<'a> IndirectLight<'a> {
    /// Finds the points that a camera sees through the centres of `side * side` cells of the picture.
    ///
    /// # Panics
    /// If the scene has no camera of the settings' name, or the card image is malformed.
    pub fn new(mapped: &'a MappedScene, settings: &RenderSettings, side: u32) -> Self {
        let camera = settings.camera(&mapped.scene).expect("a camera");
        let frame = settings.frame(&camera, &mapped.gathers);
        let (scene, mut memory) = mapped.image.view();
        let mut counters = Counters::ZERO;
        let mut context =
            Context { scene: &scene, memory: &mut memory, frame: &frame, counters: &mut counters };
        let middle = |i: u32, size: u32| (i as f32 + 0.5) / side as f32 * size as f32;
        let places =
            (0..side * side).map(|i| [middle(i % side, frame.width), middle(i / side, frame.height)]);
        let points = places
            .filter_map(|place| see(&mut context, place).expect("sound"))
            .filter(|surface| !surface.reflection.is_black())
            .collect();
        Self { mapped, frame, points }
    }

    /// Indirect radiance that each point reflects towards the eye, W/(sr m^2), by `rays` gather rays of a
    /// sampling.
    ///
    /// # Panics
    /// If the card image is malformed.
    pub fn radiance(&self, sampling: Sampling, rays: u32, seed: u32) -> Vec<Vec3> {
        let frame = FrameParameters { sampling, ..self.frame };
        let gather = |(index, surface): (usize, &Surface)| {
            let (scene, mut memory) = self.mapped.image.view();
            let mut counters = Counters::ZERO;
            let mut context =
                Context { scene: &scene, memory: &mut memory, frame: &frame, counters: &mut counters };
            let mut candidates = CandidateBuffer::<512>::new();
            let pattern = Pattern::new(seed, index as u32, 0, 0, Dimension::Gather);
            let mut point = GatherPoint::sample(*surface, pattern, rays);
            point.choose_directions(&mut context, candidates.view()).expect("sound");
            let mut sum = Vec3::ZERO;
            let target = GatherTarget::new(0, PointIndex::Pixel(0));
            let mut ends = GatherRayEnds::new();
            for bundle in bundles(0..rays) {
                cast(&mut context, &point, target, bundle, &mut ends).expect("sound");
                for end in &ends {
                    if end.is_near {
                        sum += end.light.total(LightGroups::ONE);
                    }
                    if let Some(request) = &end.request {
                        let brought = gathered(&mut context, request, candidates.view()).expect("sound");
                        sum += brought.total(LightGroups::ONE);
                    }
                }
            }
            sum * scene.header.radiance_unit
        };
        self.points.par_iter().enumerate().map(|(index, surface)| gather((index, surface))).collect()
    }
}

fn collect(window: Window, parts: &[(Tile, Vec<Vec3>, Counters)]) -> Frame {
    let width = (window.x1 - window.x0) as usize;
    let mut radiance = vec![Vec3::ZERO; width * (window.y1 - window.y0) as usize];
    let mut counters = Counters::ZERO;
    for (tile, pixels, counted) in parts {
        counters.add(counted);
        for (row, pixels) in pixels.chunks(tile.width as usize).enumerate() {
            let start = ((tile.y - window.y0) as usize + row) * width + (tile.x - window.x0) as usize;
            radiance[start..start + pixels.len()].copy_from_slice(pixels);
        }
    }
    Frame { radiance, counters }
}
