//! Units of a chip, the steps that they execute, and numbers of operations by kind.

use photoncard_picture::choice::choices;
use photoncard_shared::counters::Counters;
use serde::{Deserialize, Serialize};

use crate::emulator::contents::Contents;

/// Unit of a chip that does one kind of arithmetic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Intersection of rays with boxes.
    Traversal,
    /// Intersection of rays with triangles.
    Triangles,
    /// Distances from queries to photons and to boxes of photons.
    Search,
    /// Selection of the k nearest candidates of a search.
    Selection,
    /// Density estimate, and reflection of the light of photons.
    Reflection,
    /// Evaluation of surfaces at the ends of rays.
    Shading,
    /// Direct light: choice of a light, and reflection of its radiance.
    Light,
    /// Choice of the directions of gather rays.
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

/// Unit of the chip in the cost model of Table 7.1, which combines several `Unit`s.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChipPart {
    /// Casts rays and evaluates the surfaces at their ends.
    RayCaster,
    /// Generates eye rays and directions of gather rays, and computes the irradiance cache and pixels.
    Controller,
    /// Searches for photons and computes all reflection, including that of direct light.
    GatherUnit,
}

impl Unit {
    /// Part of the chip that contains the unit.
    pub fn part(self) -> ChipPart {
        match self {
            Self::Traversal | Self::Triangles | Self::Shading => ChipPart::RayCaster,
            Self::Sampling | Self::IrradianceCache | Self::Pixels => ChipPart::Controller,
            Self::Search | Self::Selection | Self::Reflection | Self::Light => ChipPart::GatherUnit,
        }
    }
}

/// Step of a unit, with a fixed or nearly fixed number of operations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Preparation of a ray for the tests of boxes and triangles.
    Ray,
    /// Computation that is done once for all boxes of a hierarchy node.
    Node,
    /// Test of one box of a node.
    Box,
    /// Shear of one vertex of a leaf.
    Vertex,
    /// Edge functions of one triangle of a leaf, whether or not they exclude it.
    Triangle,
    /// Intersection with the triangles of a leaf that their edge functions do not exclude.
    Leaf,
    /// Distance to one box of photons.
    PhotonBox,
    /// Distance to one photon of a leaf.
    Photon,
    /// Distance to one photon of the kd-tree.
    TreePhoton,
    /// Guess of the interval that contains the k-th smallest distance, per candidate that a selection reads.
    Selected,
    /// Comparison of two distances.
    Compared,
    /// Density estimate of radiance by a gather, or use of an irradiance point, without the search.
    Gather,
    /// Decoding of a photon's normal.
    Normal,
    /// Reflection of a photon by a lobe.
    Reflected,
    /// Value of a Phong lobe for a photon.
    Phong,
    /// Value of a microfacet lobe for a photon.
    Microfacets,
    /// Evaluation of a surface.
    Surface,
    /// Evaluation of a light record: a node of the light tree, or an emitter.
    LightRecord,
    /// Direct light of a shadow ray, without its intersection and light records.
    ShadowRay,
    /// Choice of the direction of a gather ray.
    GatherRay,
    /// Construction of a direction table.
    Table,
    /// Contribution of a photon to a direction table.
    TablePhoton,
    /// Survey ray of an irradiance record, without its intersection.
    SurveyRay,
    /// Gradients of an irradiance record, per gather ray.
    RecordRay,
    /// Interpolation of a sample's irradiance.
    Interpolated,
    /// Eye ray and its contribution to a pixel, without its intersection.
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
    /// Counted work of a frame with `gather_rays` gather rays per sample.
    pub fn new(counters: &Counters, contents: &Contents, gather_rays: f64) -> Self {
        Self { counters: *counters, contents: *contents, gather_rays }
    }
}

impl Step {
    /// Unit that performs the step.
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

    /// Number of these steps in the work `work`.
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
            // The operations of `Self::Photon` do not include the comparison of its distance with the limit,
            // which compares bits. Those of `Self::TreePhoton` include it.
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

/// Estimates the number of photons found by the searches for direction tables. Each such search is assumed to
/// find as many photons as the mean of all searches.
fn photons_of_tables(counters: &Counters) -> f64 {
    counters.photons_found as f64 * counters.tables as f64 / counters.gathers.max(1) as f64
}

/// Numbers of operations by kind. A vector operation counts once per lane that is used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Operations {
    /// Additions and subtractions.
    pub add: f64,
    /// Multiplications.
    pub multiply: f64,
    /// Divisions.
    pub divide: f64,
    /// Square roots.
    pub square_root: f64,
    /// Comparisons, minima and maxima, including comparisons of squared distances by their bits.
    pub compare: f64,
    /// Conversions between integers and floating point, and roundings to integers. [`Self::flops`] excludes
    /// them.
    pub convert: f64,
}

impl Operations {
    /// Floating-point operations of all kinds, without conversions.
    pub fn flops(&self) -> f64 {
        self.add + self.multiply + self.divide + self.square_root + self.compare
    }

    /// Numbers by kind, in the order of the fields.
    pub fn to_array(self) -> [f64; 6] {
        [self.add, self.multiply, self.divide, self.square_root, self.compare, self.convert]
    }

    /// Multiplies all numbers by `count`.
    #[must_use]
    pub fn times(&self, count: f64) -> Self {
        Self {
            add: self.add * count,
            multiply: self.multiply * count,
            divide: self.divide * count,
            square_root: self.square_root * count,
            compare: self.compare * count,
            convert: self.convert * count,
        }
    }

    /// Adds the operations of `other`.
    pub fn add(&mut self, other: &Self) {
        self.add += other.add;
        self.multiply += other.multiply;
        self.divide += other.divide;
        self.square_root += other.square_root;
        self.compare += other.compare;
        self.convert += other.convert;
    }
}
