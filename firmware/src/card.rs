//! A card: commands in, replies out. A state machine without I/O, fed with bytes and giving bytes.
//!
//! Whoever runs it ([`crate::serve`], or a simulator) calls [`Card::feed`] with what came, sends what
//! [`Card::outgoing`] holds, calls [`Card::work`] while [`Card::is_busy`], and [`Card::acknowledge`] when the line is quiet.
//! No call takes longer than some rays or gathers, or the checksum of a few lines; none blocks, and nothing that is fed can
//! make one panic.

mod load;

use heapless::Deque;
use photoncard_shared::budget::{
    Budget, MAX_BINS, MAX_GATHER_RAYS, MICRO, REFERENCE, TechniqueMemory, gather_candidates,
};
use photoncard_shared::counters::Counters;
use photoncard_shared::image::{Header, LAYOUT_VERSION, SectionKind};
use photoncard_shared::message::{
    self, Command, Fault, FaultCode, FrameParameters, MemoryUse, PIXELS_BYTES, PROTOCOL_VERSION, Parameter,
    PixelRecord, Radiance, Reply, Tile, record_bytes,
};
use photoncard_shared::transport::Transport;

use self::load::{CHECKSUMS_BYTES, Checksums, ImageState, Loader, OUT_OF_ORDER};
use crate::chip::{Chip, MicroChip, Progress, ReferenceChip, sram_bytes};
use crate::memory::{CardMemory, Dram};
use crate::render::Context;

/// Tile commands that any budget may allow to wait.
const TILE_QUEUE: usize = 4;

/// A card of one chip: its memory, its chip and both directions of its link.
pub struct Card<
    M,
    const TILE_PIXELS: usize,
    const CANDIDATES: usize,
    const QUEUE: usize,
    const RECORDS: usize,
    const GATHERED: usize,
> {
    budget: Budget,
    memory: M,
    transport: Transport,
    session: Session<TILE_PIXELS, CANDIDATES, QUEUE, RECORDS, GATHERED>,
}

/// What commands act on.
struct Session<
    const TILE_PIXELS: usize,
    const CANDIDATES: usize,
    const QUEUE: usize,
    const RECORDS: usize,
    const GATHERED: usize,
> {
    chip: Chip<TILE_PIXELS, CANDIDATES, QUEUE, RECORDS, GATHERED>,
    image: ImageState,
    /// How a board measures what its image takes of on-chip memory.
    measure: Option<fn() -> MemoryUse>,
    /// Lines from the first on that were written since the card was switched on.
    written: u32,
    checksums: Option<Checksums>,
    frame: Option<FrameParameters>,
    /// Of the tile at work.
    counters: Counters,
    tiles: Deque<Tile, TILE_QUEUE>,
    at_work: Option<TileWork>,
    /// Pixels of that tile, or checksums, that wait to be sent.
    data: heapless::Vec<u8, DATA_BYTES>,
}

/// The tile at work.
#[derive(Clone, Copy)]
enum TileWork {
    Rendering(Tile),
    /// Its pixels from this one on are still to be completed and sent.
    Sending(Tile, u32),
    /// All its pixels are sent.
    Sent(Tile),
}

/// Bytes of pixels or checksums in one reply.
const DATA_BYTES: usize = PIXELS_BYTES;
const _: () = assert!(CHECKSUMS_BYTES <= DATA_BYTES);

impl<
    M: CardMemory,
    const TILE_PIXELS: usize,
    const CANDIDATES: usize,
    const QUEUE: usize,
    const RECORDS: usize,
    const GATHERED: usize,
