//! Groups of settings, each with the options that state its fields. The function `options` of a group must
//! list each field or explicitly omit it; otherwise the code does not compile. Defaults are the
//! dissertation's nominal values (Table 7.1) on one emulated reference chip.

use photoncard_cards::link::LineFaults;
use photoncard_cards::scheduler::GatherOrder;
use photoncard_map::photon_map::{PhotonLayout, PhotonsFor};
use photoncard_picture::film::Window;
use photoncard_picture::layer::Layers;
use photoncard_scene::Aperture;
use photoncard_shared::message::{Filter, PixelForm, Radiance, Sampling};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::setting::Changes::{Cards, Nothing, Pixels, Work};
use super::setting::{Setting, UNSTATED, list, name, optional, place, setting, value};
use crate::address::CardAddress;
use crate::chip::ChipModel;
use crate::display::DisplaySettings;
use crate::emulator::memory_model::CacheSettings;
use crate::emulator::trace::TraceSettings;
use crate::emulator::{Emulated, EmulatedKind};
use crate::partial::PartialSettings;
use crate::parts::Part;

/// Picture, and the camera that sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Window to render; `None` for the whole picture.
    pub crop: Option<Window>,
    /// Name of the camera; `None` for the first camera of the scene.
    pub camera: Option<String>,
    /// Position of the camera in the coordinates of the scene's file, metres; `None` for the camera's own.
    pub camera_at: Option<[f64; 3]>,
    /// Point at which the camera looks, in the coordinates of the scene's file, metres. `None` for the
    /// camera's own direction.
    pub look_at: Option<[f64; 3]>,
    /// Direction that is up in the picture, of any length; `None` for +y with [`Self::look_at`], else for the
    /// camera's own.
    pub up: Option<[f64; 3]>,
    /// Vertical field of view of a perspective picture, degrees; `None` for the camera's own projection. At
    /// most one of `fov`, `orthographic` and `panorama` can be stated.
    pub fov: Option<f32>,
    /// Height that an orthographic picture shows, metres; `None` for the camera's own projection.
    pub orthographic: Option<f32>,
    /// Longitudes and latitudes that an equirectangular panorama shows, degrees; `None` for the camera's own
    /// projection.
    pub panorama: Option<[f32; 2]>,
    /// Lens shift ([`Camera::shift`](photoncard_scene::Camera)); `None` for the camera's own.
    pub shift: Option<[f32; 2]>,
    /// Opening of the lens; `None` for the camera's own.
    pub aperture: Option<Aperture>,
    /// Distance of the plane in focus, metres; `None` for the camera's own or, if it has no lens, the
    /// distance of [`Self::look_at`].
    pub focus: Option<f32>,
    /// Layers of the picture in addition to radiance.
    pub layers: Layers,
    /// Names of the light groups whose light the picture separates: those of the scene
    /// ([`LightGroups`](photoncard_scene::LightGroups)), or none.
    pub light_groups: Vec<String>,
    /// Pixel filter.
    pub filter: Filter,
    /// True if the environment is black where eye rays see it directly. Files then have alpha, and radiance
    /// is premultiplied.
    pub transparent: bool,
    /// True if the picture shows irradiance, W/m^2, of the first surfaces that the eye rays meet, in place of
    /// radiance.
    pub irradiance: bool,
    /// Luminous efficacy of the layer of illuminance, lm/W; `None` for [`Scene::lumens_per_watt`].
    ///
    /// [`Scene::lumens_per_watt`]: photoncard_scene::Scene::lumens_per_watt
    pub lumens_per_watt: Option<f32>,
}

impl Picture {
    /// Optional contents of pixels that the picture's files need.
    pub fn form(&self) -> PixelForm {
        let form = self.layers.form();
        // There are at most four groups.
        let light_groups = self.light_groups.len() as u8;
        PixelForm { coverage: form.coverage || self.transparent, light_groups, ..form }
    }

    /// Window of the picture that is rendered.
    pub(super) fn window(&self) -> Window {
        self.crop.unwrap_or(Window::full(self.width, self.height))
    }

