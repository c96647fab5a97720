//! What a file that lotpilot wrote says about itself.

use policy::conditions::Conditions;
use policy::network::InferenceSettings;
use serde::{Deserialize, Serialize};

/// Key of the metadata that hold it.
pub(crate) const KEY: &str = "lotpilot";
/// Its version.
const SCHEMA: u32 = 1;

/// What the numbers of a network do not say: TOML, in the metadata of the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct About {
    schema: u32,
    /// How its answers are used.
    pub inference: InferenceSettings,
    /// What it was trained with.
    pub conditions: Conditions,
}

impl About {
    pub(crate) fn new(inference: InferenceSettings, conditions: Conditions) -> Self {
        Self { schema: SCHEMA, inference, conditions }
    }

    pub(crate) fn to_toml(&self) -> String {
        toml::to_string(self).expect("plain values")
    }

    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        let about: Self = toml::from_str(text).map_err(|error| error.message().to_owned())?;
        if about.schema != SCHEMA {
            return Err(format!("schema {}, and this lotpilot reads {SCHEMA}", about.schema));
        }
        about.inference.validate().map_err(|error| error.to_string())?;
        Ok(about)
    }
}
