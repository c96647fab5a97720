//! samples/s of a real training: train_speed ROUND_STORE NET BATCH STEPS
use policy::dataset::store::Store;
use policy::dataset::{Dataset, ValidationSplit};
use policy::fit::{FitContext, FitProgress, FitSettings, KeepWeights, fit};
use policy::network::{DeviceChoice, InferenceSettings, NetworkArchitecture, Weights};
use sim::seed::RootSeed;
use sim::sensing::GridGeometry;
use std::ops::ControlFlow;
use std::time::Instant;
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let store = Store::open(std::path::Path::new(&a[1])).unwrap();
    let mut dataset = Dataset::default();
    dataset.push(store.read_round(0).unwrap().0);
    let net = if a[2] == "paper" { NetworkArchitecture::paper() } else { NetworkArchitecture::compact() };
    let (batch, steps): (usize, u32) = (a[3].parse().unwrap(), a[4].parse().unwrap());
    let settings = FitSettings {
        batch,
        validation: ValidationSplit::none(),
        keep: KeepWeights::Last,
        validate_every: 0,
        ..FitSettings::quick(steps)
    };
    let start = Instant::now();
    let mut marks = Vec::new();
    let mut progress = |now: &FitProgress| {
        if now.step % (steps / 5) == 0 {
            marks.push((now.samples_done, start.elapsed().as_secs_f64()));
        }
        ControlFlow::Continue(())
    };
    let context = FitContext {
        geometry: GridGeometry::paper(),
        inference: InferenceSettings::plain(),
        device: DeviceChoice::Cpu,
        seed: RootSeed(1),
    };
    let out = fit(Weights::init(net, RootSeed(1), 0), &dataset, &settings, context, &mut progress).unwrap();
    let mut last = (0, 0.0);
    let parts: Vec<String> = marks
        .iter()
        .map(|m| {
            let r = (m.0 - last.0) as f64 / (m.1 - last.1);
            last = *m;
            format!("{r:.0}")
        })
        .collect();
    println!(
        "{} batch {batch} steps {steps}: {:.0} samples/s ({}) loss {:?}",
        a[2],
        last.0 as f64 / last.1,
        parts.join(" "),
        out.report.curve.last().unwrap().training.total
    );
}