> Card<M, TILE_PIXELS, CANDIDATES, QUEUE, RECORDS, GATHERED>
{
    /// A card that has seen no host yet.
    pub const fn new(budget: Budget, memory: M) -> Self {
        Self {
            budget,
            memory,
            transport: Transport::card(),
            session: Session {
                chip: Chip::new(),
                image: ImageState::None,
                measure: None,
                written: 0,
                checksums: None,
                frame: None,
                counters: Counters::ZERO,
                tiles: Deque::new(),
                at_work: None,
                data: heapless::Vec::new(),
            },
        }
    }

    /// The card's memory: what it counted, if it counts.
    pub fn memory(&mut self) -> &mut M {
        &mut self.memory
    }

    /// Makes the card tell hosts what `measure` finds. Without it nobody knows.
    pub fn measure_memory_by(&mut self, measure: fn() -> MemoryUse) {
        self.session.measure = Some(measure);
    }

    /// Whether there is something to do without a byte from the host.
    pub fn is_busy(&self) -> bool {
        self.session.has_work() && self.transport.can_send()
    }

    /// What is to be sent now.
    pub fn outgoing(&mut self) -> &[u8] {
        self.transport.outgoing()
    }

    /// Tells that the first `bytes` of [`Self::outgoing`] are sent.
    pub fn sent(&mut self, bytes: usize) {
        self.transport.sent(bytes);
    }

    /// Takes bytes from the host, and does what they command. What takes long is left to [`Self::work`].
    pub fn feed(&mut self, bytes: &[u8]) {
        let mut rest = bytes;
        while !rest.is_empty() {
            let (taken, _) = self.transport.receive(rest);
            rest = rest.get(taken..).unwrap_or(&[]);
            self.execute();
        }
    }

    /// Does the commands that have come, as long as there is room for a reply to each.
    fn execute(&mut self) {
        let Self { budget, memory, transport, session } = self;
        while transport.can_send() {
            let Some(payload) = transport.take() else { break };
            let result = match message::decode::<Command>(payload) {
                None => Err(Fault { code: FaultCode::Message, detail: payload.len() as u32 }),
                Some(command) => session.execute(budget, memory, &command),
            };
            match result {
                Ok(Some(reply)) => send(transport, &reply),
                Ok(None) => {}
                Err(fault) => send(transport, &Reply::Fault(fault)),
            }
        }
    }

    /// Tells the host what has come: before a wait, as when the line is quiet.
    pub fn acknowledge(&mut self) {
        self.transport.acknowledge();
    }

    /// Does the next piece of work, if there is room for a reply.
    pub fn work(&mut self) {
        if !self.transport.can_send() {
            return;
        }
        if let Err(fault) = self.session.work(&mut self.memory, &mut self.transport) {
            self.session.at_work = None;
            send(&mut self.transport, &Reply::Fault(fault));
        }
    }
}

/// Sends a reply; whoever calls it has seen that there is room.
fn send(transport: &mut Transport, reply: &Reply) {
    // Every reply fits a frame: tests pin the longest.
    transport.send(|bytes| message::encode(reply, bytes));
}

impl<
    const TILE_PIXELS: usize,
    const CANDIDATES: usize,
    const QUEUE: usize,
    const RECORDS: usize,
    const GATHERED: usize,
