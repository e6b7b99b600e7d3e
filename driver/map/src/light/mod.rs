//! Lights of a scene in the format of a card. Emissive triangles, point lights and spot lights are in a light
//! tree; distant lights and the environment are separate. The module also computes the probabilities with
//! which shadow rays and photons choose each of them.

mod colour;
mod emission;
pub(crate) mod environment;
mod environment_parts;
mod footprint;
mod profile;
mod pyramid;
mod shares;
mod sources;
mod targets;
mod thresholds;
mod tree;

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use photoncard_shared::address::LINE_BYTES;
use photoncard_shared::image;
use photoncard_shared::layout::{DistantLight, Emitter, EmitterKind};
use rayon::prelude::*;

use self::colour::mean;
use self::emission::EmissiveTextures;
pub(crate) use self::environment::EnvironmentMap;
pub(crate) use self::profile::{ProfileDirection, ProfileDirections};
use self::shares::Shares;
pub use self::sources::SourceRadiance;
pub(crate) use self::sources::{Source, Sources};
pub(crate) use self::targets::{Aim, SolidCone, Targets};
use self::thresholds::thresholds;
use self::tree::{Bounds, Cone, LightTree};
use photoncard_scene::{Material, PunctualKind, PunctualLight, Scene, Triangle};

/// All lights of a scene.
#[derive(Debug)]
pub(crate) struct Lights {
    emitters: Vec<SceneEmitter>,
    /// Index of the emitter of each triangle of the scene; empty if no triangle emits.
    of_triangles: Vec<Option<u32>>,
    tree: LightTree,
    profiles: Arc<Profiles>,
    distant: Vec<DistantLight>,
    environment: Option<EnvironmentMap>,
    shares: Shares,
    power: f64,
    /// Light group of the environment.
    environment_group: u8,
}

/// Directions of the lights with profiles, by the index of a profile's texture.
pub(crate) type Profiles = BTreeMap<u32, ProfileDirections>;

/// Leaf of the light tree: an emissive triangle, or a light at a point.
#[derive(Debug)]
struct SceneEmitter {
    /// Index of the triangle in the scene; `usize::MAX` for a light without an area.
    triangle: usize,
    record: Emitter,
    bounds: Bounds,
    /// Power in the strongest channel, watts. It is an upper bound, because the emissive texture is assumed
    /// to be white.
    strongest: f64,
}

impl Lights {
    pub(crate) fn new(scene: &Scene) -> Self {
        let mut emitters = area_emitters(scene);
        let mut of_triangles = Vec::new();
        if !emitters.is_empty() {
            of_triangles.resize(scene.triangles.len(), None);
        }
        for (index, emitter) in (0..).zip(&emitters) {
            of_triangles[emitter.triangle] = Some(index);
        }
        let profiles = profiles(scene);
        let lights = scene.lights.iter().enumerate();
        emitters.extend(lights.filter_map(|(index, light)| {
            SceneEmitter::of_light(light, scene.light_groups.of_light(index), &profiles)
        }));
        let bounds: Vec<Bounds> = emitters.iter().map(|emitter| emitter.bounds.clone()).collect();
        let tree = LightTree::new(&bounds);
        for (emitter, &trail) in emitters.iter_mut().zip(&tree.trails) {
            emitter.record.trail = trail;
        }
        let distant = distant_lights(scene);
        let environment = scene.environment.as_ref().and_then(EnvironmentMap::new);
        let tree_power = emitters.iter().map(|emitter| emitter.bounds.power).sum();
        let [emitter_power, environment_power, distant_power] =
            shares::powers(scene, tree_power, environment.as_ref(), &distant);
        Self {
            emitters,
            of_triangles,
            tree,
            profiles: Arc::new(profiles),
            shares: Shares::new([emitter_power, environment_power, distant_power]),
            power: emitter_power + environment_power + distant_power,
            distant,
            environment,
            environment_group: scene.light_groups.of_environment(),
        }
    }

    /// Index of the emitter of a triangle of the scene, if the triangle emits.
    pub(crate) fn of_triangle(&self, triangle: u32) -> Option<u32> {
        self.of_triangles.get(triangle as usize).copied().flatten()
    }

    /// Records of the emitters; `index_in_image` maps a triangle's index in the scene to its index in the
    /// card image.
    pub(crate) fn emitters(
        &self,
        index_in_image: impl Fn(usize) -> u32,
    ) -> impl ExactSizeIterator<Item = Emitter> {
        self.emitters.iter().map(move |emitter| {
            let mut record = emitter.record;
            if let EmitterKind::Triangle { triangle, .. } = &mut record.kind {
                *triangle = index_in_image(emitter.triangle);
            }
            record
        })
    }

