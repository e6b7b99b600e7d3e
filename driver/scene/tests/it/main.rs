//! Scenes from files: what glTF states is what is loaded, and what it forbids is named.

mod animations;
mod compression;
mod damage;
mod draco;
mod errors;
mod framing;
mod glass;
mod ktx2;
mod layers;
mod loading;
mod materials;
mod schema;
mod specular_glossiness;
mod support;
mod tangents;
mod textures;
mod vertices;
