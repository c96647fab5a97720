//! Draws the maps in `examples/maps`, `examples/maps-blind` and `examples/maps-blind-2`:
//! `cargo run -p scenarios --example make_maps`. Kinds of ground that the generator does not make, as image files, scaled to
//! the car. The same bytes every time.
#![allow(clippy::unwrap_used, missing_docs, reason = "an example that a person runs")]

mod blind_indoors;
mod blind_outdoors;
mod blind_parking;
mod drawing;
mod first_twelve;
mod last_eight;
mod later_nine;
mod second_indoors;
mod second_outdoors;
mod second_parking;

use drawing::Drawing;
use std::path::{Path, PathBuf};

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples").join(name)
}

fn main() {
    for (name, drawings) in folders() {
        let folder = folder(name);
        std::fs::create_dir_all(&folder).unwrap();
        for drawing in drawings {
            drawing.image().save(folder.join(format!("{}.png", drawing.name))).unwrap();
            for (file, text) in drawing.texts() {
                std::fs::write(folder.join(file), text).unwrap();
            }
        }
    }
}

/// Maps that have been looked at while families and settings were made, and twice those whose makers did not know how any
/// driver fares: the second time when failures on the first had led to families.
fn folders() -> [(&'static str, Vec<Drawing>); 3] {
    let seen = [first_twelve::drawings(), later_nine::drawings(), last_eight::drawings()];
    let blind = [blind_indoors::drawings(), blind_outdoors::drawings(), blind_parking::drawings()];
    let second = [second_indoors::drawings(), second_outdoors::drawings(), second_parking::drawings()];
    [("maps", seen), ("maps-blind", blind), ("maps-blind-2", second)]
        .map(|(name, drawn)| (name, drawn.into_iter().flatten().collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_maps_in_the_folders_are_those_that_are_drawn() {
        for (name, drawings) in folders() {
            let folder = folder(name);
            let mut files = 0;
            for drawing in drawings {
                let kept = image::open(folder.join(format!("{}.png", drawing.name))).unwrap();
                assert!(kept.into_luma8() == drawing.image(), "{}: draw the maps again", drawing.name);
                files += 1;
                for (file, text) in drawing.texts() {
                    let kept = std::fs::read_to_string(folder.join(&file)).unwrap();
                    assert_eq!(kept, text, "{file}: draw the maps again");
                    files += 1;
                }
            }
            assert_eq!(folder.read_dir().unwrap().count(), files, "{name}: something there is not drawn");
        }
    }
}
