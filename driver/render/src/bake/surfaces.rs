//! Surfaces that take lightmaps: triangles of the scene in world space, by object and material.

use glam::{DVec2, Vec2, Vec3};
use photoncard_scene::{Material, Reflection, Scene, Triangle, VertexAttributes};

use super::error::BakeError;

/// Number of names that an error lists.
const NAMED: usize = 8;

/// Triangles of one object that have one material.
#[derive(Clone, Debug, PartialEq)]
pub struct Primitive {
    /// Index into [`SceneContents::objects`](photoncard_scene::SceneContents::objects).
    pub object: u32,
    /// Index into [`SceneContents::materials`](photoncard_scene::SceneContents::materials).
    pub material: u32,
    /// Indices of the triangles in [`Surfaces::scene`], ascending.
    pub triangles: Vec<u32>,
    /// True if the primitive takes a lightmap.
    pub is_baked: bool,
}

/// Scene without instances, and its primitives.
pub struct Surfaces {
    /// The scene; every triangle is in world space.
    pub scene: Scene,
    /// Primitives in the order of objects, then of materials.
    pub primitives: Vec<Primitive>,
}

impl Surfaces {
    /// Collects the surfaces of a scene. Objects of the names `objects` take lightmaps, all if there are no
    /// names, except for glass and for metals without emission, whose light is not that of a diffuse surface.
    /// Surfaces that cameras do not see are left out.
    ///
    /// # Errors
    /// If a name is unknown, or nothing takes a lightmap.
    pub fn new(scene: &Scene, objects: &[String]) -> Result<Self, BakeError> {
        if let Some(name) = objects.iter().find(|name| !scene.objects.contains(name)) {
            let mut names: Vec<&str> = scene.objects.iter().map(String::as_str).collect();
            names.sort_unstable();
            names.dedup();
            let more = if names.len() > NAMED { ", ..." } else { "" };
            names.truncate(NAMED);
            let remedy = format!("give --object one of: {}{more}", names.join(", "));
            return Err(BakeError::UnknownObject { name: name.clone(), remedy });
        }
        let scene = scene.expanded(&vec![true; scene.groups.len()]);
        let mut order: Vec<(u32, u32, u32)> = (0..)
            .zip(&scene.triangles)
            .map(|(index, triangle)| (triangle.object, triangle.material, index))
            .collect();
        order.sort_unstable();
        let of_chunk = |chunk: &[(u32, u32, u32)]| {
            let &(object, material, _) = chunk.first()?;
            let finish = scene.materials.get(material as usize).filter(|finish| finish.visibility.camera)?;
            let is_named = || scene.objects.get(object as usize).is_some_and(|name| objects.contains(name));
            let is_baked = (objects.is_empty() || is_named()) && is_diffuse(finish);
            let triangles = chunk.iter().map(|&(.., index)| index).collect();
            Some(Primitive { object, material, triangles, is_baked })
        };
        let chunks = order.chunk_by(|one, other| (one.0, one.1) == (other.0, other.1));
        let primitives: Vec<Primitive> = chunks.filter_map(of_chunk).collect();
        if !primitives.iter().any(|primitive| primitive.is_baked) {
            return Err(BakeError::Nothing);
        }
        Ok(Self { scene, primitives })
    }

    /// Primitives that take a lightmap, with their indices.
    pub fn baked(&self) -> impl Iterator<Item = (u32, &Primitive)> {
        (0..).zip(&self.primitives).filter(|(_, primitive)| primitive.is_baked)
    }

    /// Name of an object.
    pub fn name(&self, object: u32) -> &str {
        self.scene.objects.get(object as usize).map_or("", String::as_str)
    }

    /// Triangle of an index in [`Primitive::triangles`].
    pub fn triangle(&self, index: u32) -> Triangle {
        let absent = Triangle::new([Vec3::ZERO; 3], 0);
        self.scene.triangles.get(index as usize).copied().unwrap_or(absent)
    }

    /// Attributes of a triangle's corners.
    pub fn attributes(&self, triangle: &Triangle) -> &VertexAttributes {
        self.scene.attributes.get(triangle.attributes as usize).unwrap_or(&VertexAttributes::NONE)
    }

    /// Unit normals of the corners of a triangle, on its front side.
    pub fn normals(&self, triangle: &Triangle) -> [Vec3; 3] {
        let face = triangle.scaled_normal().normalize_or_zero();
        self.attributes(triangle).normals.map_or([face; 3], |normals| {
            normals.map(|normal| if normal.dot(face) > 0.0 { normal } else { face })
        })
    }

    /// Texture coordinates of a triangle's corners in set 0 or 1.
    pub fn coordinates(&self, triangle: &Triangle, set: usize) -> Option<[DVec2; 3]> {
        let attributes = self.scene.attributes.get(triangle.attributes as usize)?;
        Some(attributes.coordinates.get(set)?.map(Vec2::as_dvec2))
    }
}

/// Returns whether a surface shows light that a lightmap can hold: it reflects diffusely, or emits.
fn is_diffuse(material: &Material) -> bool {
    if material.is_emissive() {
        return true;
    }
    match material.reflection {
        Reflection::Phong { .. } => true,
        Reflection::MetallicRoughness { metallic, transmission, .. } => {
            material.may_be_dielectric(metallic)
                && transmission.is_none_or(|transmission| transmission.factor == 0.0)
        }
    }
}
