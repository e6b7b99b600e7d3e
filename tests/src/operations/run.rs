//! Operations of a scene's tiles, as counted and by the cost model.

use std::path::Path;

use photoncard_driver::choice::Choice;
use photoncard_driver::cost_model::arithmetic::{Arithmetic, OPERATIONS, Operations, Step, Unit, Work};
use photoncard_driver::emulator::EmulatedKind;
use photoncard_driver::emulator::contents::Contents;
use photoncard_driver::emulator::direct::render_tile_of;
use photoncard_driver::emulator::memory_model::CacheSettings;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::photon_map::map_photons;
use photoncard_driver::render::RenderSettings;
use photoncard_driver::scene::gltf;
use photoncard_driver::scheduler::tiles;
use photoncard_firmware::kind::REFERENCE;
use photoncard_shared::counters::Counters;

use super::{Instrument, STEPS};

/// Counted operations of some tiles of a scene, with the work that the cost model needs.
pub struct Run {
    /// Counters of all tiles.
    pub counters: Counters,
    /// Work of all tiles, as the cost model's numbers of steps.
    pub work: Work,
    /// Counted operations of each step, in the order of [`Step::ALL`].
    pub steps: [Operations; STEPS],
}

impl Run {
    /// Renders `count` tiles of a shipped scene, spread over the picture, both with the program that counts
    /// operations and on an emulated chip.
    ///
    /// # Panics
    /// If the scene cannot be rendered, or the counters of the two differ.
    pub fn new(instrument: &Instrument, scene: &str, settings: &RenderSettings, count: usize) -> Self {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes").join(scene);
        let scene = gltf::load(&path).expect("a scene that ships loads");
        let packed = PackedScene::new(&scene).expect("it is packed");
        let mapped = map_photons(packed, &settings.photon_settings(&scene), &|_| true).expect("it is lit");
        let camera = settings.camera(&scene).expect("it has a camera");
        let frame = settings.frame(&camera, &mapped.gathers);
        let all = tiles(settings.window(), settings.tile_side(&[REFERENCE]), settings.schedule.order);
        let step = (all.len() / count).max(1);
        let chosen: Vec<_> = all.iter().skip(step / 2).step_by(step).copied().collect();
        let counted = instrument.count(&mapped.image, &frame, &chosen);
        let (mut counters, mut contents) = (Counters::ZERO, Contents::ZERO);
        let (mut chip, caches) = (EmulatedKind::Reference.emulated().chip(), CacheSettings::default());
        for (&tile, counted) in chosen.iter().zip(&counted.counters) {
            let rendered =
                render_tile_of(&mut chip, &mapped.image, Some((&caches).into()), &frame, tile, None)
                    .expect("a sound image");
            assert_eq!(rendered.counters, *counted, "tile {}", tile.id);
            counters.add(&rendered.counters);
            contents.add(&rendered.traffic.contents);
        }
        let mut steps = counted.steps;
        let work = Work::new(&counters, &contents, f64::from(frame.gather_rays));
        // The program makes no calls for comparisons of bits. They are counted by the chip and its memory
        // model.
        let compared = Step::ALL.iter().position(|&step| step == Step::Compared).expect("it is one of all");
        steps[compared].compare = Step::Compared.count(&work);
        Self { counters, work, steps }
    }

    /// Counted operations of a unit's steps.
    pub fn counted(&self, unit: Unit) -> Operations {
        let mut sum = Operations::default();
        let of_unit = Step::ALL.iter().zip(&self.steps).filter(|(step, _)| step.unit() == unit);
        of_unit.for_each(|(_, operations)| sum.add(operations));
        sum
    }

    /// Operations of each unit by the cost model.
    pub fn modelled(&self) -> Arithmetic {
        Arithmetic::of(&self.work)
    }
}

/// Mean operations of one step of each kind in some runs. Kinds of steps that occur in no run keep the values
/// of [`OPERATIONS`].
pub fn means(runs: &[Run]) -> [Operations; STEPS] {
    let mut means = OPERATIONS;
    for (index, (step, mean)) in Step::ALL.iter().zip(&mut means).enumerate() {
        let steps: f64 = runs.iter().map(|run| step.count(&run.work)).sum();
        if steps > 0.0 {
            let mut sum = Operations::default();
            runs.iter().for_each(|run| sum.add(&run.steps[index]));
            *mean = sum.times(1.0 / steps);
        }
    }
    means
}
