//! `cargo xtask <command>`: see [`xtask::cli`] for the commands.

use std::process::ExitCode;

// Training allocates and frees large buffers all the time: a quarter faster than with the system's allocator.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    xtask::main()
}
