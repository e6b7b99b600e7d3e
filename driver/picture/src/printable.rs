//! Escapes foreign text from scenes, cards, paths or arguments, before it is printed or inserted into a
//! command.

use std::borrow::Cow;

/// Escapes all characters that do not print as themselves: control characters including line ends, invisible
/// and bidirectional formatting characters, and unassigned code points. Quotes and backslashes are kept, so
/// that escaped text does not change when it is escaped again.
pub fn printable(text: &str) -> Cow<'_, str> {
    if text.bytes().all(|byte| matches!(byte, b' '..=b'~')) {
        return Cow::Borrowed(text);
    }
    // `escape_debug` knows which characters print, but would escape quotes and backslashes too.
    let kept = ['\'', '"', '\\'];
    let piece = |piece: &str| {
        let body = piece.trim_end_matches(kept);
        format!("{}{}", body.escape_debug(), &piece[body.len()..])
    };
    text.split_inclusive(kept).map(piece).collect::<String>().into()
}

/// Quotes a word for a POSIX shell, so that the shell takes it literally.
pub fn shell_word(word: &str) -> Cow<'_, str> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:@%+".contains(c);
    if !word.is_empty() && word.chars().all(is_plain) {
        return Cow::Borrowed(word);
    }
    format!("'{}'", word.replace('\'', "'\\''")).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn characters_that_do_not_print_are_escaped_and_others_kept() {
        for (text, expected) in [
            ("", ""),
            ("it's \"C:\\x\" \\\\", "it's \"C:\\x\" \\\\"),
            ("Größe 大 🎨 e\u{301}'e\u{301}", "Größe 大 🎨 e\u{301}'e\u{301}"),
            ("\u{1b}[2J\0\u{7f}\u{9b}", "\\u{1b}[2J\\0\\u{7f}\\u{9b}"),
            ("a\r\n\tb", "a\\r\\n\\tb"),
            ("\u{202e}gnp\u{2066}.exr\u{feff}\u{2028}", "\\u{202e}gnp\\u{2066}.exr\\u{feff}\\u{2028}"),
            ("\u{e0041}\u{200b}", "\\u{e0041}\\u{200b}"),
        ] {
            assert_eq!(printable(text), expected);
            assert_eq!(printable(expected), expected, "it is not escaped twice");
        }
    }
}
