//! Vectors of messages and of their integers.

use photoncard_firmware::kind::MICRO;
use photoncard_firmware::self_test::arithmetic::compute;
use photoncard_shared::budget::Budget;
use photoncard_shared::counters::Counters;
use photoncard_shared::frame::MAX_PAYLOAD;
use photoncard_shared::image::LAYOUT_VERSION;
use photoncard_shared::message::*;
use serde::{Deserialize, Serialize};

use crate::json::{hex, lines, list, numbers, object, text};

pub(crate) const HELLO: Command = Command::Hello { protocol: PROTOCOL_VERSION, layout: LAYOUT_VERSION };

pub(crate) fn encoded(message: &impl Serialize) -> Vec<u8> {
    let mut bytes = [0; MAX_PAYLOAD];
    let length = encode(message, &mut bytes).unwrap();
    bytes[..length].to_vec()
}

pub(crate) fn vectors() -> Vec<(&'static str, String)> {
    vec![
        ("integers", lines(integers())),
        ("integers_decoded", lines(integers_decoded())),
        ("integers_refused", lines(integers_refused())),
        ("messages", lines(commands().into_iter().chain(replies()))),
        ("no_messages", lines(no_messages())),
        ("compute", lines(computations())),
        ("budget", budget(&MICRO)),
    ]
}

fn integer(bits: u32, value: u64, bytes: &[u8]) -> String {
    let decoded = decoded_integer(bits, bytes);
    assert_eq!(decoded, Some(value));
    object(&[
        ("bits", bits.to_string()),
        ("value", text(&format!("{value:0digits$x}", digits = bits as usize / 4))),
        ("bytes", hex(bytes)),
    ])
}

fn decoded_integer(bits: u32, bytes: &[u8]) -> Option<u64> {
    match bits {
        16 => decode::<u16>(bytes).map(u64::from),
        32 => decode::<u32>(bytes).map(u64::from),
        _ => decode(bytes),
    }
}

fn integers() -> Vec<String> {
    let values = [(16, 0), (16, 17), (16, 127), (16, 128), (16, 0xffff), (32, 300), (32, 0xffff_ffff)];
    let long = [(64, 0x4000_0000), (64, u64::MAX)];
    values.into_iter().chain(long).map(|(bits, value)| integer(bits, value, &encoded(&value))).collect()
}

/// Integers with more bytes than they need.
fn integers_decoded() -> Vec<String> {
    vec![
        integer(16, 17, &[0x91, 0x80, 0x00]),
        integer(32, 0, &[0x80, 0x00]),
        integer(32, 300, &[0xac, 0x82, 0x80, 0x80, 0x00]),
        integer(64, 1, &[0x81, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x00]),
    ]
}

fn integers_refused() -> Vec<String> {
    let refused: [(u32, &[u8]); 6] = [
        (16, &[0x80, 0x80, 0x04]),
        (16, &[0x80, 0x80, 0x80, 0x00]),
        (32, &[0xff, 0xff, 0xff, 0xff, 0x10]),
        (32, &[0x80, 0x80, 0x80, 0x80, 0x80, 0x00]),
        (64, &[0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0x02]),
        (32, &[0x80]),
    ];
    let vector = |(bits, bytes): (u32, &[u8])| {
        assert_eq!(decoded_integer(bits, bytes), None);
        object(&[("bits", bits.to_string()), ("bytes", hex(bytes))])
    };
    refused.into_iter().map(vector).collect()
}

fn vector<'a, T: Serialize + Deserialize<'a> + PartialEq + std::fmt::Debug>(
    (to, name): (&str, &str),
    fields: &[(&str, String)],
    message: &T,
) -> String {
    let bytes = encoded(message);
    let leaked: &'a [u8] = Box::leak(bytes.clone().into_boxed_slice());
    assert_eq!(decode::<T>(leaked).as_ref(), Some(message), "{name}");
    object(&[("to", text(to)), ("name", text(name)), ("fields", object(fields)), ("bytes", hex(&bytes))])
}

