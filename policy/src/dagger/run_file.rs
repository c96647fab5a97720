//! What a folder was begun with: `dagger.toml`.

use crate::dagger::settings::DaggerSettings;
use crate::files::{self, FileError, Format};
use serde::{Deserialize, Serialize};
use sim::seed::RootSeed;
use sim::sensing::GridGeometry;
use std::path::Path;
use storage::sums;

/// What a folder was begun with.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RunFile {
    pub(crate) seed: RootSeed,
    pub(crate) geometry: GridGeometry,
    pub(crate) settings: DaggerSettings,
}

impl Format for RunFile {
    const NAME: &'static str = "dagger.toml";
    const SCHEMA: u32 = 1;
}

impl RunFile {
    /// Makes sure that a folder is continued only with what it was begun with.
    pub(crate) fn claim(&self, folder: &Path) -> Result<(), FileError> {
        match files::read_if_finished::<Self>(folder)? {
            None => {
                files::write(folder, self)?;
                sums::list(folder, &[Self::NAME])
            }
            Some(theirs) if theirs == *self => Ok(()),
            Some(_) => Err(FileError::new(
                &folder.join(Self::NAME),
                "this folder was begun with another seed or other settings",
                "choose another folder, or delete this one",
            )),
        }
    }
}
