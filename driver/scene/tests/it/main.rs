//! Loads scenes from files: valid content arrives as stated, and invalid content gives an error with its
//! path.

mod animations;
mod compression;
mod damage;
mod draco;
mod errors;
mod framing;
mod glass;
mod instances;
mod ktx2;
mod lamps;
mod layers;
mod loading;
mod materials;
mod profiles;
mod schema;
mod specular_glossiness;
mod support;
mod tangents;
mod textures;
mod vertices;
