//! Renders several pictures on the same cards.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use photoncard_map::pack::PackedScene;
use photoncard_map::photon_map::{PhotonSettings, check_image};
use photoncard_picture::cryptomatte::Identities;
use photoncard_picture::film::{Film, FilmError};
use photoncard_picture::layer::Layers;
use photoncard_picture::tone_mapping::luminance;
use photoncard_scene::Scene;
use photoncard_shared::message::{FrameParameters, SumScale};

use super::cards::Cards;
use super::hands::{ChipWorkers, Hands, completed};
use super::measure::Sensors;
use super::outputs::Outputs;
use super::work::{BudgetCheck, FitChips, Prepared, Times, Work, prepare};
use super::{
    Integrator, Observer, PhotonMaps, Provenance, RenderError, RenderSettings, Statistics, TileOutputs,
};
use crate::partial::{PartialRender, PartialSettings};

/// A finished picture.
pub struct Rendering {
    /// Pixels of the picture.
    pub film: Film,
    /// Names for the picture's mattes; `None` for a picture without mattes.
    pub identities: Option<Arc<Identities>>,
    /// Illuminance of the picture's pixels, lx, row by row; `None` for a picture without that layer.
    pub illuminance: Option<Vec<f32>>,
    /// Statistics of the work.
    pub statistics: Statistics,
    /// File of finished tiles. The caller should remove it after writing the picture.
    pub partial: Option<PartialRender>,
}

/// Settings of photons and integrator chosen for a packed scene.
pub type Chosen = Result<(PhotonMaps, Integrator), RenderError>;

/// Function that chooses the settings of photons and integrator for a packed scene.
type Choice<'a> = &'a dyn Fn(&PackedScene) -> Chosen;

/// Inputs of a picture besides scene and settings.
#[derive(Default)]
struct Request<'a> {
    /// Choice of the settings of photons and integrator for the packed scene.
    choose: Option<Choice<'a>>,
    /// Film of earlier samples, to which samples are added.
    base: Option<Arc<Film>>,
    /// Sensors that are the picture's pixels; `None` for a picture that a camera sees.
    sensors: Option<&'a Sensors>,
}

/// Renders pictures one after another on the same cards, which stay open between pictures.
///
/// If only the camera changes, the host traces no photons and sends no card image, only tile commands. If the
/// scene or its photons change, the host makes a new image, and a card receives only the changed lines. The
/// card checks the checksum of the whole image. It receives the whole image if the checksum differs, or if
/// the card was reset or lost. A picture never depends on earlier pictures.
///
/// Cards are connected again in these cases: the settings have other cards; memory is modelled; the last
/// render failed, unless its input was invalid or it was stopped; or a card is remote and some seconds have
/// passed since the last picture.
#[derive(Default)]
pub struct Renderer {
    cards: Option<Cards>,
    kept: Option<Kept>,
    hands: Hands,
}

impl Renderer {
    /// Creates a renderer with the card image of a prepared scene.
    pub(super) fn with_image(kept: Kept) -> Self {
        Self { kept: Some(kept), ..Self::default() }
    }

    /// Creates a renderer whose emulated cards are started by `workers`, and whose thread does not wait:
    /// [`Self::picture`] pends where it would.
    pub fn with_workers(workers: Arc<dyn ChipWorkers>) -> Self {
        Self { hands: Hands::Turns(workers), ..Self::default() }
    }

    /// Renders a picture of a scene. If only the camera differs from the last picture, triangles and texels
    /// of the scene are not read.
    ///
    /// # Errors
    /// If settings or scene do not fit the cards, a card fails, or the observer stops the render.
    pub fn render(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
        observer: &dyn Observer,
    ) -> Result<Rendering, RenderError> {
        completed(self.picture(scene, settings, None, observer))
    }

    /// Renders a picture, as [`Self::render`] does, or as [`Self::refine`] with `base`. The future pends only
    /// if the renderer has [workers](Self::with_workers): it is then to be polled again whenever bytes have
    /// arrived at a port, and after some milliseconds without any.
    ///
    /// # Errors
    /// As [`Self::render`] and [`Self::refine`].
    pub async fn picture(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
        base: Option<Arc<Film>>,
        observer: &dyn Observer,
    ) -> Result<Rendering, RenderError> {
        self.render_by(scene, settings, Request { base, ..Request::default() }, observer).await
    }

