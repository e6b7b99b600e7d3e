//! `photoncard prepare`.

use std::sync::OnceLock;

use photoncard_driver::choice::Choice;
use photoncard_driver::pack::PackedScene;
use photoncard_driver::quality::Stated;
use photoncard_driver::render::{Phase, PreparedScene};
use photoncard_driver::scene::FixedScene;
use serde_json::{Map, Value, json};

use super::messages;
use super::steps::{assigned, on_threads};
use crate::arguments::PrepareOptions;
use crate::console::say;
use crate::failure::Failure;
use crate::progress::Progress;
use crate::{input, outputs};

/// Prepares a scene, and writes it.
pub(crate) fn run(options: &PrepareOptions) -> Result<(), Failure> {
    outputs::check(&input::files(&options.scene), &[&options.output], &[])?;
    let mut settings = options.settings();
    let budget = options.card.budget();
    let scene = assigned(&options.scene, input::load(&options.scene, budget.dram_bytes)?)?;
    let camera = settings.camera(&scene)?;
    options.picture.fit(&camera, &mut settings.picture);
    let progress = Progress::start(options.quiet, 1)
        .map_err(|error| Failure::work_error(&error))?
        .in_form(options.progress, Phase::Photons);
    let said = OnceLock::new();
    let choose = |packed: &PackedScene| {
        let stated = options.stated();
        let fit = if stated == Stated::ALL {
            None
        } else {
            options.quality.fit(&scene, packed, &settings, &progress)?
        };
        let chosen = settings.clone().with(|settings| {
            if let Some(fit) = &fit {
                fit.apply(settings, stated);
            }
        });
        let by = messages::by_quality(options.quality);
        let _ = said.set(format!("{by}: {}", messages::chosen(&chosen, false)));
        Ok((chosen.photons, chosen.integrator))
    };
    let fixed = FixedScene::from(&scene);
    let prepared = on_threads(options.threads, || {
        PreparedScene::new(&fixed, &settings, &[budget], &choose, notes(options), &progress)
    })?;
    progress.finish();
    let prepared = prepared?;
    prepared.write(&options.output).map_err(Failure::work)?;
    if !options.quiet {
        said.into_inner().iter().for_each(|chosen| say(format_args!("photoncard: {chosen}")));
        let (path, bytes) = (options.output.display(), prepared.image_bytes());
        say(format_args!("photoncard: {path}: a card image of {bytes} bytes"));
    }
    Ok(())
}

/// Notes for renders: the quality, and the inputs by their names.
fn notes(options: &PrepareOptions) -> Map<String, Value> {
    let notes = [
        ("quality", json!(options.quality.name())),
        ("inputs", Value::Object(input::provenance(&options.scene))),
    ];
    notes.map(|(name, value)| (name.to_owned(), value)).into_iter().collect()
}
