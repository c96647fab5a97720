//! ROS `map_server` maps: a YAML file that names an image (<http://wiki.ros.org/map_server>, sections "Map format" and
//! "Value Interpretation"; ROS 2's `nav2_map_server` reads the same).
//!
//! What is drivable: in mode `trinary` what is free (occupancy up to `free_thresh`, below `occupied_thresh`), in the other two an occupancy below
//! 50 %. Unknown is not drivable. Transparent pixels are unknown in every mode.

use super::contour::Mask;
use crate::error::{LoadError, read_text, shortened};
use crate::note::Note;
use image::{DynamicImage, ImageError, ImageReader};
use serde::Deserialize;
use serde::de::IgnoredAny;
use sim::limits::{IMAGE_BYTES_MAX, IMAGE_SIDE_MAX_PX, MAP_COORDINATE_MAX_M, MAP_RESOLUTION_M, MAP_YAML_BYTES_MAX};
use std::collections::BTreeMap;
use std::fmt::Display;
use std::io::{self, Cursor, ErrorKind};
use std::path::{Path, PathBuf};
use storage::{FileError, read};

/// Modes `scale` and `raw`: drivable below this occupancy, per cent.
const DRIVABLE_BELOW_PERCENT: f64 = 50.0;

/// Keys of the YAML file.
const KEYS: [&str; 7] = ["image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh", "mode"];

/// The YAML file. Other keys are ignored, as ROS does, and named in a note.
#[derive(Debug, Clone, PartialEq, Deserialize)]
struct Header {
    image: PathBuf,
    /// Metres per pixel.
    resolution: f64,
    /// Pose of the lower left corner of the lower left pixel: x, y in metres, yaw in radians counter-clockwise.
    origin: [f64; 3],
    #[serde(default)]
    negate: Flag,
    #[serde(default = "occupied_thresh")]
    occupied_thresh: f64,
    #[serde(default = "free_thresh")]
    free_thresh: f64,
    #[serde(default)]
    mode: Mode,
}

// The defaults of nav2_map_server are those of the example in the wiki.
fn occupied_thresh() -> f64 {
    0.65
}

fn free_thresh() -> f64 {
    0.196
}

/// ROS 1 writes 0 and 1, ROS 2 also false and true.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(untagged, expecting = "negate: write 0, 1, false or true")]
enum Flag {
    Word(bool),
    Number(i64),
}

/// Unknown ground, as `map_saver` of ROS 1 and 2 writes it.
const UNKNOWN_GREY: u8 = 205;

impl Default for Flag {
    fn default() -> Self {
        Self::Word(false)
    }
}

impl Flag {
    fn is_set(self) -> bool {
        !matches!(self, Self::Word(false) | Self::Number(0))
    }
}

/// How pixels are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Mode {
    #[default]
    Trinary,
    Scale,
    Raw,
}

/// A map in its own frame.
#[derive(Debug, Clone)]
pub(super) struct Map {
    /// Its drivable pixels.
    pub(super) drivable: Mask,
    /// Metres per pixel.
    pub(super) resolution_m: f64,
    origin_m: [f64; 2],
    /// Cosine and sine.
    yaw: [f64; 2],
}

impl Map {
    /// Reads the YAML file and its image, which must be beside or below it unless it may be anywhere; also what is to be
    /// said about the file.
    ///
    /// # Errors
    /// What is wrong with either, with file, place and remedy.
    pub(super) fn read(path: &Path, is_image_anywhere: bool) -> Result<(Self, PathBuf, Vec<Note>), LoadError> {
        let text = read_text(path, MAP_YAML_BYTES_MAX)?;
        let header = Header::parse(&text, path)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let file = folder.join(&header.image);
        let fault = |problem: String, remedy: &str| LoadError::Map {
            file: path.display().to_string(),
            place: format!("image {}", file.display()),
            problem,
            remedy: remedy.to_owned(),
        };
        let unreadable = |error: std::io::Error| {
            let remedy = match error.kind() {
                ErrorKind::FileTooLarge => "crop it, or halve its resolution",
                _ => "check the key image; paths start at the YAML file",
            };
            if storage::is_of_disk(&error) {
                return FileError::unreadable(&file, &error, remedy).into();
            }
            fault(format!("cannot be read: {error}"), remedy)
        };
        if !read::is_below(folder, &file).map_err(unreadable)? && !is_image_anywhere {
            let problem = "it is neither next to the YAML file nor in a folder below".to_owned();
            let remedy = "put it there, or import the map with cargo xtask generate --image-anywhere";
            return Err(fault(problem, remedy));
        }
        let image = read::bytes(&file, IMAGE_BYTES_MAX).map_err(unreadable)?;
        let (map, notes) = header.map_of(&text, &image).map_err(|(problem, remedy)| fault(problem, &remedy))?;
        Ok((map, file, notes))
    }

