//! Thread that renders the [pictures that pages request](super::wish), one after another, on the same cards.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use photoncard_driver::denoise::{DenoiseError, Denoiser};
use photoncard_driver::film::Film;
use photoncard_driver::quality::{Finish, Quality};
use photoncard_driver::render::{CardError, Observer, Phase, RenderError, Renderer, Rendering, Unobserved};
use photoncard_driver::scene::Scene;
use photoncard_driver::sink::{FinishedTile, TileSink};
use photoncard_shared::message::Tile;

use super::canvas::Origin;
use super::describe::SceneFacts;
use super::fitting::{Fitting, find};
use super::hub::{Denoised, Hub, Job, Settled};
use super::refinement::{Outcome, Pass};
use super::state::{Task, with_remedy};
use super::wish::Sketch;
use crate::arguments::{SceneOptions, ViewOptions};
use crate::input;
use crate::notices::{self, Uses};
use crate::picture_files::denoised_by;

/// Renders the pictures that pages request, until the view is over.
pub(super) struct Painter {
    hub: Arc<Hub>,
    /// Options with which the scene was read.
    options: SceneOptions,
    /// Memory of the largest card, bytes.
    dram_bytes: u64,
    quality: Quality,
    finish: Finish,
    denoiser: Option<&'static Denoiser>,
    renderer: Renderer,
    threads: Option<usize>,
    scene: Arc<Scene>,
    /// Pilot renders that continue in the background, because a page made a newer request before they ended.
    fitting: Option<Fitting>,
    /// Assignments (`--set`, and those of pages) that were applied to `scene`; `None` before the first
    /// picture, and after an assignment has failed.
    assigned: Option<Vec<String>>,
}

impl Painter {
    /// Creates the painter of a scene, to which no assignments are applied yet.
    pub(super) fn new(
        hub: Arc<Hub>,
        (scene, dram_bytes): (Scene, u64),
        options: &ViewOptions,
        denoiser: Option<&'static Denoiser>,
        renderer: Renderer,
    ) -> Self {
        let ViewOptions { scene: scene_options, quality, host, .. } = options;
        Self {
            hub,
            options: scene_options.clone(),
            dram_bytes,
            quality: *quality,
            finish: options.finish(),
            denoiser,
            threads: host.threads,
            renderer,
            scene: Arc::new(scene),
            fitting: None,
            assigned: None,
        }
    }

    /// Renders until the view is over. A panic also ends the view.
    pub(super) async fn run(mut self) {
        let _end = EndOnDrop(self.hub.clone());
        while let Some(job) = self.hub.next_job().await {
            if self.hub.take_card_back() {
                self.renderer.close_cards();
            }
            let task = match job {
                Job::Pass(task) => *task,
                Job::Reload => {
                    self.reload();
                    continue;
                }
            };
            let done = match (self.assign(&task), task.work.pass) {
                (Ok(()), Pass::Fit) => self.fit(&task),
                (Ok(()), Pass::Coarse(_) | Pass::Full) => self.render(&task).await,
                (error, _) => error,
            };
            if let Err(error) = done {
                self.fail(&task, &error);
            }
        }
        self.fitting.take().into_iter().for_each(Fitting::stop);
    }

    /// Reads the scene's files again. If they cannot be read, or the picture cannot be rendered of them,
    /// pages are told, and the scene stays.
    fn reload(&mut self) {
        let (picture, options) =
            self.hub.change(|view, _| (view.wish.settings.picture.clone(), view.options.clone()));
        let loaded = input::load_with_groups(&options, self.dram_bytes).and_then(|scene| {
            notices::say_ignored(&options, &scene, &Uses::of(&options, &picture, None))?;
            Ok(scene)
        });
        let scene = match loaded {
            Ok(scene) => scene,
            Err(failure) => {
                let text = format!("the scene is not read again: {}", failure.line());
                return self.hub.change(|view, _| view.keep_scene(&text));
            }
        };
        let parts = (Sketch::new(&scene), SceneFacts::new(input::name(&options), &scene));
        match self.hub.change(|view, _| view.replace(parts, &options, scene.light_groups.names())) {
            Ok(()) => {
                self.fitting.take().into_iter().for_each(Fitting::stop);
                (self.scene, self.assigned, self.options) = (Arc::new(scene), None, options);
            }
            Err(error) => self.hub.change(|view, _| view.keep_scene(&with_remedy(&error))),
        }
    }

