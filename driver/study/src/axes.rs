//! Axes of a sweep: settings that are varied, and the combinations of their values.

use miette::Diagnostic;
use thiserror::Error;

/// Maximum number of points of a sweep.
pub const MAX_POINTS: usize = 512;

/// Setting that a sweep varies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axis {
    /// Name of the setting, as in its command-line option.
    pub name: String,
    /// Values of the setting, written as arguments of the option.
    pub values: Vec<String>,
}

/// Error of axes that cannot form a sweep.
#[derive(Debug, Error, Diagnostic, PartialEq, Eq)]
pub enum AxisError {
    /// An axis has no values.
    #[error("--vary {name} has no value")]
    #[diagnostic(help("write --vary {name}=VALUE,VALUE"))]
    NoValue {
        /// Name of the axis.
        name: String,
    },
    /// Two axes have the same name.
    #[error("{name} is varied twice")]
    #[diagnostic(help("give all of its values in one --vary {name}=VALUE,VALUE"))]
    SameName {
        /// Name of the axes.
        name: String,
    },
    /// An axis has the same value twice.
    #[error("--vary {name} has the value {value} twice")]
    #[diagnostic(help("leave one of them out"))]
    SameValue {
        /// Name of the axis.
        name: String,
        /// The repeated value.
        value: String,
    },
    /// There are too many combinations.
    #[error("{factors} values make more than {MAX_POINTS} points")]
    #[diagnostic(help("vary fewer settings, or over fewer values"))]
    TooManyPoints {
        /// Numbers of values of the axes, joined as a product such as `512 x 2`.
        factors: String,
    },
}

/// Axes of a sweep. The sweep's points are the Cartesian product of the axes' values; the last axis varies
/// fastest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Axes(Vec<Axis>);

impl Axes {
    /// Creates the axes of a sweep.
    ///
    /// # Errors
    /// If an axis has no value, a name or a value is repeated, or there are more than [`MAX_POINTS`]
    /// combinations.
    pub(super) fn new(axes: Vec<Axis>) -> Result<Self, AxisError> {
        for (index, Axis { name, values }) in axes.iter().enumerate() {
            let name = || name.clone();
            if values.is_empty() {
                return Err(AxisError::NoValue { name: name() });
            }
            if axes[..index].iter().any(|other| other.name == axes[index].name) {
                return Err(AxisError::SameName { name: name() });
            }
            let repeated = (1..values.len()).find(|&value| values[..value].contains(&values[value]));
            if let Some(value) = repeated {
                return Err(AxisError::SameValue { name: name(), value: values[value].clone() });
            }
        }
        let counts = || axes.iter().map(|axis| axis.values.len());
        let points = counts().try_fold(1_usize, usize::checked_mul).filter(|&points| points <= MAX_POINTS);
        if points.is_none() {
            let factors: Vec<_> = counts().map(|count| count.to_string()).collect();
            return Err(AxisError::TooManyPoints { factors: factors.join(" x ") });
        }
        Ok(Self(axes))
    }

    pub(super) fn list(&self) -> &[Axis] {
        &self.0
    }

    /// Returns the combinations of values in the order of the sweep's points. A combination holds the index
    /// of one value of each axis.
    pub(super) fn combinations(&self) -> impl Iterator<Item = Vec<usize>> {
        let count = self.0.iter().map(|axis| axis.values.len()).product();
        (0..count).map(|point| self.combination(point))
    }

    fn combination(&self, point: usize) -> Vec<usize> {
        let mut rest = point;
        let mut indices: Vec<_> = (self.0.iter().rev())
            .map(|axis| {
                let index = rest % axis.values.len();
                rest /= axis.values.len();
                index
            })
            .collect();
        indices.reverse();
        indices
    }

    /// Returns the index of the sweep's point whose combination of values is `indices`, one index per axis.
    pub(super) fn point(&self, indices: &[usize]) -> usize {
        self.0.iter().zip(indices).fold(0, |point, (axis, index)| point * axis.values.len() + index)
    }

    /// Returns the name of each axis, with the axis's value at the index in `indices`.
    pub(super) fn values(&self, indices: &[usize]) -> Vec<(&str, &str)> {
        let pairs = self.0.iter().zip(indices);
        pairs.map(|(axis, &index)| (axis.name.as_str(), axis.values[index].as_str())).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(name: &str, values: &[&str]) -> Axis {
        Axis { name: name.to_owned(), values: values.iter().map(|&value| value.to_owned()).collect() }
    }

    #[test]
    fn every_combination_has_its_own_point_number() {
        let axes = Axes::new(vec![
            axis("order", &["naive", "sort"]),
            axis("tile", &["4"]),
            axis("queue", &["1", "2", "3"]),
        ]);
        let axes = axes.unwrap();
        let combinations: Vec<_> = axes.combinations().collect();
        assert_eq!(combinations.len(), 6);
        assert_eq!(axes.values(&combinations[1]), [("order", "naive"), ("tile", "4"), ("queue", "2")]);
        assert_eq!(axes.values(&combinations[3]), [("order", "sort"), ("tile", "4"), ("queue", "1")]);
        for (point, combination) in combinations.iter().enumerate() {
            assert_eq!(axes.point(combination), point);
        }
        let none = Axes::new(Vec::new()).unwrap();
        assert_eq!(none.combinations().collect::<Vec<_>>(), [[0; 0]]);
    }

    #[test]
    fn axes_that_cannot_form_a_sweep_are_refused() {
        let name = || "tile".to_owned();
        assert_eq!(Axes::new(vec![axis("tile", &[])]), Err(AxisError::NoValue { name: name() }));
        let twice = vec![axis("tile", &["4"]), axis("queue", &["1"]), axis("tile", &["8"])];
        assert_eq!(Axes::new(twice), Err(AxisError::SameName { name: name() }));
        let same = AxisError::SameValue { name: name(), value: "8".to_owned() };
        assert_eq!(Axes::new(vec![axis("tile", &["4", "8", "8"])]), Err(same));
        let numbers: Vec<_> = (0..MAX_POINTS).map(|number| number.to_string()).collect();
        let many = Axis { name: "seed".to_owned(), values: numbers };
        assert!(Axes::new(vec![many.clone()]).is_ok());
        let error = Axes::new(vec![many, axis("tile", &["4", "8"])]).unwrap_err();
        assert_eq!(error.to_string(), "512 x 2 values make more than 512 points");
    }
}
