//! Nothing here: the package exists for its one test binary, `main.rs`.
