//! Tests of the link's formats: frames arrive whole or not at all, and no opcode changes.

use photoncard_shared::budget::Budget;
use photoncard_shared::checksum::checksum;
use photoncard_shared::counters::Counters;
use photoncard_shared::frame::{
    FrameError, FrameHeader, FrameKind, FrameReader, MAX_FRAME, MAX_PAYLOAD, write_frame,
};
use photoncard_shared::message::*;
use proptest::prelude::*;

/// Budget with values as large as those of real cards.
const BUDGET: Budget = Budget {
    sram_bytes: 1 << 20,
    dram_bytes: 8 << 30,
    photon_cache_bytes: 128 << 10,
    scene_cache_bytes: 75 << 10,
    stack_bytes: 16 << 10,
    tile_pixels: 4096,
    neighbors: 256,
    gather_rays: 1 << 14,
    gather_queue: 12_640,
    irradiance_records: 512,
    shadow_rays: 64,
    samples: 4097,
    tiles: 4,
    in_flight: 2,
    waiting_blocks: 32,
};

const HEADER: FrameHeader =
    FrameHeader { kind: FrameKind::Data, session: 0x1234_5678, sequence: 0, acknowledged: 7, held: 0b101 };

fn frame(header: &FrameHeader, payload: &[u8]) -> Vec<u8> {
    let mut wire = heapless::Vec::<u8, MAX_FRAME>::new();
    write_frame(header, payload, &mut wire);
    wire.to_vec()
}

/// Decodes `bytes` in pieces of `piece` bytes. Returns all frames and errors.
fn read_all(bytes: &[u8], piece: usize) -> Vec<Result<(FrameHeader, Vec<u8>), FrameError>> {
    let mut reader = FrameReader::new();
    let mut found = Vec::new();
    for mut chunk in bytes.chunks(piece) {
        while !chunk.is_empty() {
            let (taken, result) = reader.read(chunk);
            found.extend(result.map(|r| r.map(|f| (f.header, f.payload.to_vec()))));
            chunk = &chunk[taken..];
        }
    }
    found
}

proptest! {
    #[test]
    fn a_payload_is_read_back_from_pieces_of_any_size(
        payload in proptest::collection::vec(any::<u8>(), 0..=MAX_PAYLOAD),
        piece in 1_usize..3000,
    ) {
        let wire = frame(&HEADER, &payload);
        prop_assert!(wire.len() <= MAX_FRAME);
        prop_assert_eq!(read_all(&wire, piece), vec![Ok((HEADER, payload))]);
    }

    #[test]
    fn a_flipped_bit_never_yields_another_payload(
        payload in proptest::collection::vec(any::<u8>(), 1..200),
        position in any::<prop::sample::Index>(),
        bit in 0_u32..8,
    ) {
        let mut wire = frame(&HEADER, &payload);
        let position = position.index(wire.len());
        wire[position] ^= 1_u8 << bit;
        wire.push(0);
        for found in read_all(&wire, 64).into_iter().flatten() {
            prop_assert_eq!(found, (HEADER, payload.clone()));
        }
    }

    #[test]
    fn after_garbage_the_next_frame_is_found(garbage in proptest::collection::vec(any::<u8>(), 0..6000)) {
        let mut wire = garbage;
        wire.push(0);
        wire.extend(frame(&HEADER, b"good"));
        prop_assert_eq!(read_all(&wire, 100).pop(), Some(Ok((HEADER, b"good".to_vec()))));
    }

    #[test]
    fn decoding_arbitrary_bytes_does_not_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let _ = decode::<Command>(&bytes);
        let _ = decode::<Reply>(&bytes);
    }
}

