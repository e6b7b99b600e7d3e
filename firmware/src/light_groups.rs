//! Light by light group.
//!
//! A light, an emissive material and the environment belong to a light group, and photons carry the group of
//! their light. A frame states how many groups it separates. Each group's light is then summed on its own, so
//! that a host can mix the groups after the render.

use core::ops::{AddAssign, Div, Mul};

use glam::Vec3;
use photoncard_shared::budget::MAX_LIGHT_GROUPS;
use photoncard_shared::message::FrameParameters;

/// Light groups that a frame separates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LightGroups {
    last: u8,
}

impl LightGroups {
    /// One group with all light.
    pub const ONE: Self = Self { last: 0 };

    /// Groups of a frame, at least one.
    #[inline(always)]
    pub fn of(frame: &FrameParameters) -> Self {
        Self { last: frame.light_groups.saturating_sub(1).min(MAX_LIGHT_GROUPS as u8 - 1) }
    }

    /// Number of groups, 1 to [`MAX_LIGHT_GROUPS`].
    #[inline(always)]
    pub fn count(self) -> usize {
        self.last as usize + 1
    }

    /// Returns true if there is one group.
    #[inline(always)]
    pub fn is_one(self) -> bool {
        self.last == 0
    }

    /// Index of the frame's group for the group of a light.
    #[inline(always)]
    pub fn index(self, of_light: u8) -> usize {
        of_light.min(self.last) as usize
    }

    /// Light of a light's group.
    #[inline(always)]
    pub fn light(self, of_light: u8, light: Vec3) -> GroupedLight {
        let mut all = GroupedLight::NONE;
        all.add(self.index(of_light), light);
        all
    }
}

/// Light by group: the groups of a frame, and no light in the others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroupedLight([Vec3; MAX_LIGHT_GROUPS]);

impl GroupedLight {
    /// No light.
    pub const NONE: Self = Self([Vec3::ZERO; MAX_LIGHT_GROUPS]);

    /// Light of each group by its index.
    #[inline(always)]
    pub fn of_groups(groups: LightGroups, mut light: impl FnMut(usize) -> Vec3) -> Self {
        let mut all = Self::NONE;
        for (group, of_group) in all.0.iter_mut().enumerate().take(groups.count()) {
            *of_group = light(group);
        }
        all
    }

    /// Adds light to the group with index `group`.
    #[inline(always)]
    pub fn add(&mut self, group: usize, light: Vec3) {
        if let Some(sum) = self.0.get_mut(group) {
            *sum += light;
        }
    }

    /// Light of each group.
    #[inline(always)]
    pub fn groups(&self, groups: LightGroups) -> impl Iterator<Item = Vec3> {
        self.0.iter().copied().take(groups.count())
    }

    /// Light of the group with index `group`.
    #[inline(always)]
    pub fn of_group(&self, group: usize) -> Vec3 {
        self.0.get(group).copied().unwrap_or(Vec3::ZERO)
    }

    /// Light of all groups.
    #[inline(always)]
    pub fn total(&self, groups: LightGroups) -> Vec3 {
        let [first, rest @ ..] = self.0;
        if groups.is_one() { first } else { rest.into_iter().fold(first, |sum, light| sum + light) }
    }

    /// Returns true if no group has light.
    #[inline(always)]
    pub fn is_none(&self) -> bool {
        self.0.iter().all(|&light| light == Vec3::ZERO)
    }
}

impl Mul<Vec3> for GroupedLight {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: Vec3) -> Self {
        Self(self.0.map(|light| light * factor))
    }
}

impl Mul<f32> for GroupedLight {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factor: f32) -> Self {
        Self(self.0.map(|light| light * factor))
    }
}

impl Div<f32> for GroupedLight {
    type Output = Self;

    #[inline(always)]
    fn div(self, divisor: f32) -> Self {
        Self(self.0.map(|light| light / divisor))
    }
}

impl AddAssign for GroupedLight {
    #[inline(always)]
    fn add_assign(&mut self, more: Self) {
        self.0.iter_mut().zip(more.0).for_each(|(sum, light)| *sum += light);
    }
}