fn floats(values: &[f32]) -> String {
    numbers(values)
}

fn option(value: Option<impl std::fmt::Display>) -> String {
    value.map_or("null".into(), |value| value.to_string())
}

/// The frame of the program's `render` without options, but for the size, the samples, the rays, the
/// neighbours, and the distance, which follow from the scene.
pub(crate) const FRAME: FrameParameters = FrameParameters {
    width: 64,
    height: 48,
    camera: Camera::pinhole([0.0, 0.0, 4.0], [0.0, 0.0, -1.0], [0.5, 0.0, 0.0], [0.0, 0.375, 0.0]),
    seed: 0,
    first_sample: 0,
    samples: 1,
    planned_samples: 1,
    gather_rays: 4,
    shadow_rays: 1,
    neighbors: 24,
    max_distance: 0.75,
    sampling: Sampling::Reflection,
    irradiance_error: None,
    bins: 8,
    drain: Drain::Sort,
    queue: u32::MAX,
    radiance: Radiance::Density,
    caustics: None,
    layers: false,
    light_groups: 0,
    filter: Filter::Box,
    in_flight: u32::MAX,
    keep_records: false,
    adaptive_threshold: None,
    transparent: false,
    position: false,
    coverage: false,
    identities: false,
    irradiance: false,
    near_distance: 0.25,
};

/// A frame of sensors.
const SENSORS: FrameParameters = FrameParameters {
    camera: Camera { projection: Projection::Sensors { line: 602, first: 512, count: 300 }, ..FRAME.camera },
    irradiance: true,
    ..FRAME
};

/// A frame with all options and no field of another's value.
const FULL_FRAME: FrameParameters = FrameParameters {
    width: 1920,
    height: 1080,
    camera: Camera {
        shift: [0.125, -0.5],
        projection: Projection::ThinLens {
            right: [0.0, 0.0, 0.015625],
            up: [0.0078125, 0.0, 0.0],
            focus: 2.5,
        },
        ..Camera::pinhole([1.0, 2.0, 3.0], [0.0, -1.0, 0.0], [0.0, 0.0, 0.625], [0.25, 0.0, 0.0])
    },
    seed: 7,
    first_sample: 16,
    samples: 32,
    planned_samples: 64,
    gather_rays: 256,
    shadow_rays: 2,
    neighbors: 50,
    max_distance: 1.5,
    sampling: Sampling::Focused,
    irradiance_error: Some(0.125),
    bins: 12,
    drain: Drain::Buckets,
    queue: 1000,
    radiance: Radiance::Precomputed,
    caustics: Some(CausticGather { neighbors: 60, max_distance: 0.375 }),
    layers: true,
    light_groups: 3,
    filter: Filter::BlackmanHarris,
    in_flight: 3,
    keep_records: true,
    adaptive_threshold: Some(0.0625),
    transparent: true,
    position: true,
    coverage: true,
    identities: true,
    irradiance: true,
    near_distance: 0.1875,
};

fn projected(projection: &Projection) -> String {
    match projection {
        Projection::Pinhole => object(&[("kind", "0".into())]),
        Projection::ThinLens { right, up, focus } => object(&[
            ("kind", "1".into()),
            ("right", floats(right)),
            ("up", floats(up)),
            ("focus", focus.to_string()),
        ]),
        Projection::Orthographic => object(&[("kind", "2".into())]),
        Projection::Panorama { angles } => object(&[("kind", "3".into()), ("angles", floats(angles))]),
        Projection::Sensors { line, first, count } => object(&[
            ("kind", "4".into()),
            ("line", line.to_string()),
            ("first", first.to_string()),
            ("count", count.to_string()),
        ]),
    }
}

