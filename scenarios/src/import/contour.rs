//! Outlines of drivable pixels: crack following and Douglas–Peucker simplification.
//!
//! Drivable pixels are joined by their sides, others also by their corners, so that every drivable region has one outline
//! and nothing thinner than a pixel opens a wall. Outlines follow the pixels' sides exactly; where two of them would
//! touch at a corner, both are cut back a quarter of a pixel.
//!
//! Coordinates are pixels: x to the right, y up, (0, 0) the lower left corner of the map.

use geo::{LineString, Polygon, Simplify as _};

/// Steps of simplification, pixels: the first that leaves sound polygons is taken. A staircase of 45° deviates from its
/// line by 0.71.
pub(super) const TOLERANCES_PX: [f64; 3] = [0.75, 0.25, 0.0];
/// Outlines of no more corners than this are kept as they are: single pixels would lose half of their area.
const SMALL_CORNERS: usize = 8;
/// Outlines of more corners are simplified in pieces: what is simplified may take as many steps as the square of its corners.
const LARGE_CORNERS: usize = 20_000;
/// Corners of such a piece.
const PIECE_CORNERS: usize = 1_000;
/// Cut where outlines would touch, pixels.
const CUT_PX: f64 = 0.25;
/// Directions of travel along the bottom, right, top and left side of a pixel, which then lies to the left.
const ALONG: [[i32; 2]; 4] = [[1, 0], [0, 1], [-1, 0], [0, -1]];

/// A closed outline; the last point joins the first.
pub(super) type Ring = Vec<[f64; 2]>;

/// Which pixels are drivable, row by row from the bottom.
#[derive(Debug, Clone)]
pub(super) struct Mask {
    /// Pixels per row.
    pub(super) cols: usize,
    /// `true` = drivable; a whole number of rows.
    pub(super) is_free: Vec<bool>,
}

impl Mask {
    /// Whether a pixel is drivable; outside the map nothing is.
    pub(super) fn at(&self, [col, row]: [i32; 2]) -> bool {
        self.index([col, row]).is_some_and(|index| self.is_free[index])
    }

    fn index(&self, [col, row]: [i32; 2]) -> Option<usize> {
        let (col, row) = (usize::try_from(col).ok()?, usize::try_from(row).ok()?);
        let index = row * self.cols + col;
        (col < self.cols && index < self.is_free.len()).then_some(index)
    }

    /// The drivable pixels that can be reached from one of them by steps over sides.
    #[must_use]
    pub(super) fn region_of(&self, seed: [i32; 2]) -> Self {
        let mut region = Self { cols: self.cols, is_free: vec![false; self.is_free.len()] };
        let mut reach = |pixel: [i32; 2], reached: &mut Vec<[i32; 2]>| {
            if let Some(index) = self.index(pixel).filter(|&index| self.is_free[index] && !region.is_free[index]) {
                region.is_free[index] = true;
                reached.push(pixel);
            }
        };
        // Nearest first: the front is hardly longer than the map is wide, where a stack would hold most of its pixels.
        let (mut front, mut next) = (Vec::new(), Vec::new());
        reach(seed, &mut front);
        while !front.is_empty() {
            for pixel in front.drain(..) {
                for step in ALONG {
                    reach(ahead(pixel, step), &mut next);
                }
            }
            std::mem::swap(&mut front, &mut next);
        }
        region
    }

    /// How many corners its outlines have, cuts aside.
    pub(super) fn corners(&self) -> usize {
        let (cols, rows) = (self.cols as i32, (self.is_free.len() / self.cols) as i32);
        let turns_at = |[x, y]: [i32; 2]| {
            // Free pixels below and above a corner of the raster.
            let [a, b, c, d] = [[x - 1, y - 1], [x, y - 1], [x - 1, y], [x, y]].map(|pixel| self.at(pixel));
            match [a, b, c, d].into_iter().filter(|&is_free| is_free).count() {
                1 | 3 => 1,
                2 if a == d => 2,
                _ => 0,
            }
        };
        (0..=rows).flat_map(|y| (0..=cols).map(move |x| [x, y])).map(turns_at).sum()
    }

