//! Sources of photons, chosen in proportion to their power.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use photoncard_firmware::scene::light::environment_direction;
use photoncard_scene::Scene;
use photoncard_shared::layout::DistantLight;

use super::environment::Cells;
use super::environment_parts::{Parts, SIDE};
use super::shares::projected_area;
use super::targets::Targets;
use super::thresholds::thresholds;
use super::{Lights, Profiles, mean};

/// A source of photons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Source {
    /// The emitter with this index.
    Emitter(u32),
    /// A distant light.
    Distant {
        /// Unit vector along which the light travels, from the middle of its disk.
        direction: Vec3,
        /// 1 minus the cosine of the disk's half angle; 0 for parallel light.
        spread: f32,
        /// Radiance times solid angle, W/m^2.
        irradiance: Vec3,
        /// Light group.
        light_group: u8,
    },
    /// A cell of the environment, or a part of one.
    Cell {
        /// Left border and width of the cell as fractions of the map's width.
        across: [f32; 2],
        /// Cosines of the polar angles of the cell's upper and lower border, measured from +y.
        cosines: [f32; 2],
        /// Solid angle of the cell, sr.
        solid_angle: f32,
    },
}

/// All sources of a scene, and the probabilities of choosing them.
#[derive(Clone, Debug)]
pub(crate) struct Sources {
    list: Vec<Source>,
    thresholds: Vec<u32>,
    /// Lower and upper corner of the box through which infinitely distant light enters: the part of the scene
    /// in which photons are stored, slightly enlarged.
    pub(crate) bounds: [Vec3; 2],
    /// Distance from the box, metres, beyond which nothing of the scene can hide the box; 0 if the box
    /// contains the scene.
    pub(crate) beyond: f32,
    /// Directions of lights with profiles.
    pub(crate) profiles: Arc<Profiles>,
    /// Targets at which photons are aimed; empty if photons are not aimed.
    pub(crate) targets: Targets,
    /// Power of all sources, watts, averaged over channels; 0 if photons can be aimed.
    pub(crate) power: f64,
    /// Maximum of `p / q` over the sources, watts: p is the power of a source in its strongest channel, and q
    /// is the probability of choosing the source. The unit of photon powers is derived from it. If a fraction
    /// of the photons is aimed, the other photons are stronger, and this maximum is greater.
    pub(crate) strongest: f32,
    pub(crate) radiance: SourceRadiance,
}

/// Radiance of sources, averaged over channels, W/(sr m^2). It is infinite with a light without an area, and
/// 0 without light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SourceRadiance {
    /// Mean, weighted by power: the second moment of the radiance that a ray finds at the sources, divided by
    /// the first.
    pub mean: f64,
    /// Maximum.
    pub greatest: f64,
}

/// A source chosen by [`Sources::choose`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ChosenSource {
    pub(crate) source: Source,
    pub(crate) probability: f32,
    /// Remainder of the random number, rescaled to [0, 1).
    pub(crate) rest: f32,
}

/// Minimum fraction of an emitter's light that is assumed to go towards the targets.
const MIN_AIMED_SHARE: f64 = 1e-3;
/// Margin of the box beyond the scene or its part, relative to the longest side or to a tenth of the maximum
/// coordinate, whichever is larger.
const MARGIN: f32 = 1e-4;

impl Sources {
    /// Returns sources whose photons are emitted in all directions. `part` is the part of the scene in which
    /// photons are stored; `None` if it is the whole scene.
    pub(crate) fn new(scene: &Scene, lights: &Lights, part: Option<[Vec3; 2]>) -> Self {
        Self::towards(scene, lights, part, Targets::default())
    }

    /// Returns sources whose photons are aimed at the scene's specular surfaces; `None` if it has none.
    pub(crate) fn of_caustics(scene: &Scene, lights: &Lights, part: Option<[Vec3; 2]>) -> Option<Self> {
        let targets = Targets::specular(scene);
        (!targets.is_empty()).then(|| Self::towards(scene, lights, part, targets))
    }

