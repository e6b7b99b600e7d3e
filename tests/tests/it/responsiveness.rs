//! A card polls its link after a bounded amount of work, whatever it is doing.

use std::cell::Cell;
use std::collections::VecDeque;
use std::ops::Range;
use std::time::Duration;

use glam::Vec3;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::photon::trace;
use photoncard_driver::photon_map::{GatherParameters, store_photons};
use photoncard_driver::render::{Integrator, PhotonMaps, Picture, RenderSettings};
use photoncard_firmware::card::MicroCard;
use photoncard_firmware::kind::MICRO;
use photoncard_firmware::memory::{CardMemory, MemoryPort};
use photoncard_firmware::serve::serve;
use photoncard_shared::address::{Line, LineAddress, Structure};
use photoncard_shared::checksum::image_checksum;
use photoncard_shared::image::LAYOUT_VERSION;
use photoncard_shared::link::{Port, PortError};
use photoncard_shared::message::{self, Command, Fault, FrameParameters, PROTOCOL_VERSION, Reply, Tile};
use photoncard_shared::transport::Transport;
use photoncard_tests::{camera, lambertian, room, scene, with_room_for_a_card};

/// Memory with a card image that counts reads.
struct CountingMemory<'a> {
    lines: Vec<Line>,
    reads: &'a Cell<u64>,
}

impl MemoryPort for CountingMemory<'_> {
    fn read(&mut self, _: Structure, address: LineAddress, _: Range<u32>) -> Result<&Line, Fault> {
        self.reads.set(self.reads.get() + 1);
        Ok(&self.lines[address.0 as usize])
    }
}

impl CardMemory for CountingMemory<'_> {
    fn lines(&self) -> u32 {
        self.lines.len() as u32
    }

    fn stored(&mut self, first: LineAddress, count: u32) -> Option<&[Line]> {
        self.lines.get(first.0 as usize..(first.0 + count) as usize)
    }
}

/// Host that sends its commands one by one, each when the card is idle.
struct HostPort<'a> {
    host: Transport,
    commands: VecDeque<Command<'static>>,
    reads: &'a Cell<u64>,
    /// Number of reads at the last poll of the link.
    before: u64,
    /// Maximum number of reads between two polls.
    most: u64,
    tiles: usize,
}

impl Port for HostPort<'_> {
    fn read(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, PortError> {
        self.most = self.most.max(self.reads.get() - self.before);
        self.before = self.reads.get();
        self.host.acknowledge();
        let is_idle = !wait.is_zero();
        if is_idle && self.host.is_acknowledged() && self.host.outgoing().is_empty() {
            let command = self.commands.pop_front().ok_or(PortError::Closed)?;
            self.host.send(|bytes| message::encode(&command, bytes));
        }
        let outgoing = self.host.outgoing();
        let count = outgoing.len().min(buffer.len());
        buffer[..count].copy_from_slice(&outgoing[..count]);
        self.host.sent(count);
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8], _: Duration) -> Result<usize, PortError> {
        let taken = self.host.receive(bytes).0;
        while let Some(reply) = self.host.take() {
            match message::decode(reply).expect("a card sends replies") {
                Reply::Fault(fault) => panic!("{fault:?}"),
                Reply::TileDone { .. } => self.tiles += 1,
                _ => {}
            }
        }
        Ok(taken)
    }
}

/// Maximum number of lines that a card reads between two polls of its link, during a tile of a lit room.
fn most_reads(frame: &FrameParameters) -> u64 {
    let mut lamp = lambertian("lamp", 0.5);
    lamp.emission = Vec3::ONE;
    let walls = room([0, 0, 0, 1, 0, 0]);
    let scene = scene(walls, vec![lambertian("wall", 0.5), lamp], camera(Vec3::ZERO, Vec3::NEG_Z));
    let packed = PackedScene::new(&scene).unwrap();
    let photons = trace(&packed, 0, 500, &|_| true).unwrap().photons;
    let lines = store_photons(packed, photons, 20).unwrap().lines().to_vec();
    let reads = Cell::new(0);
    let commands = VecDeque::from([
        Command::Hello { protocol: PROTOCOL_VERSION, layout: LAYOUT_VERSION },
        Command::BeginImage { lines: lines.len() as u32, checksum: image_checksum(&lines) },
        Command::EndImage,
        Command::BeginFrame(*frame),
        Command::RenderTile(Tile { id: 1, x: 0, y: 0, width: 2, height: 2 }),
    ]);
    let mut port =
        HostPort { host: Transport::host(), commands, reads: &reads, before: 0, most: 0, tiles: 0 };
    port.host.open(1);
    let mut card = Box::new(MicroCard::new(CountingMemory { lines, reads: &reads }));
    assert_eq!(serve(&mut *card, &mut port), Err(PortError::Closed));
    assert_eq!(port.tiles, 1);
    port.most
}

#[test]
fn a_card_polls_its_link_however_many_samples_a_pixel_has() {
    with_room_for_a_card(|| {
        let settings = RenderSettings {
            picture: Picture { width: 8, height: 8, ..Picture::default() },
            photons: PhotonMaps { neighbors: 20, ..PhotonMaps::default() },
            integrator: Integrator { gather_rays: 8, ..Integrator::default() },
            ..RenderSettings::default()
        };
        let frame =
            settings.frame(&camera(Vec3::new(0.0, 0.0, 0.5), Vec3::NEG_Z), &GatherParameters::within(0.5));
        let few = most_reads(&FrameParameters { samples: 64, ..frame });
        let many = most_reads(&FrameParameters { samples: MICRO.samples, ..frame });
        assert!(many <= 2 * few, "{many} lines at once, not {few}");
        let rays = FrameParameters { samples: 4, gather_rays: 256, ..frame };
        let [ending, going_on] =
            [0.0, 1e3].map(|near_distance| most_reads(&FrameParameters { near_distance, ..rays }));
        assert!(going_on <= 5 * ending, "{going_on} lines at once, not {ending}");
    });
}