fn frame(frame: &FrameParameters) -> Vec<(&'static str, String)> {
    let Camera { origin, forward, right, up, shift, projection } = &frame.camera;
    let axes = [("origin", origin), ("forward", forward), ("right", right), ("up", up)];
    let mut camera = axes.map(|(name, vector)| (name, floats(vector))).to_vec();
    camera.push(("shift", floats(shift)));
    camera.push(("projection", projected(projection)));
    let caustics = frame.caustics.map(|CausticGather { neighbors, max_distance }| {
        object(&[("neighbors", neighbors.to_string()), ("max_distance", max_distance.to_string())])
    });
    vec![
        ("width", frame.width.to_string()),
        ("height", frame.height.to_string()),
        ("camera", object(&camera)),
        ("seed", frame.seed.to_string()),
        ("first_sample", frame.first_sample.to_string()),
        ("samples", frame.samples.to_string()),
        ("planned_samples", frame.planned_samples.to_string()),
        ("gather_rays", frame.gather_rays.to_string()),
        ("shadow_rays", frame.shadow_rays.to_string()),
        ("neighbors", frame.neighbors.to_string()),
        ("max_distance", frame.max_distance.to_string()),
        ("sampling", (frame.sampling as u8).to_string()),
        ("irradiance_error", option(frame.irradiance_error)),
        ("bins", frame.bins.to_string()),
        ("drain", (frame.drain as u8).to_string()),
        ("queue", frame.queue.to_string()),
        ("radiance", (frame.radiance as u8).to_string()),
        ("caustics", option(caustics)),
        ("layers", u8::from(frame.layers).to_string()),
        ("light_groups", frame.light_groups.to_string()),
        ("filter", (frame.filter as u8).to_string()),
        ("in_flight", frame.in_flight.to_string()),
        ("keep_records", u8::from(frame.keep_records).to_string()),
        ("adaptive_threshold", option(frame.adaptive_threshold)),
        ("transparent", u8::from(frame.transparent).to_string()),
        ("position", u8::from(frame.position).to_string()),
        ("coverage", u8::from(frame.coverage).to_string()),
        ("identities", u8::from(frame.identities).to_string()),
        ("irradiance", u8::from(frame.irradiance).to_string()),
        ("near_distance", frame.near_distance.to_string()),
    ]
}

/// Operands of one computation: three `f32`.
fn operands(values: [f32; 3]) -> Vec<u8> {
    values.into_iter().flat_map(f32::to_le_bytes).collect()
}

fn commands() -> Vec<String> {
    let line: [u8; 128] = std::array::from_fn(|index| index as u8 ^ 0xa5);
    let case = operands([1.5, -2.0, 0.25]);
    let Tile { id, x, y, width, height } = Tile { id: 300, x: 16, y: 32, width: 8, height: 4 };
    let tile = [("id", id), ("x", x), ("y", y), ("width", width), ("height", height)]
        .map(|(name, value)| (name, value.to_string()));
    let version = [("protocol", PROTOCOL_VERSION.to_string()), ("layout", LAYOUT_VERSION.to_string())];
    let first_count = [("first", "128".into()), ("count", "64".into())];
    let checksum = 0x0123_4567_89ab_cdef_u64;
    let image = [("lines", "602".into()), ("checksum", text(&format!("{checksum:016x}")))];
    let write = Command::WriteLines { first: 200, data: &line };
    vec![
        vector(("card", "Hello"), &version, &HELLO),
        vector(("card", "ReadChecksums"), &first_count, &Command::ReadChecksums { first: 128, count: 64 }),
        vector(("card", "BeginImage"), &image, &Command::BeginImage { lines: 602, checksum }),
        vector(("card", "WriteLines"), &[("first", "200".into()), ("data", hex(&line))], &write),
        vector(("card", "EndImage"), &[], &Command::EndImage),
        vector(("card", "BeginFrame"), &frame(&FRAME), &Command::BeginFrame(FRAME)),
        vector(("card", "BeginFrame"), &frame(&SENSORS), &Command::BeginFrame(SENSORS)),
        vector(("card", "BeginFrame"), &frame(&FULL_FRAME), &Command::BeginFrame(FULL_FRAME)),
        vector(("card", "RenderTile"), &tile, &Command::RenderTile(Tile { id, x, y, width, height })),
        vector(("card", "Compute"), &[("data", hex(&case))], &Command::Compute { operands: &case }),
        vector(("card", "TestMemory"), &[], &Command::TestMemory),
        vector(("card", "Flush"), &[], &Command::Flush),
    ]
}

