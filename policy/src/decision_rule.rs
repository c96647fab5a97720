//! May the network drive this tick? Algorithm 2, line 9, in the readings that make sense (docs/methods.md 4.3, 4.4).

use crate::network::Prediction;
use serde::{Deserialize, Serialize};

/// What the decision rests on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// τ̂: distance between the network's clipped mean and the expert's answer, image fractions.
    pub discrepancy: f32,
    /// χ̂: standard deviation of the network's answer, (u, w), image fractions.
    pub doubt: [f32; 2],
}

impl Evidence {
    /// Algorithm 2, lines 7 and 8. Both answers are clipped to the image, as they would be driven.
    pub fn new(predicted: &Prediction, expert: [f32; 2]) -> Self {
        let novice = predicted.clipped_mean();
        let expert = expert.map(|fraction| fraction.clamp(0.0, 1.0));
        Self { discrepancy: (novice[0] - expert[0]).hypot(novice[1] - expert[1]), doubt: predicted.sigma }
    }
}

/// When the network may drive. All comparisons are strict, as printed. Thresholds that are not given are the paper's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum DecisionRule {
    /// All of τ̂ < τ, `χ̂_u` < χ, `χ̂_w` < χ: the text, the figures, and the only reading that gives the paper's table.
    AllBelow {
        /// Threshold of the discrepancy, image fractions.
        #[serde(default = "paper_tau")]
        tau: f32,
        /// Threshold of the doubt, in the unit of `chi_on`.
        #[serde(default = "paper_chi")]
        chi: f32,
        /// What χ is compared with.
        #[serde(default)]
        chi_on: ChiOn,
    },
    /// Any of them: Algorithm 2 as printed ("or").
    AnyBelowLiteral {
        /// Threshold of the discrepancy, image fractions.
        #[serde(default = "paper_tau")]
        tau: f32,
        /// Threshold of the doubt, in the unit of `chi_on`.
        #[serde(default = "paper_chi")]
        chi: f32,
        /// What χ is compared with.
        #[serde(default)]
        chi_on: ChiOn,
    },
    /// τ̂ < τ alone.
    TauOnly {
        /// Threshold of the discrepancy, image fractions.
        #[serde(default = "paper_tau")]
        tau: f32,
    },
    /// Never: the expert drives, as in behaviour cloning.
    ExpertOnly,
}

fn paper_tau() -> f32 {
    0.07
}

fn paper_chi() -> f32 {
    0.1
}

/// What χ is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ChiOn {
    /// σ of each axis: 0.1 is 1.2 m, a threshold that can bind.
    #[default]
    StdPerAxis,
    /// ‖(`σ_u`, `σ_w`)‖₂, the authors' published code.
    StdNorm,
    /// σ² of each axis, the paper's word: 0.1 is 3.8 m and never binds.
    Variance,
}

impl DecisionRule {
    /// τ = 0.07, χ = 0.1 (paper), all below, χ on σ per axis.
    pub fn paper() -> Self {
        Self::AllBelow { tau: paper_tau(), chi: paper_chi(), chi_on: ChiOn::StdPerAxis }
    }

    /// Whether the network drives.
    pub fn trusts_novice(&self, evidence: &Evidence) -> bool {
        match *self {
            Self::AllBelow { tau, chi, chi_on } => {
                evidence.discrepancy < tau && chi_on.of(evidence.doubt).into_iter().all(|doubt| doubt < chi)
            }
            Self::AnyBelowLiteral { tau, chi, chi_on } => {
                evidence.discrepancy < tau || chi_on.of(evidence.doubt).into_iter().any(|doubt| doubt < chi)
            }
            Self::TauOnly { tau } => evidence.discrepancy < tau,
            Self::ExpertOnly => false,
        }
    }
}

