//! Interface between a view's state and the rendering thread (the painter): the next pass with its settings,
//! finished tiles, and ends of passes. A pass renders a [requested picture](super::wish).

use std::time::Duration;

use photoncard_driver::quality::Fit;
use photoncard_driver::render::{Filter, Integrator, RenderSettings, Sampling, Statistics};
use photoncard_driver::sink::FinishedTile;

use super::canvas::{Origin, Patch, TileWork};
use super::pages::Revisions;
use super::refinement::{Next, Outcome, Pass};
use super::state::{Task, View};

/// Maximum number of pixels of a coarse picture without the irradiance cache; for more pixels, the cache is
/// faster.
const FEW_PIXELS: u64 = 1 << 12;
/// Gather rays in coarse pictures: per pixel without the irradiance cache, per irradiance record with it.
const RAYS: [u32; 2] = [6, 16];
/// Minimum of `--ic-error` in coarse pictures.
const IRRADIANCE_ERROR: f32 = 1.0;

impl View {
    /// Returns the next pass to render. `Err(Some(time))` means to wait until this time, `Err(None)` to wait
    /// for a change.
    pub(super) fn next(&mut self, now: Duration) -> Result<Task, Option<Duration>> {
        let work = match self.refinement.next(now) {
            Next::Work(work) => work,
            Next::Wait(until) => return Err(until),
        };
        let (settings, step) = match work.pass {
            Pass::Coarse(step) => (coarse(&self.wish.settings, step), step),
            Pass::Fit => (self.wish.settings.clone(), 1),
            Pass::Full => (full(&self.wish.settings, self.cursor), 1),
        };
        let is_coarse = matches!(work.pass, Pass::Coarse(_));
        let origin = Origin { version: work.version, is_coarse, step, samples: settings.integrator.samples };
        Ok(Task { work, wish: self.wish.clone(), settings, origin })
    }

    /// Returns whether the running pass should stop.
    pub(super) fn must_stop(&self) -> bool {
        self.refinement.must_stop() || self.is_outdated
    }

    /// Returns whether a page has asked for the scene's files to be read again, once for each request.
    pub(super) fn takes_reload(&mut self) -> bool {
        std::mem::take(&mut self.is_outdated)
    }

    /// Records whether the running pass is preparing: tracing photons and building the card image.
    pub(super) fn prepares(&mut self, is_preparing: bool, now: Duration) {
        self.refinement.prepares(is_preparing, now);
    }

    /// Adds a tile of the running pass. `card` rendered it and read `dram_lines` lines from DRAM.
    pub(super) fn put(&mut self, origin: Origin, card: &str, dram_lines: Option<u64>, tile: &FinishedTile) {
        let (number, is_new) = self.cards.rendered(card);
        if is_new {
            self.revisions.cards += 1;
        }
        if self.spared() == Some(origin.version) {
            self.canvas.put(Patch::new(
                origin,
                number,
                tile.clone(),
                TileWork::new(&tile.counters, dram_lines),
            ));
        }
    }

    /// Removes the tile `id` of pass `origin`, which was revoked: its card was outvoted or sent wrong
    /// messages.
    pub(super) fn revoke(&mut self, origin: Origin, id: u32) {
        self.canvas.revoke(origin, id);
    }

    /// Records the end of the running pass. `statistics` is `None` unless the pass has completed a picture.
    pub(super) fn finish(
        &mut self,
        task: &Task,
        outcome: Outcome,
        statistics: Option<&Statistics>,
        now: Duration,
    ) {
        if let Some(statistics) = statistics {
            self.note_pass(statistics);
        }
        self.refinement.finish(outcome, now);
        if outcome == Outcome::Done && task.work.pass == Pass::Full {
            self.settled = Some(task.wish.clone());
        }
        if outcome == Outcome::Done {
            self.keep(task.origin);
        }
        self.revisions = Revisions { state: self.revisions.state + 1, cards: self.revisions.cards + 1 };
    }

