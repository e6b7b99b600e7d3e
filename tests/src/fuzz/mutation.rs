//! Random edits of bytes and of JSON tokens.

use std::ops::Range;

use super::random::Random;

/// Maximum length of an input after an edit, bytes.
const MAX_BYTES: usize = 1 << 17;
/// Maximum length of the range that an edit inserts, deletes, repeats or takes from another input, bytes.
const CHUNK: usize = 256;

/// Integers at the limits of fields of 8 to 64 bits.
const WORDS: [u64; 24] = [
    0,
    1,
    2,
    3,
    0x7f,
    0x80,
    0xff,
    0x100,
    0x7fff,
    0x8000,
    0xffff,
    0x1_0000,
    1 << 20,
    1 << 24,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_fffe,
    0xffff_ffff,
    1 << 32,
    1 << 48,
    i64::MAX as u64,
    1 << 63,
    u64::MAX - 1,
    u64::MAX,
];

/// Floating-point numbers at the limits of arithmetic.
const FLOATS: [f32; 14] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::MAX,
    f32::MIN,
    f32::MIN_POSITIVE,
    1e-45,
    1e-20,
    1e20,
    16_777_216.0,
];

/// Random range within `bytes` bytes, of at most [`CHUNK`].
fn chunk(bytes: usize, random: &mut Random) -> Range<usize> {
    let start = random.below(bytes);
    let most = CHUNK.min(bytes - start);
    start..start + random.below(most + 1)
}

/// Overwrites 1, 2, 4 or 8 bytes from `place` on by a number of [`WORDS`] or [`FLOATS`].
pub(crate) fn put_word(bytes: &mut [u8], place: usize, random: &mut Random) {
    let word = if random.once_in(3) {
        u64::from(random.pick(&FLOATS).to_bits())
    } else {
        let word = *random.pick(&WORDS);
        // One of four numbers is the listed number minus 0 to 63.
        if random.once_in(4) { word.wrapping_sub(random.below(64) as u64) } else { word }
    };
    let mut word = word.to_le_bytes();
    let size = *random.pick(&[1, 2, 4, 4, 8]);
    if random.once_in(16) {
        word[..size].reverse();
    }
    for (target, byte) in bytes.iter_mut().skip(place).zip(&word[..size]) {
        *target = *byte;
    }
}

/// Makes one edit of arbitrary bytes. Inserted ranges come from the bytes themselves and from `others`.
pub(crate) fn edit_bytes(bytes: &mut Vec<u8>, others: &[Vec<u8>], random: &mut Random) {
    if bytes.is_empty() {
        bytes.push(random.next() as u8);
        return;
    }
    let place = random.below(bytes.len());
    match random.below(12) {
        0..=1 => bytes[place] ^= 1 << random.below(8),
        2 => bytes[place] = random.next() as u8,
        3..=4 => put_word(bytes, place, random),
        5 => bytes[place] = bytes[place].wrapping_add(random.below(33) as u8).wrapping_sub(16),
        6 => {
            let (byte, count) = (random.next() as u8, random.below(16));
            bytes.splice(place..place, std::iter::repeat_n(byte, count));
        }
        7 => drop(bytes.drain(chunk(bytes.len(), random))),
        8 => {
            let copy = bytes[chunk(bytes.len(), random)].to_vec();
            bytes.splice(place..place, copy);
        }
        9 if !others.is_empty() => {
            let other = random.pick(others);
            let from = other.get(chunk(other.len().max(1), random)).unwrap_or(&[]);
            let end = if random.once_in(2) { place } else { (place + from.len()).min(bytes.len()) };
            bytes.splice(place..end, from.iter().copied());
        }
        10 if random.once_in(2) => bytes.truncate(place),
        _ => {
            let range = chunk(bytes.len(), random);
            let value = *random.pick(&[0, 0xff, b' ', b'0']);
            bytes[range].fill(value);
        }
    }
    bytes.truncate(MAX_BYTES);
}

/// Makes several edits of arbitrary bytes.
pub(crate) fn edit(bytes: &mut Vec<u8>, others: &[Vec<u8>], random: &mut Random) {
    for _ in 0..random.edits() {
        edit_bytes(bytes, others, random);
    }
}