    /// How many islands a region encloses.
    pub(super) fn islands(&self) -> usize {
        self.specks(|_| true).len()
    }

    /// A region with the specks that it encloses taken for free, up to an area, and how many.
    pub(super) fn without_specks(mut self, up_to_px2: f64) -> (Self, usize) {
        let specks = self.specks(|area_px2| area_px2 <= up_to_px2);
        for pixel in specks.iter().flat_map(pixels_within) {
            if let Some(index) = self.index(pixel) {
                self.is_free[index] = true;
            }
        }
        (self, specks.len())
    }

    /// A region with the specks that it encloses made at least as large as an area, and how many. Specks become boxes of
    /// pixels; the region is what is still joined to the seed.
    pub(super) fn with_large_specks(self, seed: [i32; 2], area_min_px2: f64) -> (Self, usize) {
        let (mut region, mut count) = (self, 0);
        loop {
            let specks = region.specks(|area_px2| area_px2 < area_min_px2);
            if specks.is_empty() {
                return (region, count);
            }
            count += specks.len();
            for speck in &specks {
                region.block_around(speck, area_min_px2);
            }
            region = region.region_of(seed);
        }
    }

    /// A region with what is thinner made as many pixels thick, and how many pixels that took; the region is what is still
    /// joined to the seed. Bumps of something thick, which reach no farther out of it than that, stay as they are.
    pub(super) fn with_thick_walls(self, seed: [i32; 2], thickness_px: usize) -> (Self, usize) {
        let is_thin = self.thin_pixels(thickness_px);
        if !is_thin.contains(&true) {
            return (self, 0);
        }
        let mut thick = self.clone();
        let (cols, rows) = (self.cols, self.is_free.len() / self.cols);
        let lines = (0..rows).map(|row| (row * cols, 1, cols)).chain((0..cols).map(|col| (col, cols, rows)));
        for (first, apart, pixels) in lines {
            let index = |pixel: usize| first + pixel * apart;
            let mut last_free = None;
            for free in (0..pixels).filter(|&pixel| self.is_free[index(pixel)]) {
                // Blocked pixels between two free ones.
                let Some(last_free) = last_free.replace(free) else { continue };
                let missing = thickness_px.saturating_sub(free - last_free - 1);
                if missing > 0 && (last_free + 1..free).any(|pixel| is_thin[index(pixel)]) {
                    let before = (last_free + 1).saturating_sub(missing / 2);
                    let end = (free + missing.div_ceil(2)).min(pixels);
                    (before..end).for_each(|pixel| thick.is_free[index(pixel)] = false);
                }
            }
        }
        let free = |mask: &Self| mask.is_free.iter().filter(|&&is_free| is_free).count();
        let added = free(&self) - free(&thick);
        (thick.region_of(seed), added)
    }

    /// The blocked pixels that belong to nothing thick: a square of as many pixels a side has no room in what is blocked
    /// around them, nor as near as that.
    fn thin_pixels(&self, thickness_px: usize) -> Vec<bool> {
        // With what lies around the map, which is blocked. Squares are at their upper right pixel.
        let (before, around) = (thickness_px, 3 * thickness_px - 1);
        let cols = self.cols + around;
        let mut values = vec![false; cols * (self.is_free.len() / self.cols + around)];
        for (row, of_map) in values.chunks_exact_mut(cols).skip(before).zip(self.is_free.chunks_exact(self.cols)) {
            row[before..before + self.cols].copy_from_slice(of_map);
        }
        spread(&mut values, cols, thickness_px);
        for holds_free in &mut values {
            *holds_free = !*holds_free;
        }
        spread(&mut values, cols, 3 * thickness_px);
        let is_near = |index: usize| values[(index / self.cols + around) * cols + index % self.cols + around];
        self.is_free.iter().enumerate().map(|(index, is_free)| !is_free && !is_near(index)).collect()
    }

    /// Outlines of what a region encloses, of areas that count, square pixels.
    fn specks(&self, counts: impl Fn(f64) -> bool) -> Vec<Ring> {
        let is_speck = |ring: &Ring| {
            let area_px2 = signed_area_px2(ring);
            area_px2 < 0.0 && counts(-area_px2)
        };
        self.outlines().into_iter().filter(is_speck).collect()
    }