fn budget(budget: &Budget) -> String {
    object(&[
        ("sram_bytes", budget.sram_bytes.to_string()),
        ("dram_bytes", budget.dram_bytes.to_string()),
        ("photon_cache_bytes", budget.photon_cache_bytes.to_string()),
        ("scene_cache_bytes", budget.scene_cache_bytes.to_string()),
        ("stack_bytes", budget.stack_bytes.to_string()),
        ("tile_pixels", budget.tile_pixels.to_string()),
        ("neighbors", budget.neighbors.to_string()),
        ("gather_rays", budget.gather_rays.to_string()),
        ("gather_queue", budget.gather_queue.to_string()),
        ("irradiance_records", budget.irradiance_records.to_string()),
        ("shadow_rays", budget.shadow_rays.to_string()),
        ("samples", budget.samples.to_string()),
        ("tiles", budget.tiles.to_string()),
        ("in_flight", budget.in_flight.to_string()),
        ("waiting_blocks", budget.waiting_blocks.to_string()),
    ])
}

/// Answers to Hello without options and with all, and their fields.
pub(crate) fn hello_answers() -> [(Reply<'static>, Vec<(&'static str, String)>); 2] {
    let uses = MemoryUse { static_bytes: 180_000, stack_bytes: 24_576, stack_used: 9000 };
    let board = Board { name: "board-1", serial_number: "0042", clock_hz: 400_000_000 };
    [(None, None, 0), (Some(uses), Some(board), 602)].map(|(memory_use, board, written_lines)| {
        let protocol = PROTOCOL_VERSION;
        let (layout, build) = (LAYOUT_VERSION, "a card");
        let reply = Reply::Hello { protocol, layout, budget: MICRO, written_lines, memory_use, build, board };
        let memory_use = memory_use.map(|MemoryUse { static_bytes, stack_bytes, stack_used }| {
            let uses =
                [("static_bytes", static_bytes), ("stack_bytes", stack_bytes), ("stack_used", stack_used)];
            object(&uses.map(|(name, bytes)| (name, bytes.to_string())))
        });
        let board = board.map(|Board { name, serial_number, clock_hz }| {
            let names = [("name", text(name)), ("serial_number", text(serial_number))];
            object(&[&names[..], &[("clock_hz", clock_hz.to_string())]].concat())
        });
        let fields = vec![
            ("protocol", protocol.to_string()),
            ("layout", layout.to_string()),
            ("budget", budget(&MICRO)),
            ("written_lines", written_lines.to_string()),
            ("memory_use", option(memory_use)),
            ("build", text(build)),
            ("board", option(board)),
        ];
        (reply, fields)
    })
}

/// Counters from 1 on, in the order of the page, but for the last two.
fn counters() -> ([u64; 26], Counters) {
    let mut values: [u64; 26] = std::array::from_fn(|index| index as u64 + 1);
    values[24] = 300;
    values[25] = u64::MAX;
    let bytes: Vec<u8> = values.iter().flat_map(encoded).collect();
    (values, decode(&bytes).unwrap())
}

/// Sums of a pixel with a light of its own in each layer.
fn pixel(form: PixelForm) -> Vec<u8> {
    let view = PixelSums {
        albedo: [1 << 19, 1 << 18, 3],
        normal: [1 << 18, -5, i32::MIN],
        depth: 7 << 16,
        surfaces: 8,
        ..PixelSums::NOTHING
    };
    let mut identities = IdentityCoverage::NONE;
    [(3, 1 << 19), (0, 5), (7, 1 << 18)]
        .into_iter()
        .for_each(|(identity, coverage)| identities.add(identity, coverage));
    let view = PixelSums {
        position: form.position.then_some([3 << 16, -4, 5]),
        coverage: form.coverage.then_some(7 << 18),
        identities: form.identities.then_some(identities),
        ..view
    };
    let sums = if form.layers {
        let [direct, indirect, caustic] = [[1 << 40, 2, 3], [4, 5, 6], [7, 8, 9]];
        view.with_layers(LayerSums { direct, indirect, caustic, gathers: 6 })
    } else {
        view.with_light([1 << 40, 11, i64::MAX])
    };
    let groups = (1..=i64::from(form.light_groups)).map(|group| [group << 40, group, 2]);
    let sums = if form.light_groups > 0 { sums.with_light_groups(GroupSums::new(groups)) } else { sums };
    let mut bytes = Vec::new();
    sums.write(&mut |part| bytes.extend_from_slice(part));
    assert_eq!(PixelSums::read(form, &bytes), Some(sums));
    bytes
}

