//! Units of a chip, and the steps that they take.

use photoncard_picture::choice::choices;
use photoncard_shared::counters::Counters;

use crate::emulator::contents::Contents;

/// Unit of a chip, by the kind of its arithmetic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Rays against boxes.
    Traversal,
    /// Rays against triangles.
    Triangles,
    /// Distances to photons and to boxes of photons.
    Search,
    /// The k nearest of a search's candidates.
    Selection,
    /// The density estimate and the reflection of photons.
    Reflection,
    /// Surfaces where rays end.
    Shading,
    /// Direct light: choice of a light, and its reflection.
    Light,
    /// Directions of gather rays.
    Sampling,
    /// Irradiance cache: surveys, gradients, interpolation.
    IrradianceCache,
    /// Eye rays and pixels.
    Pixels,
}

choices!(Unit {
    Traversal = "traversal": "Rays against boxes",
    Triangles = "triangle test": "Rays against triangles",
    Search = "photon search": "Distances to photons and their boxes",
    Selection = "selection": "The nearest candidates of a search",
    Reflection = "reflection": "Density estimate and reflection of photons",
    Shading = "shading": "Surfaces where rays end",
    Light = "direct light": "Choice of lights, and their reflection",
    Sampling = "sampling": "Directions of gather rays",
    IrradianceCache = "irradiance cache": "Surveys, gradients, interpolation",
    Pixels = "pixels": "Eye rays and pixels",
});

/// Part of a chip in the cost model of Table 7.1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChipPart {
    /// Rays and the surfaces where they end.
    RayCaster,
    /// Directions of gather rays, irradiance cache, pixels.
    Controller,
    /// Searches and all reflection, direct light included.
    GatherUnit,
}

impl Unit {
    /// The part of the chip that the unit is in.
    pub fn part(self) -> ChipPart {
        match self {
            Self::Traversal | Self::Triangles | Self::Shading => ChipPart::RayCaster,
            Self::Sampling | Self::IrradianceCache | Self::Pixels => ChipPart::Controller,
            Self::Search | Self::Selection | Self::Reflection | Self::Light => ChipPart::GatherUnit,
        }
    }
}

/// Piece of work with a fixed or nearly fixed number of operations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Preparation of a ray.
    Ray,
    /// A node of the hierarchy: what is common to its boxes.
    Node,
    /// A box of a node.
    Box,
    /// A vertex of a leaf, sheared.
    Vertex,
    /// A triangle of a leaf, excluded or not.
    Triangle,
    /// The triangles of a leaf that were not excluded.
    Leaf,
    /// A box of photons.
    PhotonBox,
    /// A photon of a leaf.
    Photon,
    /// A photon of the kd-tree.
    TreePhoton,
    /// A candidate that a selection reads: guesses of an interval.
    Selected,
    /// A comparison of two distances.
    Compared,
    /// A gather at the end of a ray.
    Gather,
    /// A photon's normal.
    Normal,
    /// A photon that a lobe reflects.
    Reflected,
    /// The value of a Phong lobe for a photon.
    Phong,
    /// The value of a microfacet lobe for a photon.
    Microfacets,
    /// A surface that is read.
    Surface,
    /// A record of a light.
    LightRecord,
    /// A shadow ray.
    ShadowRay,
    /// A gather ray.
    GatherRay,
    /// A table of directions.
    Table,
    /// A photon of a table of directions.
    TablePhoton,
    /// A survey ray.
    SurveyRay,
    /// A gather ray of a record.
    RecordRay,
    /// A sample that is interpolated.
    Interpolated,
    /// An eye ray.
    EyeRay,
}