    /// Returns sources that aim most of their photons at the scene's surfaces other than lamps, because these
    /// surfaces may be far from the lights. Returns `None` if there are no such surfaces.
    pub(crate) fn aimed(scene: &Scene, lights: &Lights, part: Option<[Vec3; 2]>) -> Option<Self> {
        let targets = Targets::lit(scene);
        (!targets.is_empty()).then(|| Self::towards(scene, lights, part, targets))
    }

    /// Returns these sources with a fraction of their photons aimed at `targets`.
    pub(crate) fn aimed_at(&self, targets: Targets) -> Self {
        let strongest = self.strongest / (1.0 - targets.share);
        Self { targets, strongest, power: 0.0, ..self.clone() }
    }

    fn towards(scene: &Scene, lights: &Lights, part: Option<[Vec3; 2]>, targets: Targets) -> Self {
        let whole = scene.bounds();
        let bounds = enlarged(part.map_or(whole, |[lower, upper]| (lower, upper)));
        let size = (bounds[1] - bounds[0]).as_dvec3();
        let is_aimed = !targets.is_empty();
        let mut all = AllSources::default();
        for (index, emitter) in (0..).zip(&lights.emitters) {
            let share = if is_aimed { aimed_share(&targets, &emitter.bounds.corners) } else { 1.0 };
            let radiance = emitter.radiance();
            all.add(Source::Emitter(index), emitter.bounds.power * share, emitter.strongest, radiance);
        }
        let shown = |direction: DVec3| {
            if is_aimed { f64::from(targets.area()) } else { projected_area(size, direction) }
        };
        for light in &lights.distant {
            let [direction, irradiance] = [light.direction, light.irradiance].map(Vec3::from);
            let area = shown(direction.as_dvec3());
            // No component of a direction in the disk differs from that of its axis by more than the chord.
            let chord = libm::sqrt(2.0 * f64::from(light.spread));
            let rest = if is_aimed { 0.0 } else { chord * projected_area(size, DVec3::ONE) };
            let strongest = f64::from(irradiance.max_element()) * (area + rest);
            let DistantLight { light_group, spread, .. } = *light;
            all.add(
                Source::Distant { direction, spread, irradiance, light_group },
                mean(irradiance) * area,
                strongest,
                f64::INFINITY,
            );
        }
        all.add_cells(lights, shown, is_aimed.then_some(f64::from(targets.area())), size);
        let thresholds = thresholds(&all.powers);
        let strongest = all.strongest.iter().enumerate().map(|(index, watts)| {
            let (lower, upper) = share(&thresholds, index);
            (watts * super::thresholds::ALL / f64::from(upper - lower).max(1.0)) as f32
        });
        Self {
            strongest: strongest.filter(|watts| watts.is_finite()).fold(0.0, f32::max),
            power: if is_aimed { 0.0 } else { all.powers.iter().sum() },
            radiance: all.radiance(),
            list: all.list,
            thresholds,
            bounds,
            beyond: if part.is_some() { whole.0.distance(whole.1) } else { 0.0 },
            profiles: Arc::clone(&lights.profiles),
            targets,
        }
    }

    /// Chooses the source at `number / 2^64` of the cumulative distribution; `None` if there are no sources.
    pub(crate) fn choose(&self, number: u64) -> Option<ChosenSource> {
        let target = (number >> 32) as u32;
        let index = self.thresholds.partition_point(|&threshold| threshold < target);
        let source = *self.list.get(index)?;
        let (lower, upper) = share(&self.thresholds, index);
        let width = f64::from(upper - lower).max(1.0);
        let into = number.saturating_sub(u64::from(lower) << 32) as f64 / super::thresholds::ALL;
        Some(ChosenSource {
            source,
            probability: (width / super::thresholds::ALL) as f32,
            rest: ((into / width) as f32).min(1.0 - f32::EPSILON / 2.0),
        })
    }
}

/// Approximate fraction of an emitter's light that goes towards the targets: the solid angle of the targets
/// at the emitter's centre over `4 pi`. It is at least [`MIN_AIMED_SHARE`], because other points of the
/// emitter may see more of the targets.
fn aimed_share(targets: &Targets, corners: &[DVec3]) -> f64 {
    let middle = corners.iter().sum::<DVec3>() / corners.len().max(1) as f64;
    (f64::from(targets.solid_angle(middle.as_vec3())) / (4.0 * PI)).clamp(MIN_AIMED_SHARE, 1.0)
}

