//! Layout of printed errors: colours and line breaks on a terminal; unprintable characters are escaped.

use std::error::Error;
use std::fmt::{Display, Formatter, Result};
use std::io::{IsTerminal, stderr};

use anstream::{AutoStream, ColorChoice};
use clap::builder::styling::{AnsiColor, Style};
use miette::{Diagnostic, ReportHandler};
use photoncard_driver::printable::printable;

use crate::flags::with_flags;

/// Width of the mark `   │ ` before an excerpt's text, columns.
const EXCERPT_MARK: usize = 5;

/// Installs the layout. Lines are broken on a terminal only, so that a path in a log stays in one piece.
pub(crate) fn lay_out_errors() {
    let build = |_: &_| {
        #[cfg(not(target_family = "wasm"))]
        let width = terminal_size::terminal_size_of(stderr()).map(|(width, _)| usize::from(width.0));
        #[cfg(target_family = "wasm")]
        let width = None;
        let width = width.filter(|_| stderr().is_terminal()).unwrap_or(usize::MAX);
        let has_colours = AutoStream::choice(&stderr()) != ColorChoice::Never;
        Box::new(Layout { width, has_colours }) as Box<dyn ReportHandler>
    };
    // `set_hook` fails only if there is a hook already.
    let _ = miette::set_hook(Box::new(build));
}

/// Prints an error with its causes, the excerpt of a file to which it points, and its remedy.
struct Layout {
    /// Column at which lines are broken.
    width: usize,
    has_colours: bool,
}

impl ReportHandler for Layout {
    fn debug(&self, error: &dyn Diagnostic, f: &mut Formatter<'_>) -> Result {
        let red = AnsiColor::Red.on_default();
        if let Some(code) = error.code() {
            writeln!(f, "{}\n", self.coloured(red, &code))?;
        }
        let texts = messages(error);
        let last = texts.len() - 1;
        for (index, text) in texts.iter().enumerate() {
            let [first, next] = match index {
                0 => ["  × ", if last == 0 { "    " } else { "  │ " }],
                _ if index == last => ["  ╰─▶ ", "      "],
                _ => ["  ├─▶ ", "  │   "],
            };
            self.paragraph(f, red, [first, next], text)?;
        }
        self.excerpt(f, error)?;
        if let Some(help) = help(error) {
            self.paragraph(f, AnsiColor::Cyan.on_default(), ["  help: ", "        "], &help)?;
        }
        Ok(())
    }
}

impl Layout {
    fn coloured(&self, style: Style, text: impl Display) -> String {
        if self.has_colours { format!("{style}{text}{style:#}") } else { text.to_string() }
    }

    /// Prints `text` with `marks[0]` before its first line and `marks[1]` before each other line.
    fn paragraph(&self, f: &mut Formatter<'_>, style: Style, marks: [&str; 2], text: &str) -> Result {
        let [mut mark, next] = marks;
        for line in text.lines() {
            for line in broken(line, self.width.saturating_sub(next.chars().count())) {
                writeln!(f, "{}{line}", self.coloured(style, mark))?;
                mark = next;
            }
        }
        Ok(())
    }

    /// Prints each line of a file that an error points at, with a mark below the position. The line is
    /// already escaped: the error's labels are offsets in escaped text.
    fn excerpt(&self, f: &mut Formatter<'_>, error: &dyn Diagnostic) -> Result {
        let (Some(source), Some(labels)) = (error.source_code(), error.labels()) else { return Ok(()) };
        for label in labels {
            let Ok(contents) = source.read_span(label.inner(), 1, 1) else { continue };
            let text = String::from_utf8_lossy(contents.data());
            let Some(before) = text.get(..label.offset() - contents.span().offset()) else { continue };
            let start = before.rfind('\n').map_or(0, |end| end + 1);
            let indent = before[start..].chars().count();
            let line = contents.line() + before.matches('\n').count() + 1;
            let mark = self.coloured(AnsiColor::Magenta.on_default(), "╰── ");
            let shown = text[start..].lines().next().unwrap_or_default();
            let named = label.label().unwrap_or_default();
            let mark_width = "╰── ".chars().count() + named.chars().count();
            let room = self.width.saturating_sub(EXCERPT_MARK);
            let (shown, indent) = around(shown, indent, mark_width, room);
            writeln!(f, "   ╭─[{}:{line}]", contents.name().unwrap_or_default())?;
            writeln!(f, "   │ {shown}")?;
            writeln!(f, "   · {:indent$}{mark}{named}", "")?;
        }
        Ok(())
    }
}

/// Messages of an error and of its causes, escaped and with flags in place of settings' names. A cause is
/// left out if the message before it ends with the cause's message.
fn messages(error: &dyn Diagnostic) -> Vec<String> {
    let mut texts = vec![escaped(error)];
    let mut cause: Option<&dyn Error> =
        error.diagnostic_source().map(|cause| cause as &dyn Error).or_else(|| error.source());
    while let Some(error) = cause {
        let text = escaped(error);
        if !texts.last().is_some_and(|last| last.ends_with(&text)) {
            texts.push(text);
        }
        cause = error.source();
    }
    texts
}

