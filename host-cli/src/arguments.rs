//! The arguments of every command, and what they mean.

pub(crate) mod choice;
mod picture;
pub(crate) mod threads;
mod without_effect;

use std::path::PathBuf;

use clap::{ArgAction, Args, Parser, Subcommand};
use photoncard_driver::emulator::ChipKind;
use photoncard_driver::emulator::memory_model::CacheSettings;
use photoncard_driver::film::Window;
use photoncard_driver::link::{LineFaults, ListenAddress};
use photoncard_driver::partial::PartialSettings;
use photoncard_driver::photon_map::PhotonLayout;
use photoncard_driver::printable::printable;
use photoncard_driver::render::{CardAddress, MIN_IRRADIANCE_ERROR, Radiance, RenderSettings, Sampling};
use photoncard_driver::scheduler::GatherOrder;

use self::choice::{choice, switch};
pub(crate) use self::picture::PictureOptions;
use self::threads::threads;
use crate::environment::EnvironmentOption;
use crate::study::StudyArguments;

/// Global illumination by photon mapping on small rendering chips.
#[derive(Parser)]
#[command(version, about, max_term_width = 100)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
}

impl Arguments {
    /// The arguments of the process. Wrong ones end it, and a message that names them has them escaped.
    pub(crate) fn parse_printably() -> Self {
        let given = std::env::args_os();
        Self::try_parse().unwrap_or_else(|error| {
            let escaped = given.map(|argument| printable(&argument.to_string_lossy()).into_owned());
            Self::try_parse_from(escaped).err().unwrap_or(error).exit()
        })
    }
}

#[derive(Subcommand)]
pub(crate) enum Command {
    /// Render a glTF scene to an EXR picture
    Render(Box<RenderOptions>),
    /// Look at a scene
    #[command(subcommand)]
    Scene(SceneCommand),
    /// Look at a card
    #[command(subcommand)]
    Card(CardCommand),
    /// Serve an emulated card to other processes, one host at a time, until interrupted
    Emulate(EmulateOptions),
    /// Compare a picture with a reference
    Diff(DiffOptions),
    /// Measure how memory traffic and time depend on orders, caches, techniques and chips
    Study(StudyArguments),
}

#[derive(Subcommand)]
pub(crate) enum SceneCommand {
    /// Tell what a scene holds, and what of it is ignored
    Info {
        /// A glTF 2.0 file, .gltf or .glb
        scene: PathBuf,
    },
}

#[derive(Subcommand)]
pub(crate) enum CardCommand {
    /// List the serial ports of this machine: path, USB name, serial number, and the address for --card
    List,
    /// Tell what a card can hold
    Info {
        /// The card: emulated, emulated-micro, serial:PATH@BAUD, tcp:HOST:PORT or unix:PATH
        #[arg(long, default_value = "emulated:1")]
        card: CardAddress,
    },
    /// Say hello some times, and tell how long the card takes to answer
    Ping {
        /// The card: emulated, emulated-micro, serial:PATH@BAUD, tcp:HOST:PORT or unix:PATH
        #[arg(long, default_value = "emulated:1")]
        card: CardAddress,
        /// Number of hellos
        #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..))]
        count: u16,
    },
}

#[derive(Args)]
pub(crate) struct EmulateOptions {
    /// Where hosts come: pty, tcp:PORT on this machine alone, tcp:ADDRESS:PORT or unix:PATH; port 0 is any
    #[arg(long, value_name = "ADDRESS")]
    pub(crate) listen: ListenAddress,
    /// The kind of card
    #[arg(long, default_value = "emulated", value_parser = choice::<ChipKind>())]
    pub(crate) card: ChipKind,
}