    /// Adds samples to the picture `base`. Renders the samples that `base` lacks, and returns the picture
    /// with all samples of the settings. It equals, bit for bit, the picture of a single render.
    /// [`Integrator::planned_samples`] and all other settings that pixels depend on must equal those of
    /// `base`.
    ///
    /// # Errors
    /// As [`Self::render`]; and if `base` does not have fewer samples than the settings, or has another size,
    /// crop window or other layers.
    pub fn refine(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
        base: Arc<Film>,
        observer: &dyn Observer,
    ) -> Result<Rendering, RenderError> {
        completed(self.picture(scene, settings, Some(base), observer))
    }

    /// Closes the cards. The next picture connects to them again, including lost ones.
    pub fn close_cards(&mut self) {
        self.cards = None;
    }

    /// Renders a picture of a scene, with photons and integrator chosen by `choose` for the packed scene.
    /// `choose` is called after the cards have answered.
    ///
    /// # Errors
    /// As [`Self::render`], and the errors of `choose`.
    pub fn render_chosen(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
        choose: &dyn Fn(&PackedScene) -> Chosen,
        observer: &dyn Observer,
    ) -> Result<Rendering, RenderError> {
        let request = Request { choose: Some(choose), ..Request::default() };
        completed(self.render_by(scene, settings, request, observer))
    }

    /// Renders a picture whose pixels are sensors.
    ///
    /// # Errors
    /// As [`Self::refine`].
    pub(super) fn render_sensors(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
        (sensors, base): (&Sensors, Option<Arc<Film>>),
        observer: &dyn Observer,
    ) -> Result<Rendering, RenderError> {
        let request = Request { sensors: Some(sensors), base, ..Request::default() };
        completed(self.render_by(scene, settings, request, observer))
    }

    async fn render_by(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
        request: Request<'_>,
        observer: &dyn Observer,
    ) -> Result<Rendering, RenderError> {
        let result = self.render_on_cards(scene, settings, request, observer).await;
        if matches!(&result, Err(error) if !error.is_input() && !matches!(error, RenderError::Stopped)) {
            self.cards = None;
        }
        result
    }

    async fn render_on_cards(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
        Request { choose, base, sensors }: Request<'_>,
        observer: &dyn Observer,
    ) -> Result<Rendering, RenderError> {
        let start = Instant::now();
        settings.check_groups_of(scene)?;
        let camera = settings.camera(scene)?;
        settings.check()?;
        let Self { cards, kept, hands } = self;
        check_model(settings, hands)?;
        let cards = connected(cards, settings, hands, observer).await?;
        let needed = settings.needed_cards();
        cards.leave_out(&|budget| settings.check_budget(budget), needed, observer)?;
        settings.outputs.partial.as_ref().map(PartialSettings::check_free).transpose()?;
        let mut times = Times::default();
        let (settings, source) = Source::new(scene, settings, choose, kept, &mut times)?;
        cards.leave_out(&|budget| settings.check_budget(budget), needed, observer)?;
        let tile = settings.tile_side(&cards.budgets());
        let settings = &settings.with(|s| s.schedule.tile = Some(tile));
        settings.check()?;
        settings.check_budgets(&cards.budgets())?;
        // A film may be large: it is allocated after the settings are checked.
        let scale = sensors.map_or(source.sum_scale(), |sensors| sensors.scale(source.sum_scale()));
        let is_irradiance = settings.picture.irradiance;
        let mut film = settings.film(if is_irradiance { scale.of_irradiance() } else { scale })?;
        film.set_origin(scene.offset.to_array());
        base.as_ref().map_or(Ok(()), |base| film.begin_after(base)).map_err(not_more(settings))?;
        let tiles = settings.tiles(tile);
        let outputs = Outputs::open(scene, settings, &tiles, (&mut film, base), observer)?;
        let fit = &mut |check: BudgetCheck| cards.leave_out(check, needed, observer);
        let made = source.prepare(scene, settings, fit, &mut times, observer)?;
        let prepared = &kept.insert(made).prepared;
        let (image, camera_of_frame) = match sensors {
            None => (&prepared.image, settings.frame_camera(&camera)),
            Some(sensors) => {
                let (image, camera) = sensors.placed_in(&prepared.image)?;
                cards.leave_out(&|budget| Ok(check_image(image, budget)?), needed, observer)?;
                (image, camera)
            }
        };
        let frame = FrameParameters {
            camera: camera_of_frame,
            first_sample: outputs.base.as_ref().map_or(0, |base| base.format().samples),
            samples: film.format().samples,
            ..settings.frame(&camera, &prepared.gathers)
        };
        cards.leave_out(&|budget| settings.check_waiting_room(&frame, image, budget), needed, observer)?;
        let film = Mutex::new(film);
        let sinks = outputs.sinks(&film);
        let work = Work { settings, image, frame: &frame, tiles, film: &film, sinks, outputs: &outputs };
        let budgets = cards.budgets();
        let mut outcome = cards.run(work).await.inspect_err(|_| outputs.report_kept())?;
        times.load = outcome.load_seconds;
        times.render = outcome.render_seconds;
        times.total = start.elapsed().as_secs_f64();
        let provenance = Provenance::new(settings, scene, &camera, &frame, &budgets);
        let statistics = Statistics::new(settings, &frame, prepared, &outcome, times, provenance);
        if let Some(error) = outcome.failure.take() {
            outputs.report_kept();
            observer.failed(serde_json::to_value(&statistics).unwrap_or_default());
            return Err(error);
        }
        let mut film = film.into_inner().unwrap_or_else(PoisonError::into_inner);
        outputs.base.as_ref().map_or(Ok(()), |base| film.add(base)).map_err(not_more(settings))?;
        let partial = outputs.finish(&film);
        let identities = kept.as_ref().and_then(|kept| kept.prepared.identities.clone());
        let identities = identities.filter(|_| settings.picture.layers.have_mattes());
        let mut rendering = Rendering { film, identities, illuminance: None, statistics, partial };
        if settings.picture.layers.have_illuminance() {
            // A frame of its own, in this function again.
            Box::pin(self.illuminate(scene, settings, &mut rendering, observer)).await?;
        }
        Ok(rendering)
    }

