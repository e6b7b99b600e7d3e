//! Arguments of `photoncard study sweep`.

use clap::Args;
use photoncard_driver::choice::Choice;
use photoncard_driver::emulator::Emulated;
use photoncard_driver::emulator::memory_model::CacheSettings;
use photoncard_driver::quality::Quality;
use photoncard_driver::render::{ChipModel, RenderSettings, Sampling};
use photoncard_driver::study::{ALONG_CURVE, Axis, Hardware, MAX_POINTS, Point, Scale, Task};

use super::cards::ChipOption;
use super::choice::choice;
use super::integrator::IntegratorOptions;
use super::machine::RateOptions;
use super::photons::PhotonOptions;
use super::picture::PictureOptions;
use super::scene::SceneOptions;
use super::schedule::ScheduleOptions;
use super::study_output::StudyOutput;

#[derive(Args)]
pub(crate) struct SweepArguments {
    #[command(flatten)]
    pub(crate) scene: SceneOptions,
    #[arg(
        long,
        value_name = "OPTION=VALUE,VALUE",
        value_parser = axis,
        help = format!(
            "Vary an option over values; may be repeated: every combination is measured, up to {MAX_POINTS}. Values with commas are \
             separated by semicolons. chip.NAME varies a capacity of the chip, such as chip.irradiance_records=256,512. A cache may be \
             a SIZE or SIZE/LINE/WAYS of the photon map's. order={ALONG_CURVE} does all gathers of \
             a frame along a Hilbert curve, which no chip has room for: the bound of all orders"
        )
    )]
    pub(crate) vary: Vec<Axis>,
    /// Count distances between reads of a cache line, and compulsory, capacity and conflict misses, by
    /// structure: reuse.csv and reuse-distances.csv. It takes time
    #[arg(long)]
    reuse: bool,
    #[command(flatten)]
    pub(crate) output: StudyOutput,
    #[command(flatten)]
    settings: SweepSettings,
}

/// Options that can be varied.
#[derive(Args)]
struct SweepSettings {
    /// Quality of the picture, by which the options that are not stated are chosen
    #[arg(long, default_value = Quality::Paper.name(), value_parser = choice::<Quality>())]
    quality: Quality,
    #[command(flatten)]
    picture: PictureOptions,
    #[command(flatten)]
    photons: PhotonOptions,
    #[command(flatten)]
    integrator: IntegratorOptions,
    #[command(flatten)]
    schedule: ScheduleOptions,
    #[command(flatten)]
    card: ChipOption,
    /// Caches of the memory model, written as for photoncard render --cache; state the option several times
    /// to compare caches [default: those of the chip, such as photon=128K/128/4,scene=75K/128/4]
    #[arg(long = "cache", value_name = "CACHES", help_heading = "Cards")]
    caches: Vec<CacheSettings>,
    #[command(flatten)]
    machine: RateOptions,
}

/// Begin of the names of capacities in `--vary`.
pub(crate) const CHIP: &str = "chip.";

/// Name of the option `--cache` in `--vary`.
pub(crate) const CACHE: &str = "cache";

impl SweepArguments {
    /// Options that the sweep varies: those of `--vary`, and the caches if `--cache` is stated several times.
    pub(crate) fn axes(&self) -> Vec<Axis> {
        let caches = &self.settings.caches;
        let several = (caches.len() > 1).then(|| Axis {
            name: CACHE.to_owned(),
            values: caches.iter().map(ToString::to_string).collect(),
        });
        self.vary.iter().cloned().chain(several).collect()
    }

    /// Model of the chips.
    pub(crate) fn model(&self) -> &ChipModel {
        &self.settings.card.model
    }

    /// Hardware of chips of a model, with the rates that these options state.
    pub(crate) fn hardware(&self, model: &ChipModel) -> Hardware {
        Hardware::new(model, self.settings.machine.rates().or(model.rates()).machine())
    }

