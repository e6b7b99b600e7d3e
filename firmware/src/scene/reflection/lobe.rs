//! Models of a lobe. Each has a module in this directory, and a case in [`Lobe`], [`super::Reflector`] and
//! [`super::PartialReflection`].

use glam::Vec3;

use super::ggx::GgxLobe;
use super::phong::PhongLobe;
use super::sheen::SheenLobe;

/// Phong, GGX or sheen lobe of a surface's reflection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Lobe {
    /// Phong lobe, as in Steinhurst's dissertation (2007) and in `extras.photoncard.phong` of a glTF
    /// material.
    Phong(PhongLobe),
    /// GGX lobe of glTF's metallic-roughness model.
    Ggx(GgxLobe),
    /// Sheen lobe of `KHR_materials_sheen`. Rays follow it; no photons are gathered for it.
    Sheen(SheenLobe),
}

impl Lobe {
    /// A lobe that reflects nothing.
    pub(super) const BLACK: Self = Self::Phong(PhongLobe::BLACK);

    #[inline(always)]
    pub(super) fn reflects(&self) -> bool {
        match self {
            Self::Phong(lobe) => lobe.reflects(),
            Self::Ggx(lobe) => lobe.reflects(),
            Self::Sheen(lobe) => lobe.reflects(),
        }
    }

    /// Albedo of the lobe: of a Phong lobe at normal incidence; of a GGX or sheen lobe for its outgoing
    /// direction.
    #[inline(always)]
    pub(super) fn albedo(&self) -> Vec3 {
        match self {
            Self::Phong(lobe) => lobe.albedo,
            Self::Ggx(lobe) => lobe.albedo,
            Self::Sheen(lobe) => lobe.albedo(),
        }
    }

    /// Multiplies `f` by a colour.
    #[inline(always)]
    pub(super) fn dimmed(self, colour: Vec3) -> Self {
        match self {
            Self::Phong(lobe) => Self::Phong(PhongLobe { albedo: lobe.albedo * colour, ..lobe }),
            Self::Ggx(lobe) => Self::Ggx(lobe.dimmed(colour)),
            Self::Sheen(lobe) => Self::Sheen(lobe.dimmed(colour)),
        }
    }
}
