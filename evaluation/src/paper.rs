//! The figures that the paper prints, and the counts recovered from them (docs/methods.md 0).

use crate::names::DAGGER;
use serde::{Deserialize, Serialize};

/// A lot of the paper.
#[derive(Debug, Clone, Copy)]
pub struct PaperLot {
    /// The reference lot that stands for it.
    pub lot: &'static str,
    /// Length of its reference path, metres.
    pub length_m: f64,
    /// What its drivers did there, in the order of [`DRIVERS`].
    pub results: [PaperResult; 3],
}

/// A driver on a lot: five trials both ways.
#[derive(Debug, Clone, Copy)]
pub struct PaperResult {
    /// Near-collisions per 100 m, forward and reverse, as printed.
    pub per_100m: [f64; 2],
    /// Near-collisions, forward and reverse, recovered from the rates.
    pub near_collisions: [u32; 2],
    /// Safe ratio, as printed.
    pub safe_ratio: f64,
}

impl PaperLot {
    /// Metres that every driver drove: five trials both ways.
    pub fn driven_m(&self) -> f64 {
        10.0 * self.length_m
    }
}

/// Drivers of the paper, by the names of ours.
pub const DRIVERS: [&str; 3] = [DAGGER, "tentacle", "vvf"];

/// Near-collisions of a driver and metres it drove on some of the lots.
pub fn count(driver: usize, is_meant: impl Fn(&PaperLot) -> bool) -> (u32, f64) {
    LOTS.iter().filter(|lot| is_meant(lot)).fold((0, 0.0), |(events, metres), lot| {
        (events + lot.results[driver].near_collisions.iter().sum::<u32>(), metres + lot.driven_m())
    })
}

const fn result(per_100m: [f64; 2], near_collisions: [u32; 2], safe_ratio: f64) -> PaperResult {
    PaperResult { per_100m, near_collisions, safe_ratio }
}

/// Its tables of collision rates and safe ratios.
pub const LOTS: [PaperLot; 3] = [
    PaperLot {
        lot: "lot-a",
        length_m: 231.0,
        results: [
            result([0.0, 0.0], [0, 0], 0.83),
            result([1.12, 0.95], [13, 11], 0.69),
            result([1.38, 1.29], [16, 15], 0.71),
        ],
    },
    PaperLot {
        lot: "lot-b",
        length_m: 139.0,
        results: [
            result([0.0, 0.0], [0, 0], 0.72),
            result([1.87, 2.01], [13, 14], 0.63),
            result([2.01, 2.15], [14, 15], 0.64),
        ],
    },
    PaperLot {
        lot: "lot-c",
        length_m: 149.0,
        results: [
            result([0.0, 0.0], [0, 0], 0.91),
            // 1.15 is not a multiple of 1/7.45: 8 or 9.
            result([1.47, 1.15], [11, 9], 0.81),
            result([1.07, 0.93], [8, 7], 0.85),
        ],
    },
];

/// Its table of `DAgger` iterations: behaviour cloning, then i = 1 … 5.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct IterationsOfPaper {
    /// Samples collected.
    pub dataset: [usize; 6],
    /// Share of the network's actions.
    pub eta_hat: [Option<f64>; 6],
    /// Σ τ̂ with its weight in the loss over Σ τ̂ without.
    pub effect: [Option<f64>; 6],
}

/// As printed.
pub const TABLE_1: IterationsOfPaper = IterationsOfPaper {
    dataset: [6425, 3258, 2263, 2088, 1505, 731],
    eta_hat: [None, Some(0.44), Some(0.64), Some(0.65), Some(0.74), Some(0.90)],
    effect: [None, Some(0.62), Some(0.65), Some(0.85), Some(0.89), Some(0.91)],
};

#[cfg(test)]
mod tests {
    use super::*;

    /// 5180 m and the means 1.428 and 1.471 that the text quotes; rates are counts over five trials, cut after two
    /// digits (lot c's 1.15 is none).
    #[test]
    fn counts_and_lengths_give_the_printed_rates() {
        assert_eq!(LOTS.iter().map(PaperLot::driven_m).sum::<f64>(), 5190.0, "5180 with 230 m for lot a");
        for (driver, mean) in [(0, 0.0), (1, 1.428), (2, 1.471)] {
            let rates = LOTS.iter().flat_map(|lot| lot.results[driver].per_100m);
            assert!((rates.sum::<f64>() / 6.0 - mean).abs() < 0.0015);
            for lot in &LOTS {
                let PaperResult { per_100m, near_collisions, .. } = lot.results[driver];
                for (rate, count) in per_100m.into_iter().zip(near_collisions) {
                    let found = f64::from(count) / (0.05 * lot.length_m);
                    assert!((found - rate).abs() < 0.011 || rate == 1.15, "{rate}: {found}");
                }
            }
        }
    }
}
