//! Light groups from the command line: `key=Lamp,Spot`.

use std::collections::BTreeMap;

use photoncard_shared::budget::MAX_LIGHT_GROUPS;

use super::ENVIRONMENT;
use crate::error::SceneError;
use crate::light_groups::{LightGroups, LightSource, is_group_name};
use crate::nearest::nearest;
use crate::{Environment, Scene, SceneContents};

/// Name of the group of the sources that no request names.
const REST: &str = "rest";
/// Request of the groups that the file states.
const OF_FILE: &str = "file";

const FORM: &str = "write GROUP=SOURCE,SOURCE, where a source is a light, a material, an object or environment, for example \
                    key=Lamp,Spot; or file for the groups that the file states";
const GROUPS: &str =
    "there can be four groups, counting `rest` for light that none names; put more sources into one group";
const NAMES: &str = "give a group a name of letters, digits, spaces, - and _, up to 32 of them";

/// Groups that are being assigned, by the index of the source.
struct Assigned {
    names: Vec<String>,
    materials: Vec<Option<u8>>,
    objects: Vec<Option<u8>>,
    lights: Vec<Option<u8>>,
    environment: Option<u8>,
}

impl Scene {
    /// Sets the light groups: `GROUP=SOURCE,SOURCE`, where a source is the name of a punctual light, a
    /// material or an object, or `environment`; or `file` for the groups that the file states. Light of other
    /// sources is in the group `rest`, which is left out if four groups are named. An object's group takes
    /// precedence over that of its materials. The groups do not depend on what emits: an assignment may
    /// change that later. Without requests there are no groups.
    ///
    /// # Errors
    /// If a request is not of this form or names no source, there are more than [`MAX_LIGHT_GROUPS`] groups,
    /// or there are as many and a source of light is in none; the scene stays as it was.
    pub fn set_light_groups(&mut self, requests: &[String]) -> Result<(), SceneError> {
        if requests.is_empty() {
            if self.light_groups != LightGroups::default() {
                self.light_groups = LightGroups::default();
            }
            return Ok(());
        }
        let mut assigned = self.assigned(requests)?;
        let rest = if assigned.names.len() < MAX_LIGHT_GROUPS || self.has_other_light(&assigned) {
            assigned.group(&requests.join(" "), REST)?
        } else {
            0
        };
        let expands = self.groups_to_expand(&assigned);
        if expands.contains(&true) {
            *self = self.expanded(&expands);
        }
        self.split_by_object(&mut assigned);
        self.light_groups = assigned.finished(rest);
        Ok(())
    }

    /// Returns for each group of triangles whether its instances need materials by object: it emits, and an
    /// instance's object has a light group. Such instances are stored as triangles in any case.
    fn groups_to_expand(&self, assigned: &Assigned) -> Vec<bool> {
        let mut expands = vec![false; self.groups.len()];
        for instance in &self.instances {
            let group = instance.group as usize;
            let emits = || self.groups[group].iter().any(|triangle| self.emits(triangle));
            expands[group] |= assigned.of_object(instance.object).is_some() && emits();
        }
        expands
    }
}

impl SceneContents {
    fn assigned(&self, requests: &[String]) -> Result<Assigned, SceneError> {
        let mut assigned = Assigned {
            names: Vec::new(),
            materials: vec![None; self.materials.len()],
            objects: vec![None; self.objects.len()],
            lights: vec![None; self.lights.len()],
            environment: None,
        };
        for request in requests {
            if request.trim() == OF_FILE {
                self.assign_stated(&mut assigned, request)?;
                continue;
            }
            let (name, sources) =
                request.split_once('=').ok_or_else(|| fault(request, "there is no =", FORM))?;
            let group = assigned.group(request, name.trim())?;
            for source in sources.split(',').map(str::trim) {
                let found = self.sources(source);
                if found.is_empty() {
                    let known = nearest(source, self.source_names());
                    let reason = format!("no light source is called '{source}'; there are {known}");
                    return Err(fault(request, reason, FORM));
                }
                found.into_iter().for_each(|source| assigned.assign(source, group));
            }
        }
        Ok(assigned)
    }

    /// Assigns the groups that the file states.
    fn assign_stated(&self, assigned: &mut Assigned, request: &str) -> Result<(), SceneError> {
        if self.stated_light_groups.is_empty() {
            let remedy = "state extras such as {\"photoncard\": {\"light_group\": \"key\"}} on nodes or materials, or name the groups \
                          here";
            return Err(fault(request, "the file states no light groups", remedy));
        }
        for (source, name) in &self.stated_light_groups {
            let group = assigned.group(request, name.trim())?;
            assigned.assign(*source, group);
        }
        Ok(())
    }

