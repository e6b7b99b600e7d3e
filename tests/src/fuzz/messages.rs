//! Fuzzing of messages: payloads that may be commands, replies, or neither.

use photoncard_firmware::kind::{MICRO, REFERENCE};
use photoncard_shared::counters::Counters;
use photoncard_shared::frame::MAX_PAYLOAD;
use photoncard_shared::message::{
    self, Board, Camera, CausticGather, Command, Drain, Fault, FaultCode, Filter, FrameParameters,
    MemoryPattern, MemoryTest, MemoryUse, Radiance, Reply, Sampling, Tile, WrongWord, WrongWords,
};

use super::mutation;
use super::random::Random;
use super::target::{Target, bound};

/// Target for messages.
pub(super) struct Messages {
    seeds: Vec<Vec<u8>>,
}

/// Parameters of a frame that every kind of chip can render.
pub(super) fn frame() -> FrameParameters {
    let camera = Camera::pinhole([0.0, 1.0, 5.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    FrameParameters {
        width: 640,
        height: 480,
        camera,
        seed: 7,
        first_sample: 0,
        samples: 16,
        planned_samples: 16,
        gather_rays: 200,
        shadow_rays: 8,
        neighbors: 100,
        max_distance: 0.5,
        sampling: Sampling::Product,
        filter: Filter::Gaussian,
        irradiance_error: Some(0.1),
        bins: 64,
        drain: Drain::Sort,
        queue: 1024,
        radiance: Radiance::Precomputed,
        caustics: Some(CausticGather { neighbors: 50, max_distance: 1.0 }),
        layers: false,
        light_groups: 0,
        in_flight: 3,
        keep_records: true,
        adaptive_threshold: Some(0.5),
        transparent: false,
        position: false,
        coverage: false,
        identities: false,
        irradiance: false,
        near_distance: 0.25,
    }
}

/// One encoded command of each kind.
pub(super) fn commands() -> Vec<Vec<u8>> {
    let data = [0x5a; 256];
    let commands = [
        Command::Hello { protocol: 6, layout: 3 },
        Command::ReadChecksums { first: 3, count: 70_000 },
        Command::BeginImage { lines: 300, checksum: 0xdead_beef_cafe_f00d },
        Command::WriteLines { first: 200, data: &data },
        Command::EndImage,
        Command::BeginFrame(frame()),
        Command::RenderTile(Tile { id: 7, x: 300, y: 16, width: 16, height: 16 }),
        Command::Compute { operands: &data[..24] },
        Command::TestMemory,
        Command::Flush,
    ];
    commands.iter().map(|command| written(MAX_PAYLOAD, |bytes| message::encode(command, bytes))).collect()
}

/// One encoded reply of each kind.
pub(super) fn replies() -> Vec<Vec<u8>> {
    let data = [0x5a; 400];
    let hello = |budget, memory_use, board| Reply::Hello {
        protocol: 6,
        layout: 3,
        budget,
        written_lines: 300,
        memory_use,
        build: "firmware 1",
        board,
    };
    let memory_use = MemoryUse { static_bytes: 107_872, stack_bytes: 16_384, stack_used: 5948 };
    let board = Board { name: "a board", serial_number: "\u{1b}7", clock_hz: 25_000_000 };
    let replies = [
        hello(REFERENCE, None, None),
        hello(MICRO, Some(memory_use), Some(board)),
        Reply::Checksums { first: 3, data: &data },
        Reply::ImageAccepted,
        Reply::FrameAccepted,
        Reply::Pixels { tile: 7, first: 25, data: &data },
        Reply::TileDone { tile: 7, counters: Counters::ZERO },
        Reply::Fault(Fault { code: FaultCode::Depth, detail: 1 << 30 }),
        Reply::Computed { results: &data[..168] },
        Reply::MemoryTested(MemoryTest {
            lines: 4096,
            pattern: MemoryPattern::Address,
            written: 4096,
            checked: 64,
            wrong: WrongWords {
                count: 1,
                bits: 1,
                first: Some(WrongWord { index: 7, expected: 7, found: 6 }),
            },
        }),
    ];
    replies.iter().map(|reply| written(MAX_PAYLOAD, |bytes| message::encode(reply, bytes))).collect()
}

fn written(most: usize, encode: impl FnOnce(&mut [u8]) -> Option<usize>) -> Vec<u8> {
    let mut bytes = vec![0; most];
    let length = encode(&mut bytes).expect("there is room for the message");
    bytes.truncate(length);
    bytes
}

impl Messages {
    pub(super) fn new() -> Self {
        Self { seeds: [commands(), replies()].concat() }
    }
}

/// Decodes a command and encodes it again, which must not make it longer. `None` if the input is no command.
fn rewritten_command(input: &[u8]) -> Option<Vec<u8>> {
    let command = message::decode::<Command>(input)?;
    Some(written(input.len(), |bytes| message::encode(&command, bytes)))
}

/// Decodes a reply and encodes it again, which must not make it longer. `None` if the input is no reply.
fn rewritten_reply(input: &[u8]) -> Option<Vec<u8>> {
    let reply = message::decode::<Reply>(input)?;
    Some(written(input.len(), |bytes| message::encode(&reply, bytes)))
}

impl Target for Messages {
    fn name(&self) -> &'static str {
        "messages"
    }

    fn allocation_bound(&self, input: usize) -> usize {
        bound(input, 16)
    }

    fn input(&self, random: &mut Random) -> Vec<u8> {
        let mut bytes = random.pick(&self.seeds).clone();
        mutation::edit(&mut bytes, &self.seeds, random);
        bytes.truncate(MAX_PAYLOAD);
        bytes
    }

    fn read(&self, input: &[u8]) -> bool {
        let mut is_sound = false;
        for rewritten in [rewritten_command, rewritten_reply] {
            if let Some(once) = rewritten(input) {
                assert_eq!(rewritten(&once).as_ref(), Some(&once), "written otherwise than read");
                is_sound = true;
            }
        }
        is_sound
    }
}
