//! Index page that links the reports of several studies.

use std::path::Path;

use photoncard_picture::choice::Choice;

use super::error::StudyError;
use super::report::{self, Block, Provenance, Report, Section};
use super::studies::Study;

/// Writes the index page `index.html` into `folder`. Each study's report is in a subfolder with the study's
/// name.
pub(super) fn write(
    folder: &Path,
    banner: Option<String>,
    reports: &[(Study, Report)],
    provenance: &Provenance,
) -> Result<(), StudyError> {
    let sections = reports.iter().map(|(study, report)| {
        let summary = report.introduction.first().cloned().unwrap_or_default();
        let link =
            Block::Link { text: "The report".to_owned(), target: format!("{}/index.html", study.name()) };
        Section { heading: report.title.clone(), blocks: vec![Block::Paragraph(summary), link] }
    });
    let index = Report {
        title: "Studies of photon mapping on rendering chips".to_owned(),
        banner,
        introduction: vec![
            "Each study renders the same scenes with one thing changed, on emulated chips whose memory is modelled line by \
             line, and reports what was counted. Every table is a CSV file and every plot an SVG file beside its report."
                .to_owned(),
        ],
        sections: sections.collect(),
        provenance: provenance.clone(),
        figures: Vec::new(),
    };
    Ok(report::write(folder, &index)?)
}