#[derive(Args)]
pub(crate) struct RenderOptions {
    /// A glTF 2.0 file, .gltf or .glb
    pub(crate) scene: PathBuf,
    /// The picture, an EXR file: linear RGB radiance and the layers of --aov
    #[arg(short, long, value_name = "OUT.exr")]
    pub(crate) output: PathBuf,
    /// Width and height of the picture, pixels
    #[arg(long, value_name = "WxH", default_value = "512x512", value_parser = size, allow_hyphen_values = true)]
    size: (u32, u32),
    /// Render only the columns X0 up to X1 and the rows Y0 up to Y1
    #[arg(long, value_name = "X0,X1,Y0,Y1", value_parser = crop, allow_hyphen_values = true)]
    crop: Option<Window>,
    /// Name of the camera [default: the first of the file]
    #[arg(long)]
    camera: Option<String>,
    /// Change a material: MATERIAL.PROPERTY=VALUE with diffuse, specular, exponent, metallic, roughness or emission; may be repeated
    #[arg(long = "set", value_name = "ASSIGNMENT")]
    pub(crate) assignments: Vec<String>,
    /// Light from infinitely far: an equirectangular map, a Radiance (.hdr) or EXR (.exr) picture whose middle is -z and top is y;
    /// or the same radiance from everywhere
    #[arg(long, value_name = "FILE|R,G,B", allow_hyphen_values = true)]
    pub(crate) environment: Option<EnvironmentOption>,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 0, allow_negative_numbers = true)]
    seed: u32,
    /// Photons stored in the map
    #[arg(long, default_value_t = 500_000, allow_negative_numbers = true)]
    photons: usize,
    /// Layout of the photon map in card memory; it never changes the picture
    #[arg(long, default_value = "lines", value_parser = choice::<PhotonLayout>())]
    photon_map: PhotonLayout,
    /// Photons that a gather looks for
    #[arg(long, default_value_t = 100, allow_negative_numbers = true)]
    neighbors: u32,
    /// Photons of the caustic map: light that has met mirrors and glass alone [default: 200000 if anything in the scene is
    /// perfectly specular]. With 0 gather rays bring that light, with more noise, and that of punctual lights is lost
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    caustic_photons: Option<usize>,
    /// Photons that a gather of caustics looks for, at least 8: fewer are sharper, more are smoother
    /// [default: 50]
    #[arg(long, value_name = "K", allow_negative_numbers = true)]
    caustic_neighbors: Option<u32>,
    /// Greatest distance of a gather in metres, or auto: from the photons' density
    #[arg(long, default_value = "auto", value_parser = max_distance, allow_negative_numbers = true)]
    max_distance: MaxDistance,
    /// Final gather rays a sample
    #[arg(long, default_value_t = 100, allow_negative_numbers = true)]
    gather_rays: u32,
    /// Shadow rays a sample
    #[arg(long, default_value_t = 8, allow_negative_numbers = true)]
    shadow_rays: u32,
    /// Samples a pixel
    #[arg(long, default_value_t = 1, allow_negative_numbers = true)]
    spp: u32,
    /// Side of a tile, pixels [default: 16; 8 with direct, indirect, caustic or gathers in --aov, but on cards of the kind
    /// emulated]
    #[arg(long, allow_negative_numbers = true)]
    tile: Option<u32>,
    /// What the directions of gather rays are chosen by; it never changes what the picture converges to
    #[arg(long, default_value = "combined", value_parser = choice::<Sampling>())]
    sampling: Sampling,
    /// What tells the radiance of a Lambertian surface at the end of a gather ray; one with a Phong lobe is always by density
    #[arg(long, default_value = "density", value_parser = choice::<Radiance>())]
    radiance: Radiance,
    /// Gather the indirect light of Lambertian surfaces at some places and interpolate between them
    #[arg(long, default_value = "off", value_parser = switch(), action = ArgAction::Set)]
    irradiance_cache: bool,
    /// Relative error that interpolated irradiance may have [default: 0.025]
    #[arg(long, value_name = "ERROR", value_parser = ic_error, allow_negative_numbers = true)]
    ic_error: Option<f32>,
    /// Order of the photon gathers; it never changes the picture
    #[arg(long, default_value = "sort", value_parser = choice::<GatherOrder>())]
    order: GatherOrder,
    /// Direction bins of the gather rays, for the orders that have any [default: 99]
    #[arg(long)]
    bins: Option<u32>,
    /// Gathers that may wait on a chip, for the orders that let any [default: as many as it has room for]
    #[arg(long)]
    queue: Option<u32>,
    /// Where to render: emulated:CHIPS, emulated-micro:CHIPS, serial:PATH@BAUD, tcp:HOST:PORT or unix:PATH; may be
    /// repeated [default: a chip a core]
    #[arg(long = "card", value_name = "CARD")]
    cards: Vec<CardAddress>,
    /// Have two cards render a share of the tiles, above 0 and up to 1, and compare them bit for bit; of three cards the odd one lies,
    /// and others render its tiles
    #[arg(long, value_name = "SHARE", allow_negative_numbers = true)]
    verify: Option<f64>,
    /// Go on with a render that was stopped or has failed: the tiles it finished are kept beside the picture, in
    /// OUT.exr.partial, until that is written
    #[arg(long)]
    resume: bool,
    /// Make the links to the cards bad ones, to try how that is repaired: rates a byte as flips=1e-5,drops=1e-6,repeats=1e-6,
    /// delays=1e-4,seed=1
    #[arg(long, value_name = "FAULTS")]
    faults: Option<LineFaults>,
    /// Model the memory of emulated chips, and tell in the statistics what was read of it
    #[arg(long)]
    pub(crate) counters: bool,
    /// Caches of the modelled memory, SIZE/LINE/WAYS each: photon=...,scene=...[,index=hash] or unified=... [default:
    /// photon=128K/128/4,scene=75K/128/4]
    #[arg(long, value_name = "CACHES")]
    cache: Option<CacheSettings>,
    /// Write every read of an emulated chip in Dinero's input format, compressed by gzip; a frame has billions: use --crop
    #[arg(long, value_name = "OUT.din.gz")]
    pub(crate) trace: Option<PathBuf>,
    /// Threads of the host's own work [default: a thread a core]
    #[arg(long, value_parser = threads, allow_negative_numbers = true)]
    pub(crate) threads: Option<usize>,
    #[command(flatten)]
    pub(crate) picture: PictureOptions,
    /// Write what the render took, as JSON
    #[arg(long, value_name = "OUT.json")]
    pub(crate) stats: Option<PathBuf>,
    /// Show no progress
    #[arg(long)]
    pub(crate) quiet: bool,
}

