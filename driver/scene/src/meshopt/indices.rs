//! Decoder of index streams.

const TRIANGLES_HEADER: u8 = 0xe1;
const SEQUENCE_HEADER: u8 = 0xd1;

/// Size of the table of codes at the end of a stream of triangles, bytes.
const TABLE: usize = 16;

/// Size of the padding after a sequence, bytes.
const PADDING: usize = 4;

/// Maximum size of an integer of variable length, bytes.
const MAX_VARIABLE: u32 = 5;

/// Ring of the last sixteen values, with the number of values pushed so far. It initially holds no valid
/// vertex index.
struct Recent<T>([T; 16], usize);

impl<T: Copy> Recent<T> {
    fn push(&mut self, value: T) {
        self.0[self.1 % 16] = value;
        self.1 += 1;
    }

    /// Value that was pushed `back` pushes before the last one.
    fn get(&self, back: u8) -> T {
        self.0[(self.1 + 15 - usize::from(back % 16)) % 16]
    }
}

/// State of the decoder of triangles.
struct Triangles<'a> {
    /// Rest of the stream: second code bytes of triangles that have one, and differences of indices.
    data: &'a [u8],
    edges: Recent<[u32; 2]>,
    vertices: Recent<u32>,
    /// Index of the next vertex that is coded as new.
    next: u32,
    /// Last index that was coded as a difference.
    last: u32,
}

/// Decodes lists of triangles; `None` if the stream is damaged.
pub(super) fn decode_triangles(mut stream: &[u8], stride: usize, decoded: &mut [u8]) -> Option<()> {
    if *stream.split_off_first()? != TRIANGLES_HEADER {
        return None;
    }
    let codes = stream.split_off(..decoded.len() / (3 * stride))?;
    let table = stream.split_off(stream.len().checked_sub(TABLE)?..)?;
    let mut state = Triangles {
        data: stream,
        edges: Recent([[u32::MAX; 2]; 16], 0),
        vertices: Recent([u32::MAX; 16], 0),
        next: 0,
        last: 0,
    };
    for (code, triangle) in codes.iter().zip(decoded.chunks_exact_mut(3 * stride)) {
        let corners = match (code >> 4, code & 15) {
            (15, place @ 0..14) => state.fresh(table[usize::from(place)])?,
            (15, place) => state.stated(place == 15)?,
            (edge, third) => state.beside(edge, third)?,
        };
        for (index, corner) in triangle.chunks_exact_mut(stride).zip(corners) {
            write(index, corner)?;
        }
    }
    state.data.is_empty().then_some(())
}

impl Triangles<'_> {
    /// Decodes a triangle that shares a recent edge.
    fn beside(&mut self, edge: u8, third: u8) -> Option<[u32; 3]> {
        let [a, b] = self.edges.get(edge);
        let c = match third {
            0 => self.fresh_index(),
            1..13 => self.vertices.get(third),
            13 => self.moved(u32::MAX),
            14 => self.moved(1),
            _ => self.stated_index()?,
        };
        if !(1..13).contains(&third) {
            self.vertices.push(c);
        }
        self.edges.push([c, b]);
        self.edges.push([a, c]);
        Some([a, b, c])
    }

    /// Decodes a triangle whose first vertex is the next new one. `code` has four bits for each of the other
    /// two.
    fn fresh(&mut self, code: u8) -> Option<[u32; 3]> {
        let a = self.fresh_index();
        self.complete(a, code)
    }

    /// Decodes a triangle whose code is the next byte of the data. If `is_stated`, its first index follows as
    /// a difference.
    fn stated(&mut self, is_stated: bool) -> Option<[u32; 3]> {
        let code = *self.data.split_off_first()?;
        if code == 0 {
            self.next = 0;
        }
        let a = if is_stated { self.stated_index()? } else { self.fresh_index() };
        self.complete(a, code)
    }

    fn complete(&mut self, a: u32, code: u8) -> Option<[u32; 3]> {
        let [second, third] = [code >> 4, code & 15];
        let (b, c) = (self.corner(second)?, self.corner(third)?);
        self.vertices.push(a);
        for (digit, index) in [(second, b), (third, c)] {
            if matches!(digit, 0 | 15) {
                self.vertices.push(index);
            }
        }
        for edge in [[b, a], [c, b], [a, c]] {
            self.edges.push(edge);
        }
        Some([a, b, c])
    }

    fn corner(&mut self, digit: u8) -> Option<u32> {
        match digit {
            0 => Some(self.fresh_index()),
            15 => self.stated_index(),
            recent => Some(self.vertices.get(recent - 1)),
        }
    }

    fn fresh_index(&mut self) -> u32 {
        let index = self.next;
        self.next = index.wrapping_add(1);
        index
    }

    fn stated_index(&mut self) -> Option<u32> {
        let difference = signed(variable(&mut self.data)?);
        Some(self.moved(difference))
    }

    fn moved(&mut self, difference: u32) -> u32 {
        self.last = self.last.wrapping_add(difference);
        self.last
    }
}

/// Decodes a sequence of indices; `None` if the stream is damaged.
pub(super) fn decode_sequence(mut stream: &[u8], stride: usize, decoded: &mut [u8]) -> Option<()> {
    if *stream.split_off_first()? != SEQUENCE_HEADER {
        return None;
    }
    stream.split_off(stream.len().checked_sub(PADDING)?..)?;
    let mut last = [0_u32; 2];
    for index in decoded.chunks_exact_mut(stride) {
        let code = variable(&mut stream)?;
        let last = &mut last[(code & 1) as usize];
        *last = last.wrapping_add(signed(code >> 1));
        write(index, *last)?;
    }
    stream.is_empty().then_some(())
}

/// Reads an integer of seven bits per byte, the least significant ones first.
fn variable(data: &mut &[u8]) -> Option<u32> {
    let mut value = 0;
    for place in 0..MAX_VARIABLE {
        let byte = *data.split_off_first()?;
        value |= u32::from(byte & 0x7f) << (7 * place);
        if byte < 0x80 {
            return Some(value);
        }
    }
    None
}

/// Decodes the zigzag code of a difference.
fn signed(code: u32) -> u32 {
    (code >> 1) ^ (code & 1).wrapping_neg()
}

/// Writes an index to `place`, two or four bytes; `None` if the index takes more.
fn write(place: &mut [u8], index: u32) -> Option<()> {
    let bytes = index.to_le_bytes();
    let (low, high) = bytes.split_at_checked(place.len())?;
    place.copy_from_slice(low);
    high.iter().all(|byte| *byte == 0).then_some(())
}
