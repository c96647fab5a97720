//! `sample-size`: how far must be driven.

use crate::args::JsonArgs;
use crate::output::Output;
use anyhow::ensure;
use clap::{ArgGroup, Args};
use evaluation::statistics::sample_size::{Question, to_bound};
use serde::Serialize;

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask sample-size --below 0.1                      no event within these metres shows less than 0.1 per 100 m
  cargo xtask sample-size --between 1.4,0.5                to tell two drivers apart
  cargo xtask sample-size --between 1.4,1.2 --power 0.9 --dispersion 2";

/// Rates are near-collisions per 100 m.
#[derive(Debug, Clone, Args)]
#[command(group = ArgGroup::new("question").args(["below", "between"]).required(true).multiple(true))]
pub(crate) struct SampleSizeArgs {
    /// Rate per 100 m that a run without an event shows not to be reached.
    #[arg(long, value_name = "RATE")]
    below: Option<f64>,
    /// Two rates per 100 m to tell apart.
    #[arg(long, value_name = "RATE,RATE", value_parser = two_rates)]
    between: Option<[f64; 2]>,
    /// Of `--between`: probability of seeing a difference that is there.
    #[arg(long, default_value_t = 0.8)]
    power: f64,
    /// Confidence: one-sided for `--below`, two-sided for `--between`.
    #[arg(long, default_value_t = 0.95)]
    confidence: f64,
    /// Variance over mean of the counts, as printed by `evaluate`; 1 = independent events.
    #[arg(long, default_value_t = 1.0)]
    dispersion: f64,
    #[command(flatten)]
    pub(crate) json: JsonArgs,
}

/// An answer as JSON: rates per 100 m, and the metres that each driver must drive.
#[derive(Debug, Serialize)]
struct Answer {
    rates: Vec<f64>,
    metres: f64,
    confidence: f64,
    dispersion: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    power: Option<f64>,
}

fn two_rates(text: &str) -> Result<[f64; 2], String> {
    let rates = text.split_once(',').and_then(|(a, b)| Some([a.trim().parse().ok()?, b.trim().parse().ok()?]));
    rates.ok_or_else(|| "write two numbers with a comma between them, as in 1.4,0.5".to_owned())
}

pub(crate) fn run(args: &SampleSizeArgs, output: &Output) -> anyhow::Result<()> {
    for (flag, probability) in [("--power", args.power), ("--confidence", args.confidence)] {
        ensure!(
            (1e-9..=1.0 - 1e-9).contains(&probability),
            "{flag} {probability} is not a probability between 0 and 1"
        );
    }
    let dispersion = args.dispersion;
    ensure!((1.0..=1e3).contains(&dispersion), "--dispersion {dispersion} is not within 1 (independent events) … 1000");
    let confidence = percent(args.confidence);
    let mut answers = Vec::new();
    if let Some(rate) = args.below {
        check(&[rate], "--below")?;
        ensure!(rate > 0.0, "--below 0: no distance shows that a rate is zero; name a rate that would be good enough");
        // Of events that come in clusters there are as many fewer that say something by themselves.
        let metres = dispersion * to_bound(rate, args.confidence);
        output.remark(format_args!(
            "{metres:.0} m without a near-collision show a rate below {rate} per 100 m ({confidence} %, one-sided, dispersion \
             {dispersion})"
        ));
        answers.push(Answer { rates: vec![rate], metres, confidence: args.confidence, dispersion, power: None });
    }
    if let Some([a, b]) = args.between {
        check(&[a, b], "--between")?;
        ensure!(a != b, "--between {a},{b}: equal rates cannot be told apart");
        let question = Question { per_100m: [a, b], power: args.power, alpha: 1.0 - args.confidence, dispersion };
        let metres = question.metres_each();
        ensure!(metres.is_finite(), "--between {a},{b}: no distance tells rates apart that are so near to each other");
        output.remark(format_args!(
            "{metres:.0} m per driver tell {a} from {b} per 100 m in {} % of all evaluations (exact test, {confidence} %, \
             dispersion {dispersion})",
            percent(args.power)
        ));
        let (confidence, power) = (args.confidence, Some(args.power));
        answers.push(Answer { rates: vec![a, b], metres, confidence, dispersion, power });
    }
    if args.json.json { output.table(String::new, &answers) } else { Ok(()) }
}

/// Below it a distance is longer than anybody drives.
const RATE_MIN: f64 = 1e-9;

fn check(rates: &[f64], flag: &str) -> anyhow::Result<()> {
    for &rate in rates {
        ensure!(rate == 0.0 || rate.abs() >= RATE_MIN, "{flag} {rate}: a rate is 0 or at least {RATE_MIN} per 100 m");
        ensure!((0.0..=1e3).contains(&rate), "{flag} {rate}: a rate is a number of events per 100 m within 0 … 1000");
    }
    Ok(())
}

/// A probability in percent, without what the product is rounded by.
fn percent(probability: f64) -> f64 {
    (1e9 * probability).round() / 1e7
}

#[cfg(test)]
mod tests {
    use super::percent;

    /// `--power 0.55` was told 55.00000000000001 %.
    #[test]
    fn a_probability_is_said_as_it_was_given() {
        let said = [0.55, 0.29, 0.95, 0.999, 1e-9, 1.0 - 1e-9].map(|probability| percent(probability).to_string());
        assert_eq!(said, ["55", "29", "95", "99.9", "0.0000001", "99.9999999"]);
    }
}
