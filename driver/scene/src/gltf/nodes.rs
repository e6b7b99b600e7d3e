//! Nodes of a scene: world transforms, and conversion of their meshes, lights and cameras.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use glam::DMat4;
use serde::Deserialize;

use super::accessor::Source;
use super::animation::Poses;
use super::camera::CameraPlacer;
use super::document::Document;
use super::extent::Anchor;
use super::extras;
use super::instances::Instances;
use super::lamps::AreaLight;
use super::light::LightPlacer;
use super::mesh::MeshPlacer;
use super::names::object_name;
use super::notices::Notices;
use super::pose::Pose;
use super::profiles::Profiles;
use super::room::Room;
use super::skin::Skin;
use super::transform;
use crate::error::SceneError;
use crate::light_groups::LightSource;
use crate::{Camera, LightUnits, Scene, SceneContents};

/// Maximum depth of the node hierarchy.
const MAX_DEPTH: usize = 1024;

/// Adds the meshes, lights and cameras of the scene's nodes to `scene`. `poses` has the animated nodes, and
/// `units` are the units of the lights' intensities. `anchor` caches the offset of the scene's origin, which
/// is computed from the scene without animations.
///
/// All triangles are counted before the first is added.
pub(super) fn place(
    source: &Source<'_>,
    poses: &Poses,
    units: LightUnits,
    anchor: &OnceLock<Anchor>,
    scene: &mut Scene,
    room: &mut Room,
    notices: &mut Notices,
) -> Result<(), SceneError> {
    let document = source.document;
    let nodes = walk(document, poses, None)?;
    let mut placer = Placer {
        source,
        poses,
        meshes: MeshPlacer::new(source),
        cameras: CameraPlacer::new(document),
        lights: LightPlacer::new(document, units),
        profiles: Profiles::new(source),
        skins: BTreeMap::new(),
        worlds: Vec::new(),
        hidden: BTreeMap::new(),
    };
    scene.is_in_watts = placer.lights.are_in_watts();
    nodes.iter().try_for_each(|(index, world)| placer.count(*index, world, scene))?;
    placer.meshes.choose_groups(scene);
    placer.meshes.check_room(room)?;
    let nodes = walk(document, poses, Some(placer.anchor(anchor, scene)?))?;
    placer.worlds = vec![None; document.root.nodes.len()];
    nodes.iter().for_each(|&(index, world)| placer.worlds[index] = Some(world));
    nodes.into_iter().try_for_each(|(index, world)| placer.place(index, world, scene, notices))?;
    notices.not_finite = placer.meshes.not_finite;
    notices.incomplete = placer.meshes.incomplete;
    Ok(())
}

/// Cameras of the scene's nodes in the poses `poses`. Positions are relative to the scene's origin or,
/// without `anchor`, to the file's.
pub(super) fn cameras(
    document: &Document,
    poses: &Poses,
    anchor: Option<&Anchor>,
) -> Result<Vec<Camera>, SceneError> {
    let mut placer = CameraPlacer::new(document);
    let mut scene = Scene::default();
    for (index, world) in walk(document, poses, anchor)? {
        if let Some(camera) = document.root.nodes[index].camera {
            placer.place(camera.value(), index, &world, &mut scene)?;
        }
    }
    Ok(std::mem::take(&mut scene.cameras))
}

/// Properties of a node under the key `photoncard` of its `extras`. Others are ignored: an object of Blender
/// may have those of its camera.
#[derive(Default, Deserialize)]
struct Extras {
    /// Light group of the node's light, and of the emission of its mesh.
    light_group: Option<String>,
    /// Photometric file of the node's light: a path beside the scene, or a data URI.
    ies: Option<String>,
    /// Area light of the node.
    area_light: Option<AreaLight>,
    /// Visibility of the node's mesh to eye rays; `None` for true.
    camera: Option<bool>,
}

/// A source with the light group that is stated for it, if any.
fn of_group(stated: &Option<String>, source: LightSource) -> Option<(LightSource, String)> {
    Some((source, stated.clone()?))
}

struct Placer<'a> {
    source: &'a Source<'a>,
    poses: &'a Poses,
    meshes: MeshPlacer<'a>,
    cameras: CameraPlacer<'a>,
    lights: LightPlacer<'a>,
    profiles: Profiles<'a>,
    skins: BTreeMap<usize, Skin>,
    /// World transform of every node; `None` for nodes outside the scene.
    worlds: Vec<Option<DMat4>>,
    /// Copies of materials, by the index of the material, that eye rays pass.
    hidden: BTreeMap<u32, u32>,
}

