//! Clap parsers of arguments whose values are names from a fixed list.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use photoncard_driver::choice::Choice;

/// Parser of the names of an enumeration's variants.
pub(super) fn choice<T: Choice>() -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(T::ALL.iter().copied().map(possible_value))
        .try_map(|name: String| T::of_name(&name))
}

/// Parser of `on` and `off`.
pub(super) fn switch() -> impl TypedValueParser<Value = bool> {
    PossibleValuesParser::new(["on", "off"]).map(|name: String| name == "on")
}

/// Clap's possible value for a variant: its name and its help.
pub(super) fn possible_value<T: Choice>(value: T) -> PossibleValue {
    let possible = PossibleValue::new(value.name());
    if value.about().is_empty() { possible } else { possible.help(value.about()) }
}
