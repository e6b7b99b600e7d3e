//! Messages about pictures that are black, or mostly black.

use photoncard_driver::film::Film;
use photoncard_driver::scene::{Camera, Scene};

use crate::console::say;

/// Minimum fraction of black pixels, among the pixels that show a surface, for a message.
const MANY: f64 = 0.5;

/// Facts about a scene and its view that may explain a dark picture.
#[derive(Clone, Copy, Default)]
pub(super) struct Circumstances {
    /// True if Blender's exporter wrote the file and the scene has no environment.
    lacks_world: bool,
    /// True if the camera is outside the scene's bounding box.
    is_outside: bool,
}

impl Circumstances {
    pub(super) fn of(scene: &Scene, camera: &Camera) -> Self {
        let (low, high) = scene.bounds();
        let is_outside = camera.origin.cmplt(low).any() || camera.origin.cmpgt(high).any();
        Self { lacks_world: scene.is_of_blender() && scene.environment.is_none(), is_outside }
    }
}

/// Prints the probable reason if no pixel shows a surface, or if at least half of the pixels that show one
/// are black.
pub(super) fn say_dark(film: &Film, circumstances: Circumstances) {
    let pixels = film.pixels().map(|pixel| (pixel.radiance, pixel.depth));
    if let Some(line) = line(pixels, circumstances) {
        say(format_args!("photoncard: {line}"));
    }
}

/// Returns the message about a picture with these pixels (radiance, depth); `None` if it is not dark.
fn line(
    all: impl Iterator<Item = ([f32; 3], f32)>,
    Circumstances { lacks_world, is_outside }: Circumstances,
) -> Option<String> {
    let (mut pixels, mut seen, mut black, mut lit) = (0_u64, 0_u64, 0_u64, false);
    for (radiance, depth) in all {
        let (is_black, is_seen) = (radiance == [0.0; 3], depth.is_finite());
        pixels += 1;
        seen += u64::from(is_seen);
        black += u64::from(is_seen && is_black);
        lit |= !is_black;
    }
    if pixels > 0 && seen == 0 && !lit {
        return Some("the picture is black: nothing of the scene is seen in it; photoncard scene info tells where scene and cameras are".into());
    }
    let share = black as f64 / seen.max(1) as f64;
    if seen == 0 || share < MANY {
        return None;
    }
    let what = if lit {
        format!("{:.0} % of what is seen is black", (100.0 * share).floor())
    } else {
        "the picture is black".into()
    };
    let mut reasons = vec!["no light reaches what is seen, or it is the back of one-sided surfaces"];
    if is_outside {
        reasons.push("the camera is outside of the scene: of a closed room it sees the walls from behind (--camera-at X,Y,Z)");
    }
    if lacks_world {
        reasons.push(
            "area lights and the world are never in Blender's export: make emissive planes of area lights, and give the world by \
             --environment",
        );
    }
    Some(format!("{what}: {}", reasons.join("; or ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dark_picture_says_why() {
        let (black, lit) = ([0.0; 3], [0.0, 0.1, 0.0]);
        let nowhere = f32::INFINITY;
        let said = |pixels: &[([f32; 3], f32)], lacks_world, is_outside| {
            line(pixels.iter().copied(), Circumstances { lacks_world, is_outside })
        };
        assert_eq!(said(&[(lit, 1.0), (black, 1.0), (lit, 2.0)], true, true), None);
        assert_eq!(said(&[(black, nowhere), (lit, nowhere)], true, true), None);
        assert_eq!(said(&[], false, false), None);
        let past = said(&[(black, nowhere); 3], true, true).unwrap();
        assert!(past.contains("nothing of the scene is seen"), "{past}");
        let all = said(&[(black, 1.0), (black, nowhere)], false, false).unwrap();
        assert!(all.starts_with("the picture is black: no light") && !all.contains("Blender"), "{all}");
        let half = said(&[(black, 1.0), (lit, 1.0), (black, 3.0), (lit, nowhere)], true, true).unwrap();
        for part in ["66 % of what is seen is black", "outside of the scene", "Blender's export"] {
            assert!(half.contains(part), "{half}");
        }
    }
}
