//! Enumerations whose values have names, for options, files and reports.

use photoncard_shared::address::{Stage, Structure};
use photoncard_shared::message::{Filter, Radiance, Sampling};

/// An enumeration whose values have names.
pub trait Choice: Copy + Send + Sync + 'static {
    /// All values, in the order in which they are presented.
    const ALL: &'static [Self];

    /// Name of the value, as it is given to a command-line option.
    fn name(self) -> &'static str;

    /// Explanation of the value in a line of help; empty if the name suffices.
    fn about(self) -> &'static str;

    /// Finds the value named `name`.
    ///
    /// # Errors
    /// If no value has this name. The text lists all names.
    fn of_name(name: &str) -> Result<Self, String> {
        let found = Self::ALL.iter().find(|value| value.name() == name);
        found.copied().ok_or_else(|| {
            let names: Vec<_> = Self::ALL.iter().map(|value| value.name()).collect();
            format!("{name:?} is none of {}", names.join(", "))
        })
    }
}

/// Implements [`Choice`] by a table of variants, names and explanations. A variant that is missing in the
/// table is a compile error.
#[macro_export]
macro_rules! choices {
    ($choice:ty { $($variant:ident = $name:literal $(: $about:literal)?),+ $(,)? }) => {
        impl $crate::choice::Choice for $choice {
            const ALL: &'static [Self] = &[$(Self::$variant),+];

            fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name),+
                }
            }

            fn about(self) -> &'static str {
                match self {
                    $(Self::$variant => concat!($($about)?)),+
                }
            }
        }
    };
}

pub use choices;

choices!(Sampling {
    Reflection = "brdf": "The reflection function",
    Photon = "photon": "The photons that arrive at the point",
    Product = "combined": "The product of both",
    Mixture = "mixture": "The mean of both",
    Focused = "focused": "The product of both, and cones around photons that arrive from nearly the same direction",
});

choices!(Filter {
    Box = "box": "The pixel's square",
    Gaussian = "gaussian": "A Gaussian of the standard deviation 1/2 pixel, cut off at 3/2 pixels; smooth",
    BlackmanHarris = "blackman-harris": "A Blackman-Harris window of 3/2 pixels; crisp",
});

choices!(Radiance {
    Density = "density": "The density of the nearest photons",
    Precomputed = "precomputed":
        "An approximation: the irradiance that the host has estimated at the nearest photon of the surface",
});

choices!(Structure {
    Header = "header": "Header of the card image",
    Nodes = "nodes": "Bounding volume hierarchy",
    Triangles = "triangles": "Triangles",
    Materials = "materials": "Materials",
    Emitters = "emitters": "Lights and their distributions",
    PhotonNodes = "photon_nodes": "Inner nodes of the photon map",
    Photons = "photons": "Photons",
    IrradianceNodes = "irradiance_nodes": "Inner nodes above irradiance points",
    IrradiancePoints = "irradiance_points": "Irradiance points",
    CausticNodes = "caustic_nodes": "Inner nodes of the caustic map",
    CausticPhotons = "caustic_photons": "Photons of the caustic map",
    Attributes = "attributes": "Vertex attributes",
    Textures = "textures": "Texture records and texels",
    IrradianceRecords = "irradiance_records": "Irradiance records kept from an earlier frame",
    Waiting = "waiting": "Gathers that wait in card memory, their results, and blocks that wait for these",
});

choices!(Stage {
    Begin = "begin": "Loading of an image, and begin of a frame",
    Eye = "eye": "Eye rays",
    Survey = "survey": "Survey rays of irradiance records",
    Table = "table": "Photon gathers for direction tables",
    Shadow = "shadow": "Shadow rays",
    GatherRay = "gather_ray": "Final gather rays",
    Gather = "gather": "Photon gathers at the ends of gather rays",
    Caustic = "caustic": "Gathers in the caustic map",
});