    /// [`read`](Self::read), of the text of a YAML file and the bytes of its image.
    ///
    /// # Errors
    /// What is wrong with either.
    pub(super) fn parse(yaml: &str, image: &[u8]) -> Result<(Self, Vec<Note>), LoadError> {
        let file = "map.yaml";
        Header::parse(yaml, Path::new(file))?.map_of(yaml, image).map_err(|(problem, remedy)| LoadError::Map {
            file: file.to_owned(),
            place: "image".to_owned(),
            problem,
            remedy,
        })
    }

    /// The pixel at a point of the map's frame, metres, counted from the lower left.
    pub(super) fn pixel_at(&self, [x_m, y_m]: [f64; 2]) -> [i32; 2] {
        let (x_m, y_m) = (x_m - self.origin_m[0], y_m - self.origin_m[1]);
        let [cos, sin] = self.yaw;
        [x_m * cos + y_m * sin, y_m * cos - x_m * sin].map(|metres| (metres / self.resolution_m).floor() as i32)
    }

    /// The point of the map's frame at pixel coordinates from its lower left corner, metres.
    pub(super) fn point_at(&self, pixel: [f64; 2]) -> [f64; 2] {
        let [along_m, up_m] = pixel.map(|pixels| pixels * self.resolution_m);
        let [cos, sin] = self.yaw;
        [self.origin_m[0] + along_m * cos - up_m * sin, self.origin_m[1] + along_m * sin + up_m * cos]
    }

    /// What is at a pixel that is not drivable, in words.
    pub(super) fn pixel_said(&self, [col, row]: [i32; 2]) -> String {
        let (cols, rows) = (self.drivable.cols as i32, (self.drivable.is_free.len() / self.drivable.cols) as i32);
        if (0..cols).contains(&col) && (0..rows).contains(&row) {
            return format!(
                "pixel ({col}, {}) of the image, from its upper left, is occupied or unknown",
                rows - 1 - row
            );
        }
        let corners = [[0, 0], [cols, 0], [0, rows], [cols, rows]].map(|corner| self.point_at(corner.map(f64::from)));
        let [x, y] = [0, 1].map(|axis| {
            let values = corners.map(|corner| corner[axis]);
            (values.into_iter().fold(f64::INFINITY, f64::min), values.into_iter().fold(f64::NEG_INFINITY, f64::max))
        });
        format!("the map spans x {:.2} to {:.2} and y {:.2} to {:.2}", x.0, x.1, y.0, y.1)
    }
}

impl Header {
    fn parse(text: &str, path: &Path) -> Result<Self, LoadError> {
        let file = path.display().to_string();
        let header: Self = serde_saphyr::from_str(text).map_err(|error| LoadError::Faulty {
            file: file.clone(),
            line: error.location().map_or(1, |location| location.line() as usize),
            problem: shortened(&first_line(&error.without_snippet().to_string())),
            remedy: "a map needs image, resolution, origin: [x, y, yaw] and may have negate, occupied_thresh, \
                     free_thresh, mode (trinary, scale or raw)"
                .to_owned(),
        })?;
        let fault = |key: &str, problem: String, remedy: &str| {
            // The key stands at the start of its line; flow style has one line.
            let line = text.lines().position(|line| line.trim_start().starts_with(key)).unwrap_or(0);
            LoadError::Faulty {
                file: file.clone(),
                line: line + 1,
                problem: format!("{key}: {problem}"),
                remedy: remedy.to_owned(),
            }
        };
        let Self { resolution, origin, negate, occupied_thresh, free_thresh, .. } = header;
        if let Flag::Number(number) = negate
            && !(0..=1).contains(&number)
        {
            return Err(fault("negate", format!("{number} is neither 0 nor 1"), "write 0, or 1 where dark is free"));
        }
        if header.mode == Mode::Raw && negate.is_set() {
            let problem = "it is set, and mode is raw: map_server of ROS 1 negates raw values, that of ROS 2 does not";
            return Err(fault("negate", problem.to_owned(), "write 0, with values that are the occupancy in per cent"));
        }
        if !MAP_RESOLUTION_M.contains(&resolution) {
            let remedy = format!("write metres per pixel, {} to {}", MAP_RESOLUTION_M.start(), MAP_RESOLUTION_M.end());
            return Err(fault("resolution", format!("it is {resolution}"), &remedy));
        }
        let is_far = |value: &&f64| value.is_nan() || value.abs() > MAP_COORDINATE_MAX_M;
        if let Some(value) = origin.iter().find(is_far) {
            return Err(fault("origin", format!("a number is {value}"), "write [x, y, yaw] in metres and radians"));
        }
        for (key, value) in [("occupied_thresh", occupied_thresh), ("free_thresh", free_thresh)] {
            if !(0.0..=1.0).contains(&value) {
                return Err(fault(key, format!("it is {value}"), "write an occupancy from 0 to 1"));
            }
        }
        if free_thresh > occupied_thresh {
            if text.lines().any(|line| line.trim_start().starts_with("free_thresh")) {
                let problem = format!("it is {free_thresh}, above occupied_thresh, {occupied_thresh}");
                return Err(fault("free_thresh", problem, "lower it"));
            }
            let problem = format!("it is {occupied_thresh}, below free_thresh, {free_thresh} where it is not given");
            return Err(fault("occupied_thresh", problem, "raise it, or give free_thresh"));
        }
        Ok(header)
    }

