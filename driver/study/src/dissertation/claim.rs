//! A claim of the dissertation, the evidence for it, and its verdict.

use super::super::report::{NOT_REACHED, human};

/// Value of a key figure, with the ends of its 95 % confidence interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Value in the figure's unit; NaN for [`NOT_REACHED`].
    pub value: f64,
    /// Ends of the interval; `None` for a figure without one.
    pub interval: Option<[f64; 2]>,
}

/// A claim, and where it is made.
pub(super) struct Claim {
    /// Chapter, section, table or figure of the dissertation, or a paper.
    pub(super) place: &'static str,
    pub(super) claim: &'static str,
    /// Value that the source states.
    pub(super) published: &'static str,
    pub(super) evidence: Evidence,
}

/// Evidence for a claim.
pub(super) enum Evidence {
    /// Measured figures that must satisfy a condition. `otherwise` says why one does not.
    Measured { figures: &'static [FigureOf], scope: Scope, holds: Condition, otherwise: &'static str },
    /// Figures of a model, for which no hardware exists.
    Modelled { figures: &'static [FigureOf], model: &'static str },
    /// An input or a property of the design, which the named file shows.
    Built { shown: &'static str, file: &'static str },
    /// Reason why nothing was measured.
    None(&'static str),
}

/// Figures that must meet a condition.
#[derive(Clone, Copy)]
pub(super) enum Scope {
    All,
    /// The one with the best verdict.
    Best,
}

/// A key figure.
pub(super) struct FigureOf {
    /// Name in the text, such as that of the scene.
    pub(super) label: &'static str,
    pub(super) name: &'static str,
    pub(super) scene: &'static str,
    /// Factor from the figure's unit to `unit`.
    pub(super) factor: f64,
    pub(super) unit: &'static str,
}

/// Condition for a figure.
#[derive(Clone, Copy)]
pub(super) enum Condition {
    AtLeast(f64),
    AtMost(f64),
    Between(f64, f64),
}

/// Result of comparing a claim with the evidence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Verdict {
    Reproduced,
    /// The confidence interval contains values for and against the claim.
    Open,
    Contradicted,
}

impl Condition {
    /// Verdict on a figure. One that is not reached meets no condition.
    fn verdict(self, measured: Measured) -> Verdict {
        let [lower, upper] = measured.interval.unwrap_or([measured.value; 2]);
        let holds = match self {
            Self::AtLeast(least) => [lower >= least, upper >= least],
            Self::AtMost(most) => [lower <= most, upper <= most],
            Self::Between(least, most) => [lower >= least && upper <= most, lower <= most && upper >= least],
        };
        match holds {
            [true, true] => Verdict::Reproduced,
            [false, false] => Verdict::Contradicted,
            _ => Verdict::Open,
        }
    }

    /// Text of the condition, in the unit of `figure`.
    fn text(self, figure: &FigureOf) -> String {
        let number = |value: f64| {
            let unit = if figure.unit.is_empty() { String::new() } else { format!(" {}", figure.unit) };
            format!("{}{unit}", human(value * figure.factor, 3))
        };
        match self {
            Self::AtLeast(least) => format!("at least {}", number(least)),
            Self::AtMost(most) => format!("at most {}", number(most)),
            Self::Between(least, most) => format!("{} to {}", human(least * figure.factor, 3), number(most)),
        }
    }
}

impl FigureOf {
    fn text(&self, measured: Measured) -> String {
        if measured.value.is_nan() {
            return format!("{} {NOT_REACHED}", self.label).trim_start().to_owned();
        }
        let number = |value: f64| human(value * self.factor, 3);
        let interval = match measured.interval {
            Some([lower, upper]) if lower < upper => format!(" ({} to {})", number(lower), number(upper)),
            _ => String::new(),
        };
        let value = format!("{}{interval}", number(measured.value));
        let words = [self.label, &value, self.unit];
        words.into_iter().filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ")
    }
}

/// Function that returns a key figure by its name and scene.
pub(super) type Figures<'a> = &'a dyn Fn(&str, &str) -> Option<Measured>;

impl Evidence {
    /// Value found here, as text.
    pub(super) fn here(&self, figures: Figures) -> String {
        let list = |of: &[FigureOf]| {
            let text = |figure: &FigureOf| {
                figures(figure.name, figure.scene).map_or_else(
                    || format!("{} not measured", figure.label).trim_start().to_owned(),
                    |measured| figure.text(measured),
                )
            };
            of.iter().map(text).collect::<Vec<_>>().join("; ")
        };
        match self {
            Self::Measured { figures: of, holds, .. } => {
                let condition = of.first().map_or_else(String::new, |figure| holds.text(figure));
                format!("{} [{condition}]", list(of))
            }
            Self::Modelled { figures: of, model } => match list(of) {
                none if none.is_empty() => (*model).to_owned(),
                some => format!("{some}: {model}"),
            },
            Self::Built { shown, file } => format!("{shown} (`{file}`)"),
            Self::None(_) => String::new(),
        }
    }