    /// Blocks the pixels of a box around a speck that has at least an area.
    fn block_around(&mut self, speck: &Ring, area_min_px2: f64) {
        let (mut cols, mut rows) = box_around(speck);
        for grown in 0.. {
            let area_px2 = f64::from(cols.1 - cols.0) * f64::from(rows.1 - rows.0);
            if area_px2 >= area_min_px2 {
                break;
            }
            match grown % 4 {
                0 => cols.1 += 1,
                1 => rows.1 += 1,
                2 => cols.0 -= 1,
                _ => rows.0 -= 1,
            }
        }
        for pixel in (rows.0..rows.1).flat_map(|row| (cols.0..cols.1).map(move |col| [col, row])) {
            if let Some(index) = self.index(pixel) {
                self.is_free[index] = false;
            }
        }
    }

    /// Outlines of a region: counter-clockwise around it, clockwise around what it encloses, exact to the pixel.
    pub(super) fn outlines(&self) -> Vec<Ring> {
        let mut is_done = vec![[false; 4]; self.is_free.len()];
        let mut rings = Vec::new();
        for first in 0..self.is_free.len() {
            let pixel = [(first % self.cols) as i32, (first / self.cols) as i32];
            for side in 0..4 {
                if self.is_edge(pixel, side) && !is_done[first][side] {
                    rings.push(self.follow(pixel, side, &mut is_done));
                }
            }
        }
        rings
    }

    /// Whether the pixel is drivable and what lies behind its side is not.
    fn is_edge(&self, pixel: [i32; 2], side: usize) -> bool {
        self.at(pixel) && !self.at(ahead(pixel, right_of(side)))
    }

    fn follow(&self, first: [i32; 2], first_side: usize, is_done: &mut [[bool; 4]]) -> Ring {
        let mut ring = Vec::new();
        let (mut pixel, mut side) = (first, first_side);
        loop {
            if let Some(index) = self.index(pixel) {
                is_done[index][side] = true;
            }
            // The side's end, and the two pixels ahead of it: the left one beside our own.
            let end = end_of(pixel, side);
            let left = ahead(pixel, ALONG[side]);
            let right = ahead(left, right_of(side));
            match (self.at(left), self.at(right)) {
                (true, false) => pixel = left,
                (true, true) => {
                    ring.push(end);
                    (pixel, side) = (right, (side + 3) % 4);
                }
                (false, touches) => {
                    let next = (side + 1) % 4;
                    if touches {
                        ring.push(shifted(end, ALONG[side], -CUT_PX));
                        ring.push(shifted(end, ALONG[next], CUT_PX));
                    } else {
                        ring.push(end);
                    }
                    side = next;
                }
            }
            if (pixel, side) == (first, first_side) {
                return ring;
            }
        }
    }
}

/// Sets every value of a raster that has one which is set in the square of so many pixels a side below and to the left of it.
fn spread(values: &mut [bool], cols: usize, side_px: usize) {
    let mut rows_since = vec![side_px; cols];
    for row in values.chunks_exact_mut(cols) {
        let mut cols_since = side_px;
        for (value, rows_since) in row.iter_mut().zip(&mut rows_since) {
            cols_since = if *value { 0 } else { cols_since + 1 };
            *rows_since = if cols_since < side_px { 0 } else { *rows_since + 1 };
            *value = *rows_since < side_px;
        }
    }
}

/// The columns and rows of pixels, ends excluded, of a box around a ring.
fn box_around(ring: &Ring) -> ((i32, i32), (i32, i32)) {
    let side = |axis: usize| {
        let along = ring.iter().map(|corner| corner[axis]);
        let low = along.clone().fold(f64::INFINITY, f64::min).floor() as i32;
        (low, along.fold(f64::NEG_INFINITY, f64::max).ceil() as i32)
    };
    (side(0), side(1))
}

