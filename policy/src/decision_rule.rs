//! May the network drive this tick? Algorithm 2, line 9, in the readings that make sense (docs/methods.md 4.3, 4.4), and
//! the rules of other methods of the `DAgger` family (docs/methods.md 5), a file each.

mod ensemble_dagger;
mod evidence;
mod gate;
mod hg_dagger;
mod lazy_dagger;
mod safe_dagger;
mod thrifty_dagger;
mod vanilla;

pub use ensemble_dagger::EnsembleDaggerSettings;
pub use evidence::Evidence;
pub(crate) use gate::{Gate, GateTick};
pub use hg_dagger::HgDaggerSettings;
pub use lazy_dagger::LazyDaggerSettings;
pub use safe_dagger::SafeDaggerSettings;
use sim::maths;
pub(crate) use thrifty_dagger::Thresholds;
pub use thrifty_dagger::ThriftyDaggerSettings;
pub use vanilla::VanillaSettings;

use crate::string_or_table::string_or_table;
use serde::{Deserialize, Serialize};
use sim::episode::EpisodeSettings;
use sim::seed::Rng;
use thrifty_dagger::ThriftyDaggerGate;
use toml::Value;

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
    /// Never: the expert drives, as in behaviour cloning. The control experiment at equal samples.
    ExpertOnly,
    /// Vanilla `DAgger`: by chance, ever more often.
    Vanilla(VanillaSettings),
    /// `SafeDAgger`: unless a critic predicts that it is off.
    SafeDagger(SafeDaggerSettings),
    /// `EnsembleDAgger`: while it is near the expert's answer and its members agree.
    EnsembleDagger(EnsembleDaggerSettings),
    /// `HG-DAgger`: until the expert, who watches the road, takes over.
    HgDagger(HgDaggerSettings),
    /// `LazyDAgger`: as `SafeDagger`, but the expert keeps the wheel until the network is near its answer.
    LazyDagger(LazyDaggerSettings),
    /// `ThriftyDAgger`: unless the state is novel or risky.
    ThriftyDagger(ThriftyDaggerSettings),
}

/// τ of the paper, image fractions.
pub(crate) const PAPER_TAU: f32 = 0.07;

fn paper_tau() -> f32 {
    PAPER_TAU
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

    /// Who drives one car under this rule, with what it draws at random.
    pub(crate) fn gate(&self, context: GateContext<'_>) -> Box<dyn Gate> {
        let GateContext { round, episode, thresholds, rng } = context;
        match *self {
            Self::Vanilla(settings) => Box::new(settings.gate(round, rng)),
            Self::HgDagger(settings) => Box::new(settings.gate(episode)),
            Self::LazyDagger(settings) => Box::new(settings.gate()),
            Self::ThriftyDagger(_) => Box::new(ThriftyDaggerGate::new(thresholds)),
            rule => Box::new(Memoryless(rule)),
        }
    }

    /// The rule of a name, as in the settings, with its own thresholds.
    pub fn named(name: &str) -> Option<Self> {
        let by_name = Value::String(name.to_owned());
        string_or_table(by_name).ok()
    }

    /// Whether another is the same rule, whatever its thresholds are.
    pub fn is_like(&self, other: &Self) -> bool {
        std::mem::discriminant(self) == std::mem::discriminant(other)
    }

    /// Networks trained per round: those that drive together, and a critic.
    pub fn networks(&self) -> usize {
        self.members() + usize::from(self.critic().is_some())
    }

    /// τ, if it has one.
    pub fn tau(&self) -> Option<f32> {
        match *self {
            Self::AllBelow { tau, .. }
            | Self::AnyBelowLiteral { tau, .. }
            | Self::TauOnly { tau }
            | Self::SafeDagger(SafeDaggerSettings { tau })
            | Self::LazyDagger(LazyDaggerSettings { tau, .. })
            | Self::EnsembleDagger(EnsembleDaggerSettings { tau, .. }) => Some(tau),
            Self::ExpertOnly | Self::Vanilla(_) | Self::HgDagger(_) | Self::ThriftyDagger(_) => None,
        }
    }

    /// χ on the predicted spread of a single network, if it has one, and what it is compared with.
    pub fn chi(&self) -> Option<(f32, ChiOn)> {
        match *self {
            Self::AllBelow { chi, chi_on, .. } | Self::AnyBelowLiteral { chi, chi_on, .. } => Some((chi, chi_on)),
            _ => None,
        }
    }

    /// Networks that drive together.
    pub fn members(&self) -> usize {
        match *self {
            Self::EnsembleDagger(EnsembleDaggerSettings { members, .. })
            | Self::ThriftyDagger(ThriftyDaggerSettings { members, .. }) => usize::from(members),
            _ => 1,
        }
    }

    /// What a critic learns for it, if it needs one.
    pub(crate) fn critic(&self) -> Option<CriticTarget> {
        match *self {
            Self::SafeDagger(SafeDaggerSettings { tau }) | Self::LazyDagger(LazyDaggerSettings { tau, .. }) => {
                Some(CriticTarget::IsOff { tau })
            }
            Self::ThriftyDagger(ThriftyDaggerSettings { discount, .. }) => Some(CriticTarget::Risk { discount }),
            _ => None,
        }
    }

    /// Whether the method asks the expert at every tick, to decide or to label; else only while the expert drives.
    pub(crate) fn asks_at_every_tick(&self) -> bool {
        match self {
            Self::AllBelow { .. }
            | Self::AnyBelowLiteral { .. }
            | Self::TauOnly { .. }
            | Self::ExpertOnly
            | Self::Vanilla(_)
            | Self::EnsembleDagger(_) => true,
            Self::SafeDagger(_) | Self::HgDagger(_) | Self::LazyDagger(_) | Self::ThriftyDagger(_) => false,
        }
    }
}

