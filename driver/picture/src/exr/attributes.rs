//! Order of the attributes in the header of an encoded `OpenEXR` file.

use std::ops::Range;

/// Offset of the first attribute of a file with one part: after magic number and version.
const FIRST: usize = 8;

/// Sorts the attributes whose names `is_free` accepts by their names; the others keep their order, before
/// them. The header keeps its length, so that offsets in the file stay right. A file whose header cannot be
/// parsed is left unchanged.
pub(super) fn sort(file: &mut [u8], is_free: impl Fn(&str) -> bool) {
    let Some(places) = places(file) else { return };
    let Some(end) = places.last().map(|place| place.end) else { return };
    let name = |place: &Range<usize>| -> &str {
        let text = &file[place.clone()];
        text.split(|&byte| byte == 0).next().and_then(|name| str::from_utf8(name).ok()).unwrap_or_default()
    };
    let (mut free, fixed): (Vec<_>, Vec<_>) = places.iter().cloned().partition(|place| is_free(name(place)));
    if free.len() < 2 {
        return;
    }
    free.sort_by(|a, b| name(a).cmp(name(b)));
    let sorted: Vec<u8> = fixed.into_iter().chain(free).flat_map(|place| file[place].to_vec()).collect();
    file[FIRST..end].copy_from_slice(&sorted);
}

/// Places of all attributes of the first header: name, type, size and value of each; `None` if the header
/// does not end in the file.
fn places(file: &[u8]) -> Option<Vec<Range<usize>>> {
    let after_text = |start: usize| Some(start + file.get(start..)?.iter().position(|&byte| byte == 0)? + 1);
    let mut places = Vec::new();
    let mut start = FIRST;
    while *file.get(start)? != 0 {
        let size = after_text(after_text(start)?)?;
        let bytes = file.get(size..)?.first_chunk().map(|bytes| u32::from_le_bytes(*bytes))?;
        let end = (size + 4).checked_add(bytes as usize).filter(|&end| end <= file.len())?;
        places.push(start..end);
        start = end;
    }
    Some(places)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attribute(name: &str, value: &[u8]) -> Vec<u8> {
        let length = (value.len() as u32).to_le_bytes();
        [name.as_bytes(), b"\0string\0", &length, value].concat()
    }

    #[test]
    fn free_attributes_are_sorted_behind_the_others() {
        let [a, b, c, d] = ["x/a", "x/b", "channels", "owner"].map(|name| attribute(name, name.as_bytes()));
        let file = |parts: &[&[u8]]| [&[0; FIRST][..], &parts.concat(), &[0, 7, 7]].concat();
        for order in [[&a, &c, &b, &d], [&b, &c, &a, &d], [&c, &b, &d, &a]] {
            let mut bytes = file(&order.map(Vec::as_slice));
            sort(&mut bytes, |name| name.starts_with("x/"));
            assert_eq!(bytes, file(&[&c, &d, &a, &b]));
        }
        let one = file(&[&a, &c, &d]);
        let mut bytes = one.clone();
        sort(&mut bytes, |name| name.starts_with("x/"));
        assert_eq!(bytes, one);
    }

    #[test]
    fn a_truncated_header_stays() {
        let whole = [&[0; FIRST][..], &attribute("x/b", b"1"), &attribute("x/a", b"2")].concat();
        for end in 0..whole.len() {
            let mut bytes = whole[..end].to_vec();
            sort(&mut bytes, |_| true);
            assert_eq!(bytes, whole[..end]);
        }
    }
}
