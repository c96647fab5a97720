//! Several networks that answer as one (Lakshminarayanan, Pritzel and Blundell 2017, "Simple and Scalable Predictive
//! Uncertainty Estimation using Deep Ensembles").

use super::predictor::{Prediction, Predictor};
use sim::sensing::OccupancyGrid;

/// Networks whose answers are taken together: a mixture of normal distributions with equal weights, of which mean and
/// standard deviation are reported. Where the members disagree, the standard deviation says so.
#[derive(Debug, Clone)]
pub struct Ensemble {
    first: Predictor,
    others: Vec<Predictor>,
}

impl Ensemble {
    /// A single network answers the same bits as without an ensemble.
    pub fn new(first: Predictor, others: Vec<Predictor>) -> Self {
        Self { first, others }
    }

    /// Answers every grid, in order.
    pub fn predict(&mut self, grids: &[&OccupancyGrid]) -> Vec<Prediction> {
        self.predict_with_disagreement(grids).0
    }

    /// The same, and how far the members' means are spread about their mean, root mean square, image fractions: 0 of a
    /// single network.
    pub fn predict_with_disagreement(&mut self, grids: &[&OccupancyGrid]) -> (Vec<Prediction>, Vec<f32>) {
        let mut answers = self.first.predict(grids);
        let mut disagreement = vec![0.0; answers.len()];
        if self.others.is_empty() {
            return (answers, disagreement);
        }
        let others: Vec<Vec<Prediction>> = self.others.iter_mut().map(|member| member.predict(grids)).collect();
        for (at, (answer, disagreement)) in answers.iter_mut().zip(&mut disagreement).enumerate() {
            let first = *answer;
            *answer = mixture(first, || others.iter().map(|answers| answers[at]));
            let members = std::iter::once(first).chain(others.iter().map(|answers| answers[at]));
            *disagreement = spread(answer.mean, members);
        }
        (answers, disagreement)
    }
}

fn squared(value: f32) -> f32 {
    value * value
}

/// Root mean square distance of the members' means from `mean`.
fn spread(mean: [f32; 2], members: impl Iterator<Item = Prediction> + Clone) -> f32 {
    let count = members.clone().count() as f32;
    let apart = |answer: Prediction| squared(answer.mean[0] - mean[0]) + squared(answer.mean[1] - mean[1]);
    (members.map(apart).sum::<f32>() / count).sqrt()
}

/// Mean and standard deviation of a mixture with equal weights.
fn mixture<I: Iterator<Item = Prediction>>(first: Prediction, others: impl Fn() -> I) -> Prediction {
    let members = || std::iter::once(first).chain(others());
    let count = members().count() as f32;
    let mean: [f32; 2] = std::array::from_fn(|axis| members().map(|answer| answer.mean[axis]).sum::<f32>() / count);
    let sigma = std::array::from_fn(|axis| {
        let spread_sq = |answer: Prediction| squared(answer.sigma[axis]) + squared(answer.mean[axis] - mean[axis]);
        (members().map(spread_sq).sum::<f32>() / count).sqrt()
    });
    Prediction { mean, sigma }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::{InferenceSettings, NetworkArchitecture, Weights};
    use crate::test_data::lots;
    use sim::maths;
    use sim::seed::RootSeed;

    fn member(index: u64) -> Predictor {
        let weights = Weights::init(NetworkArchitecture::compact(), RootSeed(index), 0);
        Predictor::new(&weights, InferenceSettings::plain())
    }

    #[test]
    fn one_network_is_an_ensemble_of_itself() {
        let grids = lots(3);
        let grids: Vec<_> = grids.iter().collect();
        assert_eq!(Ensemble::new(member(1), Vec::new()).predict(&grids), member(1).predict(&grids));
    }

    #[test]
    fn disagreement_widens_the_spread() {
        let grids = lots(3);
        let grids: Vec<_> = grids.iter().collect();
        let (one, two) = (member(1).predict(&grids), member(2).predict(&grids));
        let both = Ensemble::new(member(1), vec![member(2)]).predict(&grids);
        for ((one, two), both) in one.iter().zip(&two).zip(&both) {
            for axis in 0..2 {
                assert!((both.mean[axis] - 0.5 * (one.mean[axis] + two.mean[axis])).abs() < 1e-6);
                let half_gap = 0.5 * (one.mean[axis] - two.mean[axis]);
                let variance = 0.5 * (squared(one.sigma[axis]) + squared(two.sigma[axis])) + half_gap * half_gap;
                assert!((both.sigma[axis] - variance.sqrt()).abs() < 1e-6 * variance.sqrt().max(1.0));
            }
        }
        // Two members 0.2 apart on either axis are 0.1 · √2 from their mean, however sure each is.
        let apart = |mean, sigma| Prediction { mean: [mean; 2], sigma: [sigma; 2] };
        let members = [apart(0.4, 0.01), apart(0.6, 0.3)];
        assert!((spread([0.5; 2], members.into_iter()) - 0.02f32.sqrt()).abs() < 1e-6);
        let narrow = |mean| Prediction { mean: [mean; 2], sigma: [0.01; 2] };
        let apart = mixture(narrow(0.4), || std::iter::once(narrow(0.6)));
        assert!((apart.sigma[0] - maths::hypot(0.1, 0.01)).abs() < 1e-6 && (apart.mean[0] - 0.5).abs() < 1e-6);
    }
}