    /// Point (measurement) that the sweep varies: it has the settings of these options and the first of the
    /// stated caches. `name` is the name of the scene.
    pub(crate) fn point(&self, name: &str, model: &ChipModel) -> Point {
        let SweepSettings { quality, picture, photons, integrator, schedule, caches, card: _, machine: _ } =
            &self.settings;
        let base = quality.settings().with(|s| {
            (s.integrator.near_distance, s.integrator.sampling) = (Some(0.0), Sampling::Product);
        });
        let settings = RenderSettings {
            picture: picture.settings(&base.picture),
            photons: photons.settings(&base.photons),
            integrator: integrator.settings(&base.integrator),
            schedule: schedule.settings(),
            ..base
        };
        // With one tile in flight, the traffic of each tile is counted by itself.
        let settings = settings.with(|s| s.schedule.in_flight = s.schedule.in_flight.or(Some(1)));
        let task = Task::Traffic {
            chip: model.kind(),
            caches: caches.first().copied().unwrap_or_else(|| model.caches()),
            sample: self.output.sample,
            least_tiles: Scale::FULL.least_tiles,
            has_reuse: self.reuse,
        };
        let (scene, assignments) = (name.to_owned(), self.scene.assignments.clone());
        Point { scene, assignments, settings, is_along_curve: false, task }
    }

    pub(crate) fn picture(&self) -> &PictureOptions {
        &self.settings.picture
    }
}

fn axis(text: &str) -> Result<Axis, String> {
    let form = "write OPTION=VALUE,VALUE, such as order=naive,sort";
    let (name, values) = text.split_once('=').ok_or_else(|| form.to_owned())?;
    let options = SweepSettings::augment_args(clap::Command::new("sweep"));
    let mut names: Vec<_> = options.get_arguments().filter_map(|option| option.get_long()).collect();
    names.push("set");
    let capacities: Vec<_> = Emulated::capacities().map(|capacity| format!("{CHIP}{capacity}")).collect();
    names.extend(capacities.iter().map(String::as_str));
    if !names.contains(&name) {
        return Err(format!("{name:?} is none of the options that can be varied: {}", names.join(", ")));
    }
    let separator = if values.contains(';') { ';' } else { ',' };
    let values: Vec<_> = values.split(separator).map(|value| value.trim().to_owned()).collect();
    if values.iter().any(String::is_empty) {
        return Err(format!("a value is empty; {form}"));
    }
    if name == CACHE && separator == ',' {
        check_parts(&values)?;
    }
    Ok(Axis { name: name.to_owned(), values })
}

/// Checks that no value of `--vary cache=` is a piece of a cache setting that was cut at its commas.
fn check_parts(values: &[String]) -> Result<(), String> {
    let part = |value: &String| value.split_once('=').map(|(part, _)| part.to_owned());
    let parts: Vec<_> = values.iter().map(part).collect();
    if parts.iter().all(|part| *part == parts[0]) {
        return Ok(());
    }
    Err(format!(
        "{} are parts of one cache, or several caches; separate caches by semicolons, such as \
         cache=photon=64K/128/4,scene=75K/128/4;photon=128K/128/4, and give one alone by --cache",
        values.join(" and ")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_cache_are_refused_as_values() {
        for (text, count) in [
            ("cache=64K,128K", 2),
            ("cache=photon=64K/128/4,photon=128K/128/4", 2),
            ("cache=photon=64K/128/4,scene=75K/128/4;unified=256K/128/8", 2),
            ("order=naive,sort,hash", 3),
        ] {
            assert_eq!(axis(text).map(|axis| axis.values.len()), Ok(count), "{text}");
        }
        for text in [
            "cache=photon=64K/128/4,scene=75K/128/4",
            "cache=photon=64K/128/4,index=hash",
            "cache=64K,scene=75K/128/4",
        ] {
            let said = axis(text).unwrap_err();
            assert!(said.contains("separate caches by semicolons") && said.contains("--cache"), "{said}");
        }
    }
}
