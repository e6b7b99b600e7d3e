//! Tests that violate a chip's invariants. Each violation must be reported as a fault, so that no light is
//! lost in silence.

use std::boxed::Box;

use glam::Vec3;
use photoncard_shared::address::Line;
use photoncard_shared::counters::Counters;
use photoncard_shared::image::{Header, Lights, Section, SectionKind};
use photoncard_shared::layout::PhotonGrid;
use photoncard_shared::message::{Camera, Fault, FrameParameters, Invariant, Tile};

use super::buffers::Shared;
use super::stored_point::{StoredPoint, pattern};
use super::test_frame::frame;
use super::*;
use crate::gather::{GatherRequest, GatherTarget, HilbertCode};
use crate::light_groups::LightGroups;
use crate::memory::Lines;
use crate::render::final_gather::{self, GatherRayEnds};
use crate::render::{Context, GatherPoint, PixelSample};
use crate::scene::{
    BUNDLE_RAYS, PartialReflection, Ray, RayKind, SceneImage, Seen, Surface, closest_hits, transmittances,
};

fn scene() -> SceneImage {
    let header = Header {
        lines: 0,
        photon_power_unit: 1.0,
        caustic_power_unit: 1.0,
        radiance_unit: 1.0,
        reach: 1.0,
        photon_grid: PhotonGrid::UNIT,
        lights: Lights::NONE,
        sections: Default::default(),
    };
    SceneImage { header }
}

/// Calls `Chip::step` on a chip with an empty card memory.
fn step(chip: &mut MicroChip, frame: &FrameParameters) -> Result<Progress, Fault> {
    let (scene, memory) = (scene(), &mut Lines(&[]));
    chip.step(&mut RenderJob { scene: &scene, memory, frame, outlet: None })
}

/// Gather request of the tile in flight with index `flight`.
fn request(flight: usize) -> GatherRequest {
    let surface = Surface::white(Vec3::ZERO, Vec3::Y, 1.0);
    GatherRequest {
        position: HilbertCode::new(&PhotonGrid::UNIT, [0.0; 3]),
        reflection: PartialReflection::encode(&surface.reflector(), Vec3::ONE, 0),
        target: GatherTarget::new(flight, PointIndex::Pixel(0)),
    }
}

#[test]
fn a_gather_without_a_tile_in_flight_is_a_fault() {
    let frame = &frame();
    // The micro chip has one tile in flight.
    for (flight, broken) in [(1, Invariant::Flight), (0, Invariant::Waiting)] {
        let mut chip = Box::new(MicroChip::new());
        assert!(chip.shared.gathers.wait_for_test(request(flight)));
        assert!(chip.flush(frame));
        assert_eq!(step(&mut chip, frame).err(), Some(broken.fault()));
    }
}

#[test]
fn a_pass_without_a_tile_in_flight_is_a_fault() {
    let mut chip = Box::new(MicroChip::new());
    chip.active = Some(1);
    assert_eq!(step(&mut chip, &frame()).err(), Some(Invariant::Flight.fault()));
}

#[test]
fn data_missing_in_a_tile_in_flight_is_a_fault() {
    let mut chip = Box::new(MicroChip::new());
    let flight = &mut chip.flights.values_mut()[0];
    assert_eq!(flight.begin_block(&frame()), Err(Invariant::Block.fault()));
    flight.begin(Tile { id: 0, x: 0, y: 0, width: 1, height: 1 });
    assert_eq!(flight.begin_block(&frame()), Ok(()));
    assert_eq!(flight.divide_block(), Err(Invariant::Halves.fault()));
    assert_eq!(flight.give_rays(1), Err(Invariant::Pixels.fault()));
    assert_eq!(flight.set_paths(1, adaptive::Paths::ONE), Err(Invariant::Pixels.fault()));
    flight.begin(Tile { id: 0, x: 0, y: 0, width: 17, height: 16 });
    assert_eq!(flight.begin_block(&frame()), Err(Invariant::Pixels.fault()));
}

