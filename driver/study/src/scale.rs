//! Scale of a study: the settings that all of its renders have in common, and whether it varies other
//! settings over many values or few.

use photoncard_cards::scheduler::GatherOrder;
use photoncard_firmware::kind::REFERENCE;
use photoncard_map::photon_map::PhotonLayout;
use photoncard_picture::choice::Choice;
use photoncard_render::cost_model::Machine;
use photoncard_render::emulator::EmulatedKind;
use photoncard_render::emulator::memory_model::CacheSettings;
use photoncard_render::{ChipModel, Integrator, PhotonMaps, Picture, RenderSettings, Sampling, Schedule};

use super::measure::is_on_one_chip;
use super::point::{Point, Task};
use super::sample::SampleRate;
use super::symbol_axes::SymbolAxes;

/// Side of the tiles in Steinhurst's dissertation (2007), pixels.
pub(super) const TILE: u32 = 16;
/// Side of the largest square tile that the reference chip can render, pixels.
pub(super) const REFERENCE_TILE: u32 = REFERENCE.tile_pixels.isqrt();

/// Settings that all points of a study have in common, and whether studies have many points or few.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    /// Width and height of the picture, pixels.
    pub side: u32,
    /// Number of photons in the map.
    pub photons: usize,
    /// Number `k` of photons that a gather searches for.
    pub neighbors: u32,
    /// Number of final gather rays per pixel, unless the study varies it.
    pub gather_rays: u32,
    /// Number of shadow rays per pixel.
    pub shadow_rays: u32,
    /// Fraction of the tiles that is rendered.
    pub sample: SampleRate,
    /// Minimum number of tiles that are rendered, if the picture has that many.
    pub least_tiles: usize,
    /// Number of tiles of 16x16 pixels that are compared with a reference.
    pub quality_tiles: usize,
    /// Number of seeds with which these tiles are compared. Each has photons and a reference of its own.
    pub quality_seeds: u32,
    /// Number of final gather rays per pixel of the reference.
    pub reference_rays: u32,
    /// True if studies vary their settings over fewer values ([`Self::pick`]).
    pub is_quick: bool,
    /// Machine for which times and numbers of chips are computed.
    pub machine: Machine,
    /// Chips that render the points, and whose caches are those of points that do not vary caches; `None` for
    /// reference chips.
    pub model: Option<ChipModel>,
    /// Values of symbols of Table 7.1 for which its formulas are evaluated as well; `None` for its own alone.
    pub symbols: Option<SymbolAxes>,
}

impl Scale {
    /// Scale with the nominal frame of Steinhurst's dissertation (2007).
    pub const FULL: Self = Self {
        side: 512,
        photons: 500_000,
        neighbors: 100,
        gather_rays: 100,
        shadow_rays: 8,
        sample: SampleRate::ALL,
        least_tiles: 15,
        quality_tiles: 48,
        quality_seeds: 2,
        reference_rays: 800,
        is_quick: false,
        machine: Machine::NOMINAL,
        model: None,
        symbols: None,
    };
    /// Scale with a small picture and fewer values, for a trial of all studies.
    pub const QUICK: Self = Self {
        side: 128,
        photons: 60_000,
        neighbors: 50,
        gather_rays: 50,
        shadow_rays: 8,
        sample: SampleRate::ALL,
        least_tiles: 15,
        quality_tiles: 8,
        quality_seeds: 2,
        reference_rays: 400,
        is_quick: true,
        machine: Machine::NOMINAL,
        model: None,
        symbols: None,
    };

    /// Returns whether all points have the settings of the dissertation's nominal frame. Published figures
    /// may be compared only with figures at such a scale.
    pub(crate) fn is_nominal(&self) -> bool {
        let frame =
            |scale: &Self| (scale.side, scale.photons, scale.neighbors, scale.gather_rays, scale.shadow_rays);
        self.model.is_none() && frame(self) == frame(&Self::FULL)
    }

    /// Kind of the chips that render the points.
    pub(crate) fn chip(&self) -> EmulatedKind {
        self.model.as_ref().map_or(EmulatedKind::Reference, ChipModel::kind)
    }

    /// Caches of the points that do not vary caches.
    pub(crate) fn caches(&self) -> CacheSettings {
        self.model.as_ref().map_or_else(CacheSettings::default, ChipModel::caches)
    }