/// Pins the bytes of frames on the wire.
#[test]
fn frames_have_their_golden_bytes() {
    let header =
        |kind| FrameHeader { kind, session: 0x0102_0304, sequence: 3, acknowledged: 0x0405, held: 6 };
    let golden: [(FrameKind, &[u8], &[u8]); 6] = [
        (
            FrameKind::Data,
            &[0, 1, 2],
            &[
                0x01, 0x06, 0x04, 0x03, 0x02, 0x01, 0x03, 0x04, 0x05, 0x04, 0x06, 0x07, 0x01, 0x02, 0x20,
                0x53, 0x84, 0xf2, 0x00,
            ],
        ),
        (
            FrameKind::Open,
            &[104, 105],
            &[
                0x07, 0x01, 0x04, 0x03, 0x02, 0x01, 0x03, 0x0a, 0x05, 0x04, 0x06, 0x68, 0x69, 0x63, 0xc3,
                0x8b, 0x7e, 0x00,
            ],
        ),
        (
            FrameKind::Acknowledge,
            &[],
            &[0x07, 0x02, 0x04, 0x03, 0x02, 0x01, 0x03, 0x08, 0x05, 0x04, 0x06, 0xa7, 0x06, 0xa7, 0x51, 0x00],
        ),
        (
            FrameKind::Probe,
            &[],
            &[0x07, 0x03, 0x04, 0x03, 0x02, 0x01, 0x03, 0x08, 0x05, 0x04, 0x06, 0x02, 0x7d, 0xf1, 0x9a, 0x00],
        ),
        (
            FrameKind::Answer,
            &[],
            &[0x07, 0x04, 0x04, 0x03, 0x02, 0x01, 0x03, 0x08, 0x05, 0x04, 0x06, 0x9b, 0xf2, 0x8a, 0xe1, 0x00],
        ),
        (
            FrameKind::Unknown,
            &[],
            &[0x07, 0x05, 0x04, 0x03, 0x02, 0x01, 0x03, 0x08, 0x05, 0x04, 0x06, 0x3e, 0x89, 0xdc, 0x2a, 0x00],
        ),
    ];
    for (kind, payload, wire) in golden {
        assert_eq!(frame(&header(kind), payload), wire, "{kind:?}");
        assert_eq!(read_all(wire, 5), [Ok((header(kind), payload.to_vec()))]);
    }
}

/// Pins the numbers in `docs/protocol.md`.
#[test]
fn the_longest_frame_is_pinned() {
    assert_eq!((MAX_PAYLOAD, MAX_FRAME), (1056, 1076));
    let longest = frame(&HEADER, &[1; MAX_PAYLOAD]);
    assert_eq!(longest.len(), MAX_FRAME);
    assert_eq!(read_all(&longest, 100), [Ok((HEADER, vec![1; MAX_PAYLOAD]))]);
}

#[test]
fn a_frame_longer_than_the_maximum_is_an_error() {
    let mut longer = vec![2; MAX_FRAME];
    longer.push(0);
    assert_eq!(read_all(&longer, 100), [Err(FrameError::TooLong)]);
    // Zero bytes are stuffed in fewer bytes: this frame is shorter than the maximum, but its payload is too
    // long.
    let payload = [0; MAX_PAYLOAD + 1];
    assert!(frame(&HEADER, &payload).len() < MAX_FRAME);
    assert_eq!(read_all(&frame(&HEADER, &payload), 100), [Err(FrameError::TooLong)]);
}

#[test]
fn a_frame_that_does_not_fit_is_not_written() {
    let mut wire = heapless::Vec::<u8, 20>::new();
    write_frame(&HEADER, &[1; 20], &mut wire);
    assert!(wire.is_empty());
}

#[test]
fn the_frame_checksum_is_crc32c() {
    assert_eq!(checksum(b"123456789"), 0xe306_9283);
}

#[test]
fn the_longest_messages_fit_a_frame() {
    let mut bytes = [0; MAX_PAYLOAD];
    let lines = [0xff; 128 * LINES_PER_WRITE];
    assert!(encode(&Command::WriteLines { first: u32::MAX, data: &lines }, &mut bytes).is_some());
    let pixels = [0xff; PIXELS_BYTES];
    assert!(encode(&Reply::Pixels { tile: u32::MAX, first: u32::MAX, data: &pixels }, &mut bytes).is_some());
    let checksums = [0xff; 8 * CHECKSUMS_PER_REPLY as usize];
    assert!(encode(&Reply::Checksums { first: u32::MAX, data: &checksums }, &mut bytes).is_some());
    let operands = [0xff; CASES_PER_COMMAND * OPERAND_BYTES];
    assert!(encode(&Command::Compute { operands: &operands }, &mut bytes).is_some());
    let results = [0xff; CASES_PER_COMMAND * RESULT_BYTES];
    assert!(encode(&Reply::Computed { results: &results }, &mut bytes).is_some());
}