    /// All sources of a name.
    fn sources(&self, name: &str) -> Vec<LightSource> {
        let called = |other: &str| other == name;
        let lights = (0..self.lights.len()).filter(|&index| called(&self.lights[index].name));
        let materials = (0..self.materials.len()).filter(|&index| called(&self.materials[index].name));
        let objects = (0..self.objects.len()).filter(|&index| called(&self.objects[index]));
        let environment =
            (name == ENVIRONMENT && self.environment.is_some()).then_some(LightSource::Environment);
        lights
            .map(LightSource::Light)
            .chain(materials.map(LightSource::Material))
            .chain(objects.map(LightSource::Object))
            .chain(environment)
            .collect()
    }

    /// Names of the lights, of the materials that emit, and of the environment.
    fn source_names(&self) -> impl Iterator<Item = &str> {
        let lights = self.lights.iter().map(|light| light.name.as_str());
        let emissive = self.materials.iter().filter(|material| material.is_emissive());
        let materials = emissive.map(|material| material.name.as_str());
        lights.chain(materials).chain(self.environment.as_ref().map(|_| ENVIRONMENT))
    }

    /// Returns whether a source of light is in no group.
    fn has_other_light(&self, assigned: &Assigned) -> bool {
        let is_other = |object: u32, material: u32| {
            let material = material as usize;
            self.materials[material].is_emissive()
                && assigned.of_object(object).is_none()
                && assigned.materials[material].is_none()
        };
        let triangles = self.triangles.iter().map(|triangle| (triangle.object, triangle.material));
        let of_instances = self.instances.iter().flat_map(|instance| {
            let group = self.groups[instance.group as usize].iter();
            group.map(|triangle| (instance.object, triangle.material))
        });
        let lights = self.lights.iter().zip(&assigned.lights);
        let mut lights = lights.filter(|(light, _)| light.intensity.max_element() > 0.0);
        let is_lit = self.environment.as_ref().is_some_and(Environment::is_lit);
        triangles.chain(of_instances).any(|(object, material)| is_other(object, material))
            || lights.any(|(_, group)| group.is_none())
            || is_lit && assigned.environment.is_none()
    }

    /// Gives the triangles of objects with a group copies of their materials, which are in this group.
    fn split_by_object(&mut self, assigned: &mut Assigned) {
        let Self { triangles, materials, .. } = self;
        let mut copies = BTreeMap::new();
        for triangle in triangles {
            let Some(group) = assigned.of_object(triangle.object) else { continue };
            let material = triangle.material;
            triangle.material = *copies.entry((material, group)).or_insert_with(|| {
                materials.push(materials[material as usize].clone());
                assigned.materials.push(Some(group));
                (materials.len() - 1) as u32
            });
        }
    }
}

impl Assigned {
    /// Index of the group of a name, which becomes the next one if it is new.
    fn group(&mut self, request: &str, name: &str) -> Result<u8, SceneError> {
        if let Some(known) = self.names.iter().position(|known| known == name) {
            return Ok(known as u8);
        }
        if !is_group_name(name) {
            return Err(fault(request, format!("'{name}' cannot be the name of a light group"), NAMES));
        }
        if self.names.len() == MAX_LIGHT_GROUPS {
            let reason = format!("'{name}' would be group number {}", MAX_LIGHT_GROUPS + 1);
            return Err(fault(request, reason, GROUPS));
        }
        self.names.push(name.to_owned());
        Ok((self.names.len() - 1) as u8)
    }

    fn assign(&mut self, source: LightSource, group: u8) {
        let (list, index) = match source {
            LightSource::Material(index) => (&mut self.materials, index),
            LightSource::Object(index) => (&mut self.objects, index),
            LightSource::Light(index) => (&mut self.lights, index),
            LightSource::Environment => {
                self.environment = Some(group);
                return;
            }
        };
        if let Some(entry) = list.get_mut(index) {
            *entry = Some(group);
        }
    }

    fn of_object(&self, object: u32) -> Option<u8> {
        self.objects.get(object as usize).copied().flatten()
    }

    /// Groups in the order of their names, in which a file's reader adds them up. Sources without a group are
    /// in `rest`.
    fn finished(self, rest: u8) -> LightGroups {
        let mut names = self.names.clone();
        names.sort();
        let place = |group: Option<u8>| {
            let name = self.names.get(group.unwrap_or(rest) as usize);
            names.iter().position(|sorted| Some(sorted) == name).unwrap_or(0) as u8
        };
        LightGroups {
            of_materials: self.materials.iter().copied().map(place).collect(),
            of_lights: self.lights.iter().copied().map(place).collect(),
            of_environment: place(self.environment),
            names,
        }
    }
}