    /// Nodes of the light tree, from the root.
    pub(crate) fn nodes(&self) -> impl ExactSizeIterator<Item = [u8; LINE_BYTES]> {
        self.tree.nodes.iter().copied()
    }

    pub(crate) fn distant(&self) -> &[DistantLight] {
        &self.distant
    }

    /// The environment; `None` if it emits no light.
    pub(crate) fn environment(&self) -> Option<&EnvironmentMap> {
        self.environment.as_ref()
    }

    /// Cumulative probabilities of the environment's cells (`Cells::thresholds`); empty without an
    /// environment.
    pub(crate) fn cell_thresholds(&self) -> Vec<u32> {
        self.environment.as_ref().map_or(Vec::new(), |environment| environment.cells.thresholds())
    }

    /// Light parameters of the card image's header. `texture` is the index of the environment's texture.
    pub(crate) fn header(&self, texture: u32) -> image::Lights {
        let environment = self.environment.as_ref();
        let cells = environment.map_or([1; 2], |map| [map.cells.columns, map.cells.rows]);
        image::Lights {
            emitters: self.shares.emitters,
            environment: self.shares.environment,
            distant: self.shares.distant,
            radiance: environment.map_or([0.0; 3], |map| map.radiance),
            texture: environment.map(|_| texture),
            // The grid has at most 128 columns and 64 rows.
            cells: cells.map(|cells| cells as u16),
            light_group: self.environment_group,
        }
    }

    /// Power of all lights that reaches the scene, watts, averaged over channels.
    pub(crate) fn power(&self) -> f64 {
        self.power
    }
}

/// Emissive triangles of a scene, in the scene's order.
fn area_emitters(scene: &Scene) -> Vec<SceneEmitter> {
    let textures = EmissiveTextures::new(scene);
    let emitter = |(index, triangle): (usize, &Triangle)| {
        let material = &scene.materials[triangle.material as usize];
        let group = scene.light_groups.of_material(triangle.material as usize);
        material
            .is_emissive()
            .then(|| SceneEmitter::of_triangle(index, triangle, (material, group), &textures))?
    };
    scene.triangles.par_iter().enumerate().filter_map(emitter).collect()
}

impl SceneEmitter {
    fn of_triangle(
        index: usize,
        triangle: &Triangle,
        (material, light_group): (&Material, u8),
        textures: &EmissiveTextures,
    ) -> Option<Self> {
        let area = f64::from(triangle.area());
        let sides = if material.double_sided { 2.0 } else { 1.0 };
        let radiance = textures.mean_radiance(triangle, material);
        let power = radiance.element_sum() / 3.0 * area * PI * sides;
        let record = Emitter {
            kind: EmitterKind::Triangle {
                vertices: triangle.vertices.map(|vertex| vertex.to_array()),
                double_sided: material.double_sided,
                triangle: 0,
                material: triangle.material,
                varies: material.emissive_texture.is_some()
                    || material.alpha_cutoff.is_some()
                    || material.blends,
            },
            emission: material.emission.to_array(),
            trail: 0,
            light_group,
        };
        let normal = triangle.scaled_normal().as_dvec3().normalize_or(DVec3::Y);
        let bounds = Bounds {
            corners: triangle.vertices.map(Vec3::as_dvec3).to_vec(),
            cone: if material.double_sided { Cone::ALL } else { Cone::new(normal, 0.0) },
            power,
        };
        let strongest = f64::from(material.emission.max_element()) * area * PI * sides;
        (power > 0.0).then_some(Self { triangle: index, record, bounds, strongest })
    }

    /// Radiance under a white texture, averaged over channels, W/(sr m^2); infinite without an area.
    fn radiance(&self) -> f64 {
        match self.record.kind {
            EmitterKind::Triangle { .. } => mean(Vec3::from(self.record.emission)),
            EmitterKind::Point { .. } | EmitterKind::Spot { .. } | EmitterKind::Profile { .. } => {
                f64::INFINITY
            }
        }
    }