fn encoded(message: &impl serde::Serialize) -> Vec<u8> {
    let mut bytes = [0; MAX_PAYLOAD];
    let length = encode(message, &mut bytes).unwrap();
    bytes[..length].to_vec()
}

#[test]
fn opcodes_are_pinned() {
    let tile = Tile { id: 1, x: 2, y: 3, width: 4, height: 5 };
    let commands = [
        Command::Hello { protocol: 1, layout: 1 },
        Command::ReadChecksums { first: 0, count: 1 },
        Command::BeginImage { lines: 2, checksum: 3 },
        Command::WriteLines { first: 0, data: &[9] },
        Command::EndImage,
    ];
    for (opcode, command) in commands.iter().enumerate() {
        assert_eq!(encoded(command)[0] as usize, opcode);
    }
    assert_eq!(encoded(&Command::RenderTile(tile)), [6, 1, 2, 3, 4, 5]);
    assert_eq!(encoded(&Command::Compute { operands: &[9, 8] }), [7, 2, 9, 8]);
    assert_eq!(encoded(&Command::TestMemory), [8]);
    assert_eq!(encoded(&Command::Flush), [9]);
    let hello = |memory_use| {
        let budget = BUDGET;
        Reply::Hello { protocol: 1, layout: 1, budget, written_lines: 0, memory_use, build: "x", board: None }
    };
    let replies = [
        (hello(None), 0),
        (Reply::Checksums { first: 0, data: &[] }, 1),
        (Reply::ImageAccepted, 2),
        (Reply::FrameAccepted, 3),
        (Reply::Pixels { tile: 1, first: 0, data: &[] }, 4),
        (Reply::TileDone { tile: 1, counters: Counters::ZERO }, 5),
        (Reply::Computed { results: &[] }, 7),
    ];
    for (reply, opcode) in replies {
        assert_eq!(encoded(&reply)[0], opcode);
    }
    assert!(encoded(&hello(None)).ends_with(&[0, 0, 1, b'x', 0]));
    let memory_use = MemoryUse { static_bytes: 3, stack_bytes: 5, stack_used: 4 };
    assert!(encoded(&hello(Some(memory_use))).ends_with(&[0, 1, 3, 5, 4, 1, b'x', 0]));
}

/// Compares the version in `docs/protocol.md`, from which other implementations are written, with that of the
/// code.
#[test]
fn the_protocol_document_states_this_version() {
    let page = include_str!("../../docs/protocol.md");
    assert!(page.contains(&format!("The version is {PROTOCOL_VERSION}\n")));
}