    /// Renders the layer of illuminance with the settings of a finished picture: an irradiance frame on the
    /// same cards. Its times are added to those of the picture.
    ///
    /// # Errors
    /// As [`Self::render`].
    pub(super) fn add_illuminance(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
        rendering: &mut Rendering,
        observer: &dyn Observer,
    ) -> Result<(), RenderError> {
        completed(self.illuminate(scene, settings, rendering, observer))
    }

    async fn illuminate(
        &mut self,
        scene: &Scene,
        settings: &RenderSettings,
        rendering: &mut Rendering,
        observer: &dyn Observer,
    ) -> Result<(), RenderError> {
        let lumens = settings.picture.lumens_per_watt.unwrap_or(scene.lumens_per_watt());
        let is_irradiance = settings.picture.irradiance;
        let settings = settings.clone().with(|settings| {
            settings.picture.irradiance = true;
            settings.picture.layers = Layers::NONE;
            settings.schedule.keep_records = false;
            settings.outputs = TileOutputs::default();
        });
        let of_film = |film: &Film| film.pixels().map(|pixel| lumens * luminance(pixel.radiance)).collect();
        if is_irradiance {
            rendering.illuminance = Some(of_film(&rendering.film));
            return Ok(());
        }
        let of_irradiance = self.render_on_cards(scene, &settings, Request::default(), observer).await?;
        rendering.illuminance = Some(of_film(&of_irradiance.film));
        rendering.statistics.time_s += of_irradiance.statistics.time_s;
        Ok(())
    }
}

/// Creates the error of mattes of a prepared scene without identities.
fn without_identities(settings: &RenderSettings) -> RenderError {
    RenderError::Setting {
        field: "picture.layers",
        value: settings.picture.layers.to_string(),
        reason: "the scene was prepared without the identities of objects and materials".into(),
        remedy: "prepare the scene with these layers, or leave object and material out".into(),
    }
}

/// Creates the error of samples that cannot be added to a picture.
fn not_more(settings: &RenderSettings) -> impl Fn(FilmError) -> RenderError {
    let samples = settings.integrator.samples;
    move |error| RenderError::Setting {
        field: "integrator.samples",
        value: samples.to_string(),
        reason: error.to_string(),
        remedy: "go on from a finished picture of fewer samples and of equal settings".into(),
    }
}