impl<'a> Placer<'a> {
    /// Counts the copies of a node's mesh.
    fn count(&mut self, index: usize, world: &DMat4, scene: &mut Scene) -> Result<(), SceneError> {
        let node = &self.source.document.root.nodes[index];
        let Some(mesh) = node.mesh.map(|mesh| mesh.value()) else { return Ok(()) };
        if self.extras(index)?.camera == Some(false) {
            self.meshes.keep_apart(mesh);
        }
        // The limit is on the instances' triangles and primitives, of which an empty mesh has none.
        if !self.meshes.has_triangles(mesh, scene)? {
            return Ok(());
        }
        let instances = match node.skin {
            Some(_) => None,
            None => Instances::of(self.source, index, node)?,
        };
        let Some(instances) = instances else {
            return self.meshes.count(mesh, 1, std::iter::once(Ok(*world)));
        };
        let transforms = (0..instances.count).map(|instance| instances.transform(self.source, instance));
        self.meshes.count(mesh, instances.count, transforms.map(|local| Ok(*world * local?)))
    }

    /// Offset of the scene's origin, computed on first use from the scene without animations.
    fn anchor<'o>(
        &mut self,
        found: &'o OnceLock<Anchor>,
        scene: &mut Scene,
    ) -> Result<&'o Anchor, SceneError> {
        if found.get().is_none() {
            let nodes = walk(self.source.document, &Poses::new(), None)?;
            let anchor = Anchor::of(self.source, &mut self.meshes, &nodes, scene)?;
            return Ok(found.get_or_init(|| anchor));
        }
        Ok(found.get_or_init(Anchor::default))
    }

    fn place(
        &mut self,
        index: usize,
        world: DMat4,
        scene: &mut Scene,
        notices: &mut Notices,
    ) -> Result<(), SceneError> {
        let document = self.source.document;
        let node = &document.root.nodes[index];
        let Extras { light_group: stated, ies, area_light, camera } = self.extras(index)?;
        let [objects, triangles] = [scene.objects.len(), scene.triangles.len()];
        if let Some(mesh) = node.mesh {
            scene.objects.push(object_name(&document.root, index));
            let weights = self.weights(index, mesh.value());
            match node.skin {
                Some(skin) => self.place_skinned((mesh.value(), weights), skin.value(), world, scene)?,
                None => self.place_mesh((mesh.value(), weights), index, world, scene)?,
            }
            if camera == Some(false) {
                self.hide(triangles, scene);
            }
        }
        if let Some(light) = area_light {
            let name = object_name(&document.root, index);
            light.place(document, index, (&name, &world), scene)?;
        }
        if let Some(camera) = node.camera {
            self.cameras.place(camera.value(), index, &world, scene)?;
        }
        let lights = scene.lights.len();
        let extensions = node.extensions.as_ref();
        if let Some(light) = extensions.and_then(|extensions| extensions.khr_lights_punctual.as_ref()) {
            let light = (light.light.value(), ies.is_some());
            self.lights.place(light, index, &world, scene, notices)?;
            // A spot light whose outer cone has no angle is left out.
            if let Some(uri) = ies.filter(|_| scene.lights.len() > lights) {
                self.profiles.assign((&uri, index), lights, scene)?;
            }
        }
        self.profiles.place(index, &world, scene)?;
        let objects = (objects..scene.objects.len()).map(LightSource::Object);
        let added = objects.chain((lights..scene.lights.len()).map(LightSource::Light));
        scene.stated_light_groups.extend(added.filter_map(|light| of_group(&stated, light)));
        Ok(())
    }

    /// Light group and photometric file that a node states in its `extras`.
    fn extras(&self, index: usize) -> Result<Extras, SceneError> {
        let document = self.source.document;
        let stated = extras::read(&document.root.nodes[index].extras).map_err(|reason| {
            let remedy = r#"docs/extras.md has the keys, such as {"photoncard": {"light_group": "key"}}"#;
            document.invalid(format!("nodes[{index}].extras.photoncard"), reason, remedy)
        })?;
        Ok(stated.unwrap_or_default())
    }

    /// Gives the triangles from index `first` on copies of their materials, which eye rays pass.
    fn hide(&mut self, first: usize, scene: &mut Scene) {
        let SceneContents { triangles, materials, .. } = &mut **scene;
        for triangle in &mut triangles[first..] {
            triangle.material = *self.hidden.entry(triangle.material).or_insert_with_key(|&material| {
                let mut copy = materials[material as usize].clone();
                copy.visibility.camera = false;
                materials.push(copy);
                (materials.len() - 1) as u32
            });
        }
    }

    /// Weights of the morph targets of a node's mesh: those of the pose, else of the node, else of the mesh.
    fn weights(&self, node: usize, mesh: usize) -> &'a [f32] {
        let root = &self.source.document.root;
        let posed = self.poses.get(&node).and_then(|pose| pose.weights.as_ref());
        let stated = [posed, root.nodes[node].weights.as_ref(), root.meshes[mesh].weights.as_ref()];
        stated.into_iter().flatten().next().map_or(&[], Vec::as_slice)
    }

    fn place_mesh(
        &mut self,
        (mesh, weights): (usize, &[f32]),
        node: usize,
        world: DMat4,
        scene: &mut Scene,
    ) -> Result<(), SceneError> {
        if !self.meshes.has_triangles(mesh, scene)? {
            return Ok(());
        }
        let instances = Instances::of(self.source, node, &self.source.document.root.nodes[node])?;
        let Some(instances) = instances else {
            return self.meshes.place(mesh, &Pose::new(world, None, weights), scene);
        };
        for instance in 0..instances.count {
            let local = instances.transform(self.source, instance)?;
            self.meshes.place(mesh, &Pose::new(world * local, None, weights), scene)?;
        }
        Ok(())
    }

    fn place_skinned(
        &mut self,
        (mesh, weights): (usize, &[f32]),
        skin: usize,
        world: DMat4,
        scene: &mut Scene,
    ) -> Result<(), SceneError> {
        if !self.skins.contains_key(&skin) {
            self.skins.insert(skin, Skin::new(self.source, skin, &self.worlds)?);
        }
        self.meshes.place(mesh, &Pose::new(world, self.skins.get(&skin), weights), scene)
    }
}