/// Pins the bytes of structures whose fields all have distinct values. A change of these bytes needs a new
/// protocol version.
#[test]
fn structures_have_their_golden_bytes() {
    assert_eq!(PROTOCOL_VERSION, 19);
    let budget = Budget {
        sram_bytes: 1,
        dram_bytes: 2,
        photon_cache_bytes: 3,
        scene_cache_bytes: 4,
        stack_bytes: 5,
        tile_pixels: 6,
        neighbors: 7,
        gather_rays: 8,
        gather_queue: 9,
        irradiance_records: 10,
        shadow_rays: 11,
        samples: 12,
        tiles: 13,
        in_flight: 300,
        waiting_blocks: 15,
    };
    let hello = Reply::Hello {
        protocol: 6,
        layout: 5,
        budget,
        written_lines: 14,
        memory_use: None,
        build: "x",
        board: None,
    };
    let bytes = [0, 6, 5, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 0xac, 2, 15, 14, 0, 1, b'x', 0];
    assert_eq!(encoded(&hello), bytes);
    let board = Some(Board { name: "b", serial_number: "7", clock_hz: 300 });
    let hello = Reply::Hello {
        protocol: 6,
        layout: 5,
        budget,
        written_lines: 14,
        memory_use: None,
        build: "x",
        board,
    };
    assert!(encoded(&hello).ends_with(&[b'x', 1, 1, b'b', 1, b'7', 0xac, 2]));

    let one = 1.0_f32.to_le_bytes();
    let projection = Projection::Panorama { angles: [1.0, 0.0] };
    let axes = Camera::pinhole([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 0.0]);
    let camera = Camera { shift: [1.0, 0.0], projection, ..axes };
    let frame = FrameParameters {
        width: 1,
        height: 2,
        camera,
        seed: 3,
        first_sample: 10,
        samples: 4,
        planned_samples: 11,
        gather_rays: 5,
        shadow_rays: 6,
        neighbors: 7,
        max_distance: 1.0,
        sampling: Sampling::Product,
        irradiance_error: Some(1.0),
        bins: 8,
        drain: Drain::Sort,
        queue: 300,
        radiance: Radiance::Precomputed,
        caustics: Some(CausticGather { neighbors: 50, max_distance: 1.0 }),
        layers: true,
        light_groups: 2,
        filter: Filter::BlackmanHarris,
        in_flight: 9,
        keep_records: true,
        adaptive_threshold: Some(1.0),
        transparent: true,
        position: false,
        coverage: true,
        identities: false,
        irradiance: true,
        near_distance: 1.0,
    };
    let zero = [0; 4];
    let camera = [one, zero, zero, zero, one, zero, zero, zero, one, one, one, zero, one, zero].concat();
    let bytes = [
        &[5, 1, 2][..],
        &camera,
        &[3],
        &one,
        &zero,
        &[3, 10, 4, 11, 5, 6, 7],
        &one,
        &[2, 1],
        &one,
        &[8, 2, 0xac, 2, 1, 1, 50],
        &one,
        &[1, 2, 9, 1, 1],
        &one,
        &[1, 0, 1, 0, 2, 1],
        &one,
    ]
    .concat();
    assert_eq!(encoded(&Command::BeginFrame(frame)), bytes);

    let counters = Counters {
        eye_rays: 1,
        shadow_rays: 2,
        gather_rays: 3,
        survey_rays: 4,
        specular_rays: 5,
        lost_paths: 6,
        caustic_gathers: 7,
        gathers: 8,
        tables: 9,
        records: 10,
        kept_records: 11,
        lambertian_samples: 12,
        interpolated_samples: 13,
        photons_tested: 14,
        photons_taken: 15,
        photons_selected: 16,
        distances_compared: 17,
        photons_found: 18,
        photons_reflected: 19,
        photons_on_microfacets: 20,
        normals_decoded: 21,
        lookups: 22,
        points_tested: 23,
        drains: 24,
        most_waiting: 300,
        cycles: 26,
    };
    let bytes = [
        5, 16, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20, 21, 22, 23, 24, 0xac,
        2, 26,
    ];
    assert_eq!(encoded(&Reply::TileDone { tile: 16, counters }), bytes);
}

/// Pins the bytes of a memory test's progress, with a wrong word and without one.
#[test]
fn self_test_messages_have_their_golden_bytes() {
    for (number, pattern) in (0..).zip(MemoryPattern::ALL) {
        let first = Some(WrongWord { index: 5, expected: 6, found: 300 });
        let wrong = WrongWords { count: 3, bits: 4, first };
        let progress = MemoryTest { lines: 2, pattern, written: 2, checked: 1, wrong };
        let bytes = [8, 2, number, 2, 1, 3, 4, 1, 5, 6, 0xac, 2];
        assert_eq!(encoded(&Reply::MemoryTested(progress)), bytes);
        let progress = MemoryTest { checked: 2, wrong: WrongWords::default(), ..progress };
        assert_eq!(encoded(&Reply::MemoryTested(progress)), [8, 2, number, 2, 2, 0, 0, 0]);
        let is_last = number == 4;
        assert_eq!((progress.is_over(), pattern.next().is_none()), (is_last, is_last));
    }
    assert_eq!((OPERAND_BYTES, RESULT_BYTES, CASES_PER_COMMAND, WORDS_PER_LINE), (12, 84, 8, 32));
}