impl ChiOn {
    /// The two values that are compared, of σ across and ahead in image fractions.
    pub fn of(self, [u, w]: [f32; 2]) -> [f32; 2] {
        match self {
            Self::StdPerAxis => [u, w],
            Self::StdNorm => [u.hypot(w); 2],
            Self::Variance => [u * u, w * w],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_by_table() {
        let all = |chi_on| DecisionRule::AllBelow { tau: 0.07, chi: 0.1, chi_on };
        let any = |chi_on| DecisionRule::AnyBelowLiteral { tau: 0.07, chi: 0.1, chi_on };
        let tau = DecisionRule::TauOnly { tau: 0.07 };
        let (novice, expert) = (true, false);
        #[rustfmt::skip]
        let table = [
            //                                  τ̂    σ_u   σ_w   who drives
            (all(ChiOn::StdPerAxis),          0.05, 0.05, 0.05, novice),
            (all(ChiOn::StdPerAxis),          0.07, 0.05, 0.05, expert), // strict
            (all(ChiOn::StdPerAxis),          0.05, 0.20, 0.05, expert),
            (all(ChiOn::StdPerAxis),          0.05, 0.05, 0.10, expert),
            (all(ChiOn::StdNorm),             0.05, 0.08, 0.08, expert), // norm 0.113
            (all(ChiOn::StdPerAxis),          0.05, 0.08, 0.08, novice),
            (all(ChiOn::Variance),            0.05, 0.30, 0.30, novice), // 0.09: does not bind
            (all(ChiOn::Variance),            0.05, 0.32, 0.30, expert),
            (any(ChiOn::StdPerAxis),          0.50, 0.20, 0.05, novice),
            (any(ChiOn::StdPerAxis),          0.05, 0.20, 0.20, novice),
            (any(ChiOn::StdPerAxis),          0.50, 0.20, 0.20, expert),
            (any(ChiOn::Variance),            0.50, 0.20, 0.20, novice),
            (tau,                             0.05, 0.90, 0.90, novice),
            (tau,                             0.08, 0.01, 0.01, expert),
            (DecisionRule::ExpertOnly,        0.00, 0.00, 0.00, expert),
        ];
        for (rule, discrepancy, u, w, expected) in table {
            let evidence = Evidence { discrepancy, doubt: [u, w] };
            assert_eq!(rule.trusts_novice(&evidence), expected, "{rule:?} on {evidence:?}");
        }
    }

    #[test]
    fn evidence_compares_what_would_be_driven() {
        let predicted = Prediction { mean: [1.3, -0.2], sigma: [0.1, 0.2] };
        let evidence = Evidence::new(&predicted, [0.7, 0.4]);
        assert!((evidence.discrepancy - 0.5).abs() < 1e-6); // (1, 0) against (0.7, 0.4)
        assert_eq!(evidence.doubt, [0.1, 0.2]);
    }

    #[derive(Debug, Serialize, Deserialize)]
    struct File {
        #[serde(deserialize_with = "crate::string_or_table::string_or_table")]
        rule: DecisionRule,
    }

    #[test]
    fn a_name_alone_is_a_rule_with_the_papers_thresholds() {
        let read = |text: &str| toml::from_str::<File>(text).map(|file| file.rule).map_err(|error| error.to_string());
        assert_eq!(read("rule = 'tau_only'"), Ok(DecisionRule::TauOnly { tau: 0.07 }));
        assert_eq!(read("rule = 'all_below'"), Ok(DecisionRule::paper()));
        assert_eq!(read("rule = 'expert_only'"), Ok(DecisionRule::ExpertOnly));
        assert_eq!(read("rule = { tau_only = {} }"), Ok(DecisionRule::TauOnly { tau: 0.07 }));
        assert_eq!(read("rule = { tau_only = { tau = 0.2 } }"), Ok(DecisionRule::TauOnly { tau: 0.2 }));
        for (text, part) in [("rule = 'tau_onli'", "all_below"), ("rule = { tau_only = { chi = 1 } }", "chi")] {
            let error = read(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }

    #[test]
    fn rules_survive_toml() {
        let text = toml::to_string(&File { rule: DecisionRule::paper() }).unwrap();
        assert_eq!(toml::from_str::<File>(&text).unwrap().rule, DecisionRule::paper());
    }
}
