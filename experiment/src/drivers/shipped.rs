//! Networks that ship with the program.

use crate::settings::Settings;
use crate::trained::TrainedOn;
use anyhow::Context as _;
use policy::checkpoint::Checkpoint;
use std::path::Path;

/// A network that ships: what a training wrote, as it wrote it.
struct Shipped {
    /// As in `trained:NAME`; the preset it was trained by.
    name: &'static str,
    /// `settings.toml` of the run.
    settings: &'static str,
    /// `model.toml` of its last round.
    model: &'static str,
    /// `model.safetensors` beside it.
    numbers: &'static [u8],
}

/// CONTRIBUTING.md says how they are made.
const SHIPPED: [Shipped; 1] = [Shipped {
    name: "default",
    settings: include_str!("../../../policy/trained/default/settings.toml"),
    model: include_str!("../../../policy/trained/default/model.toml"),
    numbers: include_bytes!("../../../policy/trained/default/model.safetensors"),
}];

/// The names of those that ship.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    SHIPPED.iter().map(|shipped| shipped.name)
}

fn find(name: &str) -> anyhow::Result<&'static Shipped> {
    let shipped = SHIPPED.iter().find(|shipped| shipped.name == name);
    shipped.with_context(|| format!("no network {name:?} ships"))
}

/// One of them.
///
/// # Errors
/// If none is named so.
pub(super) fn network(name: &str) -> anyhow::Result<Checkpoint> {
    let shipped = find(name)?;
    let folder = Path::new("policy/trained").join(name);
    Ok(Checkpoint::from_contents(shipped.model, shipped.numbers, &folder)?)
}

/// What one of them was trained on.
///
/// # Errors
/// If none is named so.
pub(super) fn trained_on(name: &str) -> anyhow::Result<TrainedOn> {
    let settings: Settings = toml::from_str(find(name)?.settings)?;
    Ok(TrainedOn { lots: settings.training.lots.into_iter().collect(), ..TrainedOn::default() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use policy::conditions::Conditions;

    /// A preset that has changed since would train another network than the one that ships under its name.
    #[test]
    fn a_network_that_ships_is_what_its_preset_trains() {
        for shipped in &SHIPPED {
            let preset = Settings::preset(shipped.name).unwrap();
            let trained: Settings = toml::from_str(shipped.settings).unwrap();
            let remedy = "train it again, as CONTRIBUTING.md says";
            assert_eq!(trained, Settings { evaluation: trained.evaluation.clone(), ..preset.clone() }, "{remedy}");
            let network = network(shipped.name).unwrap();
            assert_eq!(network.weights.architecture(), preset.dagger.network, "{remedy}");
            assert_eq!(
                (&network.conditions, &network.inference),
                (&Conditions::of(&preset.episode), &preset.dagger.inference)
            );
            assert_eq!(trained_on(shipped.name).unwrap().lots, preset.training.lots.into_iter().collect());
            // Verified by the sums beside it.
            let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../policy/trained").join(shipped.name);
            assert!(network == Checkpoint::load(&folder).unwrap(), "{remedy}");
        }
    }
}
