//! Checks names of files that the caller chooses.

/// Maximum length of a name, bytes. With an extension and a hash it stays within the 255 bytes that common
/// file systems allow.
const LONGEST: usize = 100;

/// Returns whether `name` is a valid file name on every system: 1 to 100 letters, digits, `-` and `.`, not
/// starting or ending with a dot.
pub(crate) fn is_portable(name: &str) -> bool {
    let is_allowed = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-' || byte == b'.';
    (1..=LONGEST).contains(&name.len())
        && name.bytes().all(is_allowed)
        && !name.starts_with('.')
        && !name.ends_with('.')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_plain_names_are_portable() {
        for name in ["figure-6.17", "a", "Table-7.1"] {
            assert!(is_portable(name), "{name}");
        }
        let long = "a".repeat(LONGEST + 1);
        for name in ["", ".", "..", ".hidden", "a.", "a/b", "a\\b", "a b", "ä", "a:b", long.as_str()] {
            assert!(!is_portable(name), "{name}");
        }
    }
}