/// The pixels whose middles a ring encloses, row by row: as many steps as it has corners and pixels.
fn pixels_within(ring: &Ring) -> Vec<[i32; 2]> {
    let first_middle_from = |at: f64| (at - 0.5).ceil() as i32;
    let mut crossings: Vec<(i32, f64)> = Vec::new();
    for (&[x, y], &[next_x, next_y]) in ring.iter().zip(ring.iter().cycle().skip(1)) {
        let (low, high) = (y.min(next_y), y.max(next_y));
        crossings.extend((first_middle_from(low)..first_middle_from(high)).map(|row| {
            let share = (f64::from(row) + 0.5 - y) / (next_y - y);
            (row, x + share * (next_x - x))
        }));
    }
    crossings.sort_unstable_by(|(row, x), (other_row, other_x)| row.cmp(other_row).then(x.total_cmp(other_x)));
    let spans =
        crossings.chunk_by(|(row, _), (other_row, _)| row == other_row).flat_map(|of_row| of_row.chunks_exact(2));
    spans
        .flat_map(|span| (first_middle_from(span[0].1)..first_middle_from(span[1].1)).map(|col| [col, span[0].0]))
        .collect()
}

fn ahead([col, row]: [i32; 2], [dx, dy]: [i32; 2]) -> [i32; 2] {
    [col + dx, row + dy]
}

/// Direction to the right of the travel along a side: away from the pixel.
fn right_of(side: usize) -> [i32; 2] {
    ALONG[(side + 3) % 4]
}

/// Where the travel along a side of a pixel ends.
fn end_of([col, row]: [i32; 2], side: usize) -> [f64; 2] {
    let [dx, dy] = [[1, 0], [1, 1], [0, 1], [0, 0]][side];
    [f64::from(col + dx), f64::from(row + dy)]
}

fn shifted([x, y]: [f64; 2], [dx, dy]: [i32; 2], by_px: f64) -> [f64; 2] {
    [x + by_px * f64::from(dx), y + by_px * f64::from(dy)]
}

/// Area of a ring, square pixels, negative if clockwise.
pub(super) fn signed_area_px2(ring: &[[f64; 2]]) -> f64 {
    let next = ring.iter().cycle().skip(1);
    0.5 * ring.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>()
}

/// Leaves out corners that lie within a tolerance of the line that replaces them (Douglas & Peucker 1973).
pub(super) fn simplified(ring: &[[f64; 2]], tolerance_px: f64) -> Ring {
    if ring.len() <= SMALL_CORNERS || tolerance_px == 0.0 {
        return ring.to_vec();
    }
    // The algorithm keeps the point it starts from: let that be a corner of the convex hull.
    let lowest = (0..ring.len()).min_by(|&a, &b| ring[a].partial_cmp(&ring[b]).unwrap_or(std::cmp::Ordering::Equal));
    let mut points = ring.to_vec();
    points.rotate_left(lowest.unwrap_or(0));
    // Without the last point, which repeats the first, or begins the next piece.
    let without_last = |line: &LineString<f64>| -> Ring {
        line.0[..line.0.len() - 1].iter().map(|point| [point.x, point.y]).collect()
    };
    if ring.len() > LARGE_CORNERS {
        points.push(points[0]);
        let piece = |first: usize| LineString::from(points[first..=(first + PIECE_CORNERS).min(ring.len())].to_vec());
        let firsts = (0..ring.len()).step_by(PIECE_CORNERS);
        return firsts.flat_map(|first| without_last(&piece(first).simplify(tolerance_px))).collect();
    }
    without_last(Polygon::new(LineString::from(points), Vec::new()).simplify(tolerance_px).exterior())
}

#[cfg(test)]
mod tests {
    use super::*;
    use geo::{Contains as _, Point};

    /// Every pixel was held against the whole ring: a fence across a map took minutes.
    #[test]
    fn pixels_within_a_ring_are_those_whose_middles_it_contains() {
        // A diagonal fence with bays, and pillars at its corners.
        let fence = mask(&[
            "##########",
            "##....####",
            "#.##...###",
            "#..##.#..#",
            "##.###.#.#",
            "#.#.###..#",
            "#..#..##.#",
            "#...##..##",
            "#........#",
            "##########",
        ]);
        for ring in fence.outlines() {
            let points: Vec<(f64, f64)> = ring.iter().map(|&[x, y]| (x, y)).collect();
            let polygon = Polygon::new(LineString::from(points), Vec::new());
            let contained = (0..10).flat_map(|row| (0..10).map(move |col| [col, row])).filter(|pixel| {
                let [x, y] = pixel.map(|index| f64::from(index) + 0.5);
                polygon.contains(&Point::new(x, y))
            });
            assert_eq!(pixels_within(&ring), contained.collect::<Vec<_>>(), "{ring:?}");
        }
    }

