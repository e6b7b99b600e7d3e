//! Lights of `KHR_lights_punctual` with the transforms of their nodes.

use glam::{DMat4, DVec3, Vec3};
use gltf::json::extensions::scene::khr_lights_punctual::{Light, Spot, Type};
use gltf::json::validation::Checked;
use serde::Deserialize;

use super::document::Document;
use super::extras;
use super::lamps;
use super::limits::MAX_COORDINATE;
use super::notices::Notices;
use crate::error::SceneError;
use crate::light::DISK_DEGREES;
use crate::limits::EMISSION;
use crate::{LightAxes, LightUnits, PunctualKind, PunctualLight, Scene, blender};

/// Minimum difference between the cosines of a spot light's cones, as `KHR_lights_punctual` recommends.
/// Exporters write equal angles for a sharp edge.
const MIN_PENUMBRA: f32 = 0.001;

/// Maximum excess of an outer cone angle over a right angle that counts as rounding error, radians.
const ANGLE_TOLERANCE: f32 = 1e-4;

/// Converts the file's punctual lights to the scene's.
pub(super) struct LightPlacer<'a> {
    document: &'a Document,
    units: LightUnits,
    /// Units that follow from Blender's name in `asset.generator`; `None` for other exporters, or if the
    /// settings state them.
    found: Option<LightUnits>,
}

impl<'a> LightPlacer<'a> {
    pub(super) fn new(document: &'a Document, units: LightUnits) -> Self {
        let found = match units {
            LightUnits::Auto => blender::light_units(document.root.asset.generator.as_deref()),
            _ => None,
        };
        Self { document, units: found.unwrap_or(units), found }
    }

    /// Returns true if light of the file is in watts, of lights that are converted to them.
    pub(super) fn are_in_watts(&self) -> bool {
        self.units.are_converted()
    }

    /// Adds the light `index`, which exists, with the transform of `node`. With a photometric file
    /// (`has_profile`) it stays a point, whatever its radius.
    pub(super) fn place(
        &self,
        (index, has_profile): (usize, bool),
        node: usize,
        world: &DMat4,
        scene: &mut Scene,
        notices: &mut Notices,
    ) -> Result<(), SceneError> {
        let light = &self.document.lights()[index];
        let name = light.name.clone().unwrap_or_else(|| format!("light {index}"));
        let intensity = self.intensity(index)?;
        notices.blender_units = self.found;
        if let Some(spot) = spot(light) {
            let Cone { inner, outer, is_clamped } = Cone::of(spot);
            if outer <= 0.0 {
                notices.closed_spots.push(name);
                return Ok(());
            }
            notices.clamped_spots.extend(is_clamped.then(|| name.clone()));
            let has_penumbra = self.document.is_of_blender() && inner < outer;
            notices.blender_spots.extend(has_penumbra.then(|| name.clone()));
        }
        let kind = self.kind(index, node, world)?;
        let radius = self.radius(index)?;
        if radius > 0.0 && !has_profile && matches!(kind, PunctualKind::Point { .. }) {
            let item = format!("{}.extras.photoncard.radius", place(index));
            return lamps::place_sphere(self.document, item, (&name, world), (intensity, radius), scene);
        }
        notices.lights_without_size.extend((radius > 0.0).then(|| name.clone()));
        let axes = axes(world).unwrap_or_default();
        scene.lights.push(PunctualLight { name, kind, intensity, axes });
        Ok(())
    }

    /// Colour times intensity per linear RGB channel, W/sr, or W/m^2 of a directional light.
    fn intensity(&self, index: usize) -> Result<Vec3, SceneError> {
        let light = &self.document.lights()[index];
        let divisor = match light.type_ {
            Checked::Valid(Type::Directional) => self.units.directional(),
            _ => self.units.points(),
        };
        let intensity = Vec3::from(light.color) * light.intensity / divisor;
        let is_possible = |value: f32| value == 0.0 || EMISSION.contains(&value);
        if intensity.to_array().into_iter().all(is_possible) {
            return Ok(intensity);
        }
        let reason = format!("the light's intensity is {intensity}, its colour and units included");
        let remedy = "state a colour of 0 or more, and an intensity of 0, or of 1e-20 to 1e20";
        Err(self.document.invalid(format!("{}.intensity", place(index)), reason, remedy))
    }

