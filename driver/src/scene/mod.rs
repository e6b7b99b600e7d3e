//! What a scene is once it is loaded: triangles, materials and cameras in world space.
//!
//! Right-handed, y up, metres; radiance in W/(sr m^2) per linear RGB channel.

pub mod gltf;
mod material;
mod settings;

use std::fmt::Write;

use glam::Vec3;
use photoncard_shared::checksum::Checksum;

pub use self::material::MAX_EXPONENT;
use crate::error::SceneError;

/// A scene in world space, every instance resolved.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Triangles of non-zero area, in file order, counter-clockwise seen from the front.
    pub triangles: Vec<Triangle>,
    /// Materials; the index in [`Triangle::material`] refers to this list.
    pub materials: Vec<Material>,
    /// Cameras in file order. Never empty: a file without one is framed.
    pub cameras: Vec<Camera>,
    /// What the file holds and this renderer does not use, one sentence each, each named once.
    pub notices: Vec<String>,
    /// Triangles of zero area that were left out.
    pub skipped_triangles: usize,
}

impl Scene {
    /// The smallest and the largest coordinates of any vertex; both zero for a scene without triangles.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let mut vertices = self.triangles.iter().flat_map(|triangle| triangle.vertices);
        let first = vertices.next().unwrap_or(Vec3::ZERO);
        vertices.fold((first, first), |(low, high), vertex| (low.min(vertex), high.max(vertex)))
    }

    /// A checksum of all that a render takes from the scene, as text.
    pub fn checksum(&self) -> String {
        let mut sum = Checksum::default();
        for triangle in &self.triangles {
            for vertex in triangle.vertices {
                vertex.to_array().iter().for_each(|coordinate| sum.update(&coordinate.to_le_bytes()));
            }
            sum.update(&triangle.material.to_le_bytes());
        }
        let mut text = String::new();
        // Floating-point numbers are written so that they read back the same.
        let _ = write!(text, "{:?}{:?}", self.materials, self.cameras);
        sum.update(text.as_bytes());
        format!("{:08x}", sum.value())
    }

    /// The camera of that name, or the first one.
    ///
    /// # Errors
    /// If there is none of that name; the error lists those there are.
    pub fn camera(&self, name: Option<&str>) -> Result<&Camera, SceneError> {
        let found = match name {
            None => self.cameras.first(),
            Some(name) => self.cameras.iter().find(|camera| camera.name == name),
        };
        found.ok_or_else(|| {
            let cameras: Vec<_> = self.cameras.iter().map(|camera| format!("'{}'", camera.name)).collect();
            SceneError::UnknownCamera {
                name: name.unwrap_or_default().to_owned(),
                cameras: cameras.join(", "),
            }
        })
    }

    /// Whether any triangle emits light.
    pub fn has_light(&self) -> bool {
        let is_light = |triangle: &Triangle| {
            self.materials.get(triangle.material as usize).is_some_and(Material::is_emissive)
        };
        self.triangles.iter().any(is_light)
    }

    /// Checks that the scene still has a light once settings were applied.
    ///
    /// # Errors
    /// [`SceneError::NoLight`].
    pub fn check_light(&self) -> Result<(), SceneError> {
        if self.has_light() { Ok(()) } else { Err(SceneError::NoLight { origin: "the scene".to_owned() }) }
    }
}

/// A triangle in world space, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// The three corners.
    pub vertices: [Vec3; 3],
    /// Index into [`Scene::materials`].
    pub material: u32,
}

impl Triangle {
    /// The cross product of two edges: its direction is the geometric normal's, its length twice the area in m^2.
    pub fn scaled_normal(&self) -> Vec3 {
        let [a, b, c] = self.vertices;
        (b - a).cross(c - a)
    }

    /// The area in m^2.
    pub fn area(&self) -> f32 {
        0.5 * self.scaled_normal().length()
    }
}

/// A Lambertian reflection with one Phong cosine lobe, and emission.
///
/// `f = diffuse / pi + specular (exponent + 2) / (2 pi) max(0, cos alpha)^exponent`, alpha measured from the mirror
/// direction.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// The name in the file, or `material N`.
    pub name: String,
    /// Lambertian albedo, 0 to 1.
    pub diffuse: Vec3,
    /// Albedo of the Phong lobe, 0 to 1.
    pub specular: Vec3,
    /// Exponent of the Phong lobe, at least 0.
    pub exponent: f32,
    /// Radiance emitted from the front, W/(sr m^2).
    pub emission: Vec3,
    /// Whether the back reflects and emits as the front does. A one-sided back is black.
    pub double_sided: bool,
}

/// A perspective camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// The name in the file, or `camera N`.
    pub name: String,
    /// The place of the pinhole.
    pub origin: Vec3,
    /// Unit vector to the right of the picture.
    pub right: Vec3,
    /// Unit vector to the top of the picture.
    pub up: Vec3,
    /// Unit vector of the view.
    pub forward: Vec3,
    /// Vertical field of view in radians; the horizontal one follows from the picture's aspect.
    pub vertical_fov: f32,
    /// Width over height, if the file states it.
    pub aspect: Option<f32>,
}