#[test]
fn fault_codes_are_pinned() {
    use FaultCode::*;
    let codes = [
        Message,
        Order,
        ImageTooLarge,
        Lines,
        Chunks,
        ImageChecksum,
        ImageHeader,
        Parameter,
        Tile,
        TooManyTiles,
        LineRange,
        Record,
        Depth,
        Operands,
        Internal,
        Memory,
    ];
    for (number, code) in (0..).zip(codes) {
        assert_eq!(encoded(&Reply::Fault(Fault { code, detail: 7 })), [6, number, 7]);
    }
}

#[test]
fn the_versions_of_a_hello_are_read_whatever_follows() {
    let budget = BUDGET;
    let hello = Reply::Hello {
        protocol: 300,
        layout: 2,
        budget,
        written_lines: 0,
        memory_use: None,
        build: "x",
        board: None,
    };
    let versions = Versions { protocol: 300, layout: 2 };
    assert_eq!(hello_versions(&encoded(&hello)), Some(versions));
    assert_eq!(hello_versions(&[0, 0xac, 2, 2]), Some(versions));
    assert_eq!(hello_versions(&[0, 0xac, 2, 2, 0xff, 0xff, 0xff]), Some(versions));
    assert_eq!(hello_versions(&[0, 0xac]), None);
    assert_eq!(hello_versions(&encoded(&Reply::ImageAccepted)), None);
    assert_eq!(hello_versions(&encoded(&Reply::Checksums { first: 1, data: &[] })), None);
}

#[test]
fn sums_of_a_pixel_survive_their_record() {
    let view = PixelSums {
        albedo: [1, 2, u32::MAX],
        normal: [4, -5, i32::MIN],
        depth: -7,
        surfaces: 8,
        ..PixelSums::default()
    };
    let layers =
        LayerSums { direct: [1, 2, 3], indirect: [4, 5, 6], caustic: [7, 8, i64::MAX], gathers: 4096 };
    let mut identities = IdentityCoverage::NONE;
    (0..20).for_each(|identity| identities.add(identity, 100 + identity));
    let groups = GroupSums::new([[12, 15, i64::MAX], [1, 0, 0], [0, 1, 2]]);
    let full = PixelSums {
        light_groups: Some(groups),
        position: Some([-1, 2, i64::MIN]),
        coverage: Some(u32::MAX),
        identities: Some(identities),
        ..view.with_layers(layers)
    };
    let forms = (0..64_u8).map(|choice| {
        let is_set = |bit: u8| choice >> bit & 1 != 0;
        let light_groups = choice >> 4;
        let [layers, position, coverage, identities] = [0, 1, 2, 3].map(is_set);
        full.in_form(PixelForm { layers, light_groups, position, coverage, identities })
    });
    let lit = [view.with_light([9, 10, 11]), view.with_layers(layers), view.with_light_groups(groups)];
    for sums in forms.chain(lit) {
        let mut bytes = Vec::new();
        sums.write(&mut |part| bytes.extend_from_slice(part));
        assert_eq!(bytes.len(), sums.form().record_bytes());
        assert_eq!(PixelSums::read(sums.form(), &bytes), Some(sums));
        assert_eq!(bytes[8..12], [0xff; 4]);
        assert_eq!(bytes[24..36], [[0xf9, 0xff, 0xff, 0xff], [0xff; 4], [8, 0, 0, 0]].concat());
        assert_eq!(PixelSums::read(sums.form(), &bytes[1..]), None);
        assert!(PIXELS_BYTES >= 2 * bytes.len());
    }
    assert_eq!(view.with_layers(layers).light, [12, 15, i64::MAX]);
    assert_eq!(view.with_light_groups(groups).light, [13, 16, i64::MAX]);
    assert_eq!(full.plus(&full).light_groups.map(|sums| sums.sums()[1]), Some([2, 0, 0]));
    assert_eq!(full.plus(&full.in_form(PixelForm::PLAIN)).form().light_groups, 0);
}

#[test]
fn texts_of_faults_name_the_parameter() {
    for parameter in Parameter::ALL {
        let words = parameter.fault().to_string();
        assert!(words.contains(&format!("`{}`", parameter.name())), "{words}");
    }
    let unknown = Fault { code: FaultCode::Parameter, detail: 99 };
    assert!(unknown.to_string().contains("parameter 99"));
}