/// Cumulative probabilities before and after a source, in units of 2^-32.
fn share(thresholds: &[u32], index: usize) -> (u32, u32) {
    let lower = index.checked_sub(1).map_or(0, |before| thresholds[before]);
    (lower, thresholds[index])
}

fn enlarged((lower, upper): (Vec3, Vec3)) -> [Vec3; 2] {
    let greatest = lower.abs().max(upper.abs()).max_element();
    let margin = MARGIN * (upper - lower).max_element().max(0.1 * greatest).max(1e-30);
    [lower - margin, upper + margin]
}

/// Sources that are being collected. For each source, its power averaged over channels and its power in the
/// strongest channel, watts.
#[derive(Default)]
struct AllSources {
    list: Vec<Source>,
    powers: Vec<f64>,
    strongest: Vec<f64>,
    /// Radiance of each source, W/(sr m^2), averaged over channels; infinite without an area.
    radiances: Vec<f64>,
}

impl AllSources {
    fn add(&mut self, source: Source, power: f64, strongest: f64, radiance: f64) {
        self.list.push(source);
        self.powers.push(power);
        self.strongest.push(strongest);
        self.radiances.push(radiance);
    }

    fn radiance(&self) -> SourceRadiance {
        let [mut weighted, mut power, mut greatest] = [0.0_f64; 3];
        for (of_source, radiance) in self.powers.iter().zip(&self.radiances) {
            if *of_source > 0.0 {
                weighted += of_source * radiance;
                power += of_source;
                greatest = greatest.max(*radiance);
            }
        }
        SourceRadiance { mean: if power > 0.0 { weighted / power } else { 0.0 }, greatest }
    }

    /// Adds the cells of the environment. `shown(direction)` is the area, m^2, through which a cell's light
    /// passes; `same` is this area if it is equal for all directions.
    fn add_cells(&mut self, lights: &Lights, shown: impl Fn(DVec3) -> f64, same: Option<f64>, size: DVec3) {
        let Some(map) = lights.environment() else { return };
        let cells = &map.cells;
        // The mean projected area of a box is half of the sum of its projected areas along the axes.
        let all_sides = same.map_or(size.y * size.z + size.z * size.x + size.x * size.y, |area| 2.0 * area);
        for row in 0..cells.rows {
            let border = |row: u32| libm::cos(std::f64::consts::PI * f64::from(row) / f64::from(cells.rows));
            let [upper, lower] = [border(row), border(row + 1)];
            for column in 0..cells.columns {
                if let Some(parts) = cells.parts(row, column) {
                    self.add_parts(cells, parts, (row, column), (&shown, all_sides));
                    continue;
                }
                let width = 1.0 / cells.columns as f32;
                let left = column as f32 * width;
                let middle = environment_direction(left + 0.5 * width, (0.5 * (upper + lower)) as f32);
                // Light of a cell that covers much of the sphere meets several sides of the box.
                let is_wide = cells.columns < 8 || cells.rows < 8;
                let area = if is_wide { 0.5 * all_sides } else { shown(middle.as_dvec3()) };
                let weight = cells.weights[(row * cells.columns + column) as usize];
                let solid_angle = cells.solid_angle(row);
                let source = Source::Cell {
                    across: [left, width],
                    cosines: [upper as f32, lower as f32],
                    solid_angle: solid_angle as f32,
                };
                let strongest = f64::from(map.brightest) * solid_angle * all_sides;
                self.add(source, weight * area, strongest, weight / solid_angle);
            }
        }
    }

