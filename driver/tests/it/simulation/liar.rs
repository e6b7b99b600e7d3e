//! Falsified output of a card, as by bad memory or altered firmware.

use photoncard_firmware::sampler::hash;
use photoncard_shared::frame::{Frame, FrameReader, MAX_FRAME, MAX_PAYLOAD, write_frame};
use photoncard_shared::message::{
    self, ALBEDO_STEPS, NORMAL_STEPS, PIXEL_BYTES, PixelForm, PixelSums, Reply,
};

use super::line::Random;

/// Falsification of a pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Lie {
    /// An impossible sum in a pixel.
    Impossible(fn(&mut PixelSums)),
    /// Red increased by a factor.
    Brighter(f32),
    /// Green replaced by a sum.
    Dazzling(i64),
}

impl Lie {
    /// Falsification that the pixel itself reveals.
    pub(crate) fn impossible(random: &mut Random) -> Self {
        const LIES: [fn(&mut PixelSums); 11] = [
            |sums| sums.light[1] = -1,
            |sums| sums.light[2] = i64::MIN,
            |sums| sums.albedo[0] = u32::MAX,
            |sums| sums.albedo[2] = sums.surfaces * ALBEDO_STEPS + 1,
            |sums| sums.normal[0] = i32::MIN,
            |sums| sums.normal = [sums.surfaces as i32 * NORMAL_STEPS as i32 * 7 / 10; 3],
            |sums| (sums.surfaces, sums.depth) = (0, 1),
            |sums| sums.depth = i64::MIN,
            |sums| sums.depth = i64::MAX,
            |sums| sums.depth = 1 << 56,
            |sums| sums.surfaces = u32::MAX,
        ];
        Self::Impossible(LIES[random.below(LIES.len())])
    }

    fn apply(self, pixel: &mut [u8]) {
        let mut sums = PixelSums::read(PixelForm::PLAIN, pixel).unwrap();
        match self {
            // Some lies are possible sums of a pixel without surfaces: the number of surfaces is falsified
            // then.
            Self::Impossible(lie) => {
                lie(&mut sums);
                sums.surfaces += u32::from(sums.surfaces == 0 && sums.depth == 0) * u32::MAX;
            }
            Self::Dazzling(light) => sums.light[1] = light,
            Self::Brighter(factor) => {
                // A factor would not change a black pixel.
                sums.light[0] = ((sums.light[0] as f64 + 1e9) * f64::from(factor)) as i64;
            }
        }
        let mut bytes = Vec::new();
        sums.write(&mut |part| bytes.extend_from_slice(part));
        pixel.copy_from_slice(&bytes);
    }
}

/// Filter of a card's output, which parses its frames and forwards them.
pub(crate) struct Voice {
    reader: FrameReader,
    /// Falsification, and `n` if it concerns one of `n` tiles.
    pub(crate) lie: Option<(Lie, u32)>,
    /// Bytes of whole frames to be sent.
    pub(crate) said: Vec<u8>,
    /// Tiles reported as done, the oldest first.
    pub(crate) done: Vec<u32>,
}

impl Voice {
    pub(crate) fn new() -> Self {
        Self { reader: FrameReader::new(), lie: None, said: Vec::new(), done: Vec::new() }
    }

    /// Falsification of a tile, if any.
    fn lies_about(&self, tile: u32) -> Option<Lie> {
        self.lie.filter(|(_, one_of)| hash(tile).is_multiple_of(*one_of)).map(|(lie, _)| lie)
    }

    /// Processes bytes that the card sends.
    pub(crate) fn hear(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let (taken, frame) = self.reader.read(bytes);
            bytes = &bytes[taken..];
            let Some(Ok(Frame { header, payload })) = frame else { continue };
            let mut payload = payload.to_vec();
            let mut altered = vec![0; MAX_PAYLOAD];
            match message::decode::<Reply>(&payload) {
                Some(Reply::TileDone { tile, .. }) => self.done.push(tile),
                Some(Reply::Pixels { tile, first, data }) => {
                    if let Some(lie) = self.lies_about(tile) {
                        let mut data = data.to_vec();
                        lie.apply(&mut data[..PIXEL_BYTES]);
                        let reply = Reply::Pixels { tile, first, data: &data };
                        let length = message::encode(&reply, &mut altered).unwrap();
                        altered.truncate(length);
                        payload = altered;
                    }
                }
                _ => {}
            }
            let mut wire = heapless::Vec::<u8, MAX_FRAME>::new();
            write_frame(&header, &payload, &mut wire);
            self.said.extend(wire);
        }
    }
}
