//! Assigns operations to the cost model's steps, by the functions of the firmware that contain the
//! operations.

use photoncard_driver::cost_model::arithmetic::Step;

/// Position of an operation: the functions that are inlined there, the innermost first, with line and column.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Place(Vec<Frame>);

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Frame {
    /// Path below `firmware/src`.
    file: String,
    function: String,
    line: Option<u32>,
    column: Option<u32>,
}

impl Place {
    /// Position of the call that returns to `address`.
    pub(super) fn new(symbols: &addr2line::Loader, address: u64) -> Self {
        let mut frames = symbols.find_frames(address - 1).expect("the symbols are sound");
        let mut place = Self(Vec::new());
        while let Some(frame) = frames.next().expect("the symbols are sound") {
            let Some(location) = frame.location else { continue };
            let Some((_, file)) = location.file.and_then(|file| file.split_once("firmware/src/")) else {
                continue;
            };
            let name = frame.function.map(|name| name.demangle().unwrap_or_default().into_owned());
            let name = name.unwrap_or_default();
            let function = name.split('<').next().unwrap_or_default().to_owned();
            place.0.push(Frame {
                file: file.to_owned(),
                function,
                line: location.line,
                column: location.column,
            });
        }
        place
    }

    /// Returns whether one of the functions is in a file or folder below `firmware/src`.
    fn is_in(&self, path: &str) -> bool {
        self.0.iter().any(|frame| frame.file.starts_with(path))
    }

    /// Returns whether one of the functions is `function` of `file`.
    fn is_of(&self, file: &str, function: &str) -> bool {
        self.0.iter().any(|frame| frame.file == file && frame.function == function)
    }
}

/// Step of an operation, by the first rule below that fits one of its functions. Operations without a rule,
/// such as those on codes of directions, count for gathers, which need them most.
pub(super) fn step_of(place: &Place) -> Step {
    ray_caster(place)
        .or_else(|| photons(place))
        .or_else(|| surfaces(place))
        .or_else(|| directions(place))
        .or_else(|| lights_and_pixels(place))
        .unwrap_or(Step::Gather)
}

/// Step of the ray caster; `None` for other operations.
fn ray_caster(place: &Place) -> Option<Step> {
    Some(if place.is_of("scene/triangle.rs", "leaf") {
        if place.is_of("scene/triangle.rs", "shear") { Step::Vertex } else { Step::Triangle }
    } else if place.is_of("scene/triangle.rs", "intersect_slot") {
        Step::Leaf
    } else if place.is_of("scene/slabs.rs", "planes") {
        Step::Node
    } else if place.is_of("scene/slabs.rs", "enter") {
        Step::Box
    } else if place.is_of("scene/slabs.rs", "new") || place.is_of("scene/triangle.rs", "new") {
        Step::Ray
    } else if place.is_in("scene/bvh.rs") {
        Step::Leaf
    } else {
        return None;
    })
}

/// Step of a photon search or of the density estimate; `None` for other operations.
fn photons(place: &Place) -> Option<Step> {
    Some(if place.is_in("photon/select.rs") {
        Step::Selected
    } else if place.is_of("photon/leaves.rs", "distances_to_boxes") {
        Step::PhotonBox
    } else if place.is_of("photon/leaves.rs", "test_leaf") {
        Step::Photon
    } else if place.is_in("photon/kdtree.rs") {
        Step::TreePhoton
    } else if place.is_in("importance/incident.rs") {
        if place.is_of("importance/incident.rs", "new") { Step::TablePhoton } else { Step::Table }
    } else if place.is_in("photon/same_surface.rs") {
        Step::Normal
    } else if place.is_of("scene/reflection/ggx_kernel.rs", "factor") {
        Step::Microfacets
    } else if place.is_of("scene/reflection/phong.rs", "power") {
        Step::Phong
    } else if place.is_of("photon/radiance.rs", "add")
        || place.is_of("scene/reflection/record.rs", "lobe_factor")
    {
        Step::Reflected
    } else if ["photon/", "gather/", "scene/reflection/record.rs", "chip/light.rs"]
        .map(|path| place.is_in(path))
        .contains(&true)
    {
        Step::Gather
    } else {
        return None;
    })
}

/// Step of direction tables or of the irradiance cache; `None` for other operations.
fn directions(place: &Place) -> Option<Step> {
    Some(if place.is_in("irradiance_cache/survey.rs") {
        Step::SurveyRay
    } else if place.is_in("irradiance_cache/gradient/") || place.is_of("irradiance_cache/mod.rs", "add") {
        Step::RecordRay
    } else if place.is_in("irradiance_cache/") {
        Step::Interpolated
    } else if place.is_in("importance/table.rs")
        && ["new", "with_foci", "of_reflection"]
            .map(|name| place.is_of("importance/table.rs", name))
            .contains(&true)
    {
        Step::Table
    } else if place.is_in("importance/") || place.is_in("render/final_gather.rs") {
        Step::GatherRay
    } else {
        return None;
    })
}

/// Step of evaluating a surface, by the innermost function that is no helper; `None` for other operations.
fn surfaces(place: &Place) -> Option<Step> {
    let inner = &place.0.iter().find(|frame| !HELPERS.contains(&frame.file.as_str()))?.file;
    let is_surface = inner.strip_prefix("scene/").is_some_and(|file| SURFACES.contains(&file));
    (is_surface && !place.is_in("scene/light/")).then_some(Step::Surface)
}

/// Files that evaluate surfaces, below `firmware/src/scene`.
const SURFACES: [&str; 7] = [
    "surface.rs",
    "shading_normal.rs",
    "normal_map.rs",
    "corners.rs",
    "materials.rs",
    "texture.rs",
    "mod.rs",
];

/// Files whose functions are used everywhere.
const HELPERS: [&str; 2] = ["vector.rs", "fixed_point.rs"];

/// Step of lights, eye rays or pixels; `None` for other operations.
fn lights_and_pixels(place: &Place) -> Option<Step> {
    Some(if place.is_in("scene/light/tree.rs") {
        Step::LightRecord
    } else if place.is_in("scene/light/") || place.is_in("render/direct.rs") {
        Step::ShadowRay
    } else if place.is_in("render/eye.rs") || place.is_in("chip/") || place.is_in("render/point.rs") {
        Step::EyeRay
    } else if place.is_in("scene/reflection/material.rs") {
        Step::Surface
    } else if place.is_in("scene/reflection/") {
        Step::GatherRay
    } else if place.is_in("scene/") {
        Step::Surface
    } else {
        return None;
    })
}
