//! Packets of tev's protocol, which its `README.md` and `src/Ipc.cpp` describe.
//!
//! A packet consists of its length in bytes (`u32`, including these four), the number of an operation (one
//! byte) and its arguments. Numbers are little-endian, strings end with a zero byte, a Boolean is a byte of 0
//! or 1.
//!
//! ```text
//! CreateImage    4   grab focus, image, width i32, height i32, channels i32, the channels' names
//! UpdateImageV3  6   grab focus, image, channels i32, the channels' names, x i32, y i32, width i32, height i32,
//!                    offset of each channel i64, stride of each channel i64, f32 ...
//! ```
//!
//! Offsets and strides are in units of `f32`: value number `offset[c] + p * stride[c]` is channel `c` of the
//! rectangle's pixel `p`, row by row. This client stores the channels of a pixel side by side. `CreateImage`
//! replaces an image with the same name.

use photoncard_picture::printable::printable;
use photoncard_shared::message::Tile;

/// Operation that creates an image, or replaces the image with the same name.
pub(crate) const CREATE_IMAGE: u8 = 4;
/// Operation that replaces the values of a rectangle in some channels.
pub(crate) const UPDATE_IMAGE: u8 = 6;

/// Creates a packet that creates a black image of `width` x `height` pixels and gives it the viewer's focus.
pub(crate) fn create_image(image: &str, [width, height]: [u32; 2], channels: &[&str]) -> Vec<u8> {
    let mut packet = Packet::new(CREATE_IMAGE, true, image);
    packet.numbers([width, height]);
    packet.names(channels);
    packet.end()
}

/// Creates a packet that replaces a rectangle of an image. `values` are the channels of each pixel in turn,
/// row by row.
pub(crate) fn update_image(
    image: &str,
    rectangle: &Tile,
    channels: &[&str],
    values: impl Iterator<Item = f32>,
) -> Vec<u8> {
    let mut packet = Packet::new(UPDATE_IMAGE, false, image);
    packet.names(channels);
    packet.numbers([rectangle.x, rectangle.y, rectangle.width, rectangle.height]);
    let count = channels.len() as u64;
    packet.long_numbers(0..count);
    packet.long_numbers(channels.iter().map(|_| count));
    packet.0.extend(values.flat_map(f32::to_le_bytes));
    packet.end()
}

/// A packet under construction. [`Self::end`] writes its length.
struct Packet(Vec<u8>);

impl Packet {
    fn new(operation: u8, grabs_focus: bool, image: &str) -> Self {
        let mut packet = Self(vec![0; 4]);
        packet.0.extend([operation, u8::from(grabs_focus)]);
        packet.text(image);
        packet
    }

    /// Appends a text and its terminating zero byte. Escapes unprintable characters, such as zero bytes.
    fn text(&mut self, text: &str) {
        self.0.extend(printable(text).bytes().chain([0]));
    }

    /// Appends numbers as `i32`. Sides and coordinates of pictures are far below 2^31.
    fn numbers(&mut self, numbers: impl IntoIterator<Item = u32>) {
        self.0.extend(numbers.into_iter().flat_map(u32::to_le_bytes));
    }

    fn long_numbers(&mut self, numbers: impl IntoIterator<Item = u64>) {
        self.0.extend(numbers.into_iter().flat_map(u64::to_le_bytes));
    }

    fn names(&mut self, channels: &[&str]) {
        self.numbers([channels.len() as u32]);
        channels.iter().for_each(|name| self.text(name));
    }

    fn end(mut self) -> Vec<u8> {
        let length = self.0.len() as u32;
        self.0[..4].copy_from_slice(&length.to_le_bytes());
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The expected bytes were written by hand from the description of the protocol.
    #[test]
    fn packets_have_the_bytes_of_the_protocol() {
        let mut created = vec![35, 0, 0, 0, 4, 1];
        created.extend(b"a.exr\0");
        created.extend([0, 1, 0, 0, 3, 0, 0, 0]);
        created.extend([2, 0, 0, 0]);
        created.extend(b"R\0albedo.G\0");
        assert_eq!(create_image("a.exr", [256, 3], &["R", "albedo.G"]), created);

        let mut updated = vec![84, 0, 0, 0, 6, 0];
        updated.extend(b"a.exr\0");
        updated.extend([2, 0, 0, 0]);
        updated.extend(b"R\0G\0");
        updated.extend([16, 0, 0, 0, 0, 1, 0, 0, 2, 0, 0, 0, 1, 0, 0, 0]);
        updated.extend([0; 8]);
        updated.extend([1, 0, 0, 0, 0, 0, 0, 0]);
        updated.extend([2, 0, 0, 0, 0, 0, 0, 0].repeat(2));
        // 1, -2, 0.5, 0.
        updated.extend([0, 0, 0x80, 0x3f, 0, 0, 0, 0xc0, 0, 0, 0, 0x3f, 0, 0, 0, 0]);
        let rectangle = Tile { id: 9, x: 16, y: 256, width: 2, height: 1 };
        let values = [1.0, -2.0, 0.5, 0.0];
        assert_eq!(update_image("a.exr", &rectangle, &["R", "G"], values.into_iter()), updated);
        let escaped = create_image("a\\0\\u{1b}", [256, 3], &[]);
        assert_eq!(create_image("a\0\u{1b}", [256, 3], &[]), escaped);
    }
}
