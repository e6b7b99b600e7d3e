//! Key figures of a run: its provenance, the figures of its studies, and a small measurement that a reader
//! can repeat.

use std::path::Path;

use photoncard_cards::scheduler::GatherOrder;
use photoncard_picture::choice::Choice;
use photoncard_picture::output;
use photoncard_render::PROGRAM;
use photoncard_shared::image::LAYOUT_VERSION;

use super::dissertation;
use super::error::StudyError;
use super::laboratory::Laboratory;
use super::point::Point;
use super::report::{Cell, FIGURES, Figure, NOT_REACHED, ReportError, figures_csv, slug};
use super::scale::Scale;

/// Scene of [`check`].
const SCENE: &str = "cornell.gltf";
/// Scale of [`check`]. At this scale the check takes about a second.
const SCALE: Scale = Scale { side: 64, photons: 20_000, gather_rays: 25, ..Scale::QUICK };

/// Orders of the measurements of [`check`].
const ORDERS: [GatherOrder; 2] = [GatherOrder::Naive, GatherOrder::Sort];
/// Name of the measurements of [`check`].
pub(super) const CHECK: &str = "check";

/// Points of [`check`].
pub(super) fn check_points() -> [Point; 2] {
    ORDERS.map(|order| SCALE.whole(SCENE, SCALE.settings(order)))
}

/// Measures figures that identify the program: the versions of program and card image layout, and the exact
/// number of bytes that two small renders fetch from DRAM. If these figures differ between two files,
/// different versions of the program made the files.
///
/// # Errors
/// If the scene is missing, or a point cannot be measured or stored.
pub fn check(laboratory: &mut Laboratory) -> Result<Vec<Figure>, StudyError> {
    let points = check_points();
    let results = laboratory.measure(CHECK, &points)?;
    let mut figures = vec![
        Figure::new("program", "", PROGRAM, ""),
        Figure::new("card-image-layout", "", LAYOUT_VERSION, ""),
    ];
    for (order, point) in ORDERS.iter().zip(&points) {
        let bytes = |of: fn(&_) -> _| results.traffic(point).tiles.iter().map(of).sum::<u64>();
        let both = [
            ("photon-map", bytes(|tile: &super::TileMeasurement| tile.photon_map().dram_bytes)),
            ("scene", bytes(|tile: &super::TileMeasurement| tile.scene().dram_bytes)),
        ];
        let name = |part: &str| format!("check.bytes.{part}.{}", order.name());
        figures.extend(both.map(|(part, bytes)| Figure::new(name(part), "cornell", bytes, "bytes")));
    }
    Ok(figures)
}

/// Writes `figures.csv` into `folder`. It contains the figures `check`, which the function [`check`]
/// measured, the settings that all points share, and the figures of the studies. If the scale is not nominal,
/// the figure `trial` states this.
///
/// # Errors
/// If the file cannot be written.
pub(super) fn write(
    folder: &Path,
    scale: &Scale,
    check: Vec<Figure>,
    studies: impl IntoIterator<Item = Figure>,
) -> Result<(), StudyError> {
    let mut figures = check;
    figures.extend(scale.banner().map(|banner| Figure::new("trial", "", banner, "")));
    let settings = scale.rows().into_iter();
    figures
        .extend(settings.map(|(name, value)| Figure::new(format!("setting.{}", slug(&name)), "", value, "")));
    figures.extend(studies);
    let csv = figures_csv(&figures);
    output::write(&folder.join(FIGURES), csv.as_bytes()).map_err(ReportError::from)?;
    Ok(())
}

/// Number of a figure; NaN for a quality that is not reached.
fn measured_number(value: &Cell) -> Option<f64> {
    match value {
        Cell::Integer(value) => Some(*value as f64),
        Cell::Real { value, .. } => Some(*value),
        Cell::Text(text) if text == NOT_REACHED => Some(f64::NAN),
        Cell::Empty | Cell::Text(_) => None,
    }
}

/// Writes the claims of the dissertation, compared with `figures`, as `dissertation.md` into `folder`.
///
/// # Errors
/// If the file cannot be written.
pub(super) fn write_claims(folder: &Path, figures: &[Figure]) -> Result<(), StudyError> {
    let measured = |name: &str, scene: &str| {
        let figure = figures.iter().find(|figure| figure.name == name && figure.scene == scene)?;
        Some(dissertation::Measured { value: measured_number(&figure.value)?, interval: figure.interval })
    };
    let page = dissertation::page(&measured);
    Ok(output::write(&folder.join("dissertation.md"), page.as_bytes()).map_err(ReportError::from)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_states_its_provenance_and_whether_it_is_a_trial() {
        let folder = tempfile::tempdir().unwrap();
        let figures_of = |scale: &Scale| {
            let check = vec![Figure::new("program", "", PROGRAM, "")];
            write(folder.path(), scale, check, [Figure::new("a", "atrium", 2.0, "GB")]).unwrap();
            std::fs::read_to_string(folder.path().join(FIGURES)).unwrap()
        };
        let full = figures_of(&Scale::FULL);
        assert!(full.contains(&format!("program,,{PROGRAM},,,")) && full.ends_with("a,atrium,2,GB,,\r\n"));
        assert!(full.contains("setting.photons,,500000,,,") && !full.contains("trial"));
        assert!(figures_of(&Scale::QUICK).contains("trial,,"));
    }
}
