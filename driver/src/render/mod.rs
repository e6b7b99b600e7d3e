//! A render, from a loaded scene to a complete film.
//!
//! [`render`] is one pipeline: settings, film, outputs, card image, frame, sinks, executor, statistics. The executor
//! fills the film: cards over their links, or for the order `hilbert` emulated chips with the host.

mod address;
mod card_thread;
mod cards;
mod crew;
mod error;
mod exchange;
mod executor;
mod greeting;
mod memory;
mod observer;
mod open_card;
mod outputs;
mod preparation;
mod provenance;
mod reopening;
mod self_test;
mod settings;
mod statistics;
mod times;
mod verification;
mod whole_frame;

pub use address::{CardAddress, RemoteAddress};
pub use error::{CardError, RenderError};
pub use greeting::{CardInfo, card_info, card_ping};
pub use memory::{MemoryStatistics, ReadStatistics, StageReads, StructureReads};
pub use observer::{Observer, Phase, Unobserved};
pub use photoncard_shared::budget::MAX_BINS;
pub use photoncard_shared::message::{Filter, Radiance, Sampling};
pub use photoncard_shared::message::{MemoryPattern, MemoryUse, WrongWord, WrongWords};
pub use provenance::Provenance;
pub use self_test::{
    ArithmeticTest, PatternTest, SelfTest, WrongResult, WrongResults, card_self_test, self_test_on,
};
pub use settings::{
    CardSet, DEFAULT_CAUSTIC_PHOTONS, Integrator, MIN_IRRADIANCE_ERROR, NamedSettings, PROGRAM, PhotonMaps,
    Picture, RenderSettings, Schedule, TileOutputs,
};
pub use statistics::{LinkStatistics, Rays, Statistics};
pub use times::Times;

use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use self::cards::Cards;
use self::executor::{Executor, Work};
use self::outputs::Outputs;
use self::preparation::prepare;
use self::whole_frame::WholeFrame;
use crate::film::Film;
use crate::pack::PackedScene;
use crate::partial::PartialRender;
use crate::scene::Scene;
use crate::scheduler::tiles;

/// Finished picture.
pub struct Rendering {
    /// Pixels of the picture.
    pub film: Film,
    /// Statistics of the work.
    pub statistics: Statistics,
    /// File of finished tiles, to be removed after the picture is written.
    pub partial: Option<PartialRender>,
}

/// Renders a scene.
///
/// A serial port may be held open for about a second after the end: an attempt to reopen it runs on a detached thread.
///
/// # Errors
/// If settings or scene do not fit the cards, a card fails, or the observer stops the render.
pub fn render(
    scene: &Scene,
    settings: &RenderSettings,
    observer: &dyn Observer,
) -> Result<Rendering, RenderError> {
    let stated = |_: &PackedScene| Ok((settings.photons.clone(), settings.integrator.clone()));
    render_chosen(scene, settings, &stated, observer)
}

/// Photons and integrator that are chosen for a packed scene.
pub type Chosen = Result<(PhotonMaps, Integrator), RenderError>;

/// Renders a scene with photons and an integrator that are chosen when the cards have answered and the scene is packed. `choose` takes
/// the packed scene; everything else is by `settings`.
///
/// # Errors
/// As [`render`], and those of `choose`.
pub fn render_chosen(
    scene: &Scene,
    settings: &RenderSettings,
    choose: &dyn Fn(&PackedScene) -> Chosen,
    observer: &dyn Observer,
) -> Result<Rendering, RenderError> {
    let start = Instant::now();
    let camera = settings.camera(scene)?;
    settings.check()?;
    let executor = executor(settings, observer)?;
    let budgets = executor.budgets();
    for budget in &budgets {
        settings.check_budget(budget)?;
    }
    settings.outputs.partial.as_ref().map(PartialRender::check_free).transpose()?;
    let mut times = Times::default();
    let packing = Instant::now();
    let packed = PackedScene::new(scene)?;
    times.hierarchy = packing.elapsed().as_secs_f64();
    times.pack = times.hierarchy;
    let choosing = Instant::now();
    let (photons, integrator) = choose(&packed)?;
    times.pilot = choosing.elapsed().as_secs_f64();
    let tile = settings.tile_side(&budgets);
    let schedule = Schedule { tile: Some(tile), ..settings.schedule.clone() };
    let settings = &RenderSettings { photons, integrator, schedule, ..settings.clone() };
    settings.check()?;
    for budget in &budgets {
        settings.check_budget(budget)?;
    }
    // A film may be large: it is allocated after the settings are checked.
    let mut film = settings.film()?;
    let tiles = tiles(settings.window(), tile, settings.schedule.order);
    let outputs = Outputs::open(scene, settings, &tiles, &mut film, observer)?;
    let prepared = prepare(scene, packed, settings, &budgets, &mut times, observer)?;
    let frame = settings.frame(&camera, prepared.max_distance, prepared.caustics);
    let film = Mutex::new(film);
    let sinks = outputs.sinks(&film, executor.finishes_tiles_early());
    let work = Work { image: &prepared.image, frame: &frame, tiles, film: &film, sinks, outputs: &outputs };
    let outcome = executor.run(work).inspect_err(|_| outputs.report_kept())?;
    times.load = outcome.load_seconds;
    times.render = outcome.render_seconds;
    times.total = start.elapsed().as_secs_f64();
    let provenance = Provenance::new(settings, scene, &camera, &frame, &budgets);
    let statistics = Statistics::new(settings, &frame, &prepared, &outcome, times, provenance);
    let film = film.into_inner().unwrap_or_else(PoisonError::into_inner);
    let partial = outputs.finish(&film);
    Ok(Rendering { film, statistics, partial })
}

/// The executor of the settings.
///
/// # Errors
/// If its cards are not of the right kind, or too few say hello.
fn executor<'a>(
    settings: &'a RenderSettings,
    observer: &dyn Observer,
) -> Result<Box<dyn Executor + 'a>, RenderError> {
    Ok(if settings.schedule.order.is_of_whole_frame() {
        Box::new(WholeFrame::new(settings)?)
    } else {
        Box::new(Cards::connect(settings, observer)?)
    })
}
