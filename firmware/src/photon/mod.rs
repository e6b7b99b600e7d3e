//! The photon map: the k photons nearest to a point, and the radiance that they reflect.

mod kdtree;
mod nearest;
mod radiance;

pub use kdtree::gather;
pub use nearest::{Candidate, NearestPhotons};
pub use radiance::{MIN_NORMAL_COSINE, SameSurface, reflected_radiance};
