//! Scenes of the studies.

/// File and name in reports of a simple, a glossy and a large scene.
pub(super) const SCENES: [(&str, &str); 3] =
    [(CORNELL, "Cornell box"), (GLOSSY, "glossy Cornell box"), (ATRIUM, "atrium")];
pub(super) const CORNELL: &str = "cornell.gltf";
pub(super) const GLOSSY: &str = "cornell-glossy.gltf";
pub(super) const ATRIUM: &str = "atrium.glb";
