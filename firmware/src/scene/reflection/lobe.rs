//! The models of a lobe. A model is a file beside this one, and a case here, in [`super::Reflector`] and in
//! [`super::PartialReflection`].

use glam::Vec3;

use super::ggx::GgxLobe;
use super::phong::PhongLobe;
use super::sheen::SheenLobe;

/// A lobe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Lobe {
    /// The dissertation's, and that of `extras.photoncard.phong`.
    Phong(PhongLobe),
    /// glTF's metallic-roughness model.
    Ggx(GgxLobe),
    /// `KHR_materials_sheen`. Rays follow it always.
    Sheen(SheenLobe),
}

impl Lobe {
    /// A lobe that reflects nothing.
    pub(super) const BLACK: Self = Self::Phong(PhongLobe::BLACK);

    /// `true` if some light is reflected.
    #[inline(always)]
    pub(super) fn reflects(&self) -> bool {
        match self {
            Self::Phong(lobe) => lobe.reflects(),
            Self::Ggx(lobe) => lobe.reflects(),
            Self::Sheen(lobe) => lobe.reflects(),
        }
    }

    /// The albedo: of a Phong lobe at normal incidence, of a GGX lobe seen from its direction.
    #[inline(always)]
    pub(super) fn albedo(&self) -> Vec3 {
        match self {
            Self::Phong(lobe) => lobe.albedo,
            Self::Ggx(lobe) => lobe.albedo,
            Self::Sheen(lobe) => lobe.albedo(),
        }
    }

    /// `f` times a colour.
    #[inline(always)]
    pub(super) fn dimmed(self, colour: Vec3) -> Self {
        match self {
            Self::Phong(lobe) => Self::Phong(PhongLobe { albedo: lobe.albedo * colour, ..lobe }),
            Self::Ggx(lobe) => Self::Ggx(lobe.dimmed(colour)),
            Self::Sheen(lobe) => Self::Sheen(lobe.dimmed(colour)),
        }
    }
}