fn replies() -> Vec<String> {
    let mut all: Vec<String> = hello_answers()
        .into_iter()
        .map(|(reply, fields)| vector(("host", "Hello"), &fields, &reply))
        .collect();
    let sum = 0x995d_c9bb_df19_39fa_u64.to_le_bytes();
    let checksums = Reply::Checksums { first: 128, data: &sum };
    all.push(vector(("host", "Checksums"), &[("first", "128".into()), ("data", hex(&sum))], &checksums));
    all.push(vector(("host", "ImageAccepted"), &[], &Reply::ImageAccepted));
    all.push(vector(("host", "FrameAccepted"), &[], &Reply::FrameAccepted));
    let coverage = PixelForm { coverage: true, ..PixelForm::PLAIN };
    for form in [PixelForm::PLAIN, PixelForm::LAYERED, coverage, PixelForm::FULL] {
        let data = pixel(form);
        let fields = [("id", "300".into()), ("first", "31".into()), ("data", hex(&data))];
        all.push(vector(("host", "Pixels"), &fields, &Reply::Pixels { tile: 300, first: 31, data: &data }));
    }
    let (values, counters) = counters();
    let values = list(values.map(|value| text(&format!("{value:x}"))));
    let fields = [("id", "300".into()), ("counters", values)];
    all.push(vector(("host", "TileDone"), &fields, &Reply::TileDone { tile: 300, counters }));
    for code in 0..16_u8 {
        let detail = 1000 + u32::from(code);
        let fault: Fault = decode(&[&[code][..], &encoded(&detail)].concat()).unwrap();
        assert_eq!(fault.code as u8, code);
        let fields = [("code", code.to_string()), ("detail", detail.to_string())];
        all.push(vector(("host", "Fault"), &fields, &Reply::Fault(fault)));
    }
    let words = words([1.5, -2.0, 0.25]);
    let results: Vec<u8> = words.into_iter().flat_map(u32::to_le_bytes).collect();
    all.push(vector(
        ("host", "Computed"),
        &[("data", hex(&results))],
        &Reply::Computed { results: &results },
    ));
    let first = WrongWord { index: 5, expected: 6, found: 300 };
    for first in [None, Some(first)] {
        let wrong = WrongWords { count: 3, bits: 4, first };
        let test =
            MemoryTest { lines: 200, pattern: MemoryPattern::ByteLanes, written: 200, checked: 64, wrong };
        let first = first.map(|WrongWord { index, expected, found }| {
            let word = [("index", index), ("expected", expected), ("found", found)];
            object(&word.map(|(name, value)| (name, value.to_string())))
        });
        let fields = [
            ("lines", "200".into()),
            ("pattern", (test.pattern as u8).to_string()),
            ("written", "200".into()),
            ("checked", "64".into()),
            ("count", "3".into()),
            ("bits", "4".into()),
            ("first", option(first)),
        ];
        all.push(vector(("host", "MemoryTested"), &fields, &Reply::MemoryTested(test)));
    }
    all
}