    /// Side of the largest square tile that the chips can render, pixels.
    pub(crate) fn widest_tile(&self) -> u32 {
        self.chip().budget().tile_pixels.isqrt()
    }

    /// Text that marks figures as those of a trial, or of another chip than the reference chip; `None` for
    /// the settings of the nominal frame.
    pub fn banner(&self) -> Option<String> {
        let of_trial = self.trial();
        let of_chip = self.model.as_ref().map(|model| {
            format!("Of the chip {model}, not of the reference chip: published figures are left out.")
        });
        of_trial.or(of_chip)
    }

    fn trial(&self) -> Option<String> {
        let Self { side, photons, neighbors, gather_rays, .. } = self;
        let Self { side: nominal_side, photons: nominal_photons, .. } = Self::FULL;
        let is_trial = !Self { model: None, ..self.clone() }.is_nominal();
        is_trial.then(|| {
            format!(
                "Trial, no result: {side}x{side} pixels, {photons} photons, {neighbors} neighbours and {gather_rays} gather rays instead \
                 of the nominal {nominal_side}x{nominal_side} pixels and {nominal_photons} photons. Published figures are left out, and \
                 nothing here says anything about them."
            )
        })
    }

    /// Replaces the fraction of the tiles that is rendered.
    pub fn with_sample(self, sample: SampleRate) -> Self {
        Self { sample, ..self }
    }

    /// Replaces the machine for which times and numbers of chips are computed. No point depends on the
    /// machine.
    pub fn on(self, machine: Machine) -> Self {
        Self { machine, ..self }
    }

    /// Replaces the chips that render the points.
    pub fn with_chips(self, model: ChipModel) -> Self {
        Self { model: Some(model), ..self }
    }

    /// Values over which a study varies a setting: `quick` if [`Self::is_quick`], else `full`.
    pub fn pick<T: Copy>(&self, full: &[T], quick: &[T]) -> Vec<T> {
        if self.is_quick { quick.to_vec() } else { full.to_vec() }
    }

    /// Settings with no technique except the order `order` of gathers: tiles of 16x16 pixels, one tile in
    /// flight, gather rays sampled by the reflection, and Jensen's kd-tree.
    pub fn settings(&self, order: GatherOrder) -> RenderSettings {
        RenderSettings {
            picture: Picture { width: self.side, height: self.side, ..Picture::default() },
            photons: PhotonMaps {
                count: self.photons,
                neighbors: self.neighbors,
                layout: PhotonLayout::Jensen,
                ..PhotonMaps::default()
            },
            integrator: Integrator {
                gather_rays: self.gather_rays,
                shadow_rays: self.shadow_rays,
                sampling: Sampling::Reflection,
                // As in the dissertation, photons are gathered at the end of every gather ray.
                near_distance: Some(0.0),
                ..Integrator::default()
            },
            schedule: Schedule { tile: Some(TILE), order, in_flight: Some(1), ..Schedule::default() },
            ..RenderSettings::default()
        }
    }

    /// Settings with all techniques: gathers sorted over the largest tiles, combined sampling, the irradiance
    /// cache, the photon map's line layout.
    pub fn all_on(&self) -> RenderSettings {
        self.settings(GatherOrder::Sort).with(|s| {
            s.photons.layout = PhotonLayout::Lines;
            s.integrator.sampling = Sampling::Product;
            s.integrator.irradiance_error = Some(IRRADIANCE_ERROR);
            s.schedule.tile = Some(self.widest_tile());
        })
    }

    /// Settings of [`Self::all_on`] with the dissertation's tiles of 16x16 pixels. A frame then has enough
    /// tiles for many chips.
    pub(crate) fn all_on_in_small_tiles(&self) -> RenderSettings {
        self.all_on().with(|s| s.schedule.tile = Some(TILE))
    }

    /// Point that measures the memory traffic of a sample of the tiles, with the chip's caches.
    pub fn traffic(&self, scene: &str, settings: RenderSettings) -> Point {
        self.traffic_behind(scene, settings, self.caches())
    }

    /// Point that measures the memory traffic of a sample of the tiles, with `caches`.
    pub fn traffic_behind(&self, scene: &str, settings: RenderSettings, caches: CacheSettings) -> Point {
        let chip = self.chip();
        let (sample, least_tiles) = (self.sample, self.least_tiles);
        let task = Task::Traffic { chip, caches, sample, least_tiles, has_reuse: false };
        Point { scene: scene.to_owned(), assignments: Vec::new(), settings, is_along_curve: false, task }
    }

