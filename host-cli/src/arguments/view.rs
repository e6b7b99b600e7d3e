//! Options of `photoncard view`.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;

use clap::Args;
use photoncard_driver::choice::Choice;
use photoncard_driver::quality::{Finish, Quality, Stated};
use photoncard_driver::render::RenderSettings;

use super::cards::CardOptions;
use super::choice::choice;
use super::host::HostOptions;
use super::integrator::IntegratorOptions;
use super::photons::PhotonOptions;
use super::picture::PictureOptions;
use super::scene::SceneOptions;
use super::schedule::ScheduleOptions;

#[derive(Args)]
#[command(
    mut_arg("quiet", |option| option.help("Print nothing but the page's address")),
    mut_arg("progress", |option| option.help("Form in which notices and a failure are reported"))
)]
pub(crate) struct ViewOptions {
    #[command(flatten)]
    pub(crate) scene: SceneOptions,
    /// Address of the page, by default one that only this machine reaches; port 0 is any free port
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8080", value_parser = listen, help_heading = "Page")]
    pub(crate) listen: SocketAddr,
    /// Open the page in the browser of this machine
    #[arg(long, help_heading = "Page")]
    pub(crate) open: bool,
    /// End the view when its standard input ends, such as that of a program that has started it
    #[arg(long, help_heading = "Page", hide_short_help = true)]
    pub(crate) attached: bool,
    /// Let browsers lend their cores as cards: the command prints a second address, of a page that does so in
    /// any browser that reaches this machine (--listen)
    #[arg(long, help_heading = "Page")]
    pub(crate) browser_cards: bool,
    /// WebAssembly module of the cards of browsers, by host-cli/module.sh [default: that of the program's
    /// package]
    #[arg(
        long,
        value_name = "FILE",
        requires = "browser_cards",
        help_heading = "Page",
        hide_short_help = true
    )]
    pub(crate) module: Option<PathBuf>,
    /// Folder in which the page may save pictures; without this option it downloads them
    #[arg(long, value_name = "DIR", help_heading = "Page")]
    pub(crate) out: Option<PathBuf>,
    /// Quality of the settled picture, the final one of each camera position, by which the options that are
    /// not stated are chosen
    #[arg(long, default_value = Quality::default().name(), value_parser = choice::<Quality>())]
    pub(crate) quality: Quality,
    /// Denoise the settled picture by Open Image Denoise, as photoncard render --denoise does
    ///
    /// With this option --quality chooses fewer samples and rays, and no irradiance cache.
    #[arg(long)]
    pub(crate) denoise: bool,
    #[command(flatten)]
    pub(crate) picture: PictureOptions,
    #[command(flatten)]
    photons: PhotonOptions,
    #[command(flatten)]
    integrator: IntegratorOptions,
    #[command(flatten)]
    schedule: ScheduleOptions,
    #[command(flatten)]
    pub(crate) cards: CardOptions,
    #[command(flatten)]
    pub(crate) host: HostOptions,
}

impl ViewOptions {
    /// Returns which settings the options state, among those that `--quality` would choose.
    pub(crate) fn stated(&self) -> Stated {
        self.photons.stated(self.integrator.stated())
    }

    /// Returns whether the final picture is denoised.
    pub(crate) fn finish(&self) -> Finish {
        Finish::new(self.denoise)
    }

    /// Returns the settings that these options state. Settings that are not stated are the defaults of
    /// `--quality`; a pilot render may change these later.
    pub(crate) fn settings(&self) -> RenderSettings {
        let base = self.quality.settings_for(self.finish());
        let mut picture = self.picture.settings(&base.picture);
        // Pages show the layers of one frame.
        picture.layers = picture.layers.of_one_frame();
        RenderSettings {
            picture,
            photons: self.photons.settings(&base.photons),
            integrator: self.integrator.settings(&base.integrator),
            schedule: self.schedule.settings(),
            cards: self.cards.settings(),
            ..RenderSettings::default()
        }
    }
}

/// Parses the address of the page: an IP address or `localhost`, and a port. Other host names are errors,
/// because their look-up may take long.
fn listen(text: &str) -> Result<SocketAddr, String> {
    let local = || Some((Ipv4Addr::LOCALHOST, text.strip_prefix("localhost:")?.parse().ok()?).into());
    let address = text.parse().ok().or_else(local);
    address.ok_or_else(|| {
        "the address is an IP address of this machine, or localhost, and a port, such as 127.0.0.1:8080"
            .into()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_address_of_a_page_is_an_ip_address_or_localhost() {
        for text in ["127.0.0.1:8080", "localhost:8080"] {
            assert_eq!(listen(text), Ok(([127, 0, 0, 1], 8080).into()));
        }
        for text in ["localhost", "localhost:65536", "example.org:80", "8080", ""] {
            assert!(listen(text).unwrap_err().contains("localhost"), "{text}");
        }
    }
}
