//! Frames as an animated GIF or PNG: one palette for all, and of every frame only what changed. The same frames give the
//! same bytes.

use rayon::prelude::*;
use std::fmt;
use tiny_skia::Pixmap;

/// What an animation is written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Plays everywhere.
    Gif,
    /// Animated PNG; programs that do not know it show the first frame.
    Apng,
}

impl Format {
    /// Ending of the file's name.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Gif => "gif",
            Self::Apng => "png",
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Gif => "GIF",
            Self::Apng => "APNG",
        })
    }
}

/// Colours of the palette; one entry more stands for "as before".
const COLOURS: usize = 255;
const AS_BEFORE: u8 = 255;
/// Frames that decide the palette, evenly spaced.
const PALETTE_FRAMES: usize = 12;
/// Bits per channel by which colours are told apart.
const BITS: u32 = 5;
/// How long the last frame stays, hundredths of a second.
const LAST_CS: u16 = 200;

/// Frames of one size in one palette.
#[derive(Debug, Clone)]
pub struct Reel {
    width_px: usize,
    height_px: usize,
    /// Red, green and blue of 256 entries; the last one is not a colour.
    palette: Vec<u8>,
    /// An index per pixel, row by row.
    frames: Vec<Vec<u8>>,
}

/// The part of a frame that differs from the frame before.
struct Patch {
    left: usize,
    top: usize,
    width: usize,
    height: usize,
    indices: Vec<u8>,
}