fn fault(request: &str, reason: impl Into<String>, remedy: &'static str) -> SceneError {
    let assignment = format!("--light-groups {request}");
    SceneError::Setting { assignment, reason: reason.into(), remedy }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::{Instance, LightAxes, Material, PunctualKind, PunctualLight, Triangle};

    /// Two objects of one lamp material, a wall, a point light and a sky.
    fn scene() -> Scene {
        let lamp = Material { emission: Vec3::ONE, ..Material::lambertian("lamp", Vec3::ZERO) };
        let triangle =
            |material, object| Triangle { object, ..Triangle::new([Vec3::ZERO, Vec3::X, Vec3::Y], material) };
        Scene::from(SceneContents {
            materials: vec![Material::lambertian("wall", Vec3::ONE), lamp],
            objects: vec!["left".into(), "right".into(), "room".into()],
            triangles: vec![triangle(1, 0), triangle(1, 1), triangle(0, 2), triangle(0, 1)],
            lights: vec![PunctualLight {
                name: "spot".into(),
                kind: PunctualKind::Point { position: Vec3::ZERO },
                intensity: Vec3::ONE,
                axes: LightAxes::default(),
            }],
            environment: Some(Environment::constant(Vec3::ONE)),
            ..SceneContents::default()
        })
    }

    fn set(requests: &[&str]) -> Result<Scene, String> {
        let mut scene = scene();
        let requests: Vec<String> = requests.iter().map(|&request| request.to_owned()).collect();
        scene.set_light_groups(&requests).map_err(|error| error.to_string())?;
        Ok(scene)
    }

    /// Group of each source: those of the emissive triangles, of the light and of the environment.
    fn groups(scene: &Scene) -> Vec<&str> {
        let groups = &scene.light_groups;
        let lamps = scene.triangles.iter().map(|triangle| triangle.material as usize);
        let lamps = lamps.filter(|&material| scene.materials[material].is_emissive());
        let all = lamps.map(|material| groups.of_material(material));
        let all = all.chain([groups.of_light(0), groups.of_environment()]);
        all.map(|group| groups.names()[group as usize].as_str()).collect()
    }

    #[test]
    fn sources_are_found_by_the_names_of_lights_materials_and_objects() {
        for (requests, expected) in [
            (&["key=lamp"][..], ["key", "key", "rest", "rest"]),
            (&["key=left", "fill=spot,right", "sky=environment"], ["key", "fill", "fill", "sky"]),
            (&["all=lamp,spot,environment", "one=right"], ["all", "one", "all", "all"]),
            (&["a=left", "b=right", "c=spot", "d=environment"], ["a", "b", "c", "d"]),
            (&["rest=spot"], ["rest"; 4]),
        ] {
            assert_eq!(groups(&set(requests).unwrap()), expected, "{requests:?}");
        }
    }

    #[test]
    fn a_scene_without_requests_has_no_groups_and_its_own_checksum() {
        let plain = scene();
        assert_eq!(set(&[]).unwrap().checksum(), plain.checksum());
        let one = set(&["key=lamp"]).unwrap();
        assert_ne!(one.checksum(), plain.checksum());
        assert_ne!(one.checksum(), set(&["key=spot"]).unwrap().checksum());
        let mut back = one;
        back.set_light_groups(&[]).unwrap();
        assert_eq!(back.light_groups, LightGroups::default());
    }

    #[test]
    fn groups_that_the_file_states_are_taken_on_request() {
        let mut scene = scene();
        let stated = [(LightSource::Light(0), "fill"), (LightSource::Material(1), "key")];
        scene.stated_light_groups = stated.map(|(source, name)| (source, name.to_owned())).into();
        scene.set_light_groups(&["file".to_owned()]).unwrap();
        assert_eq!(groups(&scene), ["key", "key", "fill", "rest"]);
    }

    #[test]
    fn groups_do_not_depend_on_what_emits() {
        let mut dark = scene();
        dark.materials[1].emission = Vec3::ZERO;
        for requests in [&["key=lamp".to_owned()][..], &["key=right".to_owned(), "wall=wall".to_owned()]] {
            let mut lit = scene();
            lit.set_light_groups(requests).unwrap();
            let mut later = dark.clone();
            later.set_light_groups(requests).unwrap();
            assert_eq!(later.light_groups, lit.light_groups);
        }
    }

    #[test]
    fn instances_of_an_object_have_its_group() {
        let mut scene = scene().with(|scene| {
            let [left, right] = [0, 1].map(|object| {
                let to_world = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
                Instance { group: 0, object, to_world, to_group: to_world }
            });
            scene.groups = vec![scene.triangles.drain(..1).collect()];
            scene.triangles.clear();
            scene.instances = vec![left, right];
        });
        scene.set_light_groups(&["key=right".to_owned()]).unwrap();
        assert_eq!(groups(&scene), ["rest", "key", "rest", "rest"]);
    }

    #[test]
    fn impossible_requests_are_refused() {
        for (requests, reason) in [
            (&["key"][..], "no ="),
            (&["key=lanp"], "'lamp'"),
            (&["key=roof"], "no light source"),
            (&["a.b=lamp"], "cannot be the name"),
            (&["=lamp"], "cannot be the name"),
            (&["file"], "states no light groups"),
            (&["a=left", "b=right", "c=spot", "d=environment", "e=lamp"], "number 5"),
            (&["a=left", "b=wall", "c=spot", "d=environment"], "'rest' would be group number 5"),
        ] {
            let error = set(requests).unwrap_err();
            assert!(error.contains(reason), "{requests:?}: {error}");
        }
    }
}
