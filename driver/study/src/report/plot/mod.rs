//! Plots of lines and markers, drawn as stand-alone SVG.
//!
//! A plot has one or several panels side by side above one legend. No font is available while it is drawn:
//! the space for text is sized for the widest common fonts.

mod axis;
mod content;
mod data;
mod legend;
mod panel;
mod style;
mod svg;
mod text;

#[cfg(test)]
mod tests;

use self::content::axis_label;
pub(crate) use self::content::{Panel, Point, Series, XAxis, XScale, YAxis, YScale};
use self::data::{LeftOut, Reason};
use self::legend::Legend;
use self::panel::Drawing;
use self::svg::Anchor;
use super::markup::escape;

/// Space around the drawing and between its parts, in pixels.
const MARGIN: f64 = 14.0;
const TITLE_GAP: f64 = 6.0;
/// Width of the plotting area of a single panel, in pixels.
const LONE_WIDTH: f64 = 560.0;
const PANEL_WIDTH: f64 = 390.0;

/// A figure: panels side by side that share a legend. Series with the same name have the same style in all
/// panels.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Plot {
    pub(crate) title: String,
    /// Caption that explains the figure; may be empty.
    pub(crate) caption: String,
    /// Panels from left to right.
    pub(crate) panels: Vec<Panel>,
    /// True if panels with the same vertical scale share one vertical range.
    pub(crate) shares_y_range: bool,
}

impl Plot {
    /// Encodes the plot as a stand-alone SVG document, which can also be embedded in HTML.
    pub(crate) fn to_svg(&self) -> String {
        let names = self.series_names();
        let (drawings, left_out) = self.drawings(&names);
        let panels_width: f64 = drawings.iter().map(Drawing::width).sum();
        let gaps = MARGIN * drawings.len().saturating_sub(1) as f64;
        let width = (panels_width + gaps).max(PANEL_WIDTH) + 2.0 * MARGIN;
        let room = width - 2.0 * MARGIN;

        let mut body = String::new();
        let mut top = MARGIN;
        let title = text::wrap(&self.title, text::TITLE, room / text::BOLD);
        body += &svg::lines("title", &title, [width / 2.0, top], text::TITLE, Anchor::Middle);
        top += text::height(title.len(), text::TITLE) + TITLE_GAP;
        let above = drawings.iter().map(Drawing::above).fold(0.0, f64::max);
        let mut left = MARGIN;
        for drawing in &drawings {
            body += &drawing.draw([left, top + above]);
            left += drawing.width() + MARGIN;
        }
        top += above + drawings.iter().map(Drawing::below_top).fold(0.0, f64::max);
        let legend = Legend::new(&names, room);
        body += &legend.draw([MARGIN, top]);
        top += legend.height();
        for note in notes(&left_out) {
            let lines = text::wrap(&note, text::TICK, room);
            body += &svg::lines("note", &lines, [MARGIN, top], text::TICK, Anchor::Start);
            top += text::height(lines.len(), text::TICK);
        }
        self.document(width, top + MARGIN, &body)
    }

    /// Returns the laid-out panels, and the points that cannot be drawn.
    fn drawings<'a>(&'a self, names: &[&'a str]) -> (Vec<Drawing<'a>>, Vec<LeftOut<'a>>) {
        let area = if self.panels.len() == 1 { LONE_WIDTH } else { PANEL_WIDTH };
        let (mut all_data, mut all_left_out) = (Vec::new(), Vec::new());
        for panel in &self.panels {
            let (data, left_out) = data::clean(panel);
            all_data.push(data);
            all_left_out.extend(left_out);
        }
        let y_axis = |index: usize| {
            let scale = self.panels[index].y.scale;
            let shares =
                |other: usize| other == index || self.shares_y_range && self.panels[other].y.scale == scale;
            let sharing = (0..all_data.len()).filter(|&other| shares(other));
            data::y_axis(scale, sharing.flat_map(|other| &all_data[other]))
        };
        let y_axes: Vec<_> = (0..self.panels.len()).map(y_axis).collect();
        let drawings = self
            .panels
            .iter()
            .zip(all_data)
            .zip(y_axes)
            .map(|((panel, data), y_axis)| Drawing::new(panel, data, y_axis, names, area))
            .collect();
        (drawings, all_left_out)
    }

    /// Names of all series, each once.
    fn series_names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for series in self.panels.iter().flat_map(|panel| &panel.series) {
            if !names.contains(&series.name.as_str()) {
                names.push(&series.name);
            }
        }
        names
    }

    fn document(&self, width: f64, height: f64, body: &str) -> String {
        let (width, height) = (svg::px(width.ceil()), svg::px(height.ceil()));
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
             height=\"{height}\" role=\"img\" font-family=\"Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', \
             sans-serif\">\n<title>{}</title>\n<desc>{}</desc>\n\
             <rect x=\"0\" y=\"0\" width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n{body}</svg>\n",
            escape(&self.title),
            escape(&self.description())
        )
    }

    /// Description of the plot for readers who cannot see it, for SVG's `desc`.
    fn description(&self) -> String {
        let mut parts = Vec::new();
        if !self.caption.is_empty() {
            parts.push(self.caption.clone());
        }
        for panel in &self.panels {
            let title = if panel.title.is_empty() { String::new() } else { format!("{}: ", panel.title) };
            let y = axis_label(&panel.y.label, &panel.y.unit, 0);
            let x = axis_label(&panel.x.label, &panel.x.unit, 0);
            parts.push(format!("{title}{y} against {x}."));
            if let XScale::Categories(names) = &panel.x.scale {
                // Long names may be shortened in the drawing.
                parts.push(format!("Categories: {}.", names.join("; ")));
            }
        }
        let names: Vec<_> = self.series_names().into_iter().filter(|name| !name.is_empty()).collect();
        if !names.is_empty() {
            parts.push(format!("Series: {}.", names.join("; ")));
        }
        parts.join(" ")
    }
}

/// Notes that report missing points and the reasons.
fn notes(left_out: &[LeftOut]) -> Vec<String> {
    let mut notes = Vec::new();
    for (reason, why) in [
        (Reason::NotFinite, "not finite"),
        (Reason::NotPositive, "zero or less, on a logarithmic axis"),
        (Reason::NoCategory, "in no category"),
    ] {
        let affected: Vec<_> = left_out.iter().filter(|left| left.reason == reason).collect();
        let count: usize = affected.iter().map(|left| left.count).sum();
        let mut names: Vec<_> =
            affected.iter().map(|left| left.name).filter(|name| !name.is_empty()).collect();
        names.dedup();
        let of = if names.is_empty() { String::new() } else { format!(" of {}", names.join(", ")) };
        match count {
            0 => {}
            1 => notes.push(format!("Left out: 1 point{of} ({why}).")),
            _ => notes.push(format!("Left out: {count} points{of} ({why}).")),
        }
    }
    notes
}