    /// The map, and notes about it; or what is wrong with its image, and the remedy.
    fn map_of(&self, text: &str, image: &[u8]) -> Result<(Map, Vec<Note>), (String, String)> {
        let image = decode(image)?;
        let mut notes = unknown_keys(text);
        notes.extend(self.is_unknown_free(&image).then_some(match self.mode {
            Mode::Scale => Note::UnknownIsScaled,
            Mode::Trinary | Mode::Raw => Note::UnknownIsFree { free_thresh: self.free_thresh },
        }));
        Ok((self.map(&image), notes))
    }

    fn map(&self, image: &DynamicImage) -> Map {
        let (cols, rows) = (image.width() as usize, image.height() as usize);
        // Row 0 of an image is its top, of a mask its bottom.
        let is_free: Vec<bool> = match image {
            // What nearly every map is.
            DynamicImage::ImageLuma8(pixels) => {
                let of_value: Vec<bool> =
                    (0..=u8::MAX).map(|value| self.is_drivable([value, value, value, u8::MAX])).collect();
                let rows = pixels.as_raw().chunks_exact(cols).rev();
                rows.flatten().map(|&value| of_value[usize::from(value)]).collect()
            }
            other => other.to_rgba8().rows().rev().flatten().map(|pixel| self.is_drivable(pixel.0)).collect(),
        };
        assert_eq!(is_free.len(), cols * rows, "every pixel is read");
        Map {
            drivable: Mask { cols, is_free },
            resolution_m: self.resolution,
            origin_m: [self.origin[0], self.origin[1]],
            yaw: [libm::cos(self.origin[2]), libm::sin(self.origin[2])],
        }
    }

    /// Whether the image has pixels of the grey that savers of ROS 1 and 2 write for unknown, and they count as free: with
    /// the thresholds that the saver of ROS 2 writes they do, and in mode `scale` with nearly any.
    fn is_unknown_free(&self, image: &DynamicImage) -> bool {
        let grey = [UNKNOWN_GREY, UNKNOWN_GREY, UNKNOWN_GREY, u8::MAX];
        let is_there = || match image {
            DynamicImage::ImageLuma8(pixels) => pixels.as_raw().contains(&UNKNOWN_GREY),
            other => other.to_rgba8().pixels().any(|pixel| pixel.0 == grey),
        };
        !self.negate.is_set() && self.is_drivable(grey) && is_there()
    }

    /// Red, green, blue, alpha.
    fn is_drivable(&self, [red, green, blue, alpha]: [u8; 4]) -> bool {
        if alpha < u8::MAX {
            return false;
        }
        let value = [red, green, blue].into_iter().map(f64::from).sum::<f64>() / 3.0;
        let occupancy = if self.negate.is_set() { value / 255.0 } else { (255.0 - value) / 255.0 };
        match self.mode {
            // What is at both thresholds is occupied.
            _ if occupancy >= self.occupied_thresh && self.mode != Mode::Raw => false,
            Mode::Trinary => occupancy <= self.free_thresh,
            Mode::Scale if occupancy <= self.free_thresh => true,
            Mode::Scale => {
                let share = (occupancy - self.free_thresh) / (self.occupied_thresh - self.free_thresh);
                100.0 * share < DRIVABLE_BELOW_PERCENT
            }
            // The value is the occupancy in per cent, and above 100 unknown.
            Mode::Raw => value < DRIVABLE_BELOW_PERCENT,
        }
    }
}

