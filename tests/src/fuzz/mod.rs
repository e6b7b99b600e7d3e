//! Fuzzing of all readers of foreign bytes, by mutated inputs. An input is a function of target, seed and
//! number, by which it can be repeated.
//!
//! No input may panic, take longer than some seconds, or allocate more than a bound. A coverage-guided fuzzer
//! would find more, but needs another build, of instrumented code.

mod compressed;
pub(crate) mod environment;
pub(crate) mod gltf;
mod headed;
pub mod image;
mod messages;
pub(crate) mod mutation;
pub(crate) mod picture;
pub mod png;
mod profile;
mod random;
mod run;
mod session;
mod target;
pub(crate) mod texture;
mod transport;

use std::sync::Arc;

pub use self::random::Random;
pub use self::run::{Failure, Report, Settings, fuzz};
pub use self::target::Target;

/// Names of all targets.
pub const NAMES: [&str; 13] = [
    "frames",
    "messages",
    "session",
    "image",
    "gltf",
    "meshopt",
    "draco",
    "textures",
    "environments",
    "profiles",
    "exr",
    "parts",
    "prepared",
];

/// Target with this name; `None` if there is none.
pub fn target(name: &str) -> Option<Arc<dyn Target>> {
    match name {
        "frames" => Some(Arc::new(transport::Frames::new())),
        "messages" => Some(Arc::new(messages::Messages::new())),
        "session" => Some(Arc::new(session::Sessions::new())),
        "image" => Some(Arc::new(image::Image::new())),
        "gltf" => Some(Arc::new(gltf::Scenes::new())),
        "meshopt" => Some(Arc::new(compressed::Streams::meshopt())),
        "draco" => Some(Arc::new(compressed::Streams::draco())),
        "textures" => Some(Arc::new(texture::Textures::new())),
        "environments" => Some(Arc::new(environment::Environments::new())),
        "profiles" => Some(Arc::new(profile::Profiles::new())),
        "exr" => Some(Arc::new(picture::Pictures::new())),
        "parts" => Some(Arc::new(headed::Files::parts())),
        "prepared" => Some(Arc::new(headed::Files::prepared())),
        _ => None,
    }
}
