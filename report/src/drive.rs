//! What stages wrote, read back.

use anyhow::Context as _;
use evaluation::conclusions::DrivenPlan;
use evaluation::drive_stage::DriveStage;
use evaluation::plan::Plan;
use evaluation::results::EvaluationResults;
use evaluation::stage::Stage;
use evaluation::stages::Chain;
use evaluation::table1::Table1;
use policy::dagger::IterationRow;
use sim::seed::RootSeed;
use std::path::Path;

/// Calls with what was driven in the stages of these folders within the run at `root`.
pub(crate) fn with_drives<const N: usize, T>(
    stages: &[Stage],
    root: &Path,
    folders: [&str; N],
    then: impl FnOnce([DrivenPlan<'_>; N]) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    let open = |folder: &str| {
        DriveStage::load(stages.iter().find(|stage| stage.folder == folder).context("every report has this stage")?)
    };
    let drives = folders.iter().map(|folder| open(folder)).collect::<anyhow::Result<Vec<_>>>()?;
    let plans: Vec<Plan<'_>> = drives.iter().map(DriveStage::plan).collect();
    let read = |(plan, folder): (&Plan<'_>, &str)| EvaluationResults::read(plan, &root.join(folder));
    let results = plans.iter().zip(folders).map(read).collect::<anyhow::Result<Vec<_>>>()?;
    then(std::array::from_fn(|i| DrivenPlan { plan: &plans[i], results: &results[i] }))
}

/// Table 1 of a training of the run at `root`.
pub(crate) fn rows_of(root: &Path, chain: Chain, seed: RootSeed) -> anyhow::Result<Vec<IterationRow>> {
    let folder = root.join(chain.folder(seed));
    let table1 = Table1::read(&folder)?;
    Ok(table1.with_context(|| format!("{}: table1.json is missing", folder.display()))?.rows)
}
