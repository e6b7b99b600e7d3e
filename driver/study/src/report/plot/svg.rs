//! Elements of an SVG drawing.

use super::super::markup::escape;
use super::super::number;
use super::text;

/// Colour of frames.
pub(super) const FRAME: &str = "#777777";
pub(super) const GRID: &str = "#dddddd";

/// Part of a text that lies at its given position: start, middle or end, as in SVG's `text-anchor`.
#[derive(Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// A line of text. Its position is on the base line.
pub(super) struct Text<'a> {
    pub(super) class: &'a str,
    pub(super) text: &'a str,
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) size: f64,
    pub(super) anchor: Anchor,
    /// Rotation about the position, degrees clockwise.
    pub(super) turn: f64,
    pub(super) is_bold: bool,
}

impl<'a> Text<'a> {
    /// Creates an upright line of text.
    pub(super) fn new(class: &'a str, text: &'a str, [x, y]: [f64; 2], size: f64, anchor: Anchor) -> Self {
        Self { class, text, x, y, size, anchor, turn: 0.0, is_bold: false }
    }

    pub(super) fn draw(&self) -> String {
        let anchor = match self.anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let (x, y) = (px(self.x), px(self.y));
        let turn = match self.turn {
            0.0 => String::new(),
            degrees => format!(" transform=\"rotate({} {x} {y})\"", px(degrees)),
        };
        let weight = if self.is_bold { " font-weight=\"bold\"" } else { "" };
        format!(
            "<text class=\"{}\" x=\"{x}\" y=\"{y}\" font-size=\"{}\" text-anchor=\"{anchor}\"{weight}{turn}>{}</text>\n",
            self.class,
            px(self.size),
            escape(self.text)
        )
    }
}

/// SVG of lines of text, one below the other. All are anchored at `x`, and the first line is below `top`.
pub(super) fn lines(class: &str, lines: &[String], [x, top]: [f64; 2], size: f64, anchor: Anchor) -> String {
    let draw = |(index, line): (usize, &String)| {
        let y = top + text::height(index, size) + size;
        Text { is_bold: size == text::TITLE, ..Text::new(class, line, [x, y], size, anchor) }.draw()
    };
    lines.iter().enumerate().map(draw).collect()
}

/// SVG of a straight line between two points.
pub(super) fn segment(class: &str, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2], colour: &str) -> String {
    format!(
        "<line class=\"{class}\" x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\" stroke=\"{colour}\"/>\n",
        px(x1),
        px(y1),
        px(x2),
        px(y2)
    )
}

/// Formats a coordinate, rounded to hundredths of a pixel.
pub(super) fn px(value: f64) -> String {
    number::full((value * 100.0).round() / 100.0 + 0.0)
}
