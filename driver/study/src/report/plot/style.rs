//! Styles of series: dashes and markers, which can be distinguished in black and white, and colours.

use std::fmt::Write;

use super::svg::px;

/// Half the extent of a marker, in pixels.
pub(super) const MARKER: f64 = 4.5;

/// Lengths of dashes and gaps, in pixels, as in SVG's `stroke-dasharray`; empty for a solid line.
const DASHES: [&str; 7] = ["", "8 4", "2 3", "10 3 2 3", "16 4", "5 2", "10 3 2 3 2 3"];

/// Shapes of markers, and whether they are filled.
const MARKERS: [(Shape, bool); 12] = [
    (Shape::Circle, true),
    (Shape::Square, false),
    (Shape::Up, true),
    (Shape::Diamond, false),
    (Shape::Down, true),
    (Shape::Plus, false),
    (Shape::Square, true),
    (Shape::Circle, false),
    (Shape::Diamond, true),
    (Shape::Cross, false),
    (Shape::Up, false),
    (Shape::Star, false),
];

/// Colours of series. The CIE lightness (0 to 100) differs by at least 4.9 between any two colours, and by at
/// least 10.9 between any two of the first six. The CIE76 difference of any two is above 20, also for
/// protanopes, deuteranopes and tritanopes (vision simulated after Machado et al. 2009).
const COLOURS: [&str; 12] = [
    "#000000", "#EB676C", "#4D1055", "#CAAE30", "#6C6DB6", "#873000", "#0046E1", "#7F5C71", "#507BEB",
    "#54079A", "#002900", "#76A8B0",
];

#[derive(Clone, Copy)]
enum Shape {
    Circle,
    Square,
    Up,
    Down,
    Diamond,
    Plus,
    Cross,
    Star,
}

/// Style of one series. The pair of dash and marker is unique among the first 84 series, the marker among the
/// first 12.
#[derive(Clone, Copy)]
pub(super) struct Style {
    dash: &'static str,
    shape: Shape,
    is_filled: bool,
    pub(super) colour: &'static str,
}

impl Style {
    /// Style of series number `index`.
    pub(super) fn of(index: usize) -> Self {
        let (shape, is_filled) = MARKERS[index % MARKERS.len()];
        Self { dash: DASHES[index % DASHES.len()], shape, is_filled, colour: COLOURS[index % COLOURS.len()] }
    }

    /// SVG of a line through the points, `width` pixels wide.
    pub(super) fn line(&self, points: &[[f64; 2]], width: f64) -> String {
        let mut path = String::new();
        for [x, y] in points {
            let _ = write!(path, "{}{} {}", if path.is_empty() { "M" } else { " L" }, px(*x), px(*y));
        }
        let dash = match self.dash {
            "" => String::new(),
            dash => format!(" stroke-dasharray=\"{dash}\""),
        };
        format!(
            "<path class=\"line\" d=\"{path}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" \
             stroke-linejoin=\"round\"{dash}/>\n",
            self.colour,
            px(width)
        )
    }

    /// SVG of the marker at a point.
    pub(super) fn marker(&self, x: f64, y: f64) -> String {
        let fill = if self.is_filled { self.colour } else { "#ffffff" };
        format!(
            "<path class=\"marker\" d=\"{}\" fill=\"{fill}\" stroke=\"{}\" stroke-width=\"1.5\"/>\n",
            self.outline(x, y),
            self.colour
        )
    }

    fn outline(&self, x: f64, y: f64) -> String {
        let r = MARKER;
        let strokes = |strokes: &[[f64; 4]]| {
            let stroke = |[a, b, c, d]: &[f64; 4]| {
                format!("M{} {} L{} {}", px(x + a * r), px(y + b * r), px(x + c * r), px(y + d * r))
            };
            strokes.iter().map(stroke).collect::<Vec<_>>().join(" ")
        };
        let polygon = |corners: &[[f64; 2]]| {
            let corner = |[a, b]: &[f64; 2]| format!("{} {}", px(x + a * r), px(y + b * r));
            format!("M{} Z", corners.iter().map(corner).collect::<Vec<_>>().join(" L"))
        };
        match self.shape {
            Shape::Circle => {
                let (left, right, y, r) = (px(x - r), px(x + r), px(y), px(r));
                format!("M{left} {y} A{r} {r} 0 0 1 {right} {y} A{r} {r} 0 0 1 {left} {y} Z")
            }
            Shape::Square => polygon(&[[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]]),
            Shape::Up => polygon(&[[0.0, -1.1], [1.1, 0.9], [-1.1, 0.9]]),
            Shape::Down => polygon(&[[0.0, 1.1], [1.1, -0.9], [-1.1, -0.9]]),
            Shape::Diamond => polygon(&[[0.0, -1.2], [1.2, 0.0], [0.0, 1.2], [-1.2, 0.0]]),
            Shape::Plus => strokes(&[[-1.1, 0.0, 1.1, 0.0], [0.0, -1.1, 0.0, 1.1]]),
            Shape::Cross => strokes(&[[-0.9, -0.9, 0.9, 0.9], [-0.9, 0.9, 0.9, -0.9]]),
            Shape::Star => strokes(&[[-1.1, 0.0, 1.1, 0.0], [-0.6, -1.0, 0.6, 1.0], [-0.6, 1.0, 0.6, -1.0]]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CIE lightness of a colour, from 0 to 100.
    fn lightness(colour: &str) -> f64 {
        let linear = |channel: usize| {
            let value = f64::from(u8::from_str_radix(&colour[channel..channel + 2], 16).unwrap()) / 255.0;
            if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
        };
        let luminance = 0.2126 * linear(1) + 0.7152 * linear(3) + 0.0722 * linear(5);
        if luminance > 0.008856 { 116.0 * luminance.cbrt() - 16.0 } else { 903.3 * luminance }
    }

    #[test]
    fn colours_differ_in_lightness_and_stand_out_from_white() {
        let least_distance = |colours: &[&str]| {
            let mut lightness: Vec<_> = colours.iter().map(|colour| lightness(colour)).collect();
            lightness.sort_by(f64::total_cmp);
            assert!(lightness[lightness.len() - 1] < 75.0);
            lightness.windows(2).map(|pair| pair[1] - pair[0]).fold(100.0, f64::min)
        };
        assert!(least_distance(&COLOURS[..6]) >= 10.9);
        assert!(least_distance(&COLOURS) >= 4.9);
    }
}
