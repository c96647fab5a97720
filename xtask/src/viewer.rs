//! The viewer program (`viewer/`): a workspace of its own, built when first needed, because rerun takes minutes to compile.

use crate::interrupt;
use crate::output::Output;
use anyhow::{Context as _, ensure};
use experiment::progress::Interrupted;
use experiment::view_request::ViewRequest;
use sim::limits::VIEW_REQUEST_BYTES_MAX;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

/// Its exit status after Ctrl-C.
const EXIT_INTERRUPTED: i32 = interrupt::EXIT as i32;
/// Between two looks at whether it has ended.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// Looks that it is given after Ctrl-C to end what it writes: so few that this process is still there to end it then.
const LOOKS_TO_END: u32 = 8;
const _: () = assert!(LOOK_EVERY.saturating_mul(LOOKS_TO_END + 1).as_millis() < interrupt::GRACE.as_millis());
/// Backends of the network that this program has: a run may ask for one.
const BACKENDS: &[&str] = &[
    #[cfg(feature = "cuda")]
    "cuda",
    #[cfg(feature = "vulkan")]
    "vulkan",
    #[cfg(feature = "wgpu")]
    "wgpu",
];

/// Builds the viewer program if necessary and runs it on a request.
///
/// # Errors
/// If it cannot be built, it failed (it has said why), or on Ctrl-C.
pub(crate) fn ask(request: &ViewRequest, output: &Output) -> anyhow::Result<()> {
    let manifest = manifest()?;
    let request = encoded(request)?;
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.args(["run", "--locked", "--manifest-path"]).arg(&manifest);
    for backend in BACKENDS {
        command.args(["--features", backend]);
    }
    // Beside this program, so that dependencies of both are compiled once.
    let target = target_folder();
    if let Some(target) = &target {
        command.arg("--target-dir").arg(target);
    }
    let program = Path::new("debug").join(format!("viewer{}", std::env::consts::EXE_SUFFIX));
    if target.is_some_and(|target| target.join(program).is_file()) {
        command.arg("--quiet");
    } else {
        output.note("building the viewer program: about 8 minutes on two cores, the first time only …");
    }
    command.env("RAYON_NUM_THREADS", rayon::current_num_threads().to_string()).stdin(Stdio::piped());
    let mut child = command.spawn().context("cargo, which builds the viewer program, cannot be started")?;
    // If it ends before it has read everything, its status says why.
    let _ = child.stdin.take().context("the pipe to the viewer program")?.write_all(&request);
    let mut looks = 0;
    let status = loop {
        if let Some(status) = child.try_wait().context("the viewer program")? {
            break status;
        }
        if interrupt::is_requested() {
            // A terminal tells it as well; whoever sends a signal to this process alone does not.
            if looks == LOOKS_TO_END {
                child.kill().context("the viewer program")?;
            }
            looks += 1;
        }
        std::thread::sleep(LOOK_EVERY);
    };
    if interrupt::is_requested() || status.code() == Some(EXIT_INTERRUPTED) {
        return Err(Interrupted { kept: "the recordings made so far are complete".to_owned() }.into());
    }
    ensure!(status.success(), "{}: the viewer program failed ({status}), see above", manifest.display());
    Ok(())
}

/// A request as it is passed on.
fn encoded(request: &ViewRequest) -> anyhow::Result<Vec<u8>> {
    let request = serde_json::to_vec(request)?;
    ensure!(
        request.len() as u64 <= VIEW_REQUEST_BYTES_MAX,
        "this asks the viewer program for too much at once, in {} bytes, and at most {VIEW_REQUEST_BYTES_MAX} are read; record \
         fewer, with a smaller --limit or --record, or fewer keys",
        request.len()
    );
    Ok(request)
}

/// The manifest of the viewer program in this checkout, wherever that was moved to.
fn manifest() -> anyhow::Result<PathBuf> {
    let starts = [std::env::current_exe(), std::env::current_dir()];
    let mut folders = starts.iter().flatten().flat_map(|start| start.ancestors());
    let is_checkout = |folder: &&Path| {
        ["viewer", "experiment", "xtask"].iter().all(|package| folder.join(package).join("Cargo.toml").is_file())
    };
    folders.find(is_checkout).map(|checkout| checkout.join("viewer/Cargo.toml")).context(
        "viewer/Cargo.toml is found neither above this program nor above the current folder; run it in the checkout",
    )
}

/// The target folder that this program was built in.
fn target_folder() -> Option<PathBuf> {
    let program = std::env::current_exe().ok()?;
    let is_profile = |folder: &&Path| folder.file_name().is_some_and(|name| name == "debug" || name == "release");
    program.ancestors().find(is_profile).and_then(Path::parent).map(Path::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use experiment::view_request::{Show, Sink};
    use sim::seed::RootSeed;

    /// The viewer program would read the first million bytes, and say that the request breaks off.
    #[test]
    fn a_request_of_more_than_a_million_bytes_is_refused_and_no_shorter_one() {
        let request = |lot: String| ViewRequest { sink: Sink::Spawn, show: vec![Show::Lot { lot, seed: RootSeed(1) }] };
        let around = encoded(&request(String::new())).unwrap().len();
        let of_length = |bytes: usize| encoded(&request("x".repeat(bytes - around)));
        assert_eq!(of_length(1_000_000).unwrap().len(), 1_000_000);
        let refusal = of_length(1_000_001).unwrap_err().to_string();
        assert!(refusal.contains("in 1000001 bytes, and at most 1000000 are read; record fewer"), "{refusal}");
    }

    #[test]
    fn the_viewer_program_of_this_checkout_is_found() {
        assert!(std::fs::read_to_string(manifest().unwrap()).unwrap().contains("name = \"viewer\""));
    }

    #[test]
    fn whoever_only_trains_does_not_compile_rerun() {
        assert!(!include_str!("../../Cargo.lock").contains("name = \"rerun\""));
    }
}
