//! Pictures of a few colours as PNG with a palette: a view of 200×200 pixels takes one or two kilobytes.

use png::{BitDepth, ColorType, Compression, Encoder};
use rerun::EncodedImage;

/// A picture of a few colours.
pub(crate) struct Picture {
    /// Pixels per row.
    pub(crate) width: u32,
    /// Index into the palette, row by row from the top left.
    pub(crate) pixels: Vec<u8>,
    /// Red, green, blue; at most 16 colours.
    pub(crate) palette: Vec<[u8; 3]>,
}

impl Picture {
    /// As Rerun shows it.
    ///
    /// # Panics
    /// If a pixel has no colour.
    pub(crate) fn encoded(&self) -> EncodedImage {
        EncodedImage::new(self.png()).with_media_type("image/png")
    }

    fn png(&self) -> Vec<u8> {
        let (depth, bits) = match self.palette.len() {
            0..=2 => (BitDepth::One, 1),
            3..=4 => (BitDepth::Two, 2),
            _ => (BitDepth::Four, 4),
        };
        assert!(self.pixels.iter().all(|&pixel| usize::from(pixel) < self.palette.len()), "a pixel without a colour");
        let rows = self.pixels.chunks_exact(self.width as usize);
        let packed: Vec<u8> = rows.clone().flat_map(|row| pack(row, bits)).collect();
        let mut bytes = Vec::with_capacity(4096);
        let mut encoder = Encoder::new(&mut bytes, self.width, rows.len() as u32);
        encoder.set_color(ColorType::Indexed);
        encoder.set_depth(depth);
        encoder.set_palette(self.palette.as_flattened());
        encoder.set_compression(Compression::Balanced);
        // Neighbouring bytes of packed indices have nothing to subtract.
        encoder.set_filter(png::Filter::NoFilter);
        let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(&packed));
        written.expect("a vector takes every byte, and the sizes agree");
        bytes
    }
}

/// Pixels of a row, the first in the highest bits.
fn pack(row: &[u8], bits: usize) -> impl Iterator<Item = u8> {
    let per_byte = 8 / bits;
    row.chunks(per_byte)
        .map(move |pixels| pixels.iter().enumerate().fold(0, |byte, (i, pixel)| byte | pixel << (8 - bits * (i + 1))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_keep_their_pixels_and_stay_small() {
        let palette = [[0, 0, 0], [255, 255, 255], [255, 0, 0], [0, 0, 255]];
        for colours in 2..=4 {
            let pixels: Vec<u8> = (0..200 * 200).map(|i| (i / 8 % colours) as u8).collect();
            let picture = Picture { width: 200, pixels, palette: palette[..colours].to_vec() };
            let png = picture.png();
            assert!(png.len() < 2000, "{} bytes", png.len());
            let mut decoder = png::Decoder::new(std::io::Cursor::new(&png));
            decoder.set_transformations(png::Transformations::EXPAND);
            let mut reader = decoder.read_info().unwrap();
            let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut rgb).unwrap();
            assert_eq!(rgb.len(), 200 * 200 * 3);
            for (pixel, index) in rgb.as_chunks::<3>().0.iter().zip(&picture.pixels) {
                assert_eq!(*pixel, palette[usize::from(*index)]);
            }
        }
    }
}
