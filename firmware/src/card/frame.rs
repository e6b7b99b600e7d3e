//! Checks a frame's parameters.

use photoncard_shared::budget::{Budget, MAX_BINS, MAX_LIGHT_GROUPS};
use photoncard_shared::image::{Header, SectionKind};
use photoncard_shared::layout::{LEAF_TRIANGLES, Record, Sensor};
use photoncard_shared::message::{Drain, Fault, FrameParameters, Parameter, Projection, Radiance};

use crate::chip::least_waiting_lines;
use crate::irradiance_cache::MIN_RECORDS;

/// Checks a frame's parameters against the budget, the card image and the number `lines` of lines of card
/// memory.
///
/// # Errors
/// The fault of the first parameter out of range.
pub(super) fn check_frame(
    budget: &Budget,
    header: &Header,
    lines: u32,
    frame: &FrameParameters,
) -> Result<(), Fault> {
    let free = u64::from(lines.saturating_sub(header.lines));
    let can_wait = budget.waiting_blocks > 0 && least_waiting_lines(frame, budget) <= free;
    let within = |value: u32, most: u32| (1..=most).contains(&value);
    let is_positive = |value: f32| value.is_finite() && value > 0.0;
    let neighbors = |count: u32| count >= 2 && within(count, budget.neighbors);
    let last_sample = frame.first_sample.saturating_add(frame.samples);
    let checks = [
        (Parameter::Width, within(frame.width, MAX_PICTURE_SIDE)),
        (Parameter::Height, within(frame.height, MAX_PICTURE_SIDE)),
        (Parameter::Camera, frame.camera.is_finite() && has_sensors(header, frame)),
        (Parameter::FirstSample, frame.first_sample < budget.samples),
        (Parameter::Samples, frame.samples > 0 && last_sample <= budget.samples),
        (Parameter::PlannedSamples, within(frame.planned_samples, budget.samples)),
        (Parameter::AdaptiveThreshold, frame.adaptive_threshold.is_none_or(is_positive)),
        (Parameter::GatherRays, frame.gather_rays <= budget.gather_rays),
        (Parameter::ShadowRays, frame.shadow_rays <= budget.shadow_rays),
        (Parameter::Neighbors, neighbors(frame.neighbors)),
        (Parameter::MaxDistance, is_positive(frame.max_distance)),
        (Parameter::IrradianceError, frame.irradiance_error.is_none_or(is_irradiance_error)),
        (Parameter::Bins, within(frame.bins, MAX_BINS)),
        (Parameter::Drain, frame.drain != Drain::Buckets || can_wait),
        (Parameter::Queue, frame.queue >= 1),
        (Parameter::InFlight, frame.in_flight >= 1),
        (Parameter::Radiance, frame.radiance == Radiance::Density || has_irradiance(header)),
        (Parameter::Identities, !frame.identities || has_identities(header)),
        (Parameter::LightGroups, has_light_groups(budget, header, frame)),
        (
            Parameter::Caustics,
            frame
                .caustics
                .is_none_or(|gather| neighbors(gather.neighbors) && is_positive(gather.max_distance)),
        ),
        (Parameter::NearDistance, frame.near_distance.is_finite() && frame.near_distance >= 0.0),
    ];
    match checks.iter().find(|(_, holds)| !holds) {
        Some((parameter, _)) => Err(parameter.fault()),
        None => Ok(()),
    }
}

/// Returns true if the card image has the lines of a frame's sensors, and the frame does nothing that sensors
/// cannot do: they belong to no triangle, and see no neighbours between which irradiance is interpolated.
fn has_sensors(header: &Header, frame: &FrameParameters) -> bool {
    let Projection::Sensors { line, count, .. } = frame.camera.projection else { return true };
    let end = line.checked_add(count.div_ceil(Sensor::PER_LINE as u32));
    end.is_some_and(|end| end <= header.lines) && frame.irradiance_error.is_none() && !frame.identities
}

/// Returns true if a chip and a card image have what the light groups of a frame need: irradiance records for
/// each group of a block of one pixel, and photons with groups, which neither kd-trees nor irradiance points
/// have.
fn has_light_groups(budget: &Budget, header: &Header, frame: &FrameParameters) -> bool {
    let groups = frame.light_groups as usize;
    let has_records =
        frame.irradiance_error.is_none() || groups * MIN_RECORDS <= budget.irradiance_records as usize;
    let has_photons =
        header.section(SectionKind::Photons).records == 0 && frame.radiance == Radiance::Density;
    groups == 0 || groups <= MAX_LIGHT_GROUPS && has_records && has_photons
}

fn is_irradiance_error(error: f32) -> bool {
    (MIN_IRRADIANCE_ERROR..=1.0).contains(&error)
}

/// Returns true if a card image has irradiance points, or has no photons to compute them from.
fn has_irradiance(header: &Header) -> bool {
    let holds = |kind| header.section(kind).records > 0;
    holds(SectionKind::IrradianceLeaves) || !holds(SectionKind::Photons) && !holds(SectionKind::PhotonLeaves)
}

/// Returns true if a card image has identities of all its triangles, or has no triangles.
fn has_identities(header: &Header) -> bool {
    let [leaves, identities] =
        [SectionKind::Triangles, SectionKind::Identities].map(|kind| header.section(kind).records);
    u64::from(identities) >= u64::from(leaves) * LEAF_TRIANGLES as u64
}

/// Minimum error bound of interpolated irradiance. A smaller bound would lie below the rounding errors of
/// irradiance.
pub const MIN_IRRADIANCE_ERROR: f32 = 1e-6;

/// Maximum width and height of a picture, pixels. At this size an `f32` holds a pixel's column or row and 7
/// bits of a position in the pixel.
pub const MAX_PICTURE_SIDE: u32 = 1 << 16;
