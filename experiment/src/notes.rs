//! Notes about lots from files, to be shown before anything is driven.

use crate::lots::Lot;
use crate::settings::NoiseChoice;
use sim::scenario::NoiseLevel;

/// What imports did and found, junctions of lots written by hand, and which lots ask for noise that they are not driven
/// with. A note begins with the name of its lot.
pub fn of(lots: &[Lot], noise: &[NoiseChoice]) -> Vec<String> {
    lots.iter().flat_map(|lot| of_lot(lot, noise)).collect()
}

fn of_lot(lot: &Lot, noise: &[NoiseChoice]) -> Vec<String> {
    let ignored = lot.asks_for_noise().filter(|&level| is_ignored(level, noise)).map(|level| {
        let driven_with: Vec<String> = noise.iter().map(|choice| choice.name()).collect();
        format!(
            "the lot asks for noise {}, but is driven with {}; noise lot is what each lot asks for",
            as_choice(level),
            driven_with.join(", ")
        )
    });
    let notes = lot.notes().into_iter().map(|note| note.to_string()).chain(ignored);
    notes.map(|note| format!("{}: {note}", lot.name())).collect()
}

/// Whether a lot asks for another level than it is driven with. A lot that says nothing asks for `paper`.
fn is_ignored(level: NoiseLevel, noise: &[NoiseChoice]) -> bool {
    level != NoiseLevel::Paper && !noise.iter().any(|&choice| choice == NoiseChoice::Lot || choice == as_choice(level))
}

fn as_choice(level: NoiseLevel) -> NoiseChoice {
    match level {
        NoiseLevel::Clean => NoiseChoice::Clean,
        NoiseLevel::Paper => NoiseChoice::Paper,
        NoiseLevel::Hard => NoiseChoice::Hard,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_ignored_if_a_lot_asks_for_another_level_than_it_gets() {
        use NoiseChoice::{Clean, Hard, Lot, Paper, Times};
        for (level, noise, expected) in [
            (NoiseLevel::Hard, &[Paper][..], true),
            (NoiseLevel::Clean, &[Paper, Times(0.5)], true),
            (NoiseLevel::Hard, &[Paper, Hard], false),
            (NoiseLevel::Hard, &[Lot], false),
            (NoiseLevel::Paper, &[Clean], false),
        ] {
            assert_eq!(is_ignored(level, noise), expected, "{level:?} {noise:?}");
        }
    }
}
