//! Lightmaps: irradiance of the surfaces of a scene as textures.
//!
//! A [`Plan`] unwraps the surfaces (`charts`, or `stated` by the file), places the charts on pages
//! (`atlas`), and puts sensors on the texels (`texels`), outside solids (`solids`). A
//! [`Meter`](crate::measure::Meter) measures the sensors, or machines measure [parts](part) of them. A
//! [`Baked`] is the light of all texels: means of sensors, continued around charts (`pages`), as irradiance,
//! and as the radiance of the surfaces (`colours`). `glb` writes the scene with its pages.
//!
//! A surface shows the radiance `albedo E / pi + emission` of a Lambertian surface with its diffuse albedo;
//! photons are reflected by the materials as they are.

mod atlas;
mod baked;
mod charts;
mod colours;
mod error;
mod file;
mod glb;
mod materials;
mod overlap;
mod pages;
pub mod part;
mod plan;
mod raster;
mod solids;
mod stated;
mod surfaces;
mod texels;

pub use self::atlas::{Atlas, MAX_PAGES, PADDING, PlacedChart};
pub use self::baked::Baked;
pub use self::error::BakeError;
pub use self::glb::{MaterialForm, write};
pub use self::pages::{NO_CHART, Page};
pub use self::plan::{BakeSettings, Plan};
pub use self::surfaces::{Primitive, Surfaces};
pub use self::texels::{Sample, Texel};
