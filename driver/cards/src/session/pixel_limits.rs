//! Ranges of pixel sums that a chip can produce. A value outside shows that the card or its memory is faulty.

use photoncard_picture::sums::SumFormat;
use photoncard_shared::image::Header;
use photoncard_shared::message::{
    ALBEDO_STEPS, COVERAGE_STEPS, DEPTH_STEPS, FrameParameters, LayerSums, NORMAL_STEPS, PixelSums,
};

/// Relative rounding error of a unit normal.
const NORMAL_ROUNDING: f64 = 1.0 / (1 << 19) as f64;
/// Rounding error of a surface's position along the view's axis, relative to the sum of the maximum
/// coordinates of the scene and of the eye.
const DEPTH_ROUNDING: f32 = 1.0 / (1 << 19) as f32;

/// Ranges of a frame's pixel sums over n samples, of which s see a surface.
///
/// | sum | range |
/// |---|---|
/// | light, of layers and groups too | at least 0; beside a lamp without extent there is no upper limit |
/// | albedo | 0 to s |
/// | normals | length 0 to s (1 + 2^-19) |
/// | depths | 0 to s times the distance from the eye to the farthest corner of `[-reach, reach]^3` |
/// | surfaces s, gathers | 0 to n |
/// | positions | -s to s times `reach`, on each axis |
/// | coverage | 0 to the weight of all paths |
/// | coverage of all identities together | 0 to the coverage |
///
/// The maximum magnitude of a coordinate of the scene is `reach` (`Header::reach`), metres. The tolerance of
/// depths and positions is s times the sum of one step and `2^-19 (reach + e)`, where `e` is the maximum
/// magnitude of a coordinate of the eye. That of coverage is half a step for each path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelLimits {
    format: SumFormat,
    /// Minimum and maximum depth of a sample, in steps of 1 / [`DEPTH_STEPS`] depth units; `None` if no value
    /// is checked.
    depths: Option<[f64; 2]>,
    /// Maximum magnitude of a coordinate of a position, in steps of 1 / [`DEPTH_STEPS`] depth units.
    reach: f64,
    /// Maximum sum of coverage.
    coverage: f64,
}

/// Invalid value of a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BadValue {
    pub(super) channel: &'static str,
    pub(super) value: f64,
}

impl PixelLimits {
    /// Computes the limits of a frame of the card image with the header `header`.
    pub fn new(header: &Header, frame: &FrameParameters) -> Self {
        let eye = frame.camera.origin.iter().fold(0.0, |most: f32, coordinate| most.max(coordinate.abs()));
        let format = SumFormat::new(header, frame);
        let steps = f64::from(DEPTH_STEPS) / f64::from(format.scale.depth);
        let rounding = f64::from(DEPTH_ROUNDING * (header.reach + eye)) * steps + 1.0;
        let tolerance = 0.5 * frame.max_paths() as f64;
        Self {
            format,
            depths: Some([-rounding, farthest_corner(header, frame) * steps + rounding]),
            reach: f64::from(header.reach) * steps + rounding,
            coverage: format.count().weight_of_light() * f64::from(COVERAGE_STEPS) + tolerance,
        }
    }

    /// Creates limits that any value meets, for a relay, whose host checks the values. The units of the
    /// format are those of an empty scene.
    pub fn unchecked(frame: &FrameParameters) -> Self {
        Self { format: SumFormat::new(&Header::EMPTY, frame), depths: None, reach: 0.0, coverage: 0.0 }
    }

    /// Format of the sums.
    pub fn format(&self) -> &SumFormat {
        &self.format
    }

    /// Returns the first invalid value of a pixel; `None` if all are valid.
    pub(super) fn find_bad(&self, sums: &PixelSums) -> Option<BadValue> {
        let depths = self.depths?;
        let PixelSums {
            light,
            albedo,
            normal,
            depth,
            surfaces,
            layers,
            light_groups,
            position,
            coverage,
            identities,
        } = *sums;
        let seen = f64::from(surfaces);
        let find = |channel, values: [f64; 3], is_possible: &dyn Fn(f64) -> bool| {
            let bad = values.into_iter().find(|&value| !is_possible(value));
            bad.map(|value| BadValue { channel, value })
        };
        let find_light =
            |channel, light: [i64; 3]| find(channel, light.map(|value| value as f64), &|value| value >= 0.0);
        let normal = normal.map(|value| f64::from(value) / f64::from(NORMAL_STEPS));
        let length = normal.iter().map(|n| n * n).sum::<f64>().sqrt();
        let find_count = |channel, count: u32| {
            let is_possible = count <= self.format.samples;
            (!is_possible).then_some(BadValue { channel, value: f64::from(count) })
        };
        let is_albedo = |value: f64| value <= seen * f64::from(ALBEDO_STEPS);
        let [least, most] = depths.map(|depth| depth * seen);
        let is_deep = (least..=most).contains(&(depth as f64)) && (surfaces > 0 || depth == 0);
        find_count("surfaces", surfaces)
            .or_else(|| find_light("radiance", light))
            .or_else(|| find("albedo", albedo.map(f64::from), &is_albedo))
            .or_else(|| find("a normal of component", normal, &|_| length <= seen * (1.0 + NORMAL_ROUNDING)))
            .or_else(|| (!is_deep).then_some(BadValue { channel: "depth", value: depth as f64 }))
            .or_else(|| {
                let most = self.reach * seen;
                let is_near = |value: f64| value.abs() <= most;
                find("a position of coordinate", position?.map(|value| value as f64), &is_near)
            })
            .or_else(|| {
                let covered = coverage?;
                let is_possible = f64::from(covered) <= self.coverage && (covered > 0 || surfaces == 0);
                (!is_possible).then_some(BadValue { channel: "coverage", value: f64::from(covered) })
            })
            .or_else(|| {
                let total = identities?.total();
                let is_possible = coverage.is_none_or(|covered| total <= covered);
                let bad = BadValue { channel: "coverage of identities", value: f64::from(total) };
                (!is_possible).then_some(bad)
            })
            .or_else(|| {
                let groups = light_groups?;
                groups.sums().iter().find_map(|group| find_light("light of a light group", *group))
            })
            .or_else(|| {
                let LayerSums { direct, indirect, caustic, gathers } = layers?;
                find_light("direct light", direct)
                    .or_else(|| find_light("indirect light", indirect))
                    .or_else(|| find_light("caustic light", caustic))
                    .or_else(|| find_count("gathers", gathers))
            })
    }
}

/// Upper bound of depths, metres: distance from the eye to the farthest corner of `[-reach, reach]^3`, times
/// the length of the view vector if that exceeds 1.
fn farthest_corner(header: &Header, frame: &FrameParameters) -> f64 {
    let length = |vector: [f64; 3]| vector.iter().map(|component| component * component).sum::<f64>().sqrt();
    let ways = frame.camera.origin.map(|eye| f64::from(eye.abs()) + f64::from(header.reach));
    length(ways) * length(frame.camera.forward.map(f64::from)).max(1.0)
}