#[derive(Args)]
pub(crate) struct DiffOptions {
    /// The picture taken as right
    pub(crate) reference: PathBuf,
    /// The picture to compare
    pub(crate) image: PathBuf,
    /// Side of the blocks whose means are compared, pixels
    #[arg(long, default_value_t = 16, allow_negative_numbers = true)]
    pub(crate) block: usize,
    /// Leave out blocks in which the reference exceeds this radiance: those that see an emitter
    #[arg(long, value_name = "RADIANCE", allow_negative_numbers = true)]
    pub(crate) exclude_above: Option<f32>,
}

#[derive(Clone, Copy)]
enum MaxDistance {
    Auto,
    Metres(f32),
}

impl RenderOptions {
    /// The settings that the options stand for; a text that says why not.
    pub(crate) fn settings(&self) -> Result<RenderSettings, String> {
        let emulated = || "emulated".parse();
        let cards = if self.cards.is_empty() { vec![emulated()?] } else { self.cards.clone() };
        Ok(RenderSettings {
            width: self.size.0,
            height: self.size.1,
            crop: self.crop,
            camera: self.camera.clone(),
            seed: self.seed,
            photons: self.photons,
            photon_layout: self.photon_map,
            neighbors: self.neighbors,
            caustic_photons: self.caustic_photons,
            caustic_neighbors: self.caustic_neighbors.unwrap_or(DEFAULT_CAUSTIC_NEIGHBORS),
            max_distance: match self.max_distance {
                MaxDistance::Auto => None,
                MaxDistance::Metres(distance) => Some(distance),
            },
            gather_rays: self.gather_rays,
            shadow_rays: self.shadow_rays,
            samples: self.spp,
            tile: self.tile.unwrap_or_else(|| RenderSettings::default_tile(&self.picture.aov, &cards)),
            layers: self.picture.aov.clone(),
            sampling: self.sampling,
            radiance: self.radiance,
            irradiance_error: (self.irradiance_cache && self.gather_rays > 0)
                .then_some(self.ic_error.unwrap_or(DEFAULT_IC_ERROR)),
            order: self.order,
            bins: self.bins,
            queue: self.queue,
            cards,
            faults: self.faults,
            verify: self.verify,
            partial: Some(PartialSettings { path: self.partial_path(), resume: self.resume }),
            caches: self.cache.or_else(|| self.counters.then(CacheSettings::default)),
            trace: self.trace.clone(),
            display: self.picture.display(&self.output),
        })
    }

    /// Where finished tiles are kept until the picture is written.
    pub(crate) fn partial_path(&self) -> PathBuf {
        let mut name = self.output.clone().into_os_string();
        name.push(".partial");
        name.into()
    }
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let sides =
        text.split_once('x').and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    match sides {
        Some((width, height)) if width > 0 && height > 0 => Ok((width, height)),
        _ => Err("a size is WIDTHxHEIGHT, both at least 1, such as 512x512".into()),
    }
}

fn crop(text: &str) -> Result<Window, String> {
    let ends: Result<Vec<u32>, _> = text.split(',').map(str::parse).collect();
    match ends.as_deref() {
        Ok(&[x0, x1, y0, y1]) => Ok(Window { x0, x1, y0, y1 }),
        _ => Err("a crop is X0,X1,Y0,Y1: four whole numbers, such as 0,64,0,64".into()),
    }
}

/// Photons that a gather of caustics looks for, unless others are asked for.
const DEFAULT_CAUSTIC_NEIGHBORS: u32 = 50;

/// Relative error of interpolated irradiance, unless another is asked for.
const DEFAULT_IC_ERROR: f32 = 0.025;

fn ic_error(text: &str) -> Result<f32, String> {
    match text.parse() {
        Ok(error) if (MIN_IRRADIANCE_ERROR..=1.0).contains(&error) => Ok(error),
        _ => {
            Err(format!("an error is a share of the irradiance, {MIN_IRRADIANCE_ERROR} to 1, such as 0.025"))
        }
    }
}

fn max_distance(text: &str) -> Result<MaxDistance, String> {
    match text.parse() {
        _ if text == "auto" => Ok(MaxDistance::Auto),
        Ok(distance) if f32::is_finite(distance) && distance > 0.0 => Ok(MaxDistance::Metres(distance)),
        _ => Err("a greatest distance is a positive number of metres, or auto".into()),
    }
}
