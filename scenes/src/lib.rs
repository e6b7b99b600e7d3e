//! Generators of the scenes that ship with photoncard.
//!
//! [`scenes`] returns all files, with equal bytes on every machine. A test compares them with the files in
//! the folder of this crate. The folder's `README.md` describes each scene.
//!
//! | module | contents |
//! |---|---|
//! | [`mesh`], `sphere` | triangle meshes and operations on them |
//! | [`material`] | reflection, transmission and emission as in glTF |
//! | [`document`], [`builder`] | glTF's JSON, and its assembly from meshes, materials, nodes and cameras |
//! | `motion` | animations of cameras, lights, joints and morph targets |
//! | `cornell`, `furnace`, `atrium`, `room`, `roughness`, `house` | one module for each scene and its variants |
//! | `sky` | environment map for `atrium-open.glb` and `house.glb` |
//!
//! To add a scene, write a module with a function that returns the file's bytes, and add it to [`scenes`].
#![forbid(unsafe_code)]

mod atrium;
pub mod builder;
mod cornell;
pub mod document;
mod furnace;
mod house;
pub mod material;
pub mod mesh;
mod motion;
mod room;
mod roughness;
mod sky;
mod sphere;

/// File of a scene or an environment map.
#[derive(Clone, Debug)]
pub struct SceneFile {
    /// Name of the file, without a folder.
    pub name: &'static str,
    /// Contents of the file.
    pub bytes: Vec<u8>,
}

/// Returns all scenes, and the environment map that lights `atrium-open.glb` and `house.glb`.
pub fn scenes() -> Vec<SceneFile> {
    vec![
        SceneFile { name: "cornell.gltf", bytes: cornell::lambertian() },
        SceneFile { name: "cornell-glossy.gltf", bytes: cornell::glossy_floor() },
        SceneFile { name: "cornell-uplight.gltf", bytes: cornell::uplight() },
        SceneFile { name: "cornell-spheres.glb", bytes: cornell::spheres() },
        SceneFile { name: "cornell-moving.glb", bytes: cornell::moving() },
        SceneFile { name: "furnace.gltf", bytes: furnace::furnace() },
        SceneFile { name: "atrium.glb", bytes: atrium::atrium() },
        SceneFile { name: "atrium-walk.glb", bytes: atrium::walk() },
        SceneFile { name: "atrium-open.glb", bytes: atrium::open() },
        SceneFile { name: "room.glb", bytes: room::room() },
        SceneFile { name: "roughness.glb", bytes: roughness::roughness() },
        SceneFile { name: "house.glb", bytes: house::house() },
        SceneFile { name: "sky.exr", bytes: sky::sky() },
    ]
}