choices!(Step {
    Ray = "ray": "Preparation of a ray",
    Node = "node": "A node of the hierarchy",
    Box = "box": "A box of a node",
    Vertex = "vertex": "A vertex of a leaf",
    Triangle = "triangle": "A triangle of a leaf",
    Leaf = "leaf": "Triangles of a leaf that may be met",
    PhotonBox = "box of photons": "A box of photons",
    Photon = "photon": "A photon of a leaf",
    TreePhoton = "photon of the kd-tree": "A photon of the kd-tree",
    Selected = "candidate": "A candidate that a selection reads",
    Compared = "comparison": "A comparison of two distances",
    Gather = "gather": "A gather at the end of a ray",
    Normal = "normal": "The normal of a photon",
    Reflected = "reflected photon": "A photon that a lobe reflects",
    Phong = "Phong lobe": "The value of a Phong lobe for a photon",
    Microfacets = "microfacet lobe": "The value of a microfacet lobe for a photon",
    Surface = "surface": "A surface that is read",
    LightRecord = "light record": "A record of a light",
    ShadowRay = "shadow ray": "A shadow ray",
    GatherRay = "gather ray": "A gather ray",
    Table = "table": "A table of directions",
    TablePhoton = "photon of a table": "A photon of a table of directions",
    SurveyRay = "survey ray": "A survey ray",
    RecordRay = "ray of a record": "A gather ray of an irradiance record",
    Interpolated = "interpolated sample": "A sample that is interpolated",
    EyeRay = "eye ray": "An eye ray",
});

/// Work of chips, from which the numbers of steps follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Work {
    counters: Counters,
    contents: Contents,
    gather_rays: f64,
}

impl Work {
    /// Work that was counted, in a frame with `gather_rays` gather rays a sample.
    pub fn new(counters: &Counters, contents: &Contents, gather_rays: f64) -> Self {
        Self { counters: *counters, contents: *contents, gather_rays }
    }
}

impl Step {
    /// The unit that takes the step.
    pub fn unit(self) -> Unit {
        match self {
            Self::Ray | Self::Node | Self::Box => Unit::Traversal,
            Self::Vertex | Self::Triangle | Self::Leaf => Unit::Triangles,
            Self::PhotonBox | Self::Photon | Self::TreePhoton => Unit::Search,
            Self::Selected | Self::Compared => Unit::Selection,
            Self::Gather | Self::Normal | Self::Reflected | Self::Phong | Self::Microfacets => {
                Unit::Reflection
            }
            Self::Surface => Unit::Shading,
            Self::LightRecord | Self::ShadowRay => Unit::Light,
            Self::GatherRay | Self::Table | Self::TablePhoton => Unit::Sampling,
            Self::SurveyRay | Self::RecordRay | Self::Interpolated => Unit::IrradianceCache,
            Self::EyeRay => Unit::Pixels,
        }
    }

    /// Number of these steps in some work.
    pub fn count(self, work: &Work) -> f64 {
        let Work { counters, contents, gather_rays } = work;
        let rays = [
            counters.eye_rays,
            counters.shadow_rays,
            counters.gather_rays,
            counters.survey_rays,
            counters.specular_rays,
        ];
        let count = match self {
            Self::Ray => rays.iter().sum(),
            Self::Node => contents.nodes,
            Self::Box => contents.boxes,
            Self::Vertex => contents.vertices,
            Self::Triangle => contents.triangles,
            Self::Leaf => contents.leaves,
            Self::PhotonBox => contents.photon_boxes,
            Self::Photon => contents.photons,
            Self::TreePhoton => contents.tree_photons,
            Self::Selected => counters.photons_selected,
            // A photon of a leaf is compared with the limit by its bits, one of the kd-tree as a number.
            Self::Compared => counters.distances_compared + contents.photons,
            Self::Gather => counters.gathers - counters.tables + counters.caustic_gathers + counters.lookups,
            Self::Normal => counters.normals_decoded,
            Self::Reflected => counters.photons_reflected,
            Self::Phong => counters.photons_reflected - counters.photons_on_microfacets,
            Self::Microfacets => counters.photons_on_microfacets,
            Self::Surface => contents.materials,
            Self::LightRecord => contents.lights,
            Self::ShadowRay => counters.shadow_rays,
            Self::GatherRay => counters.gather_rays,
            Self::Table => counters.tables,
            Self::TablePhoton => return photons_of_tables(counters),
            Self::SurveyRay => counters.survey_rays,
            Self::RecordRay => return counters.records as f64 * gather_rays,
            Self::Interpolated => counters.interpolated_samples,
            Self::EyeRay => counters.eye_rays,
        };
        count as f64
    }
}

/// Photons of the searches for direction tables, at the mean of all searches.
fn photons_of_tables(counters: &Counters) -> f64 {
    counters.photons_found as f64 * counters.tables as f64 / counters.gathers.max(1) as f64
}
