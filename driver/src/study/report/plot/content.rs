//! Panels, axes and series: the content of a plot.

use super::super::number;

/// One pair of axes and the series over them.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// The panel's own title; empty if it needs none.
    pub title: String,
    /// The horizontal axis.
    pub x: XAxis,
    /// The vertical axis.
    pub y: YAxis,
    /// The data.
    pub series: Vec<Series>,
}

/// What is told horizontally.
#[derive(Clone, Debug, PartialEq)]
pub struct XAxis {
    /// The quantity.
    pub label: String,
    /// Its unit; empty where there is none.
    pub unit: String,
    /// How values map to places.
    pub scale: XScale,
}

/// How horizontal values map to places.
#[derive(Clone, Debug, PartialEq)]
pub enum XScale {
    /// Evenly.
    Linear,
    /// By their logarithm, labelled at powers of two.
    Log2,
    /// By their logarithm, labelled at 1, 2 and 5 times powers of ten.
    Log10,
    /// By name: a point's `x` is the index of its name.
    Categories(Vec<String>),
}

/// What is told vertically.
#[derive(Clone, Debug, PartialEq)]
pub struct YAxis {
    /// The quantity.
    pub label: String,
    /// Its unit; empty where there is none.
    pub unit: String,
    /// How values map to places.
    pub scale: YScale,
}

/// How vertical values map to places.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum YScale {
    /// Evenly, over the range of the data.
    Linear,
    /// Evenly, over a range that holds zero.
    LinearFromZero,
    /// By their logarithm, labelled at 1, 2 and 5 times powers of ten.
    Log10,
}

/// A named line.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// What the legend calls it; a series without a name is not in the legend.
    pub name: String,
    /// In the order in which the line joins them.
    pub points: Vec<Point>,
}

/// A value, in the units of the axes. Values that are not finite, and those of zero or less on a logarithmic axis,
/// are left out of the drawing, which says so.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Horizontally.
    pub x: f64,
    /// Vertically.
    pub y: f64,
    /// Half the width of the confidence interval of `y`: the extent of the error bar in both directions.
    pub half_width: Option<f64>,
}

impl Point {
    /// A point without an error bar.
    pub fn new(x: f64, y: f64) -> Self {
        Self { x, y, half_width: None }
    }

    /// A point with an error bar from `y - half_width` to `y + half_width`.
    pub fn with_half_width(x: f64, y: f64, half_width: f64) -> Self {
        Self { x, y, half_width: Some(half_width) }
    }
}

/// The quantity with its unit, and with the power of ten that the tick labels leave out.
pub(super) fn axis_label(label: &str, unit: &str, omitted_exponent: i32) -> String {
    let factor = match omitted_exponent {
        0 => String::new(),
        exponent => format!("×{}", number::power(10, exponent)),
    };
    match [factor.as_str(), unit].join(" ").trim() {
        "" => label.to_owned(),
        unit => format!("{label} ({unit})"),
    }
}