    /// Point that measures the memory traffic on chips of kind `chip` with `caches`: of a sample of the
    /// tiles, or of all if gathers of several tiles wait at once, on one chip.
    pub(super) fn on_chip(
        &self,
        scene: &str,
        settings: RenderSettings,
        chip: EmulatedKind,
        caches: CacheSettings,
    ) -> Point {
        let sample = if is_on_one_chip(&settings, chip) { SampleRate::ALL } else { self.sample };
        let least_tiles = self.least_tiles;
        let task = Task::Traffic { chip, caches, sample, least_tiles, has_reuse: false };
        Point { task, ..self.traffic_behind(scene, settings, caches) }
    }

    /// Point that measures the memory traffic of all tiles, with the chip's caches.
    pub fn whole(&self, scene: &str, settings: RenderSettings) -> Point {
        Self { sample: SampleRate::ALL, ..self.clone() }.traffic(scene, settings)
    }

    /// Points that measure the error of the pixels of [`Self::quality_tiles`] tiles, one for each of
    /// [`Self::quality_seeds`].
    pub fn quality(&self, scene: &str, settings: &RenderSettings) -> Vec<Point> {
        let task = Task::Quality { tiles: self.quality_tiles, reference_rays: self.reference_rays };
        let first = settings.integrator.seed;
        let point = |seed| {
            let settings = settings.clone().with(|s| s.integrator.seed = seed);
            let assignments = Vec::new();
            Point { scene: scene.to_owned(), assignments, settings, is_along_curve: false, task }
        };
        (0..self.quality_seeds).map(|seed| point(first + seed)).collect()
    }

    /// Names and values of the settings that all points share, for a report's provenance.
    pub fn rows(&self) -> Vec<(String, String)> {
        let settings = self.settings(GatherOrder::Sort);
        let rows = [
            (
                "picture",
                format!("{0}x{0} pixels, 1 sample each, seed {1}", self.side, settings.integrator.seed),
            ),
            ("photons", self.photons.to_string()),
            ("photons a gather looks for", self.neighbors.to_string()),
            ("gather rays a pixel", self.gather_rays.to_string()),
            ("shadow rays a pixel", self.shadow_rays.to_string()),
            ("tiles", format!("{TILE}x{TILE} pixels; in the naive order rows of as many pixels")),
            ("sampling of gather rays", "brdf, unless said otherwise".to_owned()),
            ("photon map", format!("{}, unless said otherwise", settings.photons.layout.name())),
            ("error of the irradiance cache, where it is on", IRRADIANCE_ERROR.to_string()),
            ("caches, unless said otherwise", self.caches().to_string()),
            ("share of the tiles rendered", format!("{}, at least {}", self.sample, self.least_tiles)),
            ("caches at a tile's begin", "empty".to_owned()),
            ("tiles in flight, unless said otherwise", "1".to_owned()),
        ]
        .map(|(name, value)| (name.to_owned(), value));
        let model = self.model.as_ref().map(|model| ("chip that renders".to_owned(), model.to_string()));
        rows.into_iter().chain(model).chain([machine_row(&self.machine)]).collect()
    }

    /// Number of gathers of a frame in which every gather ray of every pixel ends in a gather: `side^2 N_FG`,
    /// 26.2 million at the nominal values.
    pub(crate) fn nominal_gathers(&self) -> f64 {
        f64::from(self.side) * f64::from(self.side) * f64::from(self.gather_rays)
    }
}

/// Row of a report's provenance: name and description of the machine for which times and numbers of chips are
/// computed.
pub(super) fn machine_row(machine: &Machine) -> (String, String) {
    let Machine { link, tasks, .. } = machine;
    let value = format!(
        "{machine}, reads of {} ns, {tasks} tasks in flight of each unit; host link of {} GB/s each way",
        machine.latency_ns(),
        link / 1e9
    );
    ("chip that times are of".to_owned(), value)
}

/// Error bound of the dissertation's irradiance cache, as figure 6.17 seems to state it.
pub(super) const IRRADIANCE_ERROR: f32 = 0.025;