    fn of_light(light: &PunctualLight, light_group: u8, profiles: &Profiles) -> Option<Self> {
        let mut greatest = None;
        let (position, kind, cone, solid_angle) = match light.kind {
            PunctualKind::Point { position } => {
                (position, EmitterKind::Point { position: position.to_array() }, Cone::ALL, 4.0 * PI)
            }
            PunctualKind::Spot { position, direction, inner_cosine, outer_cosine } => {
                let spot = Spot::new(inner_cosine, outer_cosine);
                let kind = EmitterKind::Spot {
                    position: position.to_array(),
                    direction: direction.to_array(),
                    scale: spot.scale,
                    offset: spot.offset,
                };
                let angle = libm::acos(f64::from(outer_cosine).clamp(-1.0, 1.0));
                (position, kind, Cone::new(direction.as_dvec3(), angle), spot.solid_angle())
            }
            PunctualKind::Profile { position, texture } => {
                let directions = profiles.get(&texture)?;
                greatest = Some(directions.strongest);
                let [aim, across] = [light.axes.aim, light.axes.across].map(|axis| axis.to_array());
                let kind = EmitterKind::Profile { position: position.to_array(), aim, across, texture };
                (position, kind, lit_cone(light.axes.aim.as_dvec3(), directions), directions.flux)
            }
            PunctualKind::Directional { .. } => return None,
        };
        let intensity = light.intensity.as_dvec3();
        let power = intensity.element_sum() / 3.0 * solid_angle;
        let record = Emitter { kind, emission: light.intensity.to_array(), trail: 0, light_group };
        let bounds = Bounds { corners: vec![position.as_dvec3()], cone, power };
        let strongest = intensity.max_element() * greatest.unwrap_or(solid_angle);
        (power > 0.0).then_some(Self { triangle: usize::MAX, record, bounds, strongest })
    }
}

/// Directions of the profiles of a scene's lights.
fn profiles(scene: &Scene) -> Profiles {
    let textures = scene.lights.iter().filter_map(|light| match light.kind {
        PunctualKind::Profile { texture, .. } => Some(texture),
        _ => None,
    });
    let mut profiles = Profiles::new();
    for index in textures {
        let texture = scene.textures.get(index as usize);
        let image = texture.and_then(|texture| scene.images.get(texture.image as usize));
        if let Some(image) = image.filter(|image| image.height > 1 && !profiles.contains_key(&index)) {
            profiles.insert(index, ProfileDirections::new(image));
        }
    }
    profiles
}

/// Cone of the directions in which a profile has light: about the aim, or opposite to it.
fn lit_cone(aim: DVec3, directions: &ProfileDirections) -> Cone {
    let [greatest, least] = directions.lit;
    if greatest <= PI - least { Cone::new(aim, greatest) } else { Cone::new(-aim, PI - least) }
}

/// Angular falloff of a spot light's intensity: `clamp(cos * scale + offset, 0, 1)^2`.
struct Spot {
    scale: f32,
    offset: f32,
}

impl Spot {
    /// Falloff recommended by `KHR_lights_punctual`, between the cosines of the inner and the outer cone.
    fn new(inner_cosine: f32, outer_cosine: f32) -> Self {
        let scale = 1.0 / (inner_cosine - outer_cosine).max(0.001);
        Self { scale, offset: -outer_cosine * scale }
    }

    /// Integral of the falloff over all directions, sr.
    fn solid_angle(&self) -> f64 {
        let [scale, offset] = [self.scale, self.offset].map(f64::from);
        // The square root of the falloff rises linearly in the cosine: from 0 at the outer cone to `reached`
        // at the inner cone, or at the axis. Within the inner cone it is 1. `whole` is `1 - cos` of the inner
        // cone.
        let reached = (scale + offset).clamp(0.0, 1.0);
        let whole = (1.0 - (1.0 - offset) / scale).max(0.0);
        2.0 * PI * (reached * reached * reached / (3.0 * scale) + whole)
    }
}

fn distant_lights(scene: &Scene) -> Vec<DistantLight> {
    let lit = scene.lights.iter().enumerate().filter_map(|(index, light)| match light.kind {
        PunctualKind::Directional { direction, angle } if light.intensity.max_element() > 0.0 => {
            let spread = DistantLight::rounded_spread(spread(angle));
            // A disk of radiance L has the solid angle `2 pi spread`, and gives a surface perpendicular to
            // its axis the irradiance `L pi spread (2 - spread)`.
            let irradiance = (light.intensity * (2.0 / (2.0 - spread))).to_array();
            let light_group = scene.light_groups.of_light(index);
            let direction = direction.to_array();
            Some(DistantLight { direction, irradiance, threshold: 0, light_group, spread })
        }
        _ => None,
    });
    let mut lit: Vec<DistantLight> = lit.collect();
    let weights: Vec<f64> = lit.iter().map(|light| mean(light.irradiance.into())).collect();
    for (light, threshold) in lit.iter_mut().zip(thresholds(&weights)) {
        light.threshold = threshold;
    }
    lit
}

/// 1 minus the cosine of half the angle across a disk, radians.
fn spread(angle: f32) -> f32 {
    let sine = libm::sinf(0.25 * angle);
    (2.0 * sine * sine).clamp(0.0, 1.0)
}