    fn kind(&self, index: usize, node: usize, world: &DMat4) -> Result<PunctualKind, SceneError> {
        let light = &self.document.lights()[index];
        let position = world.w_axis.truncate().as_vec3();
        let direction = (-world.z_axis.truncate()).try_normalize().map(DVec3::as_vec3);
        let misplaced = || {
            let reason = "the light's node, with its parents, gives it no finite position or no direction";
            let remedy = "give the light's node and its parents a finite position and a scale other than 0";
            self.document.invalid(format!("nodes[{node}]"), reason, remedy)
        };
        if !position.is_finite() {
            return Err(misplaced());
        }
        Ok(match light.type_ {
            Checked::Valid(Type::Directional) => {
                let angle = self.angle(index)?;
                PunctualKind::Directional { direction: direction.ok_or_else(misplaced)?, angle }
            }
            Checked::Valid(Type::Spot) => {
                let (inner_cosine, outer_cosine) = self.cones(light);
                let direction = direction.ok_or_else(misplaced)?;
                PunctualKind::Spot { position, direction, inner_cosine, outer_cosine }
            }
            // Validation has rejected other types.
            Checked::Valid(Type::Point) | Checked::Invalid => PunctualKind::Point { position },
        })
    }

    /// Values of this renderer in a light's `extras`.
    fn stated(&self, index: usize) -> Result<Stated, SceneError> {
        let stated = extras::read(&self.document.lights()[index].extras);
        Ok(stated.map_err(|reason| self.invalid_extras(index, reason))?.unwrap_or_default())
    }

    fn invalid_extras(&self, index: usize, reason: String) -> SceneError {
        let place = format!("{}.extras.photoncard", place(index));
        let remedy = "state {\"photoncard\": {\"angle\": A}} with the degrees across the light's disk, 0 to 180, \
                      or {\"photoncard\": {\"radius\": R}} with its metres";
        self.document.invalid(place, reason, remedy)
    }

    /// Angle across the disk of a directional light, radians: `extras.photoncard.angle`, degrees.
    fn angle(&self, index: usize) -> Result<f32, SceneError> {
        let degrees = self.stated(index)?.angle.unwrap_or_default();
        if !DISK_DEGREES.contains(&degrees) {
            return Err(self.invalid_extras(index, format!("the angle is {degrees}")));
        }
        Ok(degrees.to_radians())
    }

    /// Radius of a light, metres: `extras.photoncard.radius`.
    fn radius(&self, index: usize) -> Result<f32, SceneError> {
        let radius = self.stated(index)?.radius.unwrap_or_default();
        if !(0.0..=MAX_COORDINATE).contains(&radius) {
            return Err(self.invalid_extras(index, format!("the radius is {radius}")));
        }
        Ok(radius)
    }

    /// Cosines of the inner and the outer cone angle of a spot light.
    fn cones(&self, light: &Light) -> (f32, f32) {
        let Cone { inner, outer, .. } = spot(light).map(Cone::of).unwrap_or_default();
        let outer_cosine = libm::cosf(outer);
        let inner_cosine = if self.document.is_of_blender() {
            blender::inner_cosine(inner, outer, outer_cosine)
        } else {
            libm::cosf(inner)
        };
        (inner_cosine, outer_cosine.min(inner_cosine - MIN_PENUMBRA))
    }
}

/// Axes of a light with the transform of its node; `None` if the transform has no direction.
pub(super) fn axes(world: &DMat4) -> Option<LightAxes> {
    let aim = (-world.z_axis.truncate()).try_normalize()?;
    let across = world.x_axis.truncate().reject_from_normalized(aim).try_normalize()?;
    Some(LightAxes { aim: aim.as_vec3(), across: across.as_vec3() })
}

/// Values of this renderer in a light's `extras`.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stated {
    angle: Option<f32>,
    radius: Option<f32>,
}

/// Cone of a light, if it is a spot light.
fn spot(light: &Light) -> Option<&Spot> {
    light.spot.as_ref().filter(|_| matches!(light.type_, Checked::Valid(Type::Spot)))
}

/// Half angles of a spot light's cones, radians: `0 <= inner <= outer <= pi / 2`. With `outer` 0 the light
/// illuminates nothing.
#[derive(Default)]
struct Cone {
    inner: f32,
    outer: f32,
    /// True if the file's angles differ from `inner` and `outer` by more than rounding.
    is_clamped: bool,
}

impl Cone {
    fn of(spot: &Spot) -> Self {
        let (inner, outer) = (spot.inner_cone_angle, spot.outer_cone_angle);
        let right = std::f32::consts::FRAC_PI_2;
        let is_clamped = !(0.0..=outer).contains(&inner) || outer > right + ANGLE_TOLERANCE;
        let outer = outer.clamp(0.0, right);
        Self { inner: inner.clamp(0.0, outer), outer, is_clamped }
    }
}

/// JSON path of a light.
fn place(index: usize) -> String {
    format!("extensions.KHR_lights_punctual.lights[{index}]")
}
