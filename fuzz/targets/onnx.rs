//! A network in an ONNX file.
#![no_main]

use libfuzzer_sys::fuzz_target;
use onnx::network::OnnxNetwork;

// The runtime panics at some files, which the loader catches: the hook that ends the process is not wanted.
fuzz_target!(init: std::panic::set_hook(Box::new(|_| {})), |file: &[u8]| {
    drop(OnnxNetwork::load(&fuzz::write("network.onnx", file)));
});
