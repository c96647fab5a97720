//! Draws the maps in `examples/maps`: `cargo run -p scenarios --example make_maps`. Kinds of ground that the generator
//! does not make, as image files, scaled to the car. The same bytes every time.
#![allow(clippy::unwrap_used, missing_docs, reason = "an example that a person runs")]

mod drawing;
mod first_twelve;
mod last_eight;
mod later_nine;

use drawing::Drawing;
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/maps")
}

fn main() {
    std::fs::create_dir_all(folder()).unwrap();
    for drawing in drawings() {
        drawing.image().save(folder().join(format!("{}.png", drawing.name))).unwrap();
        for (file, text) in drawing.texts() {
            std::fs::write(folder().join(file), text).unwrap();
        }
    }
}

fn drawings() -> Vec<Drawing> {
    first_twelve::drawings().into_iter().chain(later_nine::drawings()).chain(last_eight::drawings()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_maps_in_the_folder_are_those_that_are_drawn() {
        for drawing in drawings() {
            let kept = image::open(folder().join(format!("{}.png", drawing.name))).unwrap();
            assert!(kept.into_luma8() == drawing.image(), "{}: draw the maps again", drawing.name);
            for (file, text) in drawing.texts() {
                assert_eq!(std::fs::read_to_string(folder().join(&file)).unwrap(), text, "{file}: draw the maps again");
            }
        }
    }
}
