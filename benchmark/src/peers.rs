//! Other simulators and libraries, in virtual environments of Python made from PyPI.

use anyhow::{Context as _, ensure};
use std::path::{Path, PathBuf};
use std::process::Command;

/// A program in `peers/`, what it needs and how it is called.
#[derive(Debug, Clone, Copy)]
pub struct Peer {
    /// Its name in tables.
    pub name: &'static str,
    /// Packages of PyPI.
    pub packages: &'static [&'static str],
    /// What its environment's name ends with: others cannot share one with packages that it pins. Empty: it shares one.
    pub environment: &'static str,
    /// File in `peers/`.
    pub script: &'static str,
    /// Its arguments.
    pub arguments: &'static [&'static str],
    /// What a step or a call is there.
    pub about: &'static str,
}

/// All of them.
pub const PEERS: [Peer; 8] = [
    Peer {
        name: "onnxruntime",
        packages: &["onnxruntime", "onnx", "numpy"],
        environment: "",
        script: "onnx_inference.py",
        arguments: &["compact", "1", "64", "512"],
        about: "the same network, one thread; a call is one `run` on random binary cells",
    },
    torch("PyTorch, compact network, batch 128", &["compact", "128", "2000"]),
    torch("PyTorch, compact network, batch 512", &["compact", "512", "500"]),
    torch("PyTorch, the paper's network, batch 128", &["paper", "128", "500"]),
    torch("PyTorch, the paper's network, batch 512", &["paper", "512", "150"]),
    Peer {
        name: "HighwayEnv, racetrack and parking",
        packages: &["highway-env", "gymnasium", "numpy"],
        environment: "",
        script: "highway_env_steps.py",
        arguments: &[],
        about: "a step is one action with an occupancy grid of 25×25 presence cells (racetrack) or the kinematics that \
                parking has; no distances, no noise",
    },
    Peer {
        name: "IR-SIM",
        packages: &["ir-sim", "numpy"],
        environment: "",
        script: "irsim_steps.py",
        arguments: &[],
        about: "a step moves one Ackermann car among polygons and casts a laser scan of 180 rays; no grid, no noise",
    },
    Peer {
        name: "Tactics2D, parking",
        packages: &["tactics2d==0.1.9"],
        environment: "-tactics2d",
        script: "tactics2d_steps.py",
        arguments: &[],
        about: "a step moves one car for 100 ms (20 Runge-Kutta steps), draws a bird's-eye picture of 200×200 pixels with \
                pygame, casts a laser scan of 360 rays and looks for contact with walls; no grid, no noise",
    },
];

/// PyTorch trains a network: its name, batch and steps.
const fn torch(name: &'static str, arguments: &'static [&'static str]) -> Peer {
    let about = "the same network and loss, channels last, fused Adam, denormals flushed, two threads";
    Peer { name, packages: &["torch", "numpy"], environment: "", script: "torch_training.py", arguments, about }
}

/// Runs a peer in `environment`, or its own beside it, and returns what it printed, line by line.
///
/// # Errors
/// If the environment cannot be made, a package cannot be installed, or the script fails.
pub fn run(peer: &Peer, environment: &Path) -> anyhow::Result<Vec<String>> {
    let mut path = environment.as_os_str().to_owned();
    path.push(peer.environment);
    let python = python(Path::new(&path))?;
    let installed = Command::new(&python).args(["-m", "pip", "install", "--quiet"]).args(peer.packages).output()?;
    ensure!(installed.status.success(), "pip install: {}", String::from_utf8_lossy(&installed.stderr).trim());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers").join(peer.script);
    let output = Command::new(&python).arg(&script).args(peer.arguments).output()?;
    ensure!(output.status.success(), "{}: {}", peer.script, String::from_utf8_lossy(&output.stderr).trim());
    Ok(String::from_utf8_lossy(&output.stdout).lines().map(str::to_owned).collect())
}

/// The interpreter of the environment, which is made if it is not there.
fn python(environment: &Path) -> anyhow::Result<PathBuf> {
    let python = environment.join("bin/python");
    if !python.is_file() {
        let made = Command::new("python3").args(["-m", "venv"]).arg(environment).status().context("python3")?;
        ensure!(made.success(), "python3 -m venv {} failed; install python3-venv", environment.display());
    }
    Ok(python)
}
