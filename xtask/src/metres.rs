//! `metres`: how far must be driven.

use crate::cli::MetresArgs;
use anyhow::ensure;
use statistics::metres::{Question, to_bound};

/// The command.
///
/// # Errors
/// If a rate, a probability or the dispersion is out of range.
pub fn run(args: &MetresArgs) -> anyhow::Result<()> {
    for (flag, probability) in [("--power", args.power), ("--confidence", args.confidence)] {
        ensure!(probability > 0.0 && probability < 1.0, "{flag} {probability} is no probability between 0 and 1");
    }
    let dispersion = args.dispersion;
    ensure!((1.0..=1e3).contains(&dispersion), "--dispersion {dispersion} is not within 1 (independent events) … 1000");
    let percent = 100.0 * args.confidence;
    if let Some(rate) = args.below {
        check(&[rate], "--below")?;
        ensure!(rate > 0.0, "--below 0: no distance shows that a rate is zero; name a rate that would be good enough");
        println!(
            "{:.0} m without a near-collision show a rate below {rate} per 100 m ({percent} %, one-sided)",
            to_bound(rate, args.confidence)
        );
    }
    if let Some([a, b]) = args.between {
        check(&[a, b], "--between")?;
        ensure!(a != b, "--between {a},{b}: equal rates cannot be told apart");
        let question = Question { per_100m: [a, b], power: args.power, alpha: 1.0 - args.confidence, dispersion };
        println!(
            "{:.0} m per driver tell {a} from {b} per 100 m in {} % of all evaluations (exact test, {percent} %, \
             dispersion {dispersion})",
            question.metres_each(),
            100.0 * args.power
        );
    }
    Ok(())
}

fn check(rates: &[f64], flag: &str) -> anyhow::Result<()> {
    for &rate in rates {
        ensure!((0.0..=1e3).contains(&rate), "{flag} {rate}: a rate is a number of events per 100 m within 0 … 1000");
    }
    Ok(())
}
