//! Layout and drawing of one panel.

use super::axis::{Axis, Tick};
use super::content::{Panel, XScale, axis_label};
use super::data::{self, Drawable, Mark};
use super::style::{MARKER, Style};
use super::svg::{self, Anchor, FRAME, GRID, Text, px};
use super::text::{self, LABEL, TICK};

/// The height of a plotting area, in pixels.
const AREA_HEIGHT: f64 = 290.0;
/// Space between the frame and the ends of an axis, in pixels. It keeps markers inside the frame.
const INSET: f64 = 12.0;
/// Length of a tick, in pixels.
const TICK_LENGTH: f64 = 5.0;
const GAP: f64 = 6.0;
const LABEL_GAP: f64 = 8.0;
/// Maximum length of a slanted category name, in pixels.
const SLANTED_ROOM: f64 = 220.0;
/// Minimum distance between categories with slanted names, in pixels.
const SLANTED_PITCH: f64 = 24.0;
/// Half the width of an error bar's cap, in pixels.
const CAP: f64 = 3.5;

/// A laid-out panel.
pub(super) struct Drawing<'a> {
    panel: &'a Panel,
    data: Vec<Drawable<'a>>,
    /// Style of each series in `data`.
    styles: Vec<Style>,
    x: Axis,
    y: Axis,
    x_ticks: Vec<Tick>,
    y_ticks: Vec<Tick>,
    is_slanted: bool,
    title: Vec<String>,
    x_label: Vec<String>,
    y_label: Vec<String>,
    /// Width of the plotting area, in pixels. `left` and `right` are the widths of the spaces beside it.
    area: f64,
    left: f64,
    right: f64,
}

impl<'a> Drawing<'a> {
    /// Lays out a panel whose plotting area is `area` pixels wide, or wider if its categories need it.
    /// `names` are the names of all series of the plot, which determine their styles.
    pub(super) fn new(panel: &'a Panel, data: Vec<Drawable<'a>>, y: Axis, names: &[&str], area: f64) -> Self {
        let area = match &panel.x.scale {
            XScale::Categories(names) => area.max(SLANTED_PITCH * names.len() as f64),
            _ => area,
        };
        let inset = if matches!(panel.x.scale, XScale::Categories(_)) { 0.0 } else { INSET };
        let x = data::x_axis(panel, &data);
        let mut x_ticks = x.ticks(|ticks| fit_side_by_side(ticks, area - 2.0 * inset));
        let is_slanted = !fit_side_by_side(&x_ticks, area - 2.0 * inset);
        if is_slanted {
            for tick in &mut x_ticks {
                tick.label = text::shorten(&tick.label, TICK, SLANTED_ROOM);
            }
        }
        let y_ticks = y.ticks(|ticks| fit_above_each_other(ticks, AREA_HEIGHT - 2.0 * INSET));
        let style =
            |series: &Drawable| Style::of(names.iter().position(|name| *name == series.name).unwrap_or(0));
        let x_label = axis_label(&panel.x.label, &panel.x.unit, x.omitted_exponent());
        let y_label = axis_label(&panel.y.label, &panel.y.unit, y.omitted_exponent());
        let mut drawing = Self {
            styles: data.iter().map(style).collect(),
            title: text::wrap(&panel.title, LABEL, area),
            x_label: text::wrap(&x_label, LABEL, area),
            y_label: text::wrap(&y_label, LABEL, AREA_HEIGHT),
            panel,
            data,
            x,
            y,
            x_ticks,
            y_ticks,
            is_slanted,
            area,
            left: 0.0,
            right: 0.0,
        };
        [drawing.left, drawing.right] = drawing.side_room();
        drawing
    }

    /// Width of the whole panel, in pixels.
    pub(super) fn width(&self) -> f64 {
        self.left + self.area + self.right
    }

    /// Height of the space above the plotting area, in pixels.
    pub(super) fn above(&self) -> f64 {
        text::height(self.title.len(), LABEL) + GAP
    }

