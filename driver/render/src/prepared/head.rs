//! Head of a prepared scene's file: everything but the card image.

use std::collections::BTreeMap;
use std::sync::Arc;

use photoncard_map::pack::CardImage;
use photoncard_map::photon_map::{GatherParameters, PhotonsFor};
use photoncard_picture::cryptomatte::Identities;
use photoncard_scene::{Camera, Lens, LightGroups, Projection, Scene};
use photoncard_shared::address::Line;
use photoncard_shared::checksum::Checksum;
use photoncard_shared::image::SectionKind;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::scene::{PreparedScene, View, is_camera};
use crate::renderer::Kept;
use crate::work::Prepared;
use crate::{Integrator, PROGRAM, PhotonMaps, RenderSettings};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Head {
    /// Name and version of the program that traced the photons.
    pub(super) program: String,
    /// Number of lines of the card image.
    pub(super) lines: u32,
    /// CRC-32C of the card image.
    pub(super) checksum: u32,
    cameras: Vec<StoredCamera>,
    /// Position of the origin of scene coordinates in the coordinates of the scene file, metres.
    offset: [f64; 3],
    /// Checksums of the scene, with and without cameras.
    scene: [String; 2],
    is_specular: bool,
    is_in_watts: bool,
    photons: PhotonMaps,
    integrator: Integrator,
    gathers: GatherParameters,
    paths: u64,
    /// Names of the card image's identities, and the checksum of the scene's objects; left out for an image
    /// without identities.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    identities: Option<(Identities, String)>,
    /// Names of the scene's light groups; left out without groups.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    light_groups: Vec<String>,
    /// Cameras of the frames of an animation, by frame number.
    frames: BTreeMap<u32, StoredView>,
    notes: Map<String, Value>,
}

impl Head {
    pub(super) fn new(scene: &PreparedScene) -> Self {
        let PreparedScene { scene, photons, integrator, kept, frames, notes } = scene;
        let Prepared { image, identities, gathers, paths, guiding: _ } = &kept.prepared;
        Self {
            program: PROGRAM.to_owned(),
            lines: image.lines().len() as u32,
            checksum: checksum(image.lines()),
            cameras: scene.cameras.iter().map(StoredCamera::new).collect(),
            offset: scene.offset.to_array(),
            scene: [scene.checksum(), scene.checksum_without_cameras()].map(str::to_owned),
            is_specular: scene.is_specular(),
            is_in_watts: scene.is_in_watts,
            photons: photons.clone(),
            integrator: integrator.clone(),
            gathers: *gathers,
            paths: *paths,
            identities: identities
                .as_deref()
                .map(|names| (names.clone(), scene.checksum_of_objects().to_owned())),
            light_groups: scene.light_groups.names().to_vec(),
            frames: frames.iter().map(|(number, view)| (*number, StoredView::new(view))).collect(),
            notes: notes.clone(),
        }
    }