/// Replacements of JSON numbers.
const NUMBERS: [&str; 28] = [
    "0",
    "-0",
    "1",
    "-1",
    "2",
    "3",
    "4",
    "0.5",
    "1e-46",
    "1e39",
    "-1e39",
    "1e308",
    "1e309",
    "3.5e38",
    "255",
    "65536",
    "1048576",
    "50331645",
    "2147483647",
    "4294967295",
    "4294967296",
    "9007199254740993",
    "18446744073709551615",
    "18446744073709551616",
    "-9223372036854775808",
    "NaN",
    "null",
    "[1,2,3]",
];

/// Replacements of JSON strings.
const STRINGS: [&str; 14] = [
    "\"\"",
    "\"data:,\"",
    "\"data:application/octet-stream;base64,AAAA\"",
    "\"scene\"",
    "\"../scene\"",
    "\"MAT4\"",
    "\"SCALAR\"",
    "\"POSITION\"",
    "\"sparse\"",
    "\"matrix\"",
    "\"byteStride\"",
    "\"extensions\"",
    "\"\\ud83c\\udf73\"",
    "0",
];

/// Ranges of the numbers in JSON text or, if `strings`, of its strings with their quotes.
fn tokens(text: &[u8], strings: bool) -> Vec<Range<usize>> {
    let mut found = Vec::new();
    let mut at = 0;
    while at < text.len() {
        let start = at;
        if text[at] == b'"' {
            at += 1;
            while at < text.len() && text[at] != b'"' {
                at += if text[at] == b'\\' { 2 } else { 1 };
            }
            at = (at + 1).min(text.len());
            if strings {
                found.push(start..at);
            }
        } else if text[at].is_ascii_digit() || text[at] == b'-' {
            let is_part = |byte: &u8| byte.is_ascii_digit() || b"+-.eE".contains(byte);
            at += text[at..].iter().take_while(|byte| is_part(byte)).count();
            if !strings {
                found.push(start..at);
            }
        } else {
            at += 1;
        }
    }
    found
}

/// End of the JSON value that begins at `start`: position of the comma or bracket behind it.
fn value_end(text: &[u8], start: usize) -> usize {
    let (mut depth, mut is_string) = (0, false);
    for (offset, &byte) in text[start..].iter().enumerate() {
        match byte {
            b'"' => is_string = !is_string,
            b'[' | b'{' if !is_string => depth += 1,
            b']' | b'}' | b',' if !is_string && depth == 0 => return start + offset,
            b']' | b'}' if !is_string => depth -= 1,
            _ => {}
        }
    }
    text.len()
}

/// Makes one edit of JSON text, most often of a single token.
pub(crate) fn edit_json(text: &mut Vec<u8>, random: &mut Random) {
    let is_string = random.once_in(3);
    let found = tokens(text, is_string);
    if found.is_empty() {
        return;
    }
    let place = random.pick(&found).clone();
    let other = text[random.pick(&found).clone()].to_vec();
    match random.below(16) {
        0 => drop(text.splice(place, other)),
        // One digit changes, so that most indices and factors stay in range.
        1..=5 if !is_string => {
            let digit = place.start + random.below(place.len());
            if text[digit].is_ascii_digit() {
                text[digit] = b'0' + random.below(10) as u8;
            }
        }
        1..=11 => {
            let list = if is_string { &STRINGS[..] } else { &NUMBERS[..] };
            let new = if random.once_in(6) {
                random.below(20).to_string()
            } else {
                (*random.pick(list)).to_owned()
            };
            drop(text.splice(place, new.into_bytes()));
        }
        12 => {
            // A value is repeated, as the next element of its array or object.
            let end = value_end(text, place.start);
            let mut copy = text[place.start..end].to_vec();
            copy.push(b',');
            drop(text.splice(place.start..place.start, copy));
        }
        13 => {
            // A value is deleted, with its comma.
            let end = (value_end(text, place.start) + 1).min(text.len());
            drop(text.drain(place.start..end));
        }
        _ => {
            // A value is nested in arrays, at times deeper than a reader may follow.
            let depth = if random.once_in(4) { 200 + random.below(4000) } else { random.below(4) };
            let nested = [vec![b'['; depth], other, vec![b']'; depth]].concat();
            drop(text.splice(place, nested));
        }
    }
    text.truncate(MAX_BYTES);
}
