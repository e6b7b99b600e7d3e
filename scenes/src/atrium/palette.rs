//! Materials of the atrium, all of them Lambertian.

use crate::builder::SceneBuilder;
use crate::material::Material;

/// Indices of the materials in the glTF file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Palette {
    pub(super) stone: usize,
    pub(super) trim: usize,
    pub(super) plaster: usize,
    pub(super) ochre: usize,
    pub(super) floor_light: usize,
    pub(super) floor_dark: usize,
    pub(super) terracotta: usize,
    pub(super) roof: usize,
    pub(super) wood: usize,
    pub(super) soil: usize,
    pub(super) leaves: usize,
    pub(super) water: usize,
    pub(super) glaze: usize,
    /// Cloths in red, green, blue and gold.
    pub(super) cloths: [usize; 4],
    pub(super) sky: usize,
    pub(super) sun: usize,
}

impl Palette {
    pub(super) fn new(scene: &mut SceneBuilder) -> Self {
        let mut diffuse = |name: &str, albedo: [f64; 3]| scene.material(&Material::diffuse(name, albedo));
        let palette = Self {
            stone: diffuse("stone", [0.64, 0.57, 0.46]),
            trim: diffuse("trim", [0.72, 0.67, 0.58]),
            plaster: diffuse("plaster", [0.76, 0.70, 0.60]),
            ochre: diffuse("ochre", [0.70, 0.47, 0.27]),
            floor_light: diffuse("floor-light", [0.66, 0.60, 0.51]),
            floor_dark: diffuse("floor-dark", [0.30, 0.24, 0.21]),
            terracotta: diffuse("terracotta", [0.55, 0.26, 0.15]),
            roof: diffuse("roof", [0.38, 0.20, 0.13]),
            wood: diffuse("wood", [0.30, 0.17, 0.09]),
            soil: diffuse("soil", [0.10, 0.07, 0.05]),
            leaves: diffuse("leaves", [0.12, 0.26, 0.07]),
            water: diffuse("water", [0.10, 0.26, 0.30]),
            glaze: diffuse("glaze", [0.12, 0.22, 0.45]),
            cloths: [0; 4],
            sky: 0,
            sun: 0,
        };
        let cloths = [
            ("cloth-red", [0.66, 0.06, 0.05]),
            ("cloth-green", [0.08, 0.38, 0.14]),
            ("cloth-blue", [0.07, 0.13, 0.50]),
            ("cloth-gold", [0.80, 0.54, 0.12]),
        ];
        let cloths =
            cloths.map(|(name, albedo)| scene.material(&Material::diffuse(name, albedo).double_sided()));
        let sky = scene.material(&Material::diffuse("sky", [0.0; 3]).emitting(SKY_RADIANCE));
        let sun = scene.material(&Material::diffuse("sun", [0.0; 3]).emitting(SUN_RADIANCE));
        Self { cloths, sky, sun, ..palette }
    }
}

const SKY_RADIANCE: [f64; 3] = [0.8, 1.1, 1.6];
const SUN_RADIANCE: [f64; 3] = [7000.0, 5600.0, 3800.0];