impl Reel {
    /// Draws frames `0..count`; all must have the size of the first.
    ///
    /// # Panics
    /// Without frames, or with frames of several sizes.
    pub fn draw(count: usize, frame: impl Fn(usize) -> Pixmap + Sync) -> Self {
        assert!(count > 0, "an animation has frames");
        let step = count.div_ceil(PALETTE_FRAMES);
        let samples: Vec<Pixmap> =
            (0..count).step_by(step).chain([count - 1]).collect::<Vec<_>>().par_iter().map(|&i| frame(i)).collect();
        let palette = palette(&samples);
        let indices = nearest(&palette);
        let (width_px, height_px) = (samples[0].width() as usize, samples[0].height() as usize);
        let indexed = |i: usize| {
            let pixmap = frame(i);
            assert_eq!((pixmap.width() as usize, pixmap.height() as usize), (width_px, height_px), "frame {i}");
            pixmap.data().chunks_exact(4).map(|rgba| indices[bin(rgba)]).collect()
        };
        Self { width_px, height_px, palette, frames: (0..count).into_par_iter().map(indexed).collect() }
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Never: a reel has frames.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// The animation in at most `limit` bytes: every frame, or every second, third … sixth one, for as much longer each.
    /// Returns the stride, too.
    ///
    /// # Errors
    /// If it is larger all the same, or cannot be encoded.
    pub fn encode_within(&self, limit: usize, delay_cs: u16, format: Format) -> anyhow::Result<(Vec<u8>, usize)> {
        for stride in 1..=6 {
            let bytes = self.encode(stride, delay_cs, format)?;
            if bytes.len() <= limit {
                return Ok((bytes, stride));
            }
        }
        anyhow::bail!(
            "the animation is larger than {} kB; choose a shorter part with --from and --to, or a higher --speed",
            limit / 1000
        )
    }

    /// Every `stride`-th frame, `stride * delay_cs` hundredths of a second each; the last one stays longer.
    ///
    /// # Errors
    /// If it cannot be encoded.
    pub fn encode(&self, stride: usize, delay_cs: u16, format: Format) -> anyhow::Result<Vec<u8>> {
        let mut chosen: Vec<&[u8]> = self.frames.iter().step_by(stride).map(Vec::as_slice).collect();
        if let Some(last) = self.frames.last().filter(|_| !(self.len() - 1).is_multiple_of(stride)) {
            chosen.push(last);
        }
        let delay_cs = delay_cs * stride as u16;
        let before = std::iter::once(None).chain(chosen.iter().copied().map(Some));
        let patches: Vec<Patch> = before.zip(&chosen).map(|(before, now)| self.patch(before, now)).collect();
        let delays = (1..=patches.len()).map(|i| if i == patches.len() { LAST_CS } else { delay_cs });
        match format {
            Format::Gif => self.to_gif(&patches, delays),
            Format::Apng => self.to_apng(&patches, delays),
        }
    }

    fn patch(&self, before: Option<&[u8]>, now: &[u8]) -> Patch {
        let width = self.width_px;
        let Some(before) = before else {
            return Patch { left: 0, top: 0, width, height: self.height_px, indices: now.to_vec() };
        };
        let rows = || before.chunks_exact(width).zip(now.chunks_exact(width));
        let changed: Vec<usize> = rows().enumerate().filter(|(_, (a, b))| a != b).map(|(row, _)| row).collect();
        let (Some(&top), Some(&bottom)) = (changed.first(), changed.last()) else {
            return Patch { left: 0, top: 0, width: 1, height: 1, indices: vec![AS_BEFORE] };
        };
        let (mut left, mut right) = (width, 0);
        for (a, b) in rows().skip(top).take(bottom + 1 - top).filter(|(a, b)| a != b) {
            let differs = |&i: &usize| a[i] != b[i];
            left = (0..left).find(differs).unwrap_or(left);
            right = (right..width).rev().find(differs).unwrap_or(right);
        }
        let part = rows().skip(top).take(bottom + 1 - top);
        let indices = part.flat_map(|(a, b)| {
            let pairs = a[left..=right].iter().zip(&b[left..=right]);
            pairs.map(|(a, b)| if a == b { AS_BEFORE } else { *b })
        });
        Patch { left, top, width: right + 1 - left, height: bottom + 1 - top, indices: indices.collect() }
    }

    fn to_gif(&self, patches: &[Patch], delays: impl Iterator<Item = u16>) -> anyhow::Result<Vec<u8>> {
        let (width, height) = (u16::try_from(self.width_px)?, u16::try_from(self.height_px)?);
        let mut encoder = gif::Encoder::new(Vec::new(), width, height, &self.palette)?;
        encoder.set_repeat(gif::Repeat::Infinite)?;
        for (patch, delay) in patches.iter().zip(delays) {
            encoder.write_frame(&gif::Frame {
                delay,
                dispose: gif::DisposalMethod::Keep,
                transparent: Some(AS_BEFORE),
                left: patch.left as u16,
                top: patch.top as u16,
                width: patch.width as u16,
                height: patch.height as u16,
                buffer: patch.indices.as_slice().into(),
                ..gif::Frame::default()
            })?;
        }
        Ok(encoder.into_inner()?)
    }

    fn to_apng(&self, patches: &[Patch], delays: impl Iterator<Item = u16>) -> anyhow::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width_px as u32, self.height_px as u32);
        encoder.set_color(png::ColorType::Indexed);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_filter(png::Filter::NoFilter);
        encoder.set_palette(self.palette.as_slice());
        let mut opacity = vec![255; COLOURS];
        opacity.push(0);
        encoder.set_trns(opacity);
        encoder.set_animated(patches.len() as u32, 0)?;
        encoder.set_blend_op(png::BlendOp::Over)?;
        let mut writer = encoder.write_header()?;
        for (patch, delay) in patches.iter().zip(delays) {
            writer.reset_frame_position()?;
            writer.set_frame_dimension(patch.width as u32, patch.height as u32)?;
            writer.set_frame_position(patch.left as u32, patch.top as u32)?;
            writer.set_frame_delay(delay, 100)?;
            writer.write_image_data(&patch.indices)?;
        }
        writer.finish()?;
        Ok(bytes)
    }
}

/// Colours that look alike have the same number.
fn bin(rgba: &[u8]) -> usize {
    let part = |channel: u8| usize::from(channel >> (8 - BITS));
    part(rgba[0]) << (2 * BITS) | part(rgba[1]) << BITS | part(rgba[2])
}

/// The most frequent colours: mean of what falls into a bin.
fn palette(samples: &[Pixmap]) -> Vec<u8> {
    let mut bins = vec![[0_u64; 4]; 1 << (3 * BITS)];
    for rgba in samples.iter().flat_map(|pixmap| pixmap.data().chunks_exact(4)) {
        let [count, sums @ ..] = &mut bins[bin(rgba)];
        *count += 1;
        for (sum, &channel) in sums.iter_mut().zip(rgba) {
            *sum += u64::from(channel);
        }
    }
    bins.sort_by(|a, b| b.cmp(a));
    let seen = bins.iter().take(COLOURS).filter(|[count, ..]| *count > 0);
    let mut palette: Vec<u8> = seen.flat_map(|[count, sums @ ..]| sums.map(|sum| (sum / count) as u8)).collect();
    palette.resize(3 * (COLOURS + 1), 0);
    palette
}

