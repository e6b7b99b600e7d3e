//! Content of a plot: panels, axes and series.

use super::super::number;

/// A pair of axes, and the series drawn over them.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Panel {
    /// Title of the panel; may be empty.
    pub(crate) title: String,
    pub(crate) x: XAxis,
    pub(crate) y: YAxis,
    pub(crate) series: Vec<Series>,
}

/// Horizontal axis.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct XAxis {
    /// Name of the quantity.
    pub(crate) label: String,
    /// Unit of the quantity; empty if it has none.
    pub(crate) unit: String,
    /// Mapping of values to positions.
    pub(crate) scale: XScale,
}

/// Mapping of horizontal values to positions.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum XScale {
    #[cfg_attr(not(test), expect(dead_code, reason = "the plainest scale, which tests draw"))]
    Linear,
    /// Logarithmic scale with labels at powers of two.
    Log2,
    /// Logarithmic scale with labels at 1, 2 and 5 times powers of ten.
    Log10,
    /// Categorical scale: a point's `x` is the index of its name.
    Categories(Vec<String>),
}

/// Vertical axis.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct YAxis {
    /// Name of the quantity.
    pub(crate) label: String,
    /// Unit of the quantity; empty if it has none.
    pub(crate) unit: String,
    /// Mapping of values to positions.
    pub(crate) scale: YScale,
}

/// Mapping of vertical values to positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum YScale {
    /// Linear scale over the range of the data.
    #[cfg_attr(not(test), expect(dead_code, reason = "the plainest scale, which tests draw"))]
    Linear,
    /// Linear scale over a range that includes zero.
    LinearFromZero,
    /// Logarithmic scale with labels at 1, 2 and 5 times powers of ten.
    Log10,
}

/// A named line.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Series {
    /// Name in the legend. A series with an empty name is not in the legend.
    pub(crate) name: String,
    /// Points, in the order in which the line joins them.
    pub(crate) points: Vec<Point>,
}

/// A point in the units of the axes. It is not drawn if a value is not finite, or is 0 or less on a
/// logarithmic axis. A note below the plot counts the points that are left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    pub(crate) x: f64,
    pub(crate) y: f64,
    /// Half-width of the confidence interval of `y`: the extent of the error bar in either direction.
    pub(crate) half_width: Option<f64>,
}

impl Point {
    /// A point without an error bar.
    pub(crate) fn new(x: f64, y: f64) -> Self {
        Self { x, y, half_width: None }
    }

    /// A point with an error bar from `y - half_width` to `y + half_width`.
    pub(crate) fn with_half_width(x: f64, y: f64, half_width: f64) -> Self {
        Self { x, y, half_width: Some(half_width) }
    }
}

/// Label of an axis: the quantity with its unit, and the power of ten that the tick labels omit.
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
