//! Escapes text in HTML and SVG.

/// Escapes `text` as content, or as the value of an attribute in double quotes. Characters that XML does not
/// allow become U+FFFD.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            '\t' | '\n' | '\r' => escaped.push(character),
            '\u{0}'..='\u{1f}' | '\u{fffe}' | '\u{ffff}' => escaped.push('\u{fffd}'),
            _ => escaped.push(character),
        }
    }
    escaped
}

/// A strict parser of the markup in reports. It panics on malformed documents.
#[cfg(test)]
pub(super) mod reader {
    /// A start tag or empty tag, and the text up to the next tag.
    #[derive(Debug)]
    pub(crate) struct Element {
        pub(crate) tag: String,
        pub(crate) attributes: Vec<(String, String)>,
        pub(crate) text: String,
    }

    impl Element {
        pub(crate) fn get(&self, name: &str) -> Option<&str> {
            self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
        }

        pub(crate) fn number(&self, name: &str) -> Option<f64> {
            self.get(name).map(|value| value.parse().unwrap())
        }
    }

    /// Elements of a document, in order.
    ///
    /// # Panics
    /// If the document is not well-formed.
    pub(crate) fn elements(document: &str) -> Vec<Element> {
        let (mut elements, mut open): (Vec<Element>, Vec<String>) = (Vec::new(), Vec::new());
        let mut rest = document.trim().strip_prefix("<!DOCTYPE html>").unwrap_or(document.trim()).trim();
        while let Some(inside) = rest.strip_prefix('<') {
            let (tag, after) = inside.split_once('>').expect("a tag ends");
            assert!(!tag.contains('<'), "< in the tag {tag}");
            let (text, _) = after.split_at(after.find('<').unwrap_or(after.len()));
            if let Some(name) = tag.strip_prefix('/') {
                assert_eq!(open.pop().as_deref(), Some(name), "tags are balanced");
            } else {
                let (tag, is_empty) = tag.strip_suffix('/').map_or((tag, false), |tag| (tag, true));
                let (name, attributes) = tag.split_once(' ').unwrap_or((tag, ""));
                assert!(name.bytes().all(|byte| byte.is_ascii_alphanumeric()), "the tag {name}");
                elements.push(Element {
                    tag: name.to_owned(),
                    attributes: self::attributes(attributes),
                    text: unescape(text),
                });
                if !is_empty {
                    open.push(name.to_owned());
                }
            }
            check_entities(text);
            rest = &after[text.len()..];
            assert!(!open.is_empty() || rest.is_empty(), "one root");
        }
        assert!(rest.is_empty() && open.is_empty(), "unclosed: {open:?}, left: {rest}");
        elements
    }

    fn attributes(mut text: &str) -> Vec<(String, String)> {
        let mut attributes: Vec<(String, String)> = Vec::new();
        loop {
            text = text.trim_start();
            if text.is_empty() {
                return attributes;
            }
            let (name, quoted) = text.split_once("=\"").expect("attributes are quoted");
            assert!(name.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-:".contains(&byte)), "{name}");
            assert!(attributes.iter().all(|(other, _)| other != name), "{name} twice");
            let (value, after) = quoted.split_once('"').expect("quotes end");
            check_entities(value);
            attributes.push((name.to_owned(), unescape(value)));
            text = after;
        }
    }

    fn check_entities(text: &str) {
        for after in text.split('&').skip(1) {
            let known = ["amp;", "lt;", "gt;", "quot;", "#39;"];
            assert!(known.iter().any(|entity| after.starts_with(entity)), "& before {after}");
        }
        assert!(!text.chars().any(|character| character < ' ' && !"\n\r\t".contains(character)), "{text:?}");
    }

    fn unescape(text: &str) -> String {
        [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&#39;", "'"), ("&amp;", "&")]
            .iter()
            .fold(text.to_owned(), |text, (entity, character)| text.replace(entity, character))
    }

    #[test]
    fn malformed_markup_is_detected() {
        for malformed in
            ["<a>", "<a><b></a></b>", "<a b=c/>", "<a>&x</a>", "<a/><b/>", "<a b=\"1\" b=\"2\"/>"]
        {
            assert!(std::panic::catch_unwind(|| elements(malformed)).is_err(), "{malformed}");
        }
        let escaped = super::escape("<b c=\"d\"> & 'e'\u{0}");
        let elements = elements(&format!("<a b=\"{escaped}\">{escaped}</a>"));
        assert_eq!(elements[0].text, "<b c=\"d\"> & 'e'\u{fffd}");
        assert_eq!(elements[0].get("b"), Some(elements[0].text.as_str()));
    }
}
