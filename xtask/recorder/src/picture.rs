//! Pictures of a few colours as PNG with a palette: a view of 200×200 pixels takes one or two kilobytes.

use anyhow::Context as _;
use png::{BitDepth, ColorType, Compression, Encoder};
use protocol::Picture;

/// Encodes a picture.
///
/// # Errors
/// If a pixel has no colour.
pub fn png(picture: &Picture) -> anyhow::Result<Vec<u8>> {
    let width = picture.width as usize;
    let (depth, bits) = match picture.palette.len() {
        0..=2 => (BitDepth::One, 1),
        3..=4 => (BitDepth::Two, 2),
        _ => (BitDepth::Four, 4),
    };
    let darkest_unknown = 1_u8 << bits;
    anyhow::ensure!(picture.pixels.iter().all(|&pixel| pixel < darkest_unknown), "a pixel without a colour");
    let rows = picture.pixels.chunks_exact(width);
    let packed: Vec<u8> = rows.clone().flat_map(|row| pack(row, bits)).collect();
    let mut bytes = Vec::with_capacity(4096);
    let mut encoder = Encoder::new(&mut bytes, picture.width, rows.len() as u32);
    encoder.set_color(ColorType::Indexed);
    encoder.set_depth(depth);
    encoder.set_palette(picture.palette.as_flattened());
    encoder.set_compression(Compression::Balanced);
    // Neighbouring bytes of packed indices have nothing to subtract.
    encoder.set_filter(png::Filter::NoFilter);
    let mut writer = encoder.write_header().context("a picture")?;
    writer.write_image_data(&packed).context("a picture")?;
    drop(writer);
    Ok(bytes)
}

/// Pixels of a row, the first in the highest bits.
fn pack(row: &[u8], bits: usize) -> impl Iterator<Item = u8> {
    let per_byte = 8 / bits;
    row.chunks(per_byte)
        .map(move |pixels| pixels.iter().enumerate().fold(0, |byte, (i, pixel)| byte | pixel << (8 - bits * (i + 1))))
}