/// What rules with a memory, or that look at the road, are made of.
pub(crate) struct GateContext<'a> {
    /// 0 = behaviour cloning.
    pub(crate) round: u32,
    pub(crate) episode: &'a EpisodeSettings,
    pub(crate) thresholds: Thresholds,
    pub(crate) rng: Rng,
}

/// What a critic learns to predict from a grid, 0…1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum CriticTarget {
    /// Whether the network's τ̂ is above τ.
    IsOff { tau: f32 },
    /// `discount` to the power of the ticks until the next near-collision; 0 if none follows.
    Risk { discount: f32 },
}

/// A rule that needs nothing but the evidence of the tick.
struct Memoryless(DecisionRule);

impl Gate for Memoryless {
    fn trusts_novice(&mut self, tick: &GateTick<'_>) -> bool {
        self.0.trusts_novice(&tick.evidence)
    }
}

impl DecisionRule {
    /// Whether the network drives, by the evidence of the tick alone.
    fn trusts_novice(&self, evidence: &Evidence) -> bool {
        match *self {
            Self::AllBelow { tau, chi, chi_on } => {
                evidence.discrepancy < tau && chi_on.of(evidence.doubt).into_iter().all(|doubt| doubt < chi)
            }
            Self::AnyBelowLiteral { tau, chi, chi_on } => {
                evidence.discrepancy < tau || chi_on.of(evidence.doubt).into_iter().any(|doubt| doubt < chi)
            }
            Self::TauOnly { tau } => evidence.discrepancy < tau,
            Self::SafeDagger(_) => safe_dagger::trusts_novice(evidence),
            Self::EnsembleDagger(settings) => settings.trusts_novice(evidence),
            Self::ExpertOnly | Self::Vanilla(_) | Self::HgDagger(_) | Self::LazyDagger(_) | Self::ThriftyDagger(_) => {
                false
            }
        }
    }
}

impl ChiOn {
    /// The two values that are compared, of σ across and ahead in image fractions.
    pub fn of(self, [u, w]: [f32; 2]) -> [f32; 2] {
        match self {
            Self::StdPerAxis => [u, w],
            Self::StdNorm => [maths::hypot(u, w); 2],
            Self::Variance => [u * u, w * w],
        }
    }
}

#[cfg(test)]
mod test_ticks;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::Prediction;

    #[test]
    fn rules_by_table() {
        let all = |chi_on| DecisionRule::AllBelow { tau: 0.07, chi: 0.1, chi_on };
        let any = |chi_on| DecisionRule::AnyBelowLiteral { tau: 0.07, chi: 0.1, chi_on };
        let tau = DecisionRule::TauOnly { tau: 0.07 };
        let ensemble = DecisionRule::EnsembleDagger(EnsembleDaggerSettings::default());
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
            (ensemble,                        0.05, 0.90, 0.90, novice), // its own spread does not count
            (ensemble,                        0.08, 0.01, 0.01, expert),
        ];
        for (rule, discrepancy, u, w, expected) in table {
            let evidence = Evidence { discrepancy, doubt: [u, w], disagreement: 0.0, alarm: 0.0 };
            assert_eq!(rule.trusts_novice(&evidence), expected, "{rule:?} on {evidence:?}");
        }
    }

    #[test]
    fn disagreement_and_a_critics_alarm_hand_over() {
        let calm = Evidence { discrepancy: 0.01, doubt: [0.01; 2], disagreement: 0.01, alarm: 0.1 };
        let ensemble = DecisionRule::EnsembleDagger(EnsembleDaggerSettings::default());
        let safe = DecisionRule::SafeDagger(SafeDaggerSettings::default());
        assert!(ensemble.trusts_novice(&calm) && safe.trusts_novice(&calm));
        assert!(!ensemble.trusts_novice(&Evidence { disagreement: 0.04, ..calm }));
        assert!(!safe.trusts_novice(&Evidence { alarm: 0.5, ..calm }));
        assert!(safe.trusts_novice(&Evidence { discrepancy: 0.5, ..calm }), "it is not asked how far off it is");
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
        let lazy = DecisionRule::LazyDagger(LazyDaggerSettings { tau: 0.05, release_share: 0.5 });
        assert_eq!(read("rule = { lazy_dagger = { tau = 0.05 } }"), Ok(lazy));
        assert_eq!(read("rule = 'hg_dagger'"), Ok(DecisionRule::HgDagger(HgDaggerSettings::default())));
        assert_eq!(read("rule = { tau_only = {} }"), Ok(DecisionRule::TauOnly { tau: 0.07 }));
        assert_eq!(read("rule = { tau_only = { tau = 0.2 } }"), Ok(DecisionRule::TauOnly { tau: 0.2 }));
        for (text, part) in [("rule = 'tau_onli'", "all_below"), ("rule = { tau_only = { chi = 1 } }", "chi")] {
            let error = read(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }

    #[test]
    fn rules_survive_toml() {
        for name in [
            "all_below",
            "any_below_literal",
            "tau_only",
            "expert_only",
            "vanilla",
            "safe_dagger",
            "ensemble_dagger",
            "hg_dagger",
            "lazy_dagger",
            "thrifty_dagger",
        ] {
            let rule = DecisionRule::named(name).unwrap();
            let text = toml::to_string(&File { rule }).unwrap();
            assert_eq!(toml::from_str::<File>(&text).unwrap().rule, rule, "{name}");
        }
    }
}
