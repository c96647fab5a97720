//! What a run leaves behind opens elsewhere.

use crate::bench::{scratch, succeed, xtask};
use ndarray::Array2;

#[test]
fn data_sets_are_npy_and_weights_are_safetensors() {
    let run = scratch("formats").join("run");
    succeed(xtask().args(["train-bc", "--preset", "smoke", "--no-eval", "--out"]).arg(&run));
    let round = run.join("round-00");
    let grids: Array2<u8> = ndarray_npy::read_npy(round.join("grids.npy")).unwrap();
    let labels: Array2<f32> = ndarray_npy::read_npy(round.join("labels.npy")).unwrap();
    let (n, bytes) = grids.dim();
    assert_eq!(bytes, 79, "625 bits");
    assert_eq!(labels.dim(), (n, 3));
    assert!(n > 500, "one way round lot a takes more than {n} ticks");
    assert!(grids.column(78).iter().all(|&last| last.trailing_zeros() >= 7), "7 bits of the last byte are not cells");
    assert!(labels.iter().all(|value| (0.0..=1.0).contains(value)), "labels are image fractions");
    assert!(labels.column(2).iter().all(|&tau_hat| tau_hat == 0.0), "behaviour cloning has no τ̂");

    let bytes = std::fs::read(round.join("model.safetensors")).unwrap();
    let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    for (name, dimensions) in [("conv1.weight", 4), ("conv2.weight", 4), ("fc1.weight", 2), ("fc2.weight", 2)] {
        assert_eq!(tensors.tensor(name).unwrap().shape().len(), dimensions, "{name}");
    }
    assert_eq!(tensors.tensor("fc2.bias").unwrap().shape(), [10], "two modes");
}