    /// Returns whether both position and direction of the camera are stated, so that they replace those in
    /// the scene file.
    pub fn states_view(&self) -> bool {
        self.camera_at.is_some() && self.look_at.is_some()
    }

    /// Settings of all layers of the picture's files, by option. The identity of a picture has only the
    /// layers that chips send on request.
    pub fn of_layers(&self) -> Map<String, Value> {
        let lumens = self.lumens_per_watt.filter(|_| self.layers.have_illuminance());
        let lumens = lumens.map(|lumens| ("lumens-per-watt".to_owned(), json!(lumens)));
        [("aov".to_owned(), json!(self.layers.to_string()))].into_iter().chain(lumens).collect()
    }

    pub(super) fn options(&self) -> Vec<Setting> {
        let Self {
            width,
            height,
            crop,
            camera,
            camera_at,
            look_at,
            up,
            fov,
            orthographic,
            panorama,
            shift,
            aperture,
            focus,
            layers,
            light_groups,
            filter,
            transparent,
            irradiance,
            lumens_per_watt,
        } = self;
        let pair = |numbers: Option<[f32; 2]>| (Some(json!(numbers)), numbers.map(|numbers| list(&numbers)));
        let aperture = aperture.map(|aperture| aperture.to_string());
        let size = (Some(json!([width, height])), Some(format!("{width}x{height}")));
        let Window { x0, x1, y0, y1 } = self.window();
        let window = [x0, x1, y0, y1];
        // A picture with a background has the provenance that it had before there was a choice.
        let switch = |is_on: &bool| if *is_on { (Some(json!(true)), Some(String::new())) } else { UNSTATED };
        // The scene's sources of the groups are part of its checksum; the options are those of the scene.
        let groups = (!light_groups.is_empty()).then(|| json!(light_groups));
        let aov = (Some(json!(layers.of_chip().to_string())), Some(layers.to_string()));
        vec![
            setting(Pixels, "picture.width", "size", size),
            setting(Pixels, "picture.height", "size", UNSTATED),
            setting(Pixels, "picture.crop", "crop", (Some(json!(window)), crop.map(|_| list(&window)))),
            setting(Pixels, "picture.camera", "camera", optional(camera.clone())),
            setting(Pixels, "picture.camera_at", "camera-at", place(*camera_at)),
            setting(Pixels, "picture.look_at", "look-at", place(*look_at)),
            setting(Pixels, "picture.up", "up", place(*up)),
            setting(Pixels, "picture.fov", "fov", optional(*fov)),
            setting(Pixels, "picture.orthographic", "orthographic", optional(*orthographic)),
            setting(Pixels, "picture.panorama", "panorama", pair(*panorama)),
            setting(Pixels, "picture.shift", "shift", pair(*shift)),
            setting(Pixels, "picture.aperture", "aperture", optional(aperture)),
            setting(Pixels, "picture.focus", "focus", optional(*focus)),
            setting(Pixels, "picture.layers", "aov", aov),
            setting(Pixels, "picture.light_groups", "light-groups", (groups, None)),
            setting(Pixels, "picture.filter", "filter", name(*filter)),
            setting(Pixels, "picture.transparent", "transparent", switch(transparent)),
            setting(Pixels, "picture.irradiance", "irradiance", switch(irradiance)),
            setting(Nothing, "picture.lumens_per_watt", "lumens-per-watt", optional(*lumens_per_watt)),
        ]
    }
}

impl Default for Picture {
    fn default() -> Self {
        Self {
            width: 512,
            height: 512,
            crop: None,
            camera: None,
            camera_at: None,
            look_at: None,
            up: None,
            fov: None,
            orthographic: None,
            panorama: None,
            shift: None,
            aperture: None,
            focus: None,
            layers: Layers::default(),
            light_groups: Vec::new(),
            filter: Filter::Box,
            transparent: false,
            irradiance: false,
            lumens_per_watt: None,
        }
    }
}