    /// Adds the parts of a subdivided cell, as [`Self::add_cells`] adds cells.
    fn add_parts(
        &mut self,
        cells: &Cells,
        parts: &Parts,
        (row, column): (u32, u32),
        (shown, all_sides): (impl Fn(DVec3) -> f64, f64),
    ) {
        let border = |row: u32| libm::cos(std::f64::consts::PI * f64::from(row) / f64::from(cells.rows));
        let [upper, lower] = [border(row), border(row + 1)];
        let height = (lower - upper) / f64::from(SIDE);
        let width = 1.0 / (cells.columns * SIDE) as f32;
        let solid_angle = cells.solid_angle(row) / f64::from(SIDE * SIDE);
        for (index, (weight, brightest)) in (0..).zip(parts.weights.iter().zip(&parts.brightest)) {
            let [down, right] = [index / SIDE, index % SIDE];
            let upper = upper + height * f64::from(down);
            let left = column as f32 / cells.columns as f32 + right as f32 * width;
            let middle = environment_direction(left + 0.5 * width, (upper + 0.5 * height) as f32);
            let source = Source::Cell {
                across: [left, width],
                cosines: [upper as f32, (upper + height) as f32],
                solid_angle: solid_angle as f32,
            };
            let strongest = brightest * solid_angle * all_sides;
            self.add(source, weight * shown(middle.as_dvec3()), strongest, weight / solid_angle);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use photoncard_scene::{
        Environment, LightAxes, Material, PunctualKind, PunctualLight, SceneContents, Triangle,
    };

    /// A lamp of radiance 3 W/(sr m^2) and area 1/2 m^2, with the other contents.
    fn lamp(others: SceneContents) -> Sources {
        let lamp = Material { emission: Vec3::splat(3.0), ..Material::lambertian("lamp", Vec3::ZERO) };
        let triangles = vec![Triangle::new([Vec3::ZERO, Vec3::X, Vec3::Y], 0)];
        let scene = Scene::from(SceneContents { triangles, materials: vec![lamp], ..others });
        Sources::new(&scene, &Lights::new(&scene), None)
    }

    #[test]
    fn the_mean_radiance_is_weighted_by_power_and_infinite_with_a_light_without_an_area() {
        let alone = lamp(SceneContents::default()).radiance;
        assert_eq!(alone, SourceRadiance { mean: 3.0, greatest: 3.0 });
        let light = PunctualLight {
            name: "dim".into(),
            kind: PunctualKind::Point { position: Vec3::ZERO },
            intensity: Vec3::splat(1e-3),
            axes: LightAxes::default(),
        };
        let with_point = lamp(SceneContents { lights: vec![light], ..SceneContents::default() }).radiance;
        assert_eq!([with_point.mean, with_point.greatest], [f64::INFINITY; 2]);
        let environment = Some(Environment::constant(Vec3::ONE));
        let both = lamp(SceneContents { environment, ..SceneContents::default() });
        let of_lamp = 3.0 * 0.5 * std::f64::consts::PI / both.power;
        let SourceRadiance { mean, greatest } = both.radiance;
        assert!((mean - (3.0 * of_lamp + 1.0 - of_lamp)).abs() < 1e-5, "{mean}");
        assert!((0.1..0.9).contains(&of_lamp) && greatest == 3.0);
        let dark = Scene::default();
        let none = Sources::new(&dark, &Lights::new(&dark), None).radiance;
        assert_eq!([none.mean, none.greatest], [0.0; 2]);
    }

    #[test]
    fn sources_are_chosen_in_proportion_to_their_power() {
        let light = |intensity: f32| PunctualLight {
            name: "lamp".into(),
            kind: PunctualKind::Point { position: Vec3::ZERO },
            intensity: Vec3::splat(intensity),
            axes: LightAxes::default(),
        };
        let scene = Scene::from(SceneContents {
            lights: vec![light(1.0), light(3.0)],
            environment: Some(Environment::constant(Vec3::ZERO)),
            ..SceneContents::default()
        });
        let sources = Sources::new(&scene, &Lights::new(&scene), None);
        assert!((sources.power / (16.0 * std::f64::consts::PI) - 1.0).abs() < 1e-6);
        let at = |number: f64| sources.choose((number * 2.0_f64.powi(64)) as u64).expect("there are some");
        let first = at(0.2);
        assert_eq!(first.source, Source::Emitter(0));
        assert!((first.probability - 0.25).abs() < 1e-6 && (first.rest - 0.8).abs() < 1e-6, "{first:?}");
        let second = at(0.4);
        assert_eq!(second.source, Source::Emitter(1));
        assert!((second.rest - 0.2).abs() < 1e-6, "{second:?}");
        assert_eq!(at(0.999_999_999_9).source, Source::Emitter(1));
        let dark = Scene::default();
        assert!(Sources::new(&dark, &Lights::new(&dark), None).choose(7).is_none());
    }
}