/// Nodes of the file's default scene, or of its first one, with their world transforms; parents come before
/// children. The transforms are relative to the scene's origin or, without `anchor`, to the file's.
fn walk(
    document: &Document,
    poses: &Poses,
    anchor: Option<&Anchor>,
) -> Result<Vec<(usize, DMat4)>, SceneError> {
    let root = &document.root;
    let chosen = root.scene.map_or(0, |scene| scene.value());
    let Some(chosen) = root.scenes.get(chosen) else {
        return Err(SceneError::NoScene { file: document.path.clone() });
    };
    let mut placed = Vec::new();
    let mut seen = vec![false; root.nodes.len()];
    // Stack of nodes with the transform of the parent and the depth.
    let mut open: Vec<_> = chosen.nodes.iter().rev().map(|node| (node.value(), DMat4::IDENTITY, 0)).collect();
    while let Some((index, parent, depth)) = open.pop() {
        let fault = |reason, remedy| Err(document.invalid(format!("nodes[{index}]"), reason, remedy));
        if std::mem::replace(&mut seen[index], true) {
            let reason = "the node is reached twice: it has two parents, or is its own descendant";
            return fault(reason, "give every node one parent; a mesh may be shown by several nodes instead");
        }
        if depth > MAX_DEPTH {
            let reason = format!("the node lies more than {MAX_DEPTH} levels deep");
            let remedy = "flatten the hierarchy of nodes";
            return Err(document.invalid(format!("nodes[{index}]"), reason, remedy));
        }
        let node = &root.nodes[index];
        let Some(local) = transform::local(node, poses.get(&index)) else {
            let reason =
                "the transform is not finite, or does not keep parallels parallel, or has a zero rotation";
            return fault(reason, "give the node a finite translation, rotation and scale");
        };
        let is_posed = poses.get(&index).is_some_and(|pose| pose.translation.is_some());
        let placed_local = anchor.map(|anchor| anchor.placed(index, local, is_posed, depth == 0));
        let world = parent * placed_local.unwrap_or(local);
        placed.push((index, world));
        let children = node.children.iter().flatten().rev();
        open.extend(children.map(|child| (child.value(), world, depth + 1)));
    }
    Ok(placed)
}
