//! Search of parameters: the same method and the same number of candidates for every planner.
//!
//! Parameters are searched in the unit cube that [`Span`] maps to their ranges. The first half of the candidates is drawn
//! uniformly (the starting point first of all), the second half normally around the best so far, narrower from
//! generation to generation. The search has no settings of its own.

use rand::RngExt as _;
use sim::maths;
use sim::seed::{Rng, RootSeed, Stream};

/// Candidates asked for at a time. A constant: results do not depend on the number of threads.
pub const GENERATION: usize = 8;
/// Standard deviation of the draws around the best at the beginning and at the end of the second half, in unit cubes.
const SPREAD: [f32; 2] = [0.25, 0.05];

/// One parameter that is searched.
#[derive(Debug)]
pub struct Dimension<P> {
    /// Name of the parameter, as in its file.
    pub name: &'static str,
    /// Its range.
    pub span: Span,
    /// Reads it.
    pub get: fn(&P) -> f32,
    /// Writes it.
    pub set: fn(&mut P, f32),
}

/// The range of a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Span {
    /// Evenly from … to.
    Linear(f32, f32),
    /// Evenly in the logarithm, from … to.
    Log(f32, f32),
    /// One of so many options, by index.
    Choice(u8),
}

impl Span {
    /// A point of 0…1 as a value.
    pub fn from_unit(self, unit: f32) -> f32 {
        let unit = unit.clamp(0.0, 1.0);
        match self {
            Self::Linear(low, high) => (low + unit * (high - low)).clamp(low, high),
            Self::Log(low, high) => (low * maths::pow(high / low, unit)).clamp(low, high),
            Self::Choice(options) => (unit * f32::from(options)).floor().min(f32::from(options) - 1.0),
        }
    }

    /// Inverse of [`Self::from_unit`] (the middle of an option); values outside come to the nearer end.
    pub fn to_unit(self, value: f32) -> f32 {
        let unit = match self {
            Self::Linear(low, high) => (value - low) / (high - low),
            Self::Log(low, high) => maths::ln(value.max(f32::MIN_POSITIVE) / low) / maths::ln(high / low),
            Self::Choice(options) => (value + 0.5) / f32::from(options),
        };
        unit.clamp(0.0, 1.0)
    }
}

impl std::fmt::Display for Span {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Linear(low, high) => write!(f, "{low} to {high}"),
            Self::Log(low, high) => write!(f, "{low} to {high}, logarithmic"),
            Self::Choice(options) => write!(f, "one of {options} options"),
        }
    }
}

/// A search under way: ask for a generation, tell which of all is best.
#[derive(Debug)]
pub struct Search {
    start: Vec<f32>,
    budget: usize,
    asked: usize,
    rng: Rng,
}

impl Search {
    /// A search from a starting point over `budget` candidates, the starting point included. Draws come from the stream
    /// [`Stream::Search`] of `seed` at `index`.
    pub fn new(start: Vec<f32>, budget: usize, seed: RootSeed, index: u64) -> Self {
        Self { start, budget, asked: 0, rng: seed.rng(Stream::Search, index) }
    }

    /// The next candidates, at most [`GENERATION`]; empty when the budget is spent. `best` is the best so far, `None`
    /// in the beginning.
    pub fn ask(&mut self, best: Option<&[f32]>) -> Vec<Vec<f32>> {
        let count = GENERATION.min(self.budget - self.asked);
        (0..count)
            .map(|_| {
                let candidate = self.draw(best);
                self.asked += 1;
                candidate
            })
            .collect()
    }

    fn draw(&mut self, best: Option<&[f32]>) -> Vec<f32> {
        let half = self.budget / 2;
        match best {
            _ if self.asked == 0 => self.start.clone(),
            Some(best) if self.asked >= half => {
                let share = (self.asked - half) as f32 / (self.budget - half) as f32;
                let spread = SPREAD[0] * maths::pow(SPREAD[1] / SPREAD[0], share);
                best.iter().map(|unit| reflect(unit + spread * normal(&mut self.rng))).collect()
            }
            _ => self.start.iter().map(|_| self.rng.random()).collect(),
        }
    }
}

/// Folds a step over the edge of 0…1 back inside.
fn reflect(unit: f32) -> f32 {
    let folded = unit.rem_euclid(2.0);
    if folded > 1.0 { 2.0 - folded } else { folded }
}

/// A standard normal draw (Box–Muller).
pub(crate) fn normal(rng: &mut Rng) -> f32 {
    let (radius, angle): (f32, f32) = (rng.random(), rng.random());
    (-2.0 * maths::ln(1.0 - radius)).sqrt() * maths::cos(std::f32::consts::TAU * angle)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_map_the_unit_interval_and_back() {
        assert_eq!(Span::Linear(1.0, 3.0).from_unit(0.25), 1.5);
        assert!((Span::Log(0.01, 1.0).from_unit(0.5) - 0.1).abs() < 1e-6);
        assert_eq!(Span::Choice(2).from_unit(0.49), 0.0);
        assert_eq!(Span::Choice(2).from_unit(1.0), 1.0);
        for span in [Span::Linear(-1.0, 4.0), Span::Log(0.1, 10.0)] {
            assert!((span.to_unit(span.from_unit(0.3)) - 0.3).abs() < 1e-5, "{span}");
        }
        assert_eq!(Span::Linear(0.0, 1.0).to_unit(9.0), 1.0);
        assert_eq!(Span::Choice(3).from_unit(Span::Choice(3).to_unit(1.0)), 1.0);
    }

    /// On a bowl in three dimensions the search spends exactly its budget, starts where it is told, and its second half
    /// comes nearer than the first.
    #[test]
    fn the_search_closes_in_on_the_best() {
        let cost = |point: &[f32]| point.iter().map(|unit| (unit - 0.7) * (unit - 0.7)).sum::<f32>();
        let run = |seed| {
            let mut search = Search::new(vec![0.0; 3], 96, RootSeed(seed), 0);
            let (mut all, mut best): (Vec<Vec<f32>>, Option<Vec<f32>>) = (Vec::new(), None);
            loop {
                let generation = search.ask(best.as_deref());
                if generation.is_empty() {
                    return (all, best.unwrap());
                }
                all.extend(generation);
                best = all.iter().min_by(|a, b| cost(a).total_cmp(&cost(b))).cloned();
            }
        };
        let (all, best) = run(1);
        assert_eq!(all.len(), 96);
        assert_eq!(all[0], [0.0; 3]);
        assert!(all.iter().flatten().all(|unit| (0.0..=1.0).contains(unit)));
        let best_of_first_half = all[..48].iter().map(|point| cost(point)).fold(f32::INFINITY, f32::min);
        assert!(cost(&best) < 0.5 * best_of_first_half && cost(&best) < 0.01, "{best:?}");
        assert_eq!(run(1).0, all, "the same seed draws the same candidates");
        assert_ne!(run(2).0, all);
    }
}
