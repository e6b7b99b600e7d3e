//! Values of the symbols of Table 7.1 over which its formulas are evaluated.

use photoncard_render::cost_model::{SymbolError, Symbols};

use super::axes::{Axes, Axis, AxisError};

/// Symbols of Table 7.1 with several values each. The formulas are evaluated for every combination.
#[derive(Clone, Debug, PartialEq)]
pub struct SymbolAxes {
    axes: Axes,
    /// Values and symbols of each combination.
    combinations: Vec<(Vec<f64>, Symbols)>,
}

/// Error of symbols that cannot be varied.
#[derive(Debug, PartialEq, thiserror::Error)]
pub enum SymbolAxesError {
    /// A name is none of a symbol, or a value is out of the symbol's range.
    #[error(transparent)]
    Symbol(#[from] SymbolError),
    /// The values cannot be combined.
    #[error(transparent)]
    Axes(#[from] AxisError),
}

impl SymbolAxes {
    /// Creates the combinations of the values of `axes`, which are named by the symbols' notation, such as
    /// `R_IC`. Other symbols have their nominal values.
    ///
    /// # Errors
    /// If an axis is no symbol, a value is out of its symbol's range, or the axes cannot be combined.
    pub fn new(axes: Vec<Axis>) -> Result<Self, SymbolAxesError> {
        let axes = Axes::new(axes)?;
        let set = |indices: Vec<usize>| {
            let mut symbols = Symbols::NOMINAL;
            let mut values = Vec::new();
            for (name, value) in axes.values(&indices) {
                symbols.set(&format!("{name}={value}"))?;
                values.extend(
                    symbols.rows().find(|(symbol, _)| symbol.notation == name).map(|(_, value)| value),
                );
            }
            Ok((values, symbols))
        };
        let combinations: Result<_, SymbolError> = axes.combinations().map(set).collect();
        Ok(Self { combinations: combinations?, axes })
    }

    /// Notation of the varied symbols.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.axes.list().iter().map(|axis| axis.name.as_str())
    }

    /// Values of the varied symbols, and all symbols, of each combination.
    pub(crate) fn combinations(&self) -> impl Iterator<Item = (&[f64], Symbols)> {
        self.combinations.iter().map(|(values, symbols)| (values.as_slice(), *symbols))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes(axes: &[(&str, &[&str])]) -> Result<SymbolAxes, String> {
        let axis = |&(name, values): &(&str, &[&str])| Axis {
            name: name.to_owned(),
            values: values.iter().map(|&value| value.to_owned()).collect(),
        };
        SymbolAxes::new(axes.iter().map(axis).collect()).map_err(|error| error.to_string())
    }

    #[test]
    fn each_combination_sets_its_symbols_and_leaves_the_others() {
        let axes = axes(&[("R_IC", &["0.2", "0.40"]), ("k", &["50"])]).unwrap();
        assert_eq!(axes.names().collect::<Vec<_>>(), ["R_IC", "k"]);
        for ((values, symbols), share) in axes.combinations().zip([0.2, 0.4]) {
            assert_eq!(values, [share, 50.0]);
            let expected = Symbols { interpolated_share: share, neighbors: 50.0, ..Symbols::NOMINAL };
            assert_eq!(symbols, expected);
        }
        assert_eq!(axes.combinations().count(), 2);
    }

    #[test]
    fn what_is_no_symbol_or_value_is_refused_with_the_valid_ones() {
        for (varied, words) in [
            ((&"X", &["1"][..]), ["no symbol \"X\"", "R_IC"]),
            ((&"R_IC", &["0.5", "2"]), ["R_IC cannot be \"2\"", "from 0 to 1"]),
            ((&"k", &["1", "1"]), ["k has the value 1 twice", "k"]),
            ((&"k", &[]), ["k has no value", "k"]),
        ] {
            let said = axes(&[(varied.0, varied.1)]).unwrap_err();
            assert!(words.iter().all(|word| said.contains(word)), "{said}");
        }
    }
}