/// Photon map and caustic map.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhotonMaps {
    /// Number of photons in the map.
    pub count: usize,
    /// Cameras for which photons are traced: any, or the picture's.
    pub photons_for: PhotonsFor,
    /// Layout of the photon map in card memory; no pixel depends on it.
    pub layout: PhotonLayout,
    /// Number of photons that a gather searches for.
    pub neighbors: u32,
    /// Maximum distance of a gather, metres; `None` to derive it from the density of the photons.
    pub max_distance: Option<f32>,
    /// Number of photons in the caustic map; `None` for
    /// [`DEFAULT_CAUSTIC_PHOTONS`](super::DEFAULT_CAUSTIC_PHOTONS) if the scene has a specular surface, and
    /// no map otherwise.
    pub caustic_photons: Option<usize>,
    /// Number of photons that a gather in the caustic map searches for.
    pub caustic_neighbors: u32,
    /// Source of the reflected radiance at the ends of gather rays.
    pub radiance: Radiance,
}

impl PhotonMaps {
    pub(super) fn options(&self) -> Vec<Setting> {
        let Self {
            count,
            photons_for,
            layout,
            neighbors,
            max_distance,
            caustic_photons,
            caustic_neighbors,
            radiance,
        } = self;
        vec![
            setting(Pixels, "photons.count", "photons", value(count)),
            setting(Pixels, "photons.photons_for", "photons-for", name(photons_for.resolved())),
            setting(Work, "photons.layout", "photon-map", name(*layout)),
            setting(Pixels, "photons.neighbors", "neighbors", value(neighbors)),
            setting(Pixels, "photons.caustic_photons", "caustic-photons", optional(*caustic_photons)),
            setting(Pixels, "photons.caustic_neighbors", "caustic-neighbors", value(caustic_neighbors)),
            setting(Pixels, "photons.max_distance", "max-distance", optional(*max_distance)),
            setting(Pixels, "photons.radiance", "radiance", name(*radiance)),
        ]
    }
}

impl Default for PhotonMaps {
    fn default() -> Self {
        Self {
            count: 500_000,
            photons_for: PhotonsFor::default(),
            layout: PhotonLayout::default(),
            neighbors: 100,
            max_distance: None,
            caustic_photons: None,
            caustic_neighbors: 50,
            radiance: Radiance::Density,
        }
    }
}

/// Parameters of light estimation by rays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Integrator {
    /// Seed of all random numbers, including photon paths.
    pub seed: u32,
    /// Number of samples per pixel.
    pub samples: u32,
    /// Planned number of samples per pixel, among which the irradiance cache divides the gather rays of a
    /// pixel; `None` for `samples`. It is equal in all passes of a picture.
    pub planned_samples: Option<u32>,
    /// Number of final gather rays per sample. With an irradiance cache: per record, and per pixel for
    /// samples without interpolation.
    pub gather_rays: u32,
    /// Number of shadow rays per sample.
    pub shadow_rays: u32,
    /// Importance sampling of final gather rays.
    pub sampling: Sampling,
    /// Relative error bound of interpolated irradiance, at most 1; `None` for no interpolation.
    pub irradiance_error: Option<f32>,
    /// Threshold of adaptive sampling, W^(1/2)/(sr^(1/2) m); `None` for one path per sample. It is compared
    /// with the standard deviation of a pixel's probes, divided by the square root of their mean. If this
    /// quotient is greater, the samples after the probes are means of several paths.
    pub adaptive_threshold: Option<f32>,
    /// Length below which a gather ray goes on from its end, metres; 0 for none, `None` to derive it from the
    /// density of the photons.
    pub near_distance: Option<f32>,
}

impl Integrator {
    /// Planned number of samples per pixel, among which rays are divided.
    pub fn planned(&self) -> u32 {
        self.planned_samples.unwrap_or(self.samples)
    }

