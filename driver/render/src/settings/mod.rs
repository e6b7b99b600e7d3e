//! Settings of a render.

mod camera;
mod check;
mod dependence;
mod groups;
mod setting;

pub use photoncard_firmware::card::MIN_IRRADIANCE_ERROR;
use photoncard_firmware::importance::ENTRIES;
use photoncard_shared::budget::Budget;
use photoncard_shared::message::{self, FrameParameters, PixelForm, SumScale, Tile};

pub use self::dependence::{NamedSettings, PROGRAM};
pub use self::groups::{CardSet, Integrator, PhotonMaps, Picture, Schedule, TileOutputs};
pub use self::setting::{Changes, Setting};
use crate::emulator::memory_model::CacheSettings;
use photoncard_cards::scheduler::{GatherOrder, tiles};
use photoncard_map::photon_map::{GatherParameters, PhotonSettings, PhotonsFor};
use photoncard_picture::film::{Film, FilmError, Window};
use photoncard_picture::sums::SumFormat;
use photoncard_scene::{Camera, Scene};

/// Settings of a render, in groups.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RenderSettings {
    /// Picture, and the camera that sees it.
    pub picture: Picture,
    /// Photon map and caustic map.
    pub photons: PhotonMaps,
    /// Parameters of light estimation by rays.
    pub integrator: Integrator,
    /// Order of the work.
    pub schedule: Schedule,
    /// Cards that render.
    pub cards: CardSet,
    /// Destinations of finished tiles besides the film.
    pub outputs: TileOutputs,
}

/// Default number of direction bins for gather rays: three per entry of the direction table.
const DEFAULT_BINS: u32 = 3 * ENTRIES as u32;
/// Default number of direction bins if gathers wait in card memory. Their buckets bring gathers together, so
/// that bins serve the scene's cache alone: with few bins the surface of a gather point is read less often.
const BINS_OF_BUCKETS: u32 = 8;

/// Default minimum number of tiles per card, if there are several cards. At the end, a card waits on average
/// half the time of a tile for the last tile of another card.
const TILES_OF_CARD: u64 = 4;

/// Minimum side to which tiles are halved by default, pixels: the side of the coarsest cells of irradiance
/// records. Narrower tiles would compute these records several times.
const NARROWEST_TILE: u32 = 16;

/// Default number of caustic photons for a scene with a specular surface.
pub const DEFAULT_CAUSTIC_PHOTONS: usize = 200_000;

impl RenderSettings {
    /// Applies a change to the settings.
    #[must_use]
    pub fn with(mut self, change: impl FnOnce(&mut Self)) -> Self {
        change(&mut self);
        self
    }

    /// Window of the picture that is rendered.
    pub fn window(&self) -> Window {
        self.picture.window()
    }

    /// Side of the tiles on cards with `budgets`, pixels. It is [`Schedule::tile`] if stated. Otherwise it is
    /// the greatest for which each card has room, because wide tiles read the least memory. For several cards
    /// the side is halved, down to 16 pixels, while the window has fewer than four tiles per card.
    pub fn tile_side(&self, budgets: &[Budget]) -> u32 {
        if let Some(side) = self.schedule.tile {
            return side;
        }
        let room = budgets.iter().map(|budget| budget.pixels_of_tile(self.picture.form().sums_of_light()));
        let widest = room.min().unwrap_or(NARROWEST_TILE.pow(2)).isqrt().max(1);
        let window = self.window();
        let wanted = if budgets.len() > 1 { TILES_OF_CARD * budgets.len() as u64 } else { 1 };
        let tiles = |side: u32| {
            [window.x1 - window.x0, window.y1 - window.y0]
                .map(|extent| u64::from(extent.div_ceil(side)))
                .iter()
                .product::<u64>()
        };
        let narrower = |&side: &u32| (side / 2 >= NARROWEST_TILE && tiles(side) < wanted).then_some(side / 2);
        std::iter::successors(Some(widest), narrower).last().unwrap_or(widest)
    }

