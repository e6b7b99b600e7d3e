//! The claims of Steinhurst's dissertation (2007) and its papers, compared with the key figures of studies.

mod claim;
mod claims;

use self::claim::Evidence;
pub use self::claim::Measured;
use self::claims::{CLAIMS, SYMBOLS};

const HEAD: &str = "\
# The dissertation, claim by claim

For those who know Joshua Steinhurst's *Practical Photon Mapping in Hardware* (University of North Carolina at Chapel Hill, 2007): what of it is found here.
`photoncard study all --out DIR` writes this page, `DIR/dissertation.md`, from the key figures of its studies (`figures.csv`). The figures here are those of
[`studies.csv`](studies.csv); [studies.md](studies.md) says how they are measured. A test compares both.

The claims are those of public excerpts (end of chapter 6, section 7.1 with Table 7.1), of other quotations, and of the abstracts of the papers on reordering
(*GI*: Graphics Interface 2005; *TVCG* 2008) and on importance sampling (*IS* 2006). The rest of the dissertation was not at hand. Rows *beyond* are of
techniques that it does not have.

- *reproduced*: the figure here, with its whole 95 % confidence interval, meets the condition in brackets. *as built*: the named file shows an input or a
  property of the design.
- *contradicted, because*: neither the figure nor any value of its interval meets it.
- *open*: the interval contains values of both kinds.
- *modelled only*: a model says so, and no hardware was measured.
- *not covered*: nothing here says anything about it.

A condition is the published value, with 25 % to either side where a value is given and no bound. Intervals are of sampled tiles, and at equal quality of the
tiles that are compared. Figures without an interval are of whole frames. Pictures, scenes and caches are not the dissertation's: its Sponza atrium,
modified Cornell box and associativity are not known. GB of rows *GI* and of figure 6.17 are bytes of the photon map from DRAM in a frame;
all others have the scene, and what waits in card memory, too.
";

/// Paths of the files that the page names as evidence, from the project's root.
pub fn files() -> impl Iterator<Item = &'static str> {
    CLAIMS.iter().chain(SYMBOLS).filter_map(|claim| match claim.evidence {
        Evidence::Built { file, .. } => Some(file),
        _ => None,
    })
}

/// Page in Markdown with a row for each claim and for each symbol of Table 7.1. `figures` returns a key
/// figure by its name and scene.
pub fn page(figures: &dyn Fn(&str, &str) -> Option<Measured>) -> String {
    let mut page = HEAD.to_owned();
    for (heading, claims) in [("Claims", CLAIMS), ("Table 7.1", SYMBOLS)] {
        page +=
            &format!("\n## {heading}\n\n| place | claim | there | here | verdict |\n|---|---|---|---|---|\n");
        for claim in claims {
            let (here, verdict) = (claim.evidence.here(figures), claim.evidence.verdict(figures));
            page += &format!(
                "| {} | {} | {} | {here} | {verdict} |\n",
                claim.place, claim.claim, claim.published
            );
        }
    }
    page
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each claim has a row of five cells, whatever is measured.
    #[test]
    fn a_page_has_a_row_for_each_claim() {
        let measured = |_: &str, _: &str| Some(Measured { value: 1.0, interval: Some([0.5, 1.5]) });
        for page in [page(&measured), page(&|_, _| None)] {
            let rows: Vec<_> = page.lines().filter(|line| line.starts_with("| ")).collect();
            assert_eq!(rows.len(), CLAIMS.len() + SYMBOLS.len() + 2);
            assert!(rows.iter().all(|row| row.matches('|').count() == 6), "{page}");
        }
    }

    #[test]
    fn every_symbol_of_the_table_has_a_row() {
        let rows: Vec<_> = SYMBOLS.iter().map(|claim| claim.place).collect();
        for symbol in [
            "P",
            "T",
            "F",
            "N_FG",
            "k",
            "N_S",
            "C_J",
            "N_PM",
            "R_IC",
            "R_FG",
            "L_IC",
            "C_B1, C_B2",
            "C_RayCast",
            "C_G",
            "S_B",
        ] {
            assert!(rows.contains(&symbol), "{symbol}");
        }
        for claim in CLAIMS.iter().chain(SYMBOLS) {
            let reason = match &claim.evidence {
                Evidence::Measured { otherwise, .. } => otherwise,
                Evidence::Modelled { model, .. } => model,
                Evidence::Built { shown, .. } => shown,
                Evidence::None(reason) => reason,
            };
            assert!(!reason.is_empty(), "{}: {}", claim.place, claim.claim);
        }
    }
}