#[test]
fn light_of_a_pixel_without_sums_is_a_fault() {
    let frame = &frame();
    let mut shared = Box::new(Shared::<Micro>::new());
    let sums = &mut shared.sums;
    let broken = Invariant::Sums.fault();
    assert_eq!(sums.push(frame, 0), Err(broken));
    sums.begin(0);
    assert_eq!(sums.push(frame, 0), Ok(0));
    let light = &LightGroups::ONE.light(0, Vec3::ONE);
    assert_eq!(sums.add(frame, (0, 0), Component::Direct, light), Ok(()));
    assert_eq!(sums.add(frame, (0, 1), Component::Direct, light), Err(broken));
    assert_eq!(sums.light(frame, (0, 1)), Err(broken));
    sums.end(0);
    assert_eq!(sums.light(frame, (0, 0)), Err(broken));
}

#[test]
fn one_gather_point_too_many_is_a_fault() {
    let frame = &frame();
    let mut shared = Box::new(Shared::<Micro>::new());
    let points = &mut shared.points;
    let pattern = pattern(frame, PixelSample { x: 0, y: 0, sample: 0 });
    let point = GatherPoint::record(Surface::white(Vec3::ZERO, Vec3::Y, 1.0), pattern, 1);
    let stored = StoredPoint::of_record(&point);
    let broken = Invariant::Points.fault();
    assert_eq!(points.get(0).err(), Some(broken));
    assert_eq!(points.take_rays(&mut Position::at(Pass::Rays), 0, pattern, frame), Err(broken));
    for _ in 0..<Micro as ChipKind>::Points::ENTRIES {
        assert_eq!(points.push(0, stored, 0), Ok(()));
    }
    assert_eq!(points.push(0, stored, 0), Err(broken));
}

/// Calls `work` in a scene without surfaces.
fn in_empty_scene<T>(
    work: impl FnOnce(&mut Context<Lines>, &GatherPoint) -> Result<T, Fault>,
) -> Result<T, Fault> {
    let (mut scene, memory) = (scene(), &mut Lines(&[Line::ZERO]));
    // A line of zeros is a node without children.
    scene.header.sections[SectionKind::Nodes as usize] = Section { first_line: 0, records: 1 };
    let camera = Camera { forward: [0.0, 0.0, -1.0], ..frame().camera };
    let frame = &FrameParameters { camera, ..frame() };
    let pattern = pattern(frame, PixelSample { x: 0, y: 0, sample: 0 });
    let point = GatherPoint::record(Surface::white(Vec3::ZERO, Vec3::Y, 1.0), pattern, 32);
    work(&mut Context { scene: &scene, memory, frame, counters: &mut Counters { ..Counters::ZERO } }, &point)
}

#[test]
fn a_surface_that_is_not_seen_again_is_a_fault() {
    let read = in_empty_scene(|context, point| {
        let stored = StoredPoint { seen: Seen::ELSEWHERE, ..StoredPoint::of_record(point) };
        let at = PixelSample { x: 0, y: 0, sample: 0 };
        stored.read_surface(context, at, &mut Surface::NOWHERE.clone())
    });
    assert_eq!(read, Err(Invariant::Surface.fault()));
}

#[test]
fn one_ray_too_many_for_a_bundle_is_a_fault() {
    let broken = Err(Invariant::Bundle.fault());
    for (rays, expected) in [(BUNDLE_RAYS, Ok(())), (BUNDLE_RAYS + 1, broken)] {
        let gathered = in_empty_scene(|context, point| {
            let target = GatherTarget::new(0, PointIndex::Pixel(0));
            final_gather::cast(context, point, target, 0..rays as u32, &mut GatherRayEnds::new())
        });
        assert_eq!(gathered, expected);
        let bundle = &[Ray::new(RayKind::Light, Vec3::ZERO, Vec3::Y); BUNDLE_RAYS + 1][..rays];
        let hit = in_empty_scene(|context, _| {
            closest_hits(context.scene, context.memory, bundle, &mut [None; BUNDLE_RAYS])
        });
        assert_eq!(hit, expected);
        let passed = in_empty_scene(|context, _| transmittances(context.scene, context.memory, bundle));
        assert_eq!(passed.map(|_| ()), expected);
    }
}