/// Checks that the memory of chips outside this program is not to be modelled.
fn check_model(settings: &RenderSettings, hands: &Hands) -> Result<(), RenderError> {
    let Some(caches) = settings.modelled_caches().filter(|_| !hands.may_wait()) else { return Ok(()) };
    Err(RenderError::Setting {
        field: "cards.caches",
        value: caches.to_string(),
        reason: "the memory of chips in workers is not modelled".into(),
        remedy: "leave it out, or use the command `photoncard`".into(),
    })
}

/// Returns the open cards if the settings have the same cards, otherwise newly connected cards.
async fn connected<'c>(
    cards: &'c mut Option<Cards>,
    settings: &RenderSettings,
    hands: &Hands,
    observer: &dyn Observer,
) -> Result<&'c mut Cards, RenderError> {
    // The open cards are closed before new ones are connected, because a card serves one host at a time.
    let open = cards.take().filter(|cards| cards.serve(settings));
    Ok(cards.insert(match open {
        Some(mut open) => {
            open.take_back();
            open
        }
        None => Cards::connect(settings, hands, observer).await?,
    }))
}

/// A card image kept for further pictures, and the inputs from which it was made.
#[derive(Clone)]
pub(super) struct Kept {
    /// Checksum of the scene ([`Scene::checksum_without_cameras`]).
    pub(super) scene: String,
    pub(super) photons: PhotonSettings,
    pub(super) prepared: Prepared,
}

impl Kept {
    /// Returns whether the card image is of this scene, with the photons of the settings, and has the
    /// identities that their mattes need.
    fn is_of(&self, scene: &Scene, settings: &RenderSettings) -> bool {
        self.scene == scene.checksum_without_cameras()
            && self.photons == settings.photon_settings(scene)
            && (self.prepared.identities.is_some() || !settings.picture.layers.have_mattes())
    }
}

/// Origin of a picture's card image.
pub(super) enum Source {
    /// The card image of an earlier picture, or of a prepared scene.
    Kept(Box<Kept>),
    /// A packed scene whose photons are still to be traced.
    Packed(Box<PackedScene>),
}

impl Source {
    /// Determines the source of the card image. Returns it with the settings, in which `choose` may have
    /// replaced photons and integrator.
    pub(super) fn new(
        scene: &Scene,
        settings: &RenderSettings,
        choose: Option<Choice>,
        kept: &mut Option<Kept>,
        times: &mut Times,
    ) -> Result<(RenderSettings, Self), RenderError> {
        if let Some(kept) = kept.take_if(|kept| choose.is_none() && kept.is_of(scene, settings)) {
            return Ok((settings.clone(), Self::Kept(Box::new(kept))));
        }
        let has_mattes = settings.picture.layers.have_mattes();
        if has_mattes && scene.stored_triangles().next().is_none() {
            return Err(without_identities(settings));
        }
        let packing = Instant::now();
        let packed = match has_mattes {
            true => PackedScene::with_identities(scene)?,
            false => PackedScene::new(scene)?,
        };
        times.hierarchy = packing.elapsed().as_secs_f64();
        times.pack = times.hierarchy;
        let Some(choose) = choose else { return Ok((settings.clone(), Self::Packed(Box::new(packed)))) };
        let choosing = Instant::now();
        let (photons, integrator) = choose(&packed)?;
        times.pilot = choosing.elapsed().as_secs_f64();
        Ok((RenderSettings { photons, integrator, ..settings.clone() }, Self::Packed(Box::new(packed))))
    }

    /// Units of the sums of light and depth in pixels.
    fn sum_scale(&self) -> SumScale {
        match self {
            Self::Kept(kept) => kept.prepared.image.view().0.header.sum_scale(),
            Self::Packed(packed) => packed.sum_scale(),
        }
    }

    /// Creates or reuses the card image.
    ///
    /// # Errors
    /// If the image does not fit the chips, the photons cannot be traced, or the observer stops the render.
    pub(super) fn prepare(
        self,
        scene: &Scene,
        settings: &RenderSettings,
        fit: &mut FitChips,
        times: &mut Times,
        observer: &dyn Observer,
    ) -> Result<Kept, RenderError> {
        let packed = match self {
            Self::Packed(packed) => *packed,
            Self::Kept(kept) => {
                fit(&|budget| Ok(check_image(&kept.prepared.image, budget)?))?;
                return Ok(*kept);
            }
        };
        Ok(Kept {
            scene: scene.checksum_without_cameras().to_owned(),
            photons: settings.photon_settings(scene),
            prepared: prepare(scene, packed, settings, fit, times, observer)?,
        })
    }
}