    /// Verdict, as text.
    pub(super) fn verdict(&self, figures: Figures) -> String {
        match self {
            Self::Measured { figures: of, scope, holds, otherwise } => {
                let verdict = |figure: &FigureOf| {
                    let verdict = figures(figure.name, figure.scene).map(|value| holds.verdict(value));
                    (figure.label, verdict)
                };
                let verdicts: Vec<_> = of.iter().map(verdict).collect();
                let best = verdicts
                    .iter()
                    .filter(|(_, verdict)| verdict.is_some())
                    .min_by_key(|(_, verdict)| *verdict);
                match (scope, best) {
                    (Scope::Best, Some(best)) => summary(&[*best], otherwise),
                    _ => summary(&verdicts, otherwise),
                }
            }
            Self::Modelled { .. } => "*modelled only*".to_owned(),
            Self::Built { .. } => "*reproduced*, as built".to_owned(),
            Self::None(reason) => format!("*not covered*: {reason}"),
        }
    }
}

/// Text of the verdicts on the labelled figures of a claim; `None` for a figure that was not measured.
fn summary(verdicts: &[(&str, Option<Verdict>)], otherwise: &str) -> String {
    let word = |verdict| match verdict {
        Some(Verdict::Reproduced) => "*reproduced*",
        Some(Verdict::Open) => "*open*, as the interval contains both",
        Some(Verdict::Contradicted) => "*contradicted*",
        None => "*not covered*, as it was not measured",
    };
    let mut kinds: Vec<_> = verdicts.iter().map(|(_, verdict)| *verdict).collect();
    kinds.sort_unstable_by_key(|kind| kind.map_or(u8::MAX, |kind| kind as u8));
    kinds.dedup();
    let parts: Vec<_> = kinds
        .iter()
        .map(|kind| {
            let labels = verdicts.iter().filter(|(_, verdict)| verdict == kind).map(|(label, _)| *label);
            let because = if *kind == Some(Verdict::Contradicted) {
                format!(", because {otherwise}")
            } else {
                String::new()
            };
            match kinds.len() {
                1 => format!("{}{because}", word(*kind)),
                _ => format!("{}: {}{because}", labels.collect::<Vec<_>>().join(", "), word(*kind)),
            }
        })
        .collect();
    parts.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    const IN_MEGABYTES: FigureOf = FigureOf { label: "box", name: "a", scene: "s", factor: 1e3, unit: "MB" };

    #[test]
    fn a_verdict_needs_the_whole_interval() {
        let at = |lower: f64, upper: f64| Measured {
            value: (lower + upper) / 2.0,
            interval: Some([lower, upper]),
        };
        for (condition, lower, upper, verdict) in [
            (Condition::AtLeast(2.0), 2.0, 3.0, Verdict::Reproduced),
            (Condition::AtLeast(2.0), 1.9, 3.0, Verdict::Open),
            (Condition::AtLeast(2.0), 1.0, 1.9, Verdict::Contradicted),
            (Condition::AtMost(2.0), 1.0, 2.0, Verdict::Reproduced),
            (Condition::AtMost(2.0), 1.0, 2.1, Verdict::Open),
            (Condition::AtMost(2.0), 2.1, 3.0, Verdict::Contradicted),
            (Condition::Between(1.0, 2.0), 1.1, 1.9, Verdict::Reproduced),
            (Condition::Between(1.0, 2.0), 0.1, 2.9, Verdict::Open),
            (Condition::Between(1.0, 2.0), 0.1, 0.9, Verdict::Contradicted),
        ] {
            assert_eq!(condition.verdict(at(lower, upper)), verdict, "{lower} {upper}");
        }
        assert_eq!(
            Condition::AtMost(2.0).verdict(Measured { value: 2.5, interval: None }),
            Verdict::Contradicted
        );
    }

    #[test]
    fn a_claim_states_its_figures_with_interval_unit_and_condition() {
        let evidence = Evidence::Measured {
            figures: &[IN_MEGABYTES],
            scope: Scope::All,
            holds: Condition::AtMost(0.5),
            otherwise: "it is so",
        };
        let figures = |name: &str, scene: &str| {
            ((name, scene) == ("a", "s")).then_some(Measured { value: 0.75, interval: Some([0.625, 0.875]) })
        };
        assert_eq!(evidence.here(&figures), "box 750 (625 to 875) MB [at most 500 MB]");
        assert_eq!(evidence.verdict(&figures), "*contradicted*, because it is so");
        assert_eq!(evidence.verdict(&|_, _| None), "*not covered*, as it was not measured");
        assert_eq!(evidence.here(&|_, _| None), "box not measured [at most 500 MB]");
    }

    #[test]
    fn several_figures_are_told_apart_if_their_verdicts_differ() {
        let both = [("box", Some(Verdict::Contradicted)), ("hall", Some(Verdict::Reproduced))];
        assert_eq!(
            summary(&both, "it is open"),
            "hall: *reproduced*; box: *contradicted*, because it is open"
        );
        assert_eq!(summary(&both[1..], "it is open"), "*reproduced*");
    }
}