/// Bytes of a pixel of the deepest kind: four channels of 16 bits.
const PIXEL_BYTES_MAX: u64 = 8;
/// Bytes that an image may unpack to beside its pixels.
const OTHER_BYTES_MAX: u64 = 4 << 20;

/// Whether the header of a binary PBM, PGM or PPM ends with CRLF, of which a reader takes LF for the first byte of the raster.
/// Whatever lies behind the raster is not read.
fn has_shifted_raster(file: &[u8]) -> bool {
    let (numbers_in_header, channels) = match file {
        [b'P', b'4', ..] => (2, 1),
        [b'P', b'5', ..] => (3, 1),
        [b'P', b'6', ..] => (3, 3),
        _ => return false,
    };
    let mut at = 2;
    let mut numbers = [0_usize; 3];
    for number in &mut numbers[..numbers_in_header] {
        loop {
            match file.get(at) {
                Some(b'#') => at += file[at..].iter().take_while(|byte| **byte != b'\n').count(),
                Some(byte) if byte.is_ascii_whitespace() => at += 1,
                _ => break,
            }
        }
        let digits = file[at..].iter().take_while(|byte| byte.is_ascii_digit()).count();
        *number = std::str::from_utf8(&file[at..at + digits]).ok().and_then(|text| text.parse().ok()).unwrap_or(0);
        at += digits;
    }
    let [width, height, brightest] = numbers;
    let bytes = if brightest > 255 { 2 } else { 1 };
    let row = if numbers_in_header == 2 { width.div_ceil(8) } else { width.saturating_mul(bytes * channels) };
    file[at.min(file.len())..].starts_with(b"\r\n") && file.len() - at >= row.saturating_mul(height).saturating_add(2)
}

/// The image in the bytes of a file, or what is wrong with it, and the remedy.
fn decode(file: &[u8]) -> Result<DynamicImage, (String, String)> {
    let no_image =
        |error: &dyn Display| (format!("not a readable image: {error}"), "save the map as PGM or PNG".to_owned());
    if has_shifted_raster(file) {
        let remedy = "save it with LF in place of CRLF".to_owned();
        return Err(("its header ends with CRLF, which shifts every pixel by one".to_owned(), remedy));
    }
    // No more than the pixels need: what else a file holds, such as colour profiles, may unpack to gigabytes. Already
    // the size is read behind it.
    let reader = |pixels: u64| {
        let mut reader = ImageReader::new(Cursor::new(file)).with_guessed_format()?;
        let mut limits = image::Limits::default();
        limits.max_alloc = Some(pixels * PIXEL_BYTES_MAX + OTHER_BYTES_MAX);
        (limits.max_image_width, limits.max_image_height) = (Some(IMAGE_SIDE_MAX_PX), Some(IMAGE_SIDE_MAX_PX));
        reader.limits(limits);
        Ok(reader)
    };
    let size = reader(0).and_then(|reader| reader.into_dimensions().map_err(io::Error::other));
    let pixels = size.map_or(0, |(width, height)| u64::from(width) * u64::from(height));
    let image = reader(pixels).map_err(|error: io::Error| no_image(&error))?.decode().map_err(|error| match error {
        ImageError::Limits(_) => {
            let remedy = format!(
                "crop it, or halve its resolution, to at most {IMAGE_SIDE_MAX_PX} pixels a side, and save it without colour \
                 profile and texts"
            );
            ("it is too large".to_owned(), remedy)
        }
        error => no_image(&error),
    })?;
    if image.width() == 0 || image.height() == 0 {
        return Err(("it has no pixels".to_owned(), "save the map again".to_owned()));
    }
    Ok(image)
}

/// Keys that mean nothing here, as a misspelt one does.
fn unknown_keys(text: &str) -> Vec<Note> {
    #[expect(clippy::zero_sized_map_values, reason = "keys and values are read together")]
    let keys: BTreeMap<String, IgnoredAny> = serde_saphyr::from_str(text).unwrap_or_default();
    let is_unknown = |key: &String| !KEYS.contains(&key.as_str());
    let keys: Vec<String> = keys.into_keys().filter(is_unknown).map(|key| shortened(&key)).collect();
    if keys.is_empty() { Vec::new() } else { vec![Note::Unused { keys }] }
}