/// The nearest colour of the palette for every bin.
fn nearest(palette: &[u8]) -> Vec<u8> {
    let middle = |part: usize| ((part << (8 - BITS)) | (1 << (7 - BITS))) as i32;
    let mask = (1 << BITS) - 1;
    let of_bin = |bin: usize| {
        let wanted = [bin >> (2 * BITS), bin >> BITS & mask, bin & mask].map(middle);
        let distance = |rgb: &[u8]| -> i32 {
            wanted.iter().zip(rgb).map(|(wanted, &channel)| (wanted - i32::from(channel)).pow(2)).sum()
        };
        let colours = palette.chunks_exact(3).take(COLOURS).enumerate();
        colours.min_by_key(|(_, rgb)| distance(rgb)).map_or(0, |(index, _)| index as u8)
    };
    (0..1 << (3 * BITS)).into_par_iter().map(of_bin).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pictures::drawing::{Drawing, Font, Rgb};
    use sim::geometry::Vec2;

    const GROUND: Rgb = [0xEE, 0xEC, 0xE6];

    /// A disc that moves over a text, and stands still from the fifteenth frame on.
    fn frame(i: usize) -> Pixmap {
        let mut drawing = Drawing::new(Vec2::new(120.0, 80.0), GROUND).unwrap();
        drawing.text("0123456789", Vec2::new(10.0, 50.0), Font::Small, [0x22; 3]);
        drawing.disc(Vec2::new(20.0 + 5.0 * i.min(15) as f32, 30.0), 12.0, [0xD0, 0, 0]);
        drawing.pixmap()
    }

    /// Frames as a viewer composes them, with their delays.
    fn decoded_gif(bytes: &[u8]) -> Vec<(Vec<u8>, u16)> {
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(bytes).unwrap();
        assert_eq!(decoder.repeat(), gif::Repeat::Infinite);
        let (width, height) = (usize::from(decoder.width()), usize::from(decoder.height()));
        let mut canvas = vec![0; 4 * width * height];
        let mut frames = Vec::new();
        while let Some(frame) = decoder.read_next_frame().unwrap() {
            let of_row = 4 * usize::from(frame.width);
            for (row, pixels) in frame.buffer.chunks_exact(of_row).enumerate() {
                let start = 4 * ((usize::from(frame.top) + row) * width + usize::from(frame.left));
                for (below, above) in canvas[start..start + of_row].chunks_exact_mut(4).zip(pixels.chunks_exact(4)) {
                    if above[3] > 0 {
                        below.copy_from_slice(above);
                    }
                }
            }
            frames.push((canvas.clone(), frame.delay));
        }
        frames
    }

    #[test]
    fn a_gif_shows_what_was_drawn() {
        let reel = Reel::draw(20, frame);
        let bytes = reel.encode(1, 10, Format::Gif).unwrap();
        let frames = decoded_gif(&bytes);
        assert_eq!(frames.len(), 20);
        assert_eq!((frames[0].1, frames[19].1), (10, LAST_CS));
        for (i, (shown, _)) in frames.iter().enumerate() {
            let drawn = frame(i);
            let furthest = shown.iter().zip(drawn.data()).map(|(a, b)| a.abs_diff(*b)).max();
            assert!(furthest.unwrap() <= 16, "frame {i} is off by {furthest:?}");
        }
    }

    #[test]
    fn an_apng_has_all_frames() {
        let bytes = Reel::draw(20, frame).encode(1, 10, Format::Apng).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
        assert_eq!(reader.info().animation_control.unwrap().num_frames, 20);
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        for _ in 0..20 {
            reader.next_frame(&mut pixels).unwrap();
        }
    }

    #[test]
    fn the_same_frames_give_the_same_bytes() {
        for format in [Format::Gif, Format::Apng] {
            let [once, again] = [(); 2].map(|()| Reel::draw(20, frame).encode(1, 10, format).unwrap());
            assert!(once == again, "{format}");
        }
    }

    #[test]
    fn too_large_an_animation_drops_frames_and_says_so_if_that_is_not_enough() {
        let reel = Reel::draw(20, frame);
        let whole = reel.encode(1, 10, Format::Gif).unwrap().len();
        let (bytes, stride) = reel.encode_within(whole - 1, 10, Format::Gif).unwrap();
        assert!(bytes.len() < whole && stride > 1);
        let frames = decoded_gif(&bytes);
        assert_eq!(frames[0].1, 10 * stride as u16, "it plays as fast as before");
        assert_eq!(frames.last().unwrap().0, decoded_gif(&reel.encode(1, 10, Format::Gif).unwrap())[19].0);
        let error = reel.encode_within(100, 10, Format::Gif).unwrap_err().to_string();
        assert!(error.contains("--from"), "{error}");
    }
}