    /// Records that a task's request cannot be rendered. If it is the newest request, its settings are
    /// replaced by those of the last complete final picture. If this is not possible, `reason` is kept for
    /// pages.
    pub(super) fn refuse(&mut self, task: &Task, reason: &str, now: Duration) {
        self.tell_error(reason);
        self.finish(task, Outcome::Refused, None, now);
        if task.work.version != self.version() {
            return;
        }
        let before = self.settled.as_ref().map(|settled| self.wish.by_settings_of(settled));
        let is_possible = before.is_some_and(|wish| wish != self.wish && self.wish_for(wish).is_ok());
        if !is_possible {
            self.refused = Some(reason.to_owned());
        }
    }

    /// Records that a picture is complete with fewer samples than it will have.
    pub(super) fn refine(&mut self, origin: Origin, statistics: &Statistics) {
        self.note_pass(statistics);
        self.keep(origin);
        self.revisions.state += 1;
    }

    /// Records cost and provenance of a complete pass.
    fn note_pass(&mut self, statistics: &Statistics) {
        self.cost.add(statistics);
        self.provenance.clone_from(&statistics.provenance.pixels);
    }

    /// Drops all tiles but those of the complete pass `origin`, if it is a pass of the newest request.
    fn keep(&mut self, origin: Origin) {
        if origin.version == self.refinement.version() {
            self.done = Some(origin);
            self.canvas.keep(origin);
        }
    }

    /// Records the settings that pilot renders have found.
    pub(super) fn fit(&mut self, task: &Task, fit: Option<&Fit>, now: Duration) {
        let of_maps = |settings: &RenderSettings| (settings.photons.count, settings.photons.caustic_photons);
        let before = of_maps(&self.wish.settings);
        if let Some(fit) = fit {
            self.wish.fit(fit);
            self.start.wish.fit(fit);
        }
        let has_other_photons = of_maps(&self.wish.settings) != before;
        if has_other_photons {
            self.begin_picture();
        }
        self.finish(task, Outcome::Fitted { has_other_photons }, None, now);
    }

    pub(super) fn lose_card(&mut self, name: &str, error: String, now: Duration) {
        self.cards.lose(name, error, now);
        self.revisions.cards += 1;
    }
}

/// Settings of a coarse picture with one pixel for each square of `step` x `step`. Photon maps are those of
/// the final picture: no photon is traced again. Directions of gather rays are sampled by the reflection
/// alone: for few rays this is faster than gathering photons for direction tables.
fn coarse(settings: &RenderSettings, step: u32) -> RenderSettings {
    settings.clone().with(|settings| {
        // A chip may lack room for irradiance records of each light group.
        let has_groups = !settings.picture.light_groups.is_empty();
        let picture = &mut settings.picture;
        let Integrator { gather_rays, shadow_rays, irradiance_error, .. } = settings.integrator;
        [picture.width, picture.height] = [picture.width, picture.height].map(|side| side.div_ceil(step));
        let is_small = has_groups && settings.integrator.irradiance_error.is_none()
            || u64::from(picture.width) * u64::from(picture.height) <= FEW_PIXELS;
        picture.filter = Filter::Box;
        let [of_pixel, of_record] = RAYS.map(|rays| rays.min(gather_rays));
        let error = irradiance_error.unwrap_or(IRRADIANCE_ERROR).max(IRRADIANCE_ERROR);
        settings.integrator = Integrator {
            samples: 1,
            gather_rays: if is_small { of_pixel } else { of_record },
            shadow_rays: shadow_rays.min(1),
            sampling: Sampling::Reflection,
            irradiance_error: (!is_small && gather_rays > 0).then_some(error),
            adaptive_threshold: None,
            ..settings.integrator
        };
        settings.cards.verify = None;
    })
}

/// Settings of the final picture. Tiles near the pixel `focus` are rendered first; `None` for the middle.
fn full(settings: &RenderSettings, focus: Option<[u32; 2]>) -> RenderSettings {
    settings.clone().with(|settings| {
        let middle = [settings.picture.width / 2, settings.picture.height / 2];
        settings.schedule.focus = Some(focus.unwrap_or(middle));
    })
}