/// A message of the YAML reader on one line, without the place, which is given apart, and advice for programmers.
fn first_line(text: &str) -> String {
    let line = text.lines().next().unwrap_or_default();
    let before = |line: &str, what: &str| line.split(what).next().unwrap_or_default().to_owned();
    before(&before(line, " at line "), ", set DuplicateKeyPolicy").trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Which of the grey values are drivable.
    fn drivable(keys: &str, values: &[u8]) -> Vec<bool> {
        let text = format!("image: x.png\nresolution: 0.1\norigin: [0, 0, 0]\n{keys}");
        let header = Header::parse(&text, Path::new("map.yaml")).unwrap();
        values.iter().map(|&value| header.is_drivable([value, value, value, 255])).collect()
    }

    /// Values beside each threshold, from p = (255 − x)/255 of the wiki.
    #[test]
    fn modes_and_negate_decide_what_is_drivable() {
        // Free below 0.196: x > 205.02. The grey 205 of map_saver is unknown.
        assert_eq!(drivable("", &[255, 254, 206, 205, 128, 0]), [true, true, true, false, false, false]);
        // Occupancies at thresholds, which 51/255 = 0.2 meets exactly: free up to free_thresh, occupied from
        // occupied_thresh on, where they are the same too.
        assert_eq!(drivable("free_thresh: 0.2", &[205, 204, 203]), [true, true, false]);
        let same = "occupied_thresh: 0.2\nfree_thresh: 0.2";
        assert_eq!(drivable(same, &[205, 204, 203]), [true, false, false]);
        assert_eq!(drivable(&format!("{same}\nmode: scale"), &[205, 204, 203]), [true, false, false]);
        // Negated: p = x/255, free for x < 49.98.
        assert_eq!(drivable("negate: 1", &[0, 49, 50, 205, 255]), [true, true, false, false, false]);
        assert_eq!(drivable("negate: true", &[0, 255]), drivable("negate: 1", &[0, 255]));
        assert_eq!(drivable("negate: false", &[0, 255]), [false, true]);
        // 50 % lies at p = (0.2 + 0.6)/2: x = 153.
        let scale = "mode: scale\noccupied_thresh: 0.6\nfree_thresh: 0.2";
        assert_eq!(drivable(scale, &[255, 154, 152, 0]), [true, true, false, false]);
        // Raw values are per cent.
        assert_eq!(drivable("mode: raw", &[0, 49, 50, 100, 101, 255]), [true, true, false, false, false, false]);
    }

    #[test]
    fn colours_are_averaged_and_transparency_is_unknown() {
        let header = Header::parse("{image: x.png, resolution: 1, origin: [0, 0, 0]}", Path::new("map.yaml")).unwrap();
        // 0xeeeeee is free by the wiki's example (0.07); a mean of 206 is just free.
        assert!(header.is_drivable([0xee, 0xee, 0xee, 255]));
        assert!(header.is_drivable([255, 255, 108, 255]));
        assert!(!header.is_drivable([255, 255, 105, 255]));
        assert!(!header.is_drivable([255, 255, 255, 254]));
    }

    /// A PNG of one row that is not compressed: bits per sample, kind of colour, width, chunks before the pixels.
    fn png(bits: u8, colour: u8, width: u8, before: &[(&[u8], &[u8])], row: &[u8]) -> Vec<u8> {
        let crc = |bytes: &[u8]| {
            let of_bit = |crc: u32, _| (crc >> 1) ^ if crc & 1 == 1 { 0xedb8_8320 } else { 0 };
            !bytes.iter().fold(u32::MAX, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), of_bit))
        };
        let chunk = |name: &[u8], data: &[u8]| {
            let named = [name, data].concat();
            [&(data.len() as u32).to_be_bytes()[..], &named[..], &crc(&named).to_be_bytes()[..]].concat()
        };
        // No filter.
        let data = [&[0][..], row].concat();
        let (a, b) = data.iter().fold((1_u32, 0_u32), |(a, b), &byte| (a + u32::from(byte), b + a + u32::from(byte)));
        let (adler, length) = (((b % 65_521) << 16) | (a % 65_521), data.len() as u16);
        let stored = [&length.to_le_bytes()[..], &(!length).to_le_bytes()[..], &data[..]].concat();
        let pixels = [&[0x78, 0x01, 1][..], &stored[..], &adler.to_be_bytes()[..]].concat();
        let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
        file.extend(chunk(&b"IHDR"[..], &[0, 0, 0, width, 0, 0, 0, 1, bits, colour, 0, 0, 0]));
        for &(name, data) in before {
            file.extend(chunk(name, data));
        }
        file.extend(chunk(&b"IDAT"[..], &pixels));
        file.extend(chunk(&b"IEND"[..], &[]));
        file
    }

    /// Only images of 8 bits were tested.
    #[test]
    fn images_of_every_kind_are_read() {
        let deep = [0xff, 0xff, 0xce, 0xce, 0xcd, 0xcd, 0, 0];
        let palette: [(&[u8], &[u8]); 2] = [(b"PLTE", &[255, 255, 255, 255, 255, 255, 0, 0, 0]), (b"tRNS", &[255, 0])];
        let header = |keys: &str| {
            let text = format!("image: x.png\nresolution: 1\norigin: [0, 0, 0]\n{keys}");
            Header::parse(&text, Path::new("map.yaml")).unwrap()
        };
        // White, the darkest grey that is free, the lightest that is not, and black; of two values each twice.
        for (kind, file, expected) in [
            ("PGM, 16 bits", [&b"P5 4 1 65535\n"[..], &deep[..]].concat(), [true, true, false, false]),
            ("PGM up to 100", b"P2 4 1 100\n100 81 80 0\n".to_vec(), [true, true, false, false]),
            ("PBM, plain", b"P1 4 1\n0 0 1 1\n".to_vec(), [true, true, false, false]),
            ("PBM", b"P4\n4 1\n\x30".to_vec(), [true, true, false, false]),
            ("PNG, 16 bits", png(16, 0, 4, &[], &deep), [true, true, false, false]),
            ("PNG, 1 bit", png(1, 0, 4, &[], &[0xc0]), [true, true, false, false]),
            // White, transparent white, black, and white; with alpha a little transparent, and the darkest that is free.
            ("PNG, palette", png(8, 3, 4, &palette, &[0, 1, 2, 0]), [true, false, false, true]),
            ("PNG, alpha", png(8, 4, 4, &[], &[255, 255, 255, 254, 0, 255, 206, 255]), [true, false, false, true]),
        ] {
            let image = decode(&file).unwrap_or_else(|(problem, _)| panic!("{kind}: {problem}"));
            assert_eq!(header("").map(&image).drivable.is_free, expected, "{kind}");
        }
        // Values are brought to 0…255 first, raw ones too: 19 is read as 48, 20 as 51.
        let image = decode(b"P2 4 1 100\n0 19 20 100\n").unwrap();
        assert_eq!(header("mode: raw").map(&image).drivable.is_free, [true, true, false, false]);
    }

    /// LF of a header that ends with CRLF was read as the first pixel, and every other one lay one further on.
    #[test]
    fn a_header_that_ends_with_crlf_is_refused() {
        let image = |header: &str| [header.as_bytes(), &[0, 255, 255, 0]].concat();
        assert_eq!(decode(&image("P5\n# by hand\n2 2\n255\n")).unwrap().to_luma8().into_raw(), [0, 255, 255, 0]);
        // As a single white space, CR is as good as LF.
        assert_eq!(decode(&image("P5 2 2 255\r")).unwrap().to_luma8().into_raw(), [0, 255, 255, 0]);
        let shifted = image("P5\r\n# by hand\r\n2 2\r\n255\r\n");
        // What lies behind the raster changes nothing; of a bitmap, four rows of a byte each.
        for file in [&shifted, &[&shifted[..], b"\n"].concat(), &image("P4\r\n8 4\r\n")] {
            let (problem, _) = decode(file).unwrap_err();
            assert!(problem.contains("CRLF"), "{problem}");
        }
    }

    /// Rows run down in the image and up in the mask; pixels and points are each other's inverse.
    #[test]
    fn rows_and_frames_are_the_right_way_up() {
        let text = "{image: x.png, resolution: 0.5, origin: [-3, 7, 0.6]}";
        let image = DynamicImage::ImageLuma8(image::ImageBuffer::from_raw(2, 2, vec![255, 0, 0, 0]).unwrap());
        let map = Header::parse(text, Path::new("map.yaml")).unwrap().map(&image);
        assert_eq!(map.drivable.is_free, [false, false, true, false], "white is upper left");
        for pixel in [[0, 0], [5, 1], [-2, 9]] {
            assert_eq!(map.pixel_at(map.point_at(pixel.map(|k| f64::from(k) + 0.5))), pixel);
        }
        assert_eq!(map.point_at([0.0, 0.0]), [-3.0, 7.0]);
    }
}