    /// Tiles to render. Each has at most `side * side` pixels.
    pub fn tiles(&self, side: u32) -> Vec<Tile> {
        let order = self.schedule.order;
        match self.schedule.part {
            Some(part) => part.tiles(self.window(), side, order),
            None => tiles(self.window(), side, order),
        }
    }

    /// Creates an empty film for the picture, whose sums have the units `scale`.
    ///
    /// # Errors
    /// If the picture's size or its crop window is not possible.
    pub fn film(&self, scale: SumScale) -> Result<Film, FilmError> {
        let form = self.picture.form();
        let Integrator { samples, adaptive_threshold, .. } = self.integrator;
        let format = SumFormat::of_range(form, (0, samples), adaptive_threshold.is_some(), scale);
        let mut film = Film::new(self.picture.width, self.picture.height, self.window(), format)?;
        film.set_light_groups(&self.picture.light_groups);
        Ok(film)
    }

    /// Caches of the memory model; `None` if memory is not modelled.
    pub fn modelled_caches(&self) -> Option<CacheSettings> {
        self.cards.modelled_caches()
    }

    /// Number of photons in the caustic map; 0 for no map, as in a scene without specular surfaces.
    fn caustic_photons(&self, scene: &Scene) -> usize {
        let asked = self.photons.caustic_photons.unwrap_or(DEFAULT_CAUSTIC_PHOTONS);
        if scene.is_specular() { asked } else { 0 }
    }

    /// Canonical form of the settings: it is equal for all settings that give this scene equal pixels. It
    /// states the number of caustic photons of this scene. Photons are for any camera if no pilot has
    /// decided. Without a caustic map, the number of neighbours in that map is the default.
    #[must_use]
    pub fn resolved(&self, scene: &Scene) -> Self {
        let caustic_photons = self.caustic_photons(scene);
        self.clone().with(|settings| {
            settings.photons.caustic_photons = Some(caustic_photons);
            settings.photons.photons_for = settings.photons.photons_for.resolved();
            if caustic_photons == 0 {
                settings.photons.caustic_neighbors = PhotonMaps::default().caustic_neighbors;
            }
        })
    }

    /// Parameters of the photon maps of a scene. They contain no camera if photons are for any camera, or if
    /// the scene lacks the camera of the settings.
    pub fn photon_settings(&self, scene: &Scene) -> PhotonSettings {
        let camera = match self.photons.photons_for {
            PhotonsFor::Scene | PhotonsFor::Auto => None,
            PhotonsFor::Camera => self.camera(scene).ok().map(|camera| self.frame_camera(&camera)),
        };
        PhotonSettings {
            camera,
            caustic_photons: self.caustic_photons(scene),
            caustic_neighbors: self.photons.caustic_neighbors,
            seed: self.integrator.seed,
            photons: self.photons.count,
            neighbors: self.photons.neighbors,
            max_distance: self.photons.max_distance,
            layout: self.photons.layout,
            radiance: self.photons.radiance,
        }
    }

    /// Number of direction bins of the gather rays.
    fn bins(&self) -> u32 {
        let by_order = match self.schedule.order {
            GatherOrder::Buckets => BINS_OF_BUCKETS,
            order if order.has_bins() => DEFAULT_BINS,
            _ => return 1,
        };
        self.schedule.bins.unwrap_or(by_order)
    }

    /// Returns whether cards keep irradiance records for later pictures that add samples.
    fn keeps_records(&self) -> bool {
        self.schedule.keep_records
            && self.integrator.irradiance_error.is_some()
            && self.cards.verify.is_none()
    }

    /// The camera of the picture's frames.
    pub(crate) fn frame_camera(&self, camera: &Camera) -> message::Camera {
        camera.of_frame(self.picture.width, self.picture.height)
    }