/// Payloads that are no command, and why. The frame is [`FRAME`] but for one byte.
pub(crate) fn no_commands() -> Vec<(&'static str, Vec<u8>)> {
    let changed = |place: usize, value: u8| {
        let mut bytes = encoded(&Command::BeginFrame(FRAME));
        bytes[place] = value;
        bytes
    };
    let behind = |bytes: Vec<u8>, byte: u8| [&bytes[..], &[byte]].concat();
    let frame = encoded(&Command::BeginFrame(FRAME));
    let write = encoded(&Command::WriteLines { first: 0, data: &[0; 128] });
    let (projection, sampling, drain, filter, layers) = (59, 71, 74, 83, 82);
    vec![
        ("no bytes", Vec::new()),
        ("an unknown kind", vec![10]),
        ("Hello without a field", vec![0, 17]),
        ("Hello with a field more", behind(encoded(&HELLO), 0)),
        ("a protocol of more than 16 bits", vec![0, 0x80, 0x80, 0x04, 16]),
        ("EndImage and a byte", vec![4, 0]),
        ("BeginFrame without its last byte", frame[..frame.len() - 1].to_vec()),
        ("projection 5", changed(projection, 5)),
        ("sampling 5", changed(sampling, 5)),
        ("an option of neither 0 nor 1", changed(sampling + 1, 2)),
        ("drain 4", changed(drain, 4)),
        ("layers 2", changed(layers, 2)),
        ("filter 3", changed(filter, 3)),
        ("data that is shorter than its length", write[..write.len() - 1].to_vec()),
    ]
}

fn no_messages() -> Vec<String> {
    let of_host = |(why, bytes): (&str, Vec<u8>)| {
        assert!(decode::<Command>(&bytes).is_none(), "{why}");
        object(&[("to", text("card")), ("why", text(why)), ("bytes", hex(&bytes))])
    };
    let of_card = |(why, bytes): (&str, Vec<u8>)| {
        assert!(decode::<Reply>(&bytes).is_none(), "{why}");
        object(&[("to", text("host")), ("why", text(why)), ("bytes", hex(&bytes))])
    };
    let bare = encoded(&hello_answers()[0].0);
    let replies = vec![
        ("an unknown kind", vec![9]),
        ("an unknown fault", vec![6, 16, 0]),
        ("Hello without the option of a board", bare[..bare.len() - 1].to_vec()),
        ("25 counters", [&[5, 0][..], &[0; 25]].concat()),
    ];
    no_commands().into_iter().map(of_host).chain(replies.into_iter().map(of_card)).collect()
}

/// Results of a computation, which are those of the card's answer.
fn words(operands: [f32; 3]) -> [u32; RESULTS] {
    compute(operands)
}

fn computations() -> Vec<String> {
    let cases = [
        [1.5, -2.0, 0.25],
        [-0.5, 3.0, 1.0],
        [-2.786_423_2e33, 2.0, 1.0],
        [1.314_175_1, 0.75, -3.0],
        [1.000_244_1, 1.000_244_1, 7.0],
        [0.1, 10.0, 0.3],
        [1e-40, 3.0, -1e-40],
        [16_777_216.0, 1.000_000_1, 33_554_432.0],
        [-3e9, 0.0, -0.0],
        [f32::INFINITY, f32::NEG_INFINITY, 1.0],
        [f32::NAN, 1.0, 2.0],
    ];
    let vector = |operands: [f32; 3]| {
        let hexadecimal = |bits: u32| text(&format!("{bits:08x}"));
        object(&[
            ("operands", list(operands.map(|operand| hexadecimal(operand.to_bits())))),
            ("words", list(words(operands).map(hexadecimal))),
        ])
    };
    cases.map(vector).to_vec()
}

#[test]
fn single_functions_have_the_values_of_the_page() {
    let of = |operands, word: usize| words(operands)[word];
    assert_eq!(of([-2.786_423_2e33, 0.0, 0.0], 12), 0x3f5f_6201);
    assert_eq!(of([1.314_175_1, 0.0, 0.0], 14), 0x406e_3000);
    assert_eq!(of([1.000_244_1, 1.000_244_1, 0.0], 15), 0x3f80_0800);
    assert_eq!(of([0.1, 10.0, 0.0], 16), 0x3c23_d5a4);
}