    /// Height of the plotting area and of everything below it, in pixels.
    pub(super) fn below_top(&self) -> f64 {
        AREA_HEIGHT + self.x_tick_room() + text::height(self.x_label.len(), LABEL) + GAP
    }

    /// Draws the panel as SVG. `left` is the panel's left side, `top` the top of its plotting area.
    pub(super) fn draw(&self, [left, top]: [f64; 2]) -> String {
        let frame = Frame {
            left: left + self.left,
            top,
            width: self.area,
            inset: if matches!(self.panel.x.scale, XScale::Categories(_)) { 0.0 } else { INSET },
        };
        let mut drawn = "<g class=\"panel\">\n".to_owned();
        drawn += &self.draw_labels(&frame, left);
        drawn += &self.draw_x_ticks(&frame);
        drawn += &self.draw_y_ticks(&frame);
        drawn += &format!(
            "<rect class=\"frame\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"{FRAME}\"/>\n",
            px(frame.left),
            px(frame.top),
            px(frame.width),
            px(AREA_HEIGHT)
        );
        for (series, style) in self.data.iter().zip(&self.styles) {
            drawn += &self.draw_series(&frame, series, style);
        }
        if self.data.iter().all(|series| series.runs.is_empty()) {
            let centre = [frame.left + 0.5 * frame.width, frame.top + 0.5 * AREA_HEIGHT];
            drawn += &Text::new("note", "no data", centre, LABEL, Anchor::Middle).draw();
        }
        drawn + "</g>\n"
    }

    /// Width of the space to the left and right of the plotting area, in pixels.
    fn side_room(&self) -> [f64; 2] {
        let widest = self.y_ticks.iter().map(|tick| text::width(&tick.label, TICK)).fold(0.0, f64::max);
        let labels = text::height(self.y_label.len(), LABEL) + GAP + widest + GAP + TICK_LENGTH;
        let inset = if matches!(self.panel.x.scale, XScale::Categories(_)) { 0.0 } else { INSET };
        let (mut left, mut right) = (labels, MARKER);
        for tick in &self.x_ticks {
            let x = inset + tick.place * (self.area - 2.0 * inset);
            let width = text::width(&tick.label, TICK);
            if self.is_slanted {
                left = left.max(width * 0.71 + TICK - x);
                right = right.max(x + TICK - self.area);
            } else {
                left = left.max(0.5 * width - x);
                right = right.max(x + 0.5 * width - self.area);
            }
        }
        [left, right]
    }

    /// Height of the ticks and labels of the horizontal axis, in pixels.
    fn x_tick_room(&self) -> f64 {
        let widest = self.x_ticks.iter().map(|tick| text::width(&tick.label, TICK)).fold(0.0, f64::max);
        let labels = if self.is_slanted { 0.71 * (widest + TICK) } else { text::height(1, TICK) };
        TICK_LENGTH + GAP + labels
    }

    fn draw_labels(&self, frame: &Frame, left: f64) -> String {
        let (middle, centre) = (frame.left + 0.5 * frame.width, frame.top + 0.5 * AREA_HEIGHT);
        let title_top = frame.top - self.above();
        let mut drawn = svg::lines("panel-title", &self.title, [middle, title_top], LABEL, Anchor::Middle);
        let label_top = frame.top + AREA_HEIGHT + self.x_tick_room();
        drawn += &svg::lines("label", &self.x_label, [middle, label_top], LABEL, Anchor::Middle);
        for (index, line) in self.y_label.iter().enumerate() {
            let x = left + text::height(index, LABEL) + LABEL;
            let label = Text::new("label", line, [x, centre], LABEL, Anchor::Middle);
            drawn += &Text { turn: -90.0, ..label }.draw();
        }
        drawn
    }

