//! Models of a lobe. Each model is a file in this directory and a case of the enum [`Lobe`], of
//! [`super::Reflector`] and of [`super::PartialReflection`].

use glam::Vec3;

use super::ggx::GgxLobe;
use super::phong::PhongLobe;
use super::sheen::SheenLobe;

/// A lobe of one of the models.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Lobe {
    /// Phong lobe of the dissertation and of `extras.photoncard.phong`.
    Phong(PhongLobe),
    /// GGX lobe of glTF's metallic-roughness model.
    Ggx(GgxLobe),
    /// Sheen lobe of `KHR_materials_sheen`. Rays always follow it.
    Sheen(SheenLobe),
}

impl Lobe {
    /// A lobe that reflects nothing.
    pub(super) const BLACK: Self = Self::Phong(PhongLobe::BLACK);

    /// Returns true if the lobe reflects any light.
    #[inline(always)]
    pub(super) fn reflects(&self) -> bool {
        match self {
            Self::Phong(lobe) => lobe.reflects(),
            Self::Ggx(lobe) => lobe.reflects(),
            Self::Sheen(lobe) => lobe.reflects(),
        }
    }

    /// Albedo: of a Phong lobe at normal incidence, of other lobes for their outgoing direction.
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