/// Escaped remedy of an error, or of the first of its causes that has one.
pub(crate) fn help(error: &dyn Diagnostic) -> Option<String> {
    match error.help() {
        Some(help) => Some(escaped(help)),
        None => help(error.diagnostic_source()?),
    }
}

/// Breaks a line at spaces into parts of at most `width` characters. Longer words stay whole.
fn broken(line: &str, width: usize) -> Vec<String> {
    let mut words = line.split(' ');
    let mut parts = vec![words.next().unwrap_or_default().to_owned()];
    for word in words {
        match parts.last_mut() {
            Some(part) if part.chars().count() + 1 + word.chars().count() <= width => {
                part.push(' ');
                part.push_str(word);
            }
            _ => parts.push(word.to_owned()),
        }
    }
    parts
}

/// Returns an excerpt of a line, at most `width` characters around the character `at`, and this character's
/// column in the excerpt. A mark of `mark` columns that begins at this column also fits into `width`. An
/// ellipsis replaces the character at each end that is cut off.
fn around(line: &str, at: usize, mark: usize, width: usize) -> (String, usize) {
    let count = line.chars().count();
    let least = (at + mark).saturating_sub(width).min(at);
    if count <= width && least == 0 {
        return (line.to_owned(), at);
    }
    let start = at.saturating_sub(width / 2).min(count.saturating_sub(width)).max(least);
    let [is_cut_before, is_cut_after] = [start > 0, start + width < count];
    let part = line.chars().skip(start).take(width).enumerate();
    let shown = part.map(|(column, character)| match column {
        0 if is_cut_before => '…',
        last if is_cut_after && last + 1 == width => '…',
        _ => character,
    });
    (shown.collect(), at - start)
}

fn escaped(text: impl Display) -> String {
    printable(&with_flags(&text.to_string())).into_owned()
}

#[cfg(test)]
mod tests {
    use miette::{LabeledSpan, MietteDiagnostic, NamedSource, Report};

    use super::*;

    /// Output of [`Layout`] for a report.
    fn printed(report: &Report, width: usize) -> String {
        struct Printed<'a>(&'a dyn Diagnostic, Layout);
        impl Display for Printed<'_> {
            fn fmt(&self, f: &mut Formatter<'_>) -> Result {
                self.1.debug(self.0, f)
            }
        }
        Printed(report.as_ref(), Layout { width, has_colours: false }).to_string()
    }

    #[test]
    fn an_error_has_its_message_excerpt_and_remedy() {
        let place = LabeledSpan::at(11..12, "here");
        let error =
            MietteDiagnostic::new("no\x1b[31m number").with_code("scene::json").with_help("correct it");
        let report = Report::new(error.with_label(place))
            .with_source_code(NamedSource::new("a.gltf", "{\"ä\": 1,\n x}\n".to_owned()));
        let expected = [
            "scene::json\n",
            "  × no\\u{1b}[31m number",
            "   ╭─[a.gltf:2]",
            "   │  x}",
            "   ·  ╰── here",
            "  help: correct it\n",
        ];
        assert_eq!(printed(&report, usize::MAX), expected.join("\n"));
    }

    #[test]
    fn an_excerpt_fits_the_terminal() {
        for (at, expected) in [(0, ("012345678…", 0)), (9, ("…56789abc…", 5)), (19, ("…bcdefghij", 9))]
        {
            let (shown, column) = around("0123456789abcdefghij", at, 1, 10);
            assert_eq!((&*shown, column), expected);
        }
        assert_eq!(around("0123", 3, 1, 4), ("0123".to_owned(), 3));
        assert_eq!(around("0123456789", 9, 4, 10), ("…456789".to_owned(), 6));
        let error = MietteDiagnostic::new("no number").with_label(LabeledSpan::at(60..61, "here"));
        let source = NamedSource::new("a.gltf", "1".repeat(60) + "x" + &"2".repeat(60));
        let report = Report::new(error).with_source_code(source);
        let expected = "   │ …1111111x222222…\n   ·         ╰── here\n";
        assert!(printed(&report, 21).ends_with(expected), "{}", printed(&report, 21));
    }

    #[test]
    fn long_lines_are_broken_at_spaces() {
        assert_eq!(broken("one two three", 7), ["one two", "three"]);
        assert_eq!(broken("one two three", 8), ["one two", "three"]);
        assert_eq!(broken("a/path/without/spaces is long", 6), ["a/path/without/spaces", "is", "long"]);
        assert_eq!(broken("", 6), [""]);
        let report = Report::new(MietteDiagnostic::new("one two three").with_help("four five six"));
        assert_eq!(printed(&report, 11), "  × one two\n    three\n  help: four\n        five\n        six\n");
    }
}