    /// Gives the scene the materials and lights that a task's request states.
    fn assign(&mut self, task: &Task) -> Result<(), RenderError> {
        let assignments = task.wish.assignments();
        if self.assigned.as_ref() == Some(&assignments) {
            return Ok(());
        }
        self.assigned = None;
        self.fitting.take().into_iter().for_each(Fitting::stop);
        // The pilot renders have stopped: this is the only reference, and nothing is cloned.
        let mut scene = Arc::unwrap_or_clone(std::mem::take(&mut self.scene));
        let applied = self.hub.change(|view, _| view.apply(&task.wish, &mut scene));
        self.scene = Arc::new(scene);
        applied?;
        self.assigned = Some(assignments);
        Ok(())
    }

    /// Starts pilot renders unless some are in progress, and waits for their result. A newer request
    /// interrupts the wait; the pilot renders continue for the camera with which they were started.
    fn fit(&mut self, task: &Task) -> Result<(), RenderError> {
        let by = (self.quality, self.finish);
        if !self.hub.may_wait() {
            let found = find(&self.scene, by, &task.settings, &Unobserved)?;
            self.hub.change(|view, now| view.fit(task, found.as_ref(), now));
            return Ok(());
        }
        let begin = || Fitting::start(self.scene.clone(), by, task.settings.clone(), self.threads);
        let fitting = match self.fitting.take() {
            Some(fitting) => fitting,
            None => begin().map_err(|source| RenderError::Card {
                card: "the pilot".into(),
                source: CardError::Start(source),
            })?,
        };
        match fitting.wait(&|| self.hub.must_stop()) {
            Ok(found) => {
                let found = found?;
                self.hub.change(|view, now| view.fit(task, found.as_ref(), now));
                Ok(())
            }
            Err(fitting) => {
                self.fitting = Some(fitting);
                Err(RenderError::Stopped)
            }
        }
    }

    async fn render(&mut self, task: &Task) -> Result<(), RenderError> {
        let rendering = self.render_by_passes(task).await?;
        let statistics = rendering.statistics.clone();
        if task.work.pass == Pass::Full {
            let denoised = self.denoise(task, &rendering.film)?;
            let mut provenance = statistics.provenance.pixels.clone();
            let assignments = task.wish.assignments();
            provenance.extend(input::provenance(&SceneOptions { assignments, ..self.options.clone() }));
            let denoised = denoised
                .zip(self.denoiser)
                .map(|(radiance, denoiser)| Denoised { radiance, by: denoised_by(denoiser) });
            let wish = task.wish.clone();
            self.hub.keep(Settled { version: task.work.version, rendering, denoised, wish, provenance });
        }
        self.hub.change(|view, now| view.finish(task, Outcome::Done, Some(&statistics), now));
        Ok(())
    }

    /// Denoises the final picture of a request, if the view denoises. Pages are sent the result or the error.
    fn denoise(&self, task: &Task, film: &Film) -> Result<Option<Vec<[f32; 3]>>, RenderError> {
        let Some(denoiser) = self.denoiser else { return Ok(None) };
        let hub = &self.hub;
        let denoised = denoiser.radiance(film, self.threads, &|| hub.must_stop());
        if let Err(DenoiseError::Stopped) = denoised {
            return Err(RenderError::Stopped);
        }
        self.hub.change(|view, _| match &denoised {
            Ok(radiance) => {
                let at = |x: u32, y: u32| radiance[(y * film.window().width() + x) as usize];
                view.canvas.denoise(task.origin, &at);
            }
            Err(error) => view.tell_error(&error.to_string()),
        });
        Ok(denoised.ok())
    }

