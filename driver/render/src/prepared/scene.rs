//! A prepared scene: card image, cameras and settings, which replace the scene file for renders.

use std::collections::BTreeMap;
use std::f32::consts::PI;

use glam::Vec3;
use photoncard_map::pack::PackedScene;
use photoncard_map::photon_map::PhotonsFor;
use photoncard_picture::choice::Choice;
use photoncard_scene::{Camera, Lens, Projection, Scene};
use photoncard_shared::budget::Budget;
use serde_json::{Map, Value};

use crate::renderer::{Chosen, Kept, Renderer, Source};
use crate::work::{BudgetCheck, Times};
use crate::{Integrator, Observer, PhotonMaps, RenderError, RenderSettings};

/// A scene with its photon maps, packed as a card image, and the settings that the image depends on.
pub struct PreparedScene {
    /// Scene without geometry: cameras, offset, checksums, and whether the scene is specular.
    pub(super) scene: Scene,
    pub(super) photons: PhotonMaps,
    pub(super) integrator: Integrator,
    pub(super) kept: Kept,
    /// Cameras of the frames of an animation, by frame number.
    pub(super) frames: BTreeMap<u32, View>,
    pub(super) notes: Map<String, Value>,
}

/// Cameras of a frame, and the checksum of the scene with these cameras.
pub(super) struct View {
    pub(super) cameras: Vec<Camera>,
    pub(super) checksum: String,
}

impl PreparedScene {
    /// Prepares a scene: packs it, calls `choose` for the settings of photons and integrator, and traces
    /// photons. The card image must fit cards with `budgets`. `notes` are any data of the caller, such as
    /// names of inputs.
    ///
    /// # Errors
    /// As [`Renderer::render_chosen`].
    pub fn new(
        scene: &Scene,
        settings: &RenderSettings,
        budgets: &[Budget],
        choose: &dyn Fn(&PackedScene) -> Chosen,
        notes: Map<String, Value>,
        observer: &dyn Observer,
    ) -> Result<Self, RenderError> {
        settings.camera(scene)?;
        settings.check()?;
        settings.check_groups_of(scene)?;
        check_cameras(settings.photons.photons_for)?;
        let mut times = Times::default();
        let (mut settings, source) = Source::new(scene, settings, Some(choose), &mut None, &mut times)?;
        settings.photons.photons_for = settings.photons.photons_for.resolved();
        settings.check()?;
        settings.check_budgets(budgets)?;
        let fit = &mut |check: BudgetCheck| budgets.iter().try_for_each(check);
        let kept = source.prepare(scene, &settings, fit, &mut times, observer)?;
        let RenderSettings { photons, integrator, .. } = settings;
        let scene = Scene::of_cameras(
            scene.cameras.clone(),
            scene.offset,
            scene.light_groups.names().to_vec(),
            [scene.checksum(), scene.checksum_without_cameras(), scene.checksum_of_objects()]
                .map(str::to_owned),
            [scene.is_specular(), scene.is_in_watts],
        );
        Ok(Self { scene, photons, integrator, kept, frames: BTreeMap::new(), notes })
    }

    /// Adds frame `number` with the cameras of `scene`. Returns false, and adds no frame, if anything but the
    /// cameras differs from the prepared scene.
    pub fn add_frame(&mut self, number: u32, scene: &Scene) -> bool {
        let is_same = scene.checksum_without_cameras() == self.scene.checksum_without_cameras();
        if is_same {
            let view = View { cameras: scene.cameras.clone(), checksum: scene.checksum().to_owned() };
            self.frames.insert(number, view);
        }
        is_same
    }

    /// Frame numbers in increasing order; none if the scene was prepared without frames.
    pub fn frames(&self) -> impl Iterator<Item = u32> {
        self.frames.keys().copied()
    }

    /// Scene with the cameras of frame `number`, without triangles and other contents; `None` if there is no
    /// such frame.
    pub fn frame(&self, number: u32) -> Option<Scene> {
        let View { cameras, checksum } = self.frames.get(&number)?;
        let Self { scene, .. } = self;
        let checksums = [checksum, scene.checksum_without_cameras(), scene.checksum_of_objects()];
        let checksums = checksums.map(str::to_owned);
        let (offset, groups) = (scene.offset, scene.light_groups.names().to_vec());
        let facts = [scene.is_specular(), scene.is_in_watts];
        Some(Scene::of_cameras(cameras.clone(), offset, groups, checksums, facts))
    }

    /// Scene with the cameras of the prepared scene, without triangles and other contents.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Data of the caller that were given to [`Self::new`].
    pub fn notes(&self) -> &Map<String, Value> {
        &self.notes
    }

    /// Size of the card image, bytes.
    pub fn image_bytes(&self) -> u64 {
        self.kept.prepared.image.bytes()
    }

    /// Returns the settings with photons and integrator replaced by those for which the scene was prepared.
    #[must_use]
    pub fn settings(&self, settings: RenderSettings) -> RenderSettings {
        let (photons, integrator) = (self.photons.clone(), self.integrator.clone());
        RenderSettings { photons, integrator, ..settings }
    }

    /// Creates a renderer with the card image. Pass [`Self::scene`] or [`Self::frame`] to
    /// [`Renderer::render`], and settings from [`Self::settings`].
    pub fn renderer(&self) -> Renderer {
        Renderer::with_image(self.kept.clone())
    }
}

/// Checks that photons are traced for all cameras of a scene, not for one.
fn check_cameras(photons_for: PhotonsFor) -> Result<(), RenderError> {
    match photons_for {
        PhotonsFor::Scene | PhotonsFor::Auto => Ok(()),
        PhotonsFor::Camera => Err(RenderError::Setting {
            field: "photons.photons_for",
            value: photons_for.name().into(),
            reason: "a prepared scene has photons for all its cameras".into(),
            remedy: "leave it out".into(),
        }),
    }
}

/// Returns whether a camera is valid: finite, with angles and lengths in their ranges.
pub(super) fn is_camera(camera: &Camera) -> bool {
    let Camera { name: _, origin, right, up, forward, projection, shift, lens, aspect } = camera;
    let is_length = |length: f32| length.is_normal() && length > 0.0;
    let is_angle = |angle: f32, most: f32| is_length(angle) && angle <= most;
    let is_projection = match *projection {
        Projection::Perspective { vertical_fov } => is_length(vertical_fov) && vertical_fov < PI,
        Projection::Orthographic { half_height } => is_length(half_height),
        Projection::Panorama { angles: [longitude, latitude] } => {
            is_angle(longitude, 2.0 * PI) && is_angle(latitude, PI)
        }
    };
    [origin, right, up, forward].into_iter().all(|vector| Vec3::is_finite(*vector))
        && is_projection
        && shift.iter().all(|shift| shift.is_finite())
        && lens.is_none_or(|Lens { radius, focus }| is_length(radius) && is_length(focus))
        && aspect.is_none_or(is_length)
}
