//! One labelled tick.

use sim::sensing::OccupancyGrid;

/// One labelled tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// What was seen, noise included.
    pub grid: OccupancyGrid,
    /// The expert's look-ahead point (u, w), image fractions.
    pub label: [f32; 2],
    /// τ̂: how far off the network was, 0…1; 0 in behaviour cloning.
    pub tau_hat: f32,
}

impl Sample {
    /// The same scene seen in a mirror.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let [u, w] = self.label;
        Self { grid: self.grid.mirrored(), label: [1.0 - u, w], tau_hat: self.tau_hat }
    }
}

#[cfg(test)]
mod tests {
    use crate::test_data::round;

    #[test]
    fn a_mirror_swaps_left_and_right() {
        let sample = round(1).samples[0];
        let mirrored = sample.mirrored();
        assert_eq!(mirrored.label, [1.0 - sample.label[0], sample.label[1]]);
        assert_eq!(mirrored.grid.is_occupied(3, 0), sample.grid.is_occupied(3, 24));
        assert_eq!(mirrored.mirrored().grid, sample.grid);
    }
}
