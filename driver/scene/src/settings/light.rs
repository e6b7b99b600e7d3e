//! Assignments to punctual lights and to the environment.

use std::ops::RangeInclusive;

use glam::Vec3;

use crate::light::DISK_DEGREES;
use crate::limits::{BRIGHTEST, EMISSION};
use crate::out_of_range::every;
use crate::{Environment, PunctualKind, PunctualLight};

/// Reason why a value is refused, and remedy.
pub(super) type Refusal = (&'static str, &'static str);

/// Property of a light that can be assigned.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum LightProperty {
    Colour,
    Intensity,
    Position,
    Angle,
}

/// Range of a light's coordinates relative to the scene's origin, metres.
const PLACES: RangeInclusive<f32> = -1e15..=1e15;

impl LightProperty {
    pub(super) const ALL: [(&str, Self); 4] = [
        ("colour", Self::Colour),
        ("intensity", Self::Intensity),
        ("position", Self::Position),
        ("angle", Self::Angle),
    ];
}

impl PunctualLight {
    /// Splits the intensity into a colour whose greatest channel is 1, and the intensity of that channel. A
    /// light of intensity 0 counts as white.
    pub fn colour(&self) -> (Vec3, f32) {
        let greatest = self.intensity.max_element();
        if greatest > 0.0 { (self.intensity / greatest, greatest) } else { (Vec3::ONE, 0.0) }
    }

    /// Sets a property.
    ///
    /// # Errors
    /// Reason and remedy, if the light lacks the property or the value is impossible.
    pub(super) fn assign(&mut self, property: LightProperty, values: &[f32]) -> Result<(), Refusal> {
        let (colour, intensity) = self.colour();
        match (property, values) {
            (LightProperty::Intensity, &[value]) => {
                if !(value == 0.0 || EMISSION.contains(&value)) {
                    return Err(("no light has this intensity", "an intensity is 0, or 1e-20 to 1e20"));
                }
                self.intensity = colour * value;
            }
            (LightProperty::Intensity, _) => {
                return Err((
                    "the intensity is one number",
                    "set the colour apart, such as bulb.colour=1,0.8,0.6",
                ));
            }
            (LightProperty::Colour, _) => self.intensity = hue(values)? * intensity,
            (LightProperty::Position, &[x, y, z]) => self.move_to(Vec3::new(x, y, z))?,
            (LightProperty::Position, _) => {
                return Err((
                    "the position is three numbers",
                    "write X,Y,Z in metres, such as bulb.position=0,2,1",
                ));
            }
            (LightProperty::Angle, _) => self.spread_over(values)?,
        }
        Ok(())
    }

    fn spread_over(&mut self, values: &[f32]) -> Result<(), Refusal> {
        let &[degrees] = values else {
            return Err((
                "the angle is one number",
                "write the degrees across the disk, such as sun.angle=0.53",
            ));
        };
        let PunctualKind::Directional { angle, .. } = &mut self.kind else {
            return Err((
                "the light is no directional one, and its position is a point",
                "set the angle of a directional light; make soft shadows of a lamp by an emissive surface",
            ));
        };
        if !DISK_DEGREES.contains(&degrees) {
            return Err((
                "no disk has this angle",
                "the angle across a disk is 0 to 180 degrees, such as 0.53",
            ));
        }
        *angle = degrees.to_radians();
        Ok(())
    }

    fn move_to(&mut self, place: Vec3) -> Result<(), Refusal> {
        if !every(place, |value| PLACES.contains(&value)) {
            return Err((
                "the position is not in the scene",
                "write X,Y,Z in metres, such as bulb.position=0,2,1",
            ));
        }
        match &mut self.kind {
            PunctualKind::Point { position }
            | PunctualKind::Spot { position, .. }
            | PunctualKind::Profile { position, .. } => *position = place,
            PunctualKind::Directional { .. } => {
                return Err((
                    "the light is a directional one, which comes from infinitely far and has no position",
                    "set its colour or its intensity",
                ));
            }
        }
        Ok(())
    }
}

/// Scales a colour so that its greatest channel is 1.
fn hue(values: &[f32]) -> Result<Vec3, Refusal> {
    let colour = match *values {
        [red, green, blue] => Vec3::new(red, green, blue),
        [value, ..] => Vec3::splat(value),
        [] => Vec3::ZERO,
    };
    let greatest = colour.max_element();
    if every(colour, |value| (0.0..=BRIGHTEST).contains(&value)) && EMISSION.contains(&greatest) {
        return Ok(colour / greatest);
    }
    Err((
        "no light has this colour",
        "a colour is r,g,b of 0 or more, not all 0; the intensity 0 turns a light off",
    ))
}

impl Environment {
    /// Sets the factor of the texels.
    ///
    /// # Errors
    /// Reason and remedy, if `values` is not one number of 0 or more, or if it or a multiplied texel would
    /// exceed [`BRIGHTEST`].
    pub(super) fn set_strength(&mut self, values: &[f32]) -> Result<(), Refusal> {
        let &[strength] = values else {
            return Err(("the strength is one number", "write environment.strength=2 for twice the map"));
        };
        let brightest = self.texels.as_flattened().iter().copied().fold(0.0, f32::max);
        if !(strength >= 0.0 && (brightest * strength) <= BRIGHTEST && strength <= BRIGHTEST) {
            return Err((
                "no environment has this strength",
                "a strength is a factor of 0 or more, and no radiance is above 1e20",
            ));
        }
        self.strength = strength;
        Ok(())
    }
}