    /// A mask drawn as text, top row first; `.` is drivable.
    fn mask(rows: &[&str]) -> Mask {
        let is_free = rows.iter().rev().flat_map(|row| row.bytes().map(|pixel| pixel == b'.')).collect();
        Mask { cols: rows[0].len(), is_free }
    }

    #[test]
    fn a_room_with_a_pillar_has_two_exact_outlines() {
        let rings = mask(&["#####", "#...#", "#.#.#", "#...#", "#####"]).outlines();
        assert_eq!(
            rings,
            [
                vec![[4.0, 1.0], [4.0, 4.0], [1.0, 4.0], [1.0, 1.0]],
                vec![[2.0, 2.0], [2.0, 3.0], [3.0, 3.0], [3.0, 2.0]]
            ]
        );
        assert_eq!(rings.iter().map(|ring| signed_area_px2(ring)).collect::<Vec<_>>(), [9.0, -1.0]);
        assert_eq!(mask(&["#####", "#...#", "#.#.#", "#...#", "#####"]).corners(), 8);
        assert_eq!(mask(&["##..", "##..", "..##", "..##"]).corners(), 8);
    }

    /// The right part of the map is only reached over a corner: it is another region, and the outline is cut there.
    #[test]
    fn pixels_that_touch_at_a_corner_are_apart() {
        let whole = mask(&["##..", "##..", "..##", "..##"]);
        let region = whole.region_of([0, 0]);
        assert_eq!(region.is_free.iter().filter(|&&free| free).count(), 4);
        assert_eq!(region.outlines(), [vec![[2.0, 0.0], [2.0, 2.0], [0.0, 2.0], [0.0, 0.0]]]);
        let [lower, upper] = whole.outlines().try_into().expect("two outlines");
        assert_eq!(lower, [[2.0, 0.0], [2.0, 1.75], [1.75, 2.0], [0.0, 2.0], [0.0, 0.0]]);
        assert_eq!(upper, [[4.0, 2.0], [4.0, 4.0], [2.0, 4.0], [2.0, 2.25], [2.25, 2.0]]);
    }

    #[test]
    fn two_pillars_that_touch_at_a_corner_are_one_island() {
        let rings = mask(&["......", ".##...", "...#..", "......"]).outlines();
        assert_eq!(rings.len(), 2);
        assert!((signed_area_px2(&rings[1]) + 3.0).abs() < 0.1, "{:?}", rings[1]);
    }

    /// A line of one pixel, a block with a bump, a wall of three pixels; and a fin, which is thick but for its root.
    #[test]
    fn thin_walls_become_thick_and_what_is_thick_stays() {
        // With free ground around what is drawn.
        let framed = |rows: &[&str]| {
            let margin = ".".repeat(rows[0].len());
            let rows: Vec<String> = [&[&margin[..]; 4], rows, &[&margin[..]; 4]]
                .concat()
                .iter()
                .map(|row| format!("....{row}...."))
                .collect();
            mask(&rows.iter().map(String::as_str).collect::<Vec<_>>())
        };
        let drawn = framed(&[
            "...............###",
            ".#......####...###",
            ".#......####...###",
            ".#.....#####...###",
            ".#......####...###",
            "...............###",
        ]);
        let expected = framed(&[
            "...............###",
            "###.....####...###",
            "###.....####...###",
            "###....#####...###",
            "###.....####...###",
            "...............###",
        ]);
        let (thick, added) = drawn.with_thick_walls([0, 0], 3);
        assert_eq!((thick.is_free, added), (expected.is_free, 8));
        let (thick, added) = framed(&["####.......", "###########", "####......."]).with_thick_walls([0, 0], 3);
        let expected = framed(&["####...####", "###########", "####...####"]);
        assert_eq!((thick.is_free, added), (expected.is_free, 8));
    }

