//! Row of the table of options: the field of a setting, the option that states it, its value, and the results
//! that depend on it.

use photoncard_picture::choice::Choice;
use serde::Serialize;
use serde_json::{Value, json};

/// Results that depend on a setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Changes {
    /// Pixels.
    Pixels,
    /// A chip's work and memory traffic, but no pixel.
    Work,
    /// Cards, their links, and the model of their memory.
    Cards,
    /// No results.
    Nothing,
}

/// Setting of a render, with the option of the command line that states it.
#[derive(Clone, Debug)]
pub struct Setting {
    /// Results that depend on the setting.
    pub changes: Changes,
    /// Path of the field in [`RenderSettings`](super::RenderSettings), such as `integrator.samples`.
    pub field: &'static str,
    /// Name of the option, such as `spp`. It is also the key of the value in provenance.
    pub option: &'static str,
    /// Value that provenance records; `None` if no result depends on it, or if another row records it.
    pub value: Option<Value>,
    /// Argument of the option that states the value; `None` to leave the option out.
    pub argument: Option<String>,
}

/// Value of a setting for provenance, and the argument of its option.
type Stated = (Option<Value>, Option<String>);

/// No value and no argument, for a row that only names the option of a field in errors. Nothing depends on
/// the field, or another row has its value.
pub(super) const UNSTATED: Stated = (None, None);

pub(super) fn setting(
    changes: Changes,
    field: &'static str,
    option: &'static str,
    (value, argument): Stated,
) -> Setting {
    Setting { changes, field, option, value, argument }
}

pub(super) fn value(value: &(impl ToString + Serialize)) -> Stated {
    (Some(json!(value)), Some(value.to_string()))
}

/// Value and argument of an optional setting. For `None`, the argument is left out.
pub(super) fn optional(value: Option<impl ToString + Serialize>) -> Stated {
    (Some(json!(value)), value.map(|value| value.to_string()))
}

pub(super) fn name(choice: impl Choice) -> Stated {
    value(&choice.name())
}

pub(super) fn place(place: Option<[f64; 3]>) -> Stated {
    (Some(json!(place)), place.map(|place| list(&place)))
}

/// Writes numbers with commas between them. The text parses to the same bits.
pub(super) fn list<T: ToString>(values: &[T]) -> String {
    values.iter().map(T::to_string).collect::<Vec<_>>().join(",")
}
