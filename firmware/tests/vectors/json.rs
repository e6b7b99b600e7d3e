//! Writes JSON whose vectors stand on a line each.

/// Text of letters, digits and punctuation without escapes.
pub(crate) fn text(text: &str) -> String {
    format!("\"{text}\"")
}

pub(crate) fn hex(bytes: &[u8]) -> String {
    let digits: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    text(&digits)
}

pub(crate) fn list(items: impl IntoIterator<Item = String>) -> String {
    format!("[{}]", items.into_iter().collect::<Vec<_>>().join(", "))
}

pub(crate) fn numbers<T: std::fmt::Display>(values: impl IntoIterator<Item = T>) -> String {
    list(values.into_iter().map(|value| value.to_string()))
}

/// Items on a line each.
pub(crate) fn lines(items: impl IntoIterator<Item = String>) -> String {
    format!("[\n    {}\n  ]", items.into_iter().collect::<Vec<_>>().join(",\n    "))
}

pub(crate) fn object(fields: &[(&str, String)]) -> String {
    let fields: Vec<String> = fields.iter().map(|(name, value)| format!("\"{name}\": {value}")).collect();
    format!("{{{}}}", fields.join(", "))
}

/// An object whose fields are on a line each.
pub(crate) fn sections(fields: &[(&str, String)]) -> String {
    let fields: Vec<String> = fields.iter().map(|(name, value)| format!("  \"{name}\": {value}")).collect();
    format!("{{\n{}\n}}\n", fields.join(",\n"))
}
