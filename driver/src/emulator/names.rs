//! Names of structures and stages in statistics, traces and reports.

use photoncard_firmware::memory::Stage;
use photoncard_shared::address::Structure;

use crate::choice::choices;

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