> Session<TILE_PIXELS, CANDIDATES, QUEUE, RECORDS, GATHERED>
{
    fn execute(
        &mut self,
        budget: &Budget,
        memory: &mut impl CardMemory,
        command: &Command,
    ) -> Result<Option<Reply<'static>>, Fault> {
        match *command {
            Command::Hello { .. } => {
                self.forget();
                Ok(Some(hello(budget, self.written, self.measure.map(|measure| measure()))))
            }
            Command::ReadChecksums { first, count } => {
                if self.is_at_work() {
                    return Err(OUT_OF_ORDER);
                }
                self.data.clear();
                self.checksums = Some(Checksums::new(first, count, self.written)?);
                Ok(None)
            }
            Command::BeginImage { lines, checksum } => {
                self.forget();
                self.image = ImageState::Loading(Loader::new(memory, lines, checksum)?);
                Ok(None)
            }
            Command::WriteLines { first, data } => {
                let end = self.image.loader()?.write(memory, first, data)?;
                self.written = self.written.max(end);
                Ok(None)
            }
            Command::EndImage => {
                self.image = ImageState::Checking(self.image.loader()?.check());
                Ok(None)
            }
            Command::BeginFrame(frame) => {
                let scene = self.image.scene().filter(|_| !self.is_at_work()).ok_or(OUT_OF_ORDER)?;
                check_frame(budget, &scene.header, &frame)?;
                self.frame = Some(frame);
                Ok(Some(Reply::FrameAccepted))
            }
            Command::RenderTile(tile) => self.accept(budget, tile).map(|()| None),
        }
    }

    fn forget(&mut self) {
        self.image = ImageState::None;
        self.checksums = None;
        self.frame = None;
        self.tiles.clear();
        self.at_work = None;
    }

    /// Whether tiles or checksums are at work.
    fn is_at_work(&self) -> bool {
        self.at_work.is_some() || !self.tiles.is_empty() || self.checksums.is_some()
    }

    fn has_work(&self) -> bool {
        self.is_at_work() || matches!(self.image, ImageState::Checking(_))
    }

    fn accept(&mut self, budget: &Budget, tile: Tile) -> Result<(), Fault> {
        let frame = self.frame.ok_or(OUT_OF_ORDER)?;
        let fits =
            |first: u32, count: u32, size: u32| first.checked_add(count).is_some_and(|end| end <= size);
        let is_inside = fits(tile.x, tile.width, frame.width) && fits(tile.y, tile.height, frame.height);
        if !is_inside || tile.pixels() == 0 || tile.pixels() > self.chip.tile_pixels(&frame) {
            return Err(Fault { code: FaultCode::Tile, detail: tile.id });
        }
        let too_many = Fault { code: FaultCode::TooManyTiles, detail: tile.id };
        let waiting = self.tiles.len() + usize::from(self.at_work.is_some());
        if waiting >= budget.tiles as usize {
            return Err(too_many);
        }
        self.tiles.push_back(tile).map_err(|_| too_many)
    }

    fn work(&mut self, memory: &mut impl CardMemory, transport: &mut Transport) -> Result<(), Fault> {
        if let Some(checksums) = &mut self.checksums {
            return match checksums.step(memory, self.written) {
                Ok((checksum, is_last)) => {
                    // There is room for CHECKSUMS_PER_REPLY.
                    let _ = self.data.extend_from_slice(&checksum.to_le_bytes());
                    if is_last {
                        send(transport, &Reply::Checksums { first: checksums.first, data: &self.data });
                        self.checksums = None;
                    }
                    Ok(())
                }
                Err(fault) => {
                    self.checksums = None;
                    Err(fault)
                }
            };
        }
        if let ImageState::Checking(check) = &mut self.image {
            let result = check.step(memory);
            if let Ok(None) = result {
                return Ok(());
            }
            self.image = ImageState::None;
            if let Some(scene) = result? {
                self.image = ImageState::Ready(scene);
                send(transport, &Reply::ImageAccepted);
            }
            return Ok(());
        }
        self.render(memory, transport)
    }

    fn render(&mut self, memory: &mut impl CardMemory, transport: &mut Transport) -> Result<(), Fault> {
        let (Some(scene), Some(frame)) = (self.image.scene(), self.frame.as_ref()) else { return Ok(()) };
        match self.at_work {
            None => {
                if let Some(tile) = self.tiles.pop_front() {
                    if !self.chip.begin(memory, frame, tile) {
                        return Err(Fault { code: FaultCode::Tile, detail: tile.id });
                    }
                    self.data.clear();
                    self.counters = Counters::ZERO;
                    self.at_work = Some(TileWork::Rendering(tile));
                }
            }
            Some(TileWork::Rendering(tile)) => {
                let counters = &mut self.counters;
                let progress =
                    self.chip.step(&mut Context { scene, memory, frame, counters, outlet: None })?;
                if progress == Progress::Complete {
                    self.at_work = Some(TileWork::Sending(tile, 0));
                }
            }
            Some(TileWork::Sending(tile, next)) => {
                let counters = &mut self.counters;
                let context = &mut Context { scene, memory, frame, counters, outlet: None };
                let Some(record) = self.chip.complete(context, next as usize)? else { return Ok(()) };
                let PixelRecord { pixel, layers } = record;
                let data = &mut self.data;
                let bytes = record_bytes(frame.layers);
                // There is room: what is full is sent.
                let _ = data.extend_from_slice(&pixel.to_bytes());
                if let Some(layers) = layers {
                    let _ = data.extend_from_slice(&layers.to_bytes());
                }
                let is_last = next as u64 + 1 >= tile.pixels();
                if data.len() + bytes > data.capacity() || is_last {
                    let first = next + 1 - (data.len() / bytes) as u32;
                    send(transport, &Reply::Pixels { tile: tile.id, first, data });
                    data.clear();
                }
                self.at_work =
                    Some(if is_last { TileWork::Sent(tile) } else { TileWork::Sending(tile, next + 1) });
            }
            Some(TileWork::Sent(tile)) => {
                send(transport, &Reply::TileDone { tile: tile.id, counters: self.counters });
                self.at_work = None;
            }
        }
        Ok(())
    }
}

fn hello(budget: &Budget, written_lines: u32, memory_use: Option<MemoryUse>) -> Reply<'static> {
    Reply::Hello {
        protocol: PROTOCOL_VERSION,
        layout: LAYOUT_VERSION,
        budget: *budget,
        written_lines,
        memory_use,
        build: concat!("photoncard-firmware ", env!("CARGO_PKG_VERSION")),
    }
}