    pub(super) fn options(&self) -> Vec<Setting> {
        let Self {
            seed,
            samples,
            planned_samples,
            gather_rays,
            shadow_rays,
            sampling,
            irradiance_error,
            adaptive_threshold,
            near_distance,
        } = self;
        // Rays are divided among the planned samples with the irradiance cache alone.
        let is_planned = irradiance_error.is_some() && self.planned() != *samples;
        let planned = (is_planned.then(|| json!(self.planned())), optional(*planned_samples).1);
        let switch = if irradiance_error.is_some() { "on" } else { "off" };
        let cache = (None, Some(switch.to_owned()));
        let (threshold, argument) = optional(*adaptive_threshold);
        let adaptive = (threshold, argument.or(Some("off".to_owned())));
        vec![
            setting(Pixels, "integrator.seed", "seed", value(seed)),
            setting(Pixels, "integrator.samples", "spp", value(samples)),
            setting(Pixels, "integrator.planned_samples", "planned-spp", planned),
            setting(Pixels, "integrator.gather_rays", "gather-rays", value(gather_rays)),
            setting(Pixels, "integrator.shadow_rays", "shadow-rays", value(shadow_rays)),
            setting(Pixels, "integrator.sampling", "sampling", name(*sampling)),
            setting(Pixels, "integrator.irradiance_error", "ic-error", optional(*irradiance_error)),
            setting(Pixels, "integrator.irradiance_error", "irradiance-cache", cache),
            setting(Pixels, "integrator.adaptive_threshold", "adaptive", adaptive),
            setting(Pixels, "integrator.near_distance", "near-distance", optional(*near_distance)),
        ]
    }
}

impl Default for Integrator {
    fn default() -> Self {
        Self {
            seed: 0,
            samples: 1,
            planned_samples: None,
            gather_rays: 100,
            shadow_rays: 8,
            sampling: Sampling::Focused,
            irradiance_error: None,
            adaptive_threshold: None,
            near_distance: None,
        }
    }
}

/// Order of the work. No pixel depends on it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Schedule {
    /// Side of a tile, pixels; `None` to choose it by cards and picture
    /// ([`tile_side`](super::RenderSettings::tile_side)).
    pub tile: Option<u32>,
    /// Order in which a chip does the photon gathers.
    pub order: GatherOrder,
    /// Number of direction bins of the gather rays, for orders with bins; `None` for the default.
    pub bins: Option<u32>,
    /// Maximum number of gathers in the queue of a chip, for orders with a queue; `None` for the chip's
    /// capacity.
    pub queue: Option<u32>,
    /// Maximum number of tiles in flight on a chip; `None` for the chip's capacity.
    pub in_flight: Option<u32>,
    /// Pixel near which tiles are rendered first; `None` to spread tiles over the picture. The setting has no
    /// effect with modelled memory.
    pub focus: Option<[u32; 2]>,
    /// Part of the picture to render; `None` for the whole picture.
    pub part: Option<Part>,
    /// True if the picture is one of several whose samples are added
    /// ([`Renderer::refine`](crate::Renderer::refine)). Cards then keep irradiance records between pictures,
    /// in their memory beyond the card image. The setting has no effect if tiles are verified, because the
    /// work of cards is then compared.
    pub keep_records: bool,
}

impl Schedule {
    pub(super) fn options(&self) -> Vec<Setting> {
        let Self { tile, order, bins, queue, in_flight, focus: _, part: _, keep_records: _ } = self;
        vec![
            setting(Work, "schedule.order", "order", name(*order)),
            setting(Work, "schedule.tile", "tile", optional(*tile)),
            setting(Work, "schedule.bins", "bins", optional(*bins)),
            setting(Work, "schedule.queue", "queue", optional(*queue)),
            setting(Work, "schedule.in_flight", "in-flight", optional(*in_flight)),
        ]
    }
}

