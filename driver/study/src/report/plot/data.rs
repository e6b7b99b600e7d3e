//! Separates the data that can be drawn from the points that cannot, and creates the axes.

use super::axis::Axis;
use super::content::{Panel, Point, XScale, YScale};

/// Maximum magnitude of a value that is drawn.
const LARGEST: f64 = 1e300;
/// Minimum value that is drawn on a logarithmic axis.
const SMALLEST: f64 = 1e-300;
/// Minimum of the lower ends of error bars that a logarithmic axis includes, divided by the value of the
/// point.
const BAR_SHARE: f64 = 0.1;

/// Points of one series that can be drawn. A line joins the points of each run.
pub(super) struct Drawable<'a> {
    pub(super) name: &'a str,
    pub(super) runs: Vec<Vec<Mark>>,
}

/// A point, and the ends of its error bar.
pub(super) struct Mark {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) bar: Option<[f64; 2]>,
}

/// Reason why a point is not drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Reason {
    NotFinite,
    NotPositive,
    NoCategory,
}

/// Number of points of one series that are not drawn for the same reason.
pub(super) struct LeftOut<'a> {
    pub(super) reason: Reason,
    pub(super) name: &'a str,
    pub(super) count: usize,
}

/// Separates the points of a panel that can be drawn from those that cannot. A point that cannot be drawn
/// interrupts the line of its series.
pub(super) fn clean(panel: &Panel) -> (Vec<Drawable<'_>>, Vec<LeftOut<'_>>) {
    let mut left_out: Vec<LeftOut> = Vec::new();
    let mut drawable = Vec::new();
    for series in &panel.series {
        let mut runs = vec![Vec::new()];
        for point in &series.points {
            let Some(reason) = obstacle(panel, point) else {
                runs.last_mut().expect("there is one").push(mark(point));
                continue;
            };
            runs.push(Vec::new());
            match left_out.iter_mut().find(|left| left.reason == reason && left.name == series.name) {
                Some(left) => left.count += 1,
                None => left_out.push(LeftOut { reason, name: &series.name, count: 1 }),
            }
        }
        runs.retain(|run| !run.is_empty());
        drawable.push(Drawable { name: &series.name, runs });
    }
    (drawable, left_out)
}

fn obstacle(panel: &Panel, point: &Point) -> Option<Reason> {
    let is_finite = |value: f64| value.abs() <= LARGEST;
    if !is_finite(point.x) || !is_finite(point.y) {
        return Some(Reason::NotFinite);
    }
    let is_x_logarithmic = matches!(panel.x.scale, XScale::Log2 | XScale::Log10);
    let is_y_logarithmic = panel.y.scale == YScale::Log10;
    if is_x_logarithmic && point.x < SMALLEST || is_y_logarithmic && point.y < SMALLEST {
        return Some(Reason::NotPositive);
    }
    match &panel.x.scale {
        XScale::Categories(names) if !(0..names.len()).any(|index| index as f64 == point.x) => {
            Some(Reason::NoCategory)
        }
        _ => None,
    }
}

fn mark(point: &Point) -> Mark {
    let bar = point
        .half_width
        .filter(|half_width| *half_width > 0.0)
        .map(|half_width| [point.y - half_width, point.y + half_width])
        .filter(|[low, high]| low.abs() <= LARGEST && high.abs() <= LARGEST);
    Mark { x: point.x, y: point.y, bar }
}

/// Creates the horizontal axis of a panel.
pub(super) fn x_axis(panel: &Panel, drawable: &[Drawable]) -> Axis {
    let marks = drawable.iter().flat_map(|series| series.runs.iter().flatten());
    let range = range(marks.map(|mark| mark.x));
    match &panel.x.scale {
        XScale::Linear => {
            let [low, high] = range.unwrap_or([0.0, 1.0]);
            Axis::linear(low, high)
        }
        XScale::Log2 => {
            let [low, high] = range.unwrap_or([1.0, 2.0]);
            Axis::log2(low, high)
        }
        XScale::Log10 => {
            let [low, high] = range.unwrap_or([1.0, 10.0]);
            Axis::log10(low, high)
        }
        XScale::Categories(names) => Axis::categories(names.clone()),
    }
}

/// Creates the vertical axis for all series, including their error bars.
pub(super) fn y_axis<'a>(scale: YScale, drawable: impl Iterator<Item = &'a Drawable<'a>>) -> Axis {
    let marks = drawable.flat_map(|series| series.runs.iter().flatten());
    let values = |mark: &Mark| {
        let [low, high] = mark.bar.unwrap_or([mark.y; 2]);
        let low = if scale == YScale::Log10 { low.max(BAR_SHARE * mark.y) } else { low };
        [low, mark.y, high]
    };
    let range = range(marks.flat_map(values));
    match scale {
        YScale::Log10 => {
            let [low, high] = range.unwrap_or([1.0, 10.0]);
            Axis::log10(low, high)
        }
        YScale::Linear => {
            let [low, high] = range.unwrap_or([0.0, 1.0]);
            Axis::linear(low, high)
        }
        YScale::LinearFromZero => {
            let [low, high] = range.unwrap_or([0.0, 1.0]);
            Axis::linear(low.min(0.0), high.max(0.0))
        }
    }
}

fn range(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    values.fold(None, |range, value| match range {
        None => Some([value; 2]),
        Some([low, high]) => Some([value.min(low), value.max(high)]),
    })
}
