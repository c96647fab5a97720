//! `--set key=json` for settings of the expert.

use expert::ExpertSettings;

/// A copy with one setting replaced. Panics on a key or a value that does not exist: the user should read why.
pub(crate) fn overridden(settings: &ExpertSettings, text: &str) -> ExpertSettings {
    let (key, value) = text.split_once('=').expect("--set takes KEY=JSON");
    let mut tree = serde_json::to_value(settings).expect("settings serialise");
    let pointer = format!("/{}", key.replace('.', "/"));
    let slot = tree.pointer_mut(&pointer).unwrap_or_else(|| panic!("no setting {key:?}"));
    *slot = serde_json::from_str(value).unwrap_or_else(|_| value.into());
    serde_json::from_value(tree).unwrap_or_else(|error| panic!("{text}: {error}"))
}