/// Cards that render, with faults, verification and a memory model. No pixel depends on these settings.
#[derive(Clone, Debug, PartialEq)]
pub struct CardSet {
    /// Addresses of the cards.
    pub addresses: Vec<CardAddress>,
    /// Faults injected into the links to the cards; `None` for no faults.
    pub faults: Option<LineFaults>,
    /// Fraction of the tiles that two cards render for comparison; `None` for no tiles.
    pub verify: Option<f64>,
    /// Caches of the memory model. `None` for no model, unless `trace` is stated.
    pub caches: Option<CacheSettings>,
    /// Trace of every read of the chip; `None` for no trace. A trace requires a set of one card, which is
    /// emulated. Without `caches`, the caches of the card's kind of chip are modelled.
    pub trace: Option<TraceSettings>,
}

impl CardSet {
    pub(super) fn options(&self) -> Vec<Setting> {
        let Self { addresses, faults, verify, caches: _, trace: _ } = self;
        let addresses: Vec<_> = addresses.iter().map(ToString::to_string).collect();
        let caches = self.modelled_caches().map(|caches| caches.to_string());
        vec![
            setting(Cards, "cards.addresses", "card", (Some(json!(addresses)), None)),
            setting(Cards, "cards.faults", "faults", optional(faults.map(|faults| faults.to_string()))),
            setting(Cards, "cards.verify", "verify", optional(*verify)),
            setting(Cards, "cards.caches", "cache", optional(caches)),
            setting(Nothing, "cards.trace", "trace", UNSTATED),
            setting(Nothing, "cards.trace.format", "trace-format", UNSTATED),
            setting(Nothing, "cards.trace.has_labels", "trace-labels", UNSTATED),
        ]
    }

    /// Caches of the memory model; `None` if memory is not modelled.
    pub(super) fn modelled_caches(&self) -> Option<CacheSettings> {
        self.caches.or_else(|| self.trace.as_ref().map(|_| self.own_caches()))
    }

    /// Number of cards. Each has one chip.
    pub fn count(&self) -> usize {
        self.addresses.iter().map(|address| address.emulated_chips().max(1)).sum()
    }

    /// Names of the cards in the reports of a render.
    pub fn names(&self) -> Vec<String> {
        let each_card = self
            .addresses
            .iter()
            .flat_map(|address| std::iter::repeat_n(address, address.emulated_chips().max(1)));
        each_card.enumerate().map(|(index, address)| address.name_of(index)).collect()
    }

    /// Chip of the first emulated card, or the reference chip if no card is emulated.
    pub fn emulated_chip(&self) -> Emulated {
        let chip = self.first_emulated().map(|(model, memory)| model.kind().emulated().with_memory(memory));
        chip.unwrap_or_else(|| EmulatedKind::Reference.emulated())
    }

    /// Caches of the first emulated card's model, or of the reference chip if no card is emulated.
    pub fn own_caches(&self) -> CacheSettings {
        self.first_emulated().map_or_else(|| EmulatedKind::Reference.caches(), |(model, _)| model.caches())
    }

    /// Model and memory of the first emulated card.
    fn first_emulated(&self) -> Option<(&ChipModel, u64)> {
        self.addresses.iter().find_map(|address| match address {
            CardAddress::Emulated { model, memory, .. } => Some((model, *memory)),
            CardAddress::Remote(_) => None,
        })
    }
}

impl Default for CardSet {
    fn default() -> Self {
        Self {
            addresses: vec![CardAddress::default()],
            faults: None,
            verify: None,
            caches: None,
            trace: None,
        }
    }
}

/// Destinations of finished tiles besides the film. No pixel depends on them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TileOutputs {
    /// File in which finished tiles are kept until the picture is written; `None` to keep none.
    pub partial: Option<PartialSettings>,
    /// Viewer that shows tiles as soon as they are finished; `None` for no viewer.
    pub display: Option<DisplaySettings>,
}

impl TileOutputs {
    pub(super) fn options(&self) -> Vec<Setting> {
        let Self { partial: _, display: _ } = self;
        vec![
            setting(Nothing, "outputs.partial.resume", "resume", UNSTATED),
            setting(Nothing, "outputs.display", "display-server", UNSTATED),
        ]
    }
}
