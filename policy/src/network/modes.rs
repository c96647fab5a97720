//! Of several answers to one grid, the one that drives (docs/methods.md 4.1).
//!
//! A row of m > 1 modes is m times an answer, then the logit of each; a row of one mode is its answer.

use crate::network::architecture::{OUTPUTS, row_width};
use sim::maths;
use sim::sensing::OccupancyGrid;

/// One answer among several.
#[derive(Debug, Clone, Copy)]
struct Mode {
    raw: [f32; OUTPUTS],
    /// Larger is likelier; comparable between a grid and its mirror image.
    log_weight: f32,
}

impl Mode {
    fn mirrored(&self) -> Self {
        let [u, w, raw_u, raw_w] = self.raw;
        Self { raw: [1.0 - u, w, raw_u, raw_w], ..*self }
    }
}

/// The answer of a network to every grid, in order, of which `rows` gives the rows: the likeliest mode of a row. With mirror
/// averaging, that of the rows of the grid and of its mirror image together: `rows` is asked for the grids, then for all images.
///
/// # Panics
/// If a row has not [`row_width`] values.
pub fn answers(
    grids: &[&OccupancyGrid],
    modes: usize,
    mirror_averaging: bool,
    rows: impl FnOnce(&[&OccupancyGrid]) -> Vec<f32>,
) -> Vec<[f32; OUTPUTS]> {
    let width = row_width(modes);
    if !mirror_averaging {
        return rows(grids).chunks_exact(width).map(|row| likeliest_of(row, modes)).collect();
    }
    // The images in the same call: two small calls cost more than one of twice the size.
    let images: Vec<OccupancyGrid> = grids.iter().map(|grid| grid.mirrored()).collect();
    let both: Vec<&OccupancyGrid> = grids.iter().copied().chain(&images).collect();
    let rows = rows(&both);
    let (of_grids, of_images) = rows.split_at(grids.len() * width);
    let rows = of_grids.chunks_exact(width).zip(of_images.chunks_exact(width));
    rows.map(|(of_grid, of_image)| mirror_averaged(of_grid, of_image, modes)).collect()
}

/// The likeliest answer of a row of `modes`.
///
/// # Panics
/// If the row has not [`row_width`] values.
pub fn likeliest_of(row: &[f32], modes: usize) -> [f32; OUTPUTS] {
    likeliest(of_row(row, modes)).raw
}

/// The likeliest answer to a grid or to its mirror image, whichever is likelier, averaged with the other's that is nearest to
/// it. The rows are what the network answers to the grid and to the image.
fn mirror_averaged(of_grid: &[f32], of_image: &[f32], modes: usize) -> [f32; OUTPUTS] {
    let (of_grid, of_image) = (of_row(of_grid, modes), of_row(of_image, modes).map(|mode| mode.mirrored()));
    let (one, other) = (likeliest(of_grid.clone()), likeliest(of_image.clone()));
    if one.log_weight >= other.log_weight {
        mean(one, nearest(one, of_image))
    } else {
        mean(other, nearest(other, of_grid))
    }
}

/// The modes of one row.
fn of_row(row: &[f32], count: usize) -> impl Iterator<Item = Mode> + Clone {
    assert_eq!(row.len(), row_width(count), "a row of {count} modes");
    let (raws, logits) = row.split_at(count * OUTPUTS);
    let highest = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let log_sum = maths::ln(logits.iter().map(|logit| maths::exp(logit - highest)).sum());
    let log_weight = move |mode: usize| logits.get(mode).map_or(0.0, |logit| logit - highest - log_sum);
    let raws = raws.as_chunks::<OUTPUTS>().0.iter();
    raws.enumerate().map(move |(mode, &raw)| {
        let log_weight = log_weight(mode);
        // Of logits that cannot be compared no answer comes.
        let raw = if log_weight.is_nan() { [f32::NAN; OUTPUTS] } else { raw };
        Mode { raw, log_weight }
    })
}

fn likeliest(modes: impl Iterator<Item = Mode>) -> Mode {
    modes.max_by(|a, b| a.log_weight.total_cmp(&b.log_weight)).expect("at least one mode")
}

fn nearest(to: Mode, modes: impl Iterator<Item = Mode>) -> Mode {
    let apart = |mode: &Mode| maths::hypot(mode.raw[0] - to.raw[0], mode.raw[1] - to.raw[1]);
    modes.min_by(|a, b| apart(a).total_cmp(&apart(b))).expect("at least one mode")
}

fn mean(one: Mode, other: Mode) -> [f32; OUTPUTS] {
    std::array::from_fn(|i| 0.5 * (one.raw[i] + other.raw[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEFT: [f32; OUTPUTS] = [0.3, 0.4, -3.0, -3.0];
    const RIGHT: [f32; OUTPUTS] = [0.7, 0.4, -3.0, -3.0];

    fn row(logits: [f32; 2]) -> Vec<f32> {
        [LEFT, RIGHT].into_iter().flatten().chain(logits).collect()
    }

    /// Two ways past a tree: the answer is one of them, not their mean.
    #[test]
    fn of_several_modes_the_likeliest_drives() {
        assert_eq!(likeliest_of(&row([0.2, 0.1]), 2), LEFT);
        assert_eq!(likeliest_of(&row([0.1, 0.2]), 2), RIGHT);
        // Its mirror image prefers the same side, so both agree on one.
        let answer = mirror_averaged(&row([0.2, 0.1]), &row([0.1, 0.5]), 2);
        assert!((answer[0] - 0.3).abs() < 1e-6, "{answer:?}");
        // It prefers the other side, and is surer: that side it is, and not the middle.
        let answer = mirror_averaged(&row([0.2, 0.1]), &row([0.5, 0.1]), 2);
        assert!((answer[0] - 0.7).abs() < 1e-6, "{answer:?}");
    }

    #[test]
    fn logits_that_cannot_be_compared_give_no_answer() {
        for logits in [[f32::NAN, 0.0], [0.0, f32::NAN], [f32::INFINITY, 0.0], [f32::NEG_INFINITY; 2]] {
            assert!(likeliest_of(&row(logits), 2).iter().all(|value| value.is_nan()), "{logits:?}");
        }
        assert_eq!(likeliest_of(&row([f32::NEG_INFINITY, 0.0]), 2), RIGHT, "a way that is never taken");
    }

    #[test]
    fn one_mode_is_averaged_with_its_mirror_image() {
        assert_eq!(likeliest_of(&LEFT, 1), LEFT);
        assert_eq!(mirror_averaged(&LEFT, &[0.5, 0.6, -1.0, -2.0], 1), [0.4, 0.5, -2.0, -2.5]);
    }
}
