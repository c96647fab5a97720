//! Several networks that answer as one (Lakshminarayanan, Pritzel and Blundell 2017, "Simple and Scalable Predictive
//! Uncertainty Estimation using Deep Ensembles").

use super::predictor::{Prediction, Predictor};
use sim::sensing::OccupancyGrid;

/// Networks whose answers are taken together: a mixture of normal distributions with equal weights, of which mean and
/// standard deviation are reported. Where the members disagree, the standard deviation says so.
///
/// The mean of two ways past an obstacle leads into it. So members that choose among several modes are taken together by
/// majority: the member that is nearest to all others, and those nearest to it, more than half of them in all (chosen).
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
    pub fn predict(&self, grids: &[&OccupancyGrid]) -> Vec<Prediction> {
        self.predict_with_disagreement(grids).0
    }

    /// The same, and how far the members' means are spread about their mean, root mean square, image fractions: 0 of a
    /// single network.
    pub fn predict_with_disagreement(&self, grids: &[&OccupancyGrid]) -> (Vec<Prediction>, Vec<f32>) {
        let mut answers = self.first.predict(grids);
        let mut disagreement = vec![0.0; answers.len()];
        if self.others.is_empty() {
            return (answers, disagreement);
        }
        let is_choice = std::iter::once(&self.first).chain(&self.others).any(Predictor::chooses);
        let others: Vec<Vec<Prediction>> = self.others.iter().map(|member| member.predict(grids)).collect();
        let mut members = Vec::with_capacity(1 + others.len());
        for (at, (answer, disagreement)) in answers.iter_mut().zip(&mut disagreement).enumerate() {
            members.clear();
            members.push(*answer);
            members.extend(others.iter().map(|answers| answers[at]));
            let all = mixture(&members);
            *disagreement = spread(all.mean, &members);
            *answer = if is_choice { mixture(majority(&mut members)) } else { all };
        }
        (answers, disagreement)
    }
}

fn squared(value: f32) -> f32 {
    value * value
}

/// Squared distance of two points.
fn apart_sq(one: [f32; 2], other: [f32; 2]) -> f32 {
    squared(one[0] - other[0]) + squared(one[1] - other[1])
}

/// Root mean square distance of the members' means from `mean`.
fn spread(mean: [f32; 2], members: &[Prediction]) -> f32 {
    (members.iter().map(|answer| apart_sq(answer.mean, mean)).sum::<f32>() / members.len() as f32).sqrt()
}

/// Mean and standard deviation of a mixture with equal weights.
fn mixture(members: &[Prediction]) -> Prediction {
    let count = members.len() as f32;
    let mean: [f32; 2] =
        std::array::from_fn(|axis| members.iter().map(|answer| answer.mean[axis]).sum::<f32>() / count);
    let sigma = std::array::from_fn(|axis| {
        let spread_sq = |answer: &Prediction| squared(answer.sigma[axis]) + squared(answer.mean[axis] - mean[axis]);
        (members.iter().map(spread_sq).sum::<f32>() / count).sqrt()
    });
    Prediction { mean, sigma }
}

/// The member that is nearest to all others, and those nearest to it: more than half of them. Of equals, the earlier.
fn majority(members: &mut [Prediction]) -> &[Prediction] {
    let to_all =
        |member: &Prediction| -> f32 { members.iter().map(|other| apart_sq(member.mean, other.mean).sqrt()).sum() };
    let middle = members.iter().min_by(|a, b| to_all(a).total_cmp(&to_all(b))).map(|member| member.mean);
    let Some(middle) = middle else { return members };
    members.sort_by(|a, b| apart_sq(a.mean, middle).total_cmp(&apart_sq(b.mean, middle)));
    &members[..=members.len() / 2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::{InferenceSettings, NetworkArchitecture, Weights};
    use crate::test_data::lots;
    use sim::maths;
    use sim::seed::RootSeed;

    fn member(index: u64) -> Predictor {
        let architecture = NetworkArchitecture { modes: 1, ..NetworkArchitecture::compact() };
        let weights = Weights::init(architecture, RootSeed(index), 0);
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
        assert!((spread([0.5; 2], &members) - 0.02f32.sqrt()).abs() < 1e-6);
        let narrow = |mean| Prediction { mean: [mean; 2], sigma: [0.01; 2] };
        let apart = mixture(&[narrow(0.4), narrow(0.6)]);
        assert!((apart.sigma[0] - maths::hypot(0.1, 0.01)).abs() < 1e-6 && (apart.mean[0] - 0.5).abs() < 1e-6);
    }

    /// Their mean led into the island that they meant to pass.
    #[test]
    fn members_that_chose_two_ways_go_by_majority() {
        let to = |u| Prediction { mean: [u, 0.4], sigma: [0.02; 2] };
        let answer = |members: &mut [Prediction]| mixture(majority(members)).mean[0];
        assert!((answer(&mut [to(0.3), to(0.7), to(0.68)]) - 0.69).abs() < 1e-6);
        assert!((answer(&mut [to(0.29), to(0.7), to(0.31), to(0.68), to(0.3)]) - 0.3).abs() < 1e-6);
        // Two have no majority but themselves.
        assert!((answer(&mut [to(0.3), to(0.7)]) - 0.5).abs() < 1e-6);
        let choosing = |index| {
            let architecture = NetworkArchitecture { modes: 2, ..NetworkArchitecture::compact() };
            Predictor::new(&Weights::init(architecture, RootSeed(index), 0), InferenceSettings::plain())
        };
        let grids = lots(2);
        let grids: Vec<_> = grids.iter().collect();
        let [one, two, three] = [1, 2, 3].map(choosing);
        let members = [&one, &two, &three].map(|member| member.predict(&grids)[0]);
        let (answers, disagreement) = Ensemble::new(one, vec![two, three]).predict_with_disagreement(&grids);
        assert_eq!(answers[0], mixture(majority(&mut members.clone())));
        assert_eq!(disagreement[0], spread(mixture(&members).mean, &members), "it is about the mean of all");
    }

    /// Where the first that was named has one mode, the mean of two ways was driven at.
    #[test]
    fn one_member_that_chooses_makes_a_choice_of_it_wherever_it_is_named() {
        let grids = lots(5);
        let grids: Vec<_> = grids.iter().collect();
        let weights = Weights::init(NetworkArchitecture { modes: 2, ..NetworkArchitecture::compact() }, RootSeed(3), 0);
        let choosing = Predictor::new(&weights, InferenceSettings::plain());
        let all = [member(1), member(2), choosing];
        let answers = all.each_ref().map(|member| member.predict(&grids));
        let [one, two, choosing] = all;
        let found = Ensemble::new(one, vec![two, choosing]).predict(&grids);
        for (at, found) in found.into_iter().enumerate() {
            let mut members = answers.each_ref().map(|answers| answers[at]);
            assert_ne!(found, mixture(&members));
            assert_eq!(found, mixture(majority(&mut members)));
        }
    }
}