/// Compares a frame's parameters with the budget and the image.
fn check_frame(budget: &Budget, header: &Header, frame: &FrameParameters) -> Result<(), Fault> {
    let camera = &frame.camera;
    let camera = [camera.origin, camera.forward, camera.right, camera.up];
    let within = |value: u32, most: u32| (1..=most).contains(&value);
    let is_length = |distance: f32| distance.is_finite() && distance > 0.0;
    let neighbors = |count: u32| count >= 2 && within(count, budget.neighbors);
    let checks = [
        (Parameter::Width, within(frame.width, MAX_PICTURE_SIDE)),
        (Parameter::Height, within(frame.height, MAX_PICTURE_SIDE)),
        (Parameter::Camera, camera.as_flattened().iter().all(|component| component.is_finite())),
        (Parameter::Samples, within(frame.samples, budget.samples)),
        (Parameter::GatherRays, frame.gather_rays <= budget.gather_rays),
        (Parameter::ShadowRays, frame.shadow_rays <= budget.shadow_rays),
        (Parameter::Neighbors, neighbors(frame.neighbors)),
        (Parameter::MaxDistance, is_length(frame.max_distance)),
        (Parameter::IrradianceError, frame.irradiance_error.is_none_or(is_irradiance_error)),
        (Parameter::Bins, within(frame.bins, MAX_BINS)),
        (Parameter::Queue, frame.queue >= 1),
        (Parameter::Radiance, frame.radiance == Radiance::Density || has_irradiance(header)),
        (
            Parameter::Caustics,
            frame.caustics.is_none_or(|gather| neighbors(gather.neighbors) && is_length(gather.max_distance)),
        ),
    ];
    match checks.iter().find(|(_, holds)| !holds) {
        Some((parameter, _)) => Err(parameter.fault()),
        None => Ok(()),
    }
}

fn is_irradiance_error(error: f32) -> bool {
    (MIN_IRRADIANCE_ERROR..=1.0).contains(&error)
}

/// Whether an image has irradiance points, or no photons that they could be of.
fn has_irradiance(header: &Header) -> bool {
    let holds = |kind| header.section(kind).records > 0;
    holds(SectionKind::IrradianceLeaves) || !holds(SectionKind::Photons) && !holds(SectionKind::PhotonLeaves)
}

/// The least error that interpolated irradiance may be allowed: what is below asks for more than rounding gives.
pub const MIN_IRRADIANCE_ERROR: f32 = 1e-6;

/// Pixels in a row or a column of a picture: `f32` tells them apart with room for the place in the pixel.
pub const MAX_PICTURE_SIDE: u32 = 1 << 16;

/// The card of the reference chip.
pub type ReferenceCard<M> = Card<
    M,
    { REFERENCE.tile_pixels as usize },
    { gather_candidates(REFERENCE.neighbors) },
    { REFERENCE.gather_queue as usize },
    { REFERENCE.irradiance_records as usize },
    { REFERENCE.gathered_records as usize },
>;

/// The card of the micro chip.
pub type MicroCard<M> = Card<
    M,
    { MICRO.tile_pixels as usize },
    { gather_candidates(MICRO.neighbors) },
    { MICRO.gather_queue as usize },
    { MICRO.irradiance_records as usize },
    { MICRO.gathered_records as usize },
>;

/// On-chip memory of the reference card, bytes.
pub const REFERENCE_SRAM_BYTES: usize = sram_bytes(&REFERENCE, size_of::<ReferenceCard<Dram<'static>>>());
/// On-chip memory of the micro card, bytes.
pub const MICRO_SRAM_BYTES: usize = sram_bytes(&MICRO, size_of::<MicroCard<Dram<'static>>>());

const _: () = assert!(REFERENCE_SRAM_BYTES <= REFERENCE.sram_bytes as usize);
const _: () = assert!(MICRO_SRAM_BYTES <= MICRO.sram_bytes as usize);
const _: () = assert!(ReferenceChip::TECHNIQUES.is_within(&TechniqueMemory::REFERENCE));
const _: () = assert!(MicroChip::TECHNIQUES.is_within(&TechniqueMemory::MICRO));
const _: () = assert!(REFERENCE.tile_pixels <= 1 << 16 && MICRO.tile_pixels <= 1 << 16);
const _: () = assert!(REFERENCE.gather_rays <= MAX_GATHER_RAYS && MICRO.gather_rays <= MAX_GATHER_RAYS);
const _: () = assert!(REFERENCE.tiles as usize <= TILE_QUEUE);
const _: () = assert!(MICRO.tiles as usize <= TILE_QUEUE);