    /// By every square of pixels, one after the other.
    #[test]
    fn thin_pixels_are_those_that_no_blocked_square_is_near() {
        let (cols, rows) = (23, 17);
        for seed in 1..40_u64 {
            let noise = |pixel: i32| (pixel as u64 + 7).wrapping_mul(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15)) >> 40;
            // Patches of four pixels, and what is missing in them.
            let is_free = |pixel: i32| {
                let patch = pixel / cols / 4 * cols + pixel % cols / 4;
                noise(patch) % 5 < 3 || noise(1000 + pixel) % 9 == 0
            };
            let drawn = Mask { cols: cols as usize, is_free: (0..cols * rows).map(is_free).collect() };
            for side_px in [2, 3, 5] {
                let thin = drawn.thin_pixels(side_px as usize);
                for pixel in 0..cols * rows {
                    let [x, y] = [pixel % cols, pixel / cols];
                    let is_blocked = |[left, low]: [i32; 2]| {
                        (low..low + side_px).all(|y| (left..left + side_px).all(|x| !drawn.at([x, y])))
                    };
                    let near = |at: i32| at - 2 * side_px + 1..=at + side_px;
                    let has_square = near(y).any(|low| near(x).any(|left| is_blocked([left, low])));
                    assert_eq!(thin[pixel as usize], !drawn.at([x, y]) && !has_square, "{seed}, {side_px}: {x}, {y}");
                }
            }
        }
    }

    /// In one piece, a few hundred thousand corners took seconds.
    #[test]
    fn an_outline_of_very_many_corners_is_simplified_in_pieces() {
        let steps = 12_000;
        let stairs = (0..steps).flat_map(|i| [[i, i], [i + 1, i]]).chain([[steps, steps], [0, steps]]);
        let ring: Ring = stairs.map(|corner| corner.map(f64::from)).collect();
        let line = simplified(&ring, TOLERANCES_PX[0]);
        assert!((24..60).contains(&line.len()), "{} corners", line.len());
        let mut rest = ring.iter();
        assert!(line.iter().all(|corner| rest.any(|of_ring| of_ring == corner)), "corners of the ring, in its order");
        assert!(line.iter().all(|[x, y]| y >= x || x - y <= 1.0), "{line:?}");
    }

    #[test]
    fn a_staircase_becomes_a_line_and_a_rectangle_stays() {
        let size = 12;
        let rows: Vec<String> =
            (0..size).map(|row| (0..size).map(|col| if col <= row { '.' } else { '#' }).collect()).collect();
        let rows: Vec<&str> = rows.iter().map(String::as_str).collect();
        let rings = mask(&rows).outlines();
        assert_eq!(rings.len(), 1);
        assert_eq!(rings[0].len(), 26, "12 steps of two corners, and two more");
        let line = simplified(&rings[0], TOLERANCES_PX[0]);
        assert!(line.len() <= 5, "{line:?}");
        let rectangle = mask(&["...", "..."]).outlines().remove(0);
        assert_eq!(simplified(&rectangle, TOLERANCES_PX[0]), rectangle);
    }

    /// Every corner of the exact outline of a disc lies within the tolerance of the simplified one.
    #[test]
    fn simplification_moves_nothing_by_a_pixel() {
        let size = 60;
        let is_free = (0..size * size)
            .map(|i| libm::hypot(f64::from(i % size) - 29.3, f64::from(i / size) - 30.1) < 25.0)
            .collect();
        let ring = Mask { cols: size as usize, is_free }.outlines().remove(0);
        let short = simplified(&ring, TOLERANCES_PX[0]);
        assert!(short.len() * 2 < ring.len(), "{} of {} corners are left", short.len(), ring.len());
        let point = |[x, y]: [f64; 2]| sim::geometry::Vec2::new(x as f32, y as f32);
        let outline: Vec<_> = short.iter().map(|&corner| point(corner)).collect();
        for &corner in &ring {
            let distance_px = sim::geometry::edges(&outline)
                .map(|(a, b)| sim::geometry::distance_to_segment_m(point(corner), a, b))
                .fold(f32::INFINITY, f32::min);
            assert!(distance_px <= 0.7501, "{corner:?} moved by {distance_px} pixels");
        }
    }
}