    /// Frame parameters for a camera of the scene.
    pub fn frame(&self, camera: &Camera, gathers: &GatherParameters) -> FrameParameters {
        let GatherParameters { max_distance, near_distance, caustics } = *gathers;
        let PixelForm { layers, light_groups, position, coverage, identities } = self.picture.form();
        FrameParameters {
            width: self.picture.width,
            height: self.picture.height,
            camera: self.frame_camera(camera),
            seed: self.integrator.seed,
            first_sample: 0,
            samples: self.integrator.samples,
            planned_samples: self.integrator.planned(),
            gather_rays: self.integrator.gather_rays,
            shadow_rays: self.integrator.shadow_rays,
            neighbors: self.photons.neighbors,
            max_distance,
            sampling: self.integrator.sampling,
            irradiance_error: self.integrator.irradiance_error,
            bins: self.bins(),
            drain: self.schedule.order.drain(),
            queue: self.schedule.queue.unwrap_or(u32::MAX),
            radiance: self.photons.radiance,
            caustics,
            layers,
            light_groups,
            filter: self.picture.filter,
            in_flight: self.schedule.in_flight.unwrap_or(u32::MAX),
            keep_records: self.keeps_records(),
            adaptive_threshold: self.integrator.adaptive_threshold,
            transparent: self.picture.transparent,
            position,
            coverage,
            identities,
            irradiance: self.picture.irradiance,
            near_distance: self.integrator.near_distance.unwrap_or(near_distance),
        }
    }
}

#[cfg(test)]
mod tests {
    use photoncard_firmware::kind::{MICRO, REFERENCE};

    use glam::Vec3;
    use photoncard_picture::layer::Layers;

    use super::*;

    #[test]
    fn tiles_are_as_wide_as_all_cards_have_room_for_while_each_has_several() {
        let side = |width, height, budgets: &[Budget]| {
            let picture = Picture { width, height, ..Picture::default() };
            RenderSettings { picture, ..RenderSettings::default() }.tile_side(budgets)
        };
        assert_eq!(side(512, 512, &[REFERENCE; 2]), 64);
        assert_eq!(side(10, 10, &[REFERENCE]), 64);
        assert_eq!(side(512, 512, &[REFERENCE; 16]), 64);
        assert_eq!(side(512, 512, &[REFERENCE; 17]), 32);
        assert_eq!(side(512, 512, &[REFERENCE; 1000]), 16);
        assert_eq!(side(20, 10, &[REFERENCE; 2]), 16);
        assert_eq!(side(1 << 16, 1 << 16, &[REFERENCE, MICRO, REFERENCE]), 16);
    }

    #[test]
    fn tiles_with_layers_fit_and_a_stated_side_stays() {
        let settings = RenderSettings::default().with(|s| s.picture.layers = Layers::all());
        assert_eq!(settings.tile_side(&[REFERENCE]), 32);
        assert_eq!(settings.tile_side(&[MICRO]), 8);
        assert_eq!(settings.with(|s| s.schedule.tile = Some(5)).tile_side(&[REFERENCE; 3]), 5);
    }

    #[test]
    fn photons_for_the_scene_depend_on_no_camera() {
        let [right, up, forward] = [Vec3::X, Vec3::Y, Vec3::NEG_Z];
        let seen_from = |origin: Vec3| {
            let camera = Camera::perspective("camera", origin, [right, up, forward], 1.0, None);
            Scene::default().with(|scene| scene.cameras = vec![camera])
        };
        for (photons_for, is_of_camera) in [(PhotonsFor::Scene, false), (PhotonsFor::Camera, true)] {
            let settings = RenderSettings::default().with(|s| s.photons.photons_for = photons_for);
            let [of_first, of_second] =
                [Vec3::ZERO, Vec3::X].map(|origin| settings.photon_settings(&seen_from(origin)));
            assert_eq!(of_first != of_second, is_of_camera);
            // A crop is a part of the same picture.
            let cropped = settings.with(|s| s.picture.crop = Some(Window { x0: 1, x1: 2, y0: 3, y1: 4 }));
            assert_eq!(cropped.photon_settings(&seen_from(Vec3::ZERO)), of_first);
        }
    }
}