    fn draw_x_ticks(&self, frame: &Frame) -> String {
        let bottom = frame.top + AREA_HEIGHT;
        let mut drawn = String::new();
        for tick in &self.x_ticks {
            let x = frame.x(tick.place);
            drawn += &svg::segment("grid", [x, frame.top], [x, bottom], GRID);
            drawn += &svg::segment("tick", [x, bottom], [x, bottom + TICK_LENGTH], FRAME);
            let below = bottom + TICK_LENGTH + GAP;
            drawn += &if self.is_slanted {
                let label = Text::new(
                    "x-tick",
                    &tick.label,
                    [x + 0.35 * TICK, below + 0.35 * TICK],
                    TICK,
                    Anchor::End,
                );
                Text { turn: -45.0, ..label }.draw()
            } else {
                Text::new("x-tick", &tick.label, [x, below + 0.7 * TICK], TICK, Anchor::Middle).draw()
            };
        }
        drawn
    }

    fn draw_y_ticks(&self, frame: &Frame) -> String {
        let mut drawn = String::new();
        for tick in &self.y_ticks {
            let y = frame.y(tick.place);
            drawn += &svg::segment("grid", [frame.left, y], [frame.left + frame.width, y], GRID);
            drawn += &svg::segment("tick", [frame.left - TICK_LENGTH, y], [frame.left, y], FRAME);
            let place = [frame.left - TICK_LENGTH - GAP, y + 0.35 * TICK];
            drawn += &Text::new("y-tick", &tick.label, place, TICK, Anchor::End).draw();
        }
        drawn
    }

    fn draw_series(&self, frame: &Frame, series: &Drawable, style: &Style) -> String {
        let place = |mark: &Mark| [frame.x(self.x.place(mark.x)), frame.y(self.y.place(mark.y))];
        // Categories have no order, so the slope of a line means nothing: the line is thin, a guide for the
        // eye.
        let width = if matches!(self.panel.x.scale, XScale::Categories(_)) { 1.0 } else { 1.75 };
        let mut drawn = "<g class=\"series\">\n".to_owned();
        for run in &series.runs {
            let points: Vec<_> = run.iter().map(place).collect();
            if points.len() > 1 {
                drawn += &style.line(&points, width);
            }
        }
        for mark in series.runs.iter().flatten() {
            let [x, y] = place(mark);
            drawn += &self.draw_bar(frame, mark, x, style.colour);
            drawn += &style.marker(x, y);
        }
        drawn + "</g>\n"
    }

    fn draw_bar(&self, frame: &Frame, mark: &Mark, x: f64, colour: &str) -> String {
        let Some(ends) = mark.bar else { return String::new() };
        let [low, high] = ends.map(|end| frame.y(self.y.place(end)));
        let mut drawn = svg::segment("bar", [x, low], [x, high], colour);
        for (end, y) in ends.into_iter().zip([low, high]) {
            // An error bar that extends below the axis has no cap at its lower end.
            if self.y.holds(end) {
                drawn += &svg::segment("bar", [x - CAP, y], [x + CAP, y], colour);
            }
        }
        drawn
    }
}

/// Rectangle of the plotting area, in pixels.
struct Frame {
    left: f64,
    top: f64,
    width: f64,
    inset: f64,
}

impl Frame {
    fn x(&self, place: f64) -> f64 {
        self.left + self.inset + place * (self.width - 2.0 * self.inset)
    }

    fn y(&self, place: f64) -> f64 {
        self.top + INSET + (1.0 - place) * (AREA_HEIGHT - 2.0 * INSET)
    }
}

/// Returns whether labels centred at ticks along `length` horizontal pixels do not overlap.
fn fit_side_by_side(ticks: &[Tick], length: f64) -> bool {
    let is_apart = |pair: &[Tick]| {
        let half_widths = 0.5 * (text::width(&pair[0].label, TICK) + text::width(&pair[1].label, TICK));
        (pair[1].place - pair[0].place) * length >= half_widths + LABEL_GAP
    };
    ticks.windows(2).all(is_apart)
}

/// Returns whether labels at ticks along `length` vertical pixels do not overlap.
fn fit_above_each_other(ticks: &[Tick], length: f64) -> bool {
    let line = text::height(1, TICK);
    ticks.windows(2).all(|pair| (pair[1].place - pair[0].place) * length >= line)
}