    /// Renders a picture in passes, each with twice the samples of the pass before, up to the requested
    /// number.
    async fn render_by_passes(&mut self, task: &Task) -> Result<Rendering, RenderError> {
        let asked = &task.settings.integrator;
        let with = |samples: u32| {
            task.settings.clone().with(|settings| {
                settings.integrator.samples = samples;
                settings.integrator.planned_samples = Some(asked.planned());
                settings.schedule.keep_records = asked.samples > 1;
                // Browsers may lend cards between passes.
                settings.cards.addresses.extend(self.hub.look(|view| view.cards.lent().collect::<Vec<_>>()));
            })
        };
        let mut samples = 1;
        let easel = Easel::new(&self.hub, task, samples);
        let mut rendering = self.renderer.picture(&self.scene, &with(samples), None, &easel).await?;
        while samples < asked.samples {
            let origin = Origin { samples, ..task.origin };
            self.hub.change(|view, _| view.refine(origin, &rendering.statistics));
            samples = asked.samples.min(2 * samples);
            let easel = Easel::new(&self.hub, task, samples);
            let base = Some(Arc::new(rendering.film));
            rendering = self.renderer.picture(&self.scene, &with(samples), base, &easel).await?;
        }
        Ok(rendering)
    }

    fn fail(&self, task: &Task, error: &RenderError) {
        self.hub.change(|view, now| {
            let outcome = match error {
                RenderError::Stopped => Outcome::Stopped,
                error if error.is_input() => return view.refuse(task, &with_remedy(error), now),
                RenderError::Card { card, source } => {
                    view.lose_card(card, source.to_string(), now);
                    view.tell_error(&format!("no card is left: {error}; the view goes on when one returns"));
                    Outcome::NoCard
                }
                error => {
                    view.tell_error(&with_remedy(error));
                    Outcome::NoCard
                }
            };
            view.finish(task, outcome, None, now);
        });
    }
}

/// Guard that ends the view when its painter ends.
struct EndOnDrop(Arc<Hub>);

impl Drop for EndOnDrop {
    fn drop(&mut self) {
        self.0.end();
    }
}

/// Observer that puts the tiles of one pass on the view's canvas.
struct Easel<'a> {
    hub: &'a Hub,
    origin: Origin,
    is_preparing: AtomicBool,
    /// By tile number: name of the card that rendered the tile, and number of lines that it read from DRAM.
    /// An entry is removed when the tile's pixels arrive.
    cards: Mutex<HashMap<u32, (String, Option<u64>)>>,
}

impl<'a> Easel<'a> {
    fn new(hub: &'a Hub, task: &Task, samples: u32) -> Self {
        let origin = Origin { samples, ..task.origin };
        Self { hub, origin, is_preparing: AtomicBool::new(false), cards: Mutex::default() }
    }
}

impl Observer for Easel<'_> {
    fn progress(&self, phase: Phase, _: u64, _: u64) {
        let is_preparing = matches!(phase, Phase::Photons | Phase::Pack);
        if self.is_preparing.swap(is_preparing, Ordering::Relaxed) != is_preparing {
            self.hub.change(|view, now| view.prepares(is_preparing, now));
        }
    }

    fn is_stopped(&self) -> bool {
        self.hub.must_stop()
    }

    fn lost(&self, card: &str, error: &CardError) {
        self.hub.change(|view, now| view.lose_card(card, error.to_string(), now));
    }

    fn waits_for(&self, card: &str, error: &CardError, _: Duration) {
        self.lost(card, error);
    }

    fn rendered(&self, card: &str, tile: &Tile, dram_lines: Option<u64>) {
        let mut cards = self.cards.lock().unwrap_or_else(PoisonError::into_inner);
        cards.insert(tile.id, (card.to_owned(), dram_lines));
    }

    fn tiles(&self) -> Option<&dyn TileSink> {
        Some(self)
    }
}

impl TileSink for Easel<'_> {
    fn put(&self, tile: &FinishedTile) {
        let id = tile.tile().id;
        let report = self.cards.lock().unwrap_or_else(PoisonError::into_inner).remove(&id);
        let (card, dram_lines) = report.unwrap_or_default();
        self.hub.change(|view, _| view.put(self.origin, &card, dram_lines, tile));
    }

    fn revoke(&self, tile: &Tile) {
        self.hub.change(|view, _| view.revoke(self.origin, tile.id));
    }
}