    /// Combines the head with the card image into the prepared scene.
    ///
    /// # Errors
    /// If a camera, a gather distance or the offset is invalid, or the photons are for one camera.
    pub(super) fn into_scene(self, image: CardImage) -> Result<PreparedScene, &'static str> {
        let Self {
            cameras,
            offset,
            photons,
            integrator,
            gathers,
            paths,
            identities,
            light_groups,
            frames,
            notes,
            ..
        } = self;
        let values = image.view().0.header.section(SectionKind::Identities).records;
        if identities.is_some() != (values > 0) {
            return Err("its card image has identities without names, or there are names without identities");
        }
        let is_distance = |distance: f32| distance.is_normal() && distance > 0.0;
        let GatherParameters { max_distance, near_distance, caustics } = gathers;
        let distances = [Some(max_distance), caustics.map(|gather| gather.max_distance)];
        let is_near = near_distance.is_finite() && near_distance >= 0.0;
        if !is_near || !distances.into_iter().flatten().all(is_distance) {
            return Err("its distances of gathers are none");
        }
        if photons.photons_for != PhotonsFor::Scene {
            return Err("its photons are not for all cameras");
        }
        let cameras: Vec<Camera> = cameras.into_iter().map(StoredCamera::camera).collect();
        let frames: BTreeMap<u32, View> =
            frames.into_iter().map(|(number, view)| (number, view.view())).collect();
        let is_seen = |cameras: &[Camera]| !cameras.is_empty() && cameras.iter().all(is_camera);
        if !is_seen(&cameras) || !frames.values().all(|view| is_seen(&view.cameras)) {
            return Err("its cameras are none");
        }
        if !offset.into_iter().all(f64::is_finite) {
            return Err("its place is none");
        }
        let settings = RenderSettings { photons, integrator, ..RenderSettings::default() };
        let (names, objects) = identities.unzip();
        let (image, identities) = (Arc::new(image), names.map(Arc::new));
        let prepared = Prepared { image, identities, gathers, paths, guiding: None };
        let [checksum, without_cameras] = self.scene;
        let checksums = [checksum, without_cameras, objects.unwrap_or_default()];
        if !LightGroups::are_names(&light_groups) {
            return Err("its light groups are none");
        }
        let facts = [self.is_specular, self.is_in_watts];
        let scene = Scene::of_cameras(cameras, offset.into(), light_groups, checksums, facts);
        let kept = Kept {
            scene: scene.checksum_without_cameras().to_owned(),
            photons: settings.photon_settings(&scene),
            prepared,
        };
        let RenderSettings { photons, integrator, .. } = settings;
        Ok(PreparedScene { scene, photons, integrator, kept, frames, notes })
    }
}

/// CRC-32C of lines.
fn checksum(lines: &[Line]) -> u32 {
    let mut sum = Checksum::default();
    lines.iter().for_each(|line| sum.update(&line.0));
    sum.value()
}

/// View of a frame, as stored in a file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredView {
    checksum: String,
    cameras: Vec<StoredCamera>,
}

impl StoredView {
    fn new(view: &View) -> Self {
        let View { cameras, checksum } = view;
        Self { checksum: checksum.clone(), cameras: cameras.iter().map(StoredCamera::new).collect() }
    }

    fn view(self) -> View {
        let Self { cameras, checksum } = self;
        View { checksum, cameras: cameras.into_iter().map(StoredCamera::camera).collect() }
    }
}

/// Camera, as stored in a file. Its numbers are read back exactly.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredCamera {
    name: String,
    origin: [f32; 3],
    right: [f32; 3],
    up: [f32; 3],
    forward: [f32; 3],
    projection: StoredProjection,
    shift: [f32; 2],
    /// Radius and focus of the lens, metres.
    lens: Option<[f32; 2]>,
    aspect: Option<f32>,
}

/// [`Projection`], as stored in a file.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum StoredProjection {
    VerticalFov(f32),
    HalfHeight(f32),
    Panorama([f32; 2]),
}

impl StoredCamera {
    fn new(camera: &Camera) -> Self {
        let Camera { name, origin, right, up, forward, projection, shift, lens, aspect } = camera.clone();
        let [origin, right, up, forward] = [origin, right, up, forward].map(|vector| vector.to_array());
        let projection = match projection {
            Projection::Perspective { vertical_fov } => StoredProjection::VerticalFov(vertical_fov),
            Projection::Orthographic { half_height } => StoredProjection::HalfHeight(half_height),
            Projection::Panorama { angles } => StoredProjection::Panorama(angles),
        };
        let lens = lens.map(|Lens { radius, focus }| [radius, focus]);
        Self { name, origin, right, up, forward, projection, shift, lens, aspect }
    }

    fn camera(self) -> Camera {
        let Self { name, origin, right, up, forward, projection, shift, lens, aspect } = self;
        let [origin, right, up, forward] = [origin, right, up, forward].map(Into::into);
        let projection = match projection {
            StoredProjection::VerticalFov(vertical_fov) => Projection::Perspective { vertical_fov },
            StoredProjection::HalfHeight(half_height) => Projection::Orthographic { half_height },
            StoredProjection::Panorama(angles) => Projection::Panorama { angles },
        };
        let lens = lens.map(|[radius, focus]| Lens { radius, focus });
        Camera { name, origin, right, up, forward, projection, shift, lens, aspect }
    }
}
