//! Size of text. No font is available while plots are drawn, so widths are upper bounds, which hold for the
//! widest common fonts.

/// Font size of titles, in pixels.
pub(super) const TITLE: f64 = 16.0;
pub(super) const LABEL: f64 = 13.0;
pub(super) const TICK: f64 = 12.0;

/// Upper bound of the ratio of the widths of bold and regular text.
pub(super) const BOLD: f64 = 1.12;

/// Distance between two lines of text, divided by the font size.
const LEADING: f64 = 1.3;

/// Upper bound of the width of `text` at font size `size`, in pixels.
pub(super) fn width(text: &str, size: f64) -> f64 {
    text.chars().map(|character| advance(character) * size).sum()
}

/// Height of `lines` lines of text at font size `size`, in pixels.
pub(super) fn height(lines: usize, size: f64) -> f64 {
    lines as f64 * size * LEADING
}

/// Breaks `text` into lines of at most `room` pixels, at spaces, and within words that are longer than a
/// line.
pub(super) fn wrap(text: &str, size: f64, room: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if width(line, size) + width(" ", size) + width(word, size) <= room => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.extend(break_word(word, size, room)),
        }
    }
    lines
}

/// Returns `text` if it fits into `room` pixels, otherwise its longest prefix that fits with an ellipsis.
pub(super) fn shorten(text: &str, size: f64, room: f64) -> String {
    if width(text, size) <= room {
        return text.to_owned();
    }
    let mut short = String::new();
    for character in text.chars() {
        if width(&short, size) + width(&format!("{character}…"), size) > room {
            break;
        }
        short.push(character);
    }
    short.truncate(short.trim_end().len());
    short + "…"
}

fn break_word(word: &str, size: f64, room: f64) -> Vec<String> {
    let mut pieces = vec![String::new()];
    let mut filled = 0.0;
    for character in word.chars() {
        let advance = advance(character) * size;
        if filled > 0.0 && filled + advance > room {
            pieces.push(String::new());
            filled = 0.0;
        }
        filled += advance;
        pieces.last_mut().expect("there is one").push(character);
    }
    pieces
}

/// Width of a character in `DejaVu Sans`, divided by the font size, rounded up.
fn advance(character: char) -> f64 {
    match character {
        ' ' | '.' | ',' | ':' | ';' | '\'' | '|' | 'i' | 'j' | 'l' | 'I' => 0.36,
        'f' | 't' | 'r' | 's' | 'c' | 'J' | '!' | '"' | '(' | ')' | '[' | ']' | '/' | '-' => 0.56,
        'm' | 'w' | 'M' | 'W' | '%' | '@' | '…' => 1.0,
        '⁰' | '¹' | '²' | '³' | '⁴'..='⁹' | '⁻' => 0.5,
        '#' | '^' | '~' | '+' | '=' | '<' | '>' | '−' | '×' | '±' | '&' | 'A'..='Z' => 0.85,
        ' '..='~' | '·' | '–' => 0.66,
        _ => 1.1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrapped_lines_fit_and_lose_nothing_but_spaces() {
        let text = "a few short words and_one_word_that_is_far_longer_than_any_line_may_be at last";
        let lines = wrap(text, LABEL, 150.0);
        assert!(lines.len() > 3);
        assert!(lines.iter().all(|line| width(line, LABEL) <= 150.0), "{lines:?}");
        assert_eq!(lines.concat().replace(' ', ""), text.replace(' ', ""));
        assert!(wrap(" \n ", LABEL, 150.0).is_empty());
        // If not even one character fits, each character has a line of its own.
        assert_eq!(wrap("ab", LABEL, 1.0), ["a", "b"]);
    }

    #[test]
    fn shortened_text_fits() {
        assert_eq!(shorten("sort", TICK, 60.0), "sort");
        let short = shorten("a category with a long name", TICK, 60.0);
        assert!(short.ends_with('…') && width(&short, TICK) <= 60.0, "{short}");
    }
}
