//! False colours: a quantity such as illuminance as colours between two values, with contours and a legend.
//!
//! Colours are those of the map *viridis* (van der Walt, Smith 2015), which is even to the eye and readable
//! by people who do not tell red from green. Contours lie between eight equal steps, of values averaged over
//! 5 x 5 pixels.

/// Range of values that the colours stand for, and their unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FalseColor<'a> {
    /// Value of the darkest colour.
    pub low: f32,
    /// Value of the brightest colour, above `low`.
    pub high: f32,
    /// Unit in the legend, of the letters in `Wcdlmx2/`.
    pub unit: &'a str,
}

/// Picture of 8-bit sRGB colours, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColourPicture {
    /// Columns and rows.
    pub size: [u32; 2],
    /// Colours of the pixels.
    pub pixels: Vec<[u8; 3]>,
}

/// Viridis at equal steps from 0 to 1.
const COLOURS: [[u8; 3]; 9] = [
    [68, 1, 84],
    [71, 44, 122],
    [59, 81, 139],
    [44, 113, 142],
    [33, 144, 141],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
];
/// Number of steps between contours.
const STEPS: u32 = 8;
const CONTOUR: [u8; 3] = [16, 16, 16];
const PAPER: [u8; 3] = [255; 3];
/// Columns of the legend: of its bar, and of all of it.
const BAR: u32 = 14;
const LEGEND: u32 = 84;
/// Pixels on each side over which values are averaged for contours.
const SMOOTH: usize = 2;
/// Side of a dot of the letters, pixels.
const DOT: u32 = 2;
/// Rows of a letter and the blank below, dots.
const LETTER_ROWS: u32 = 6;
/// Rows of a picture from which on it has a legend.
const LEAST_ROWS: u32 = 4 * LETTER_ROWS * DOT;

impl FalseColor<'_> {
    /// Picture of values, row by row, in a picture `width` columns wide. A legend is at its right side.
    ///
    /// # Panics
    /// If the width is 0, or there are no whole rows.
    pub fn picture(&self, width: u32, values: &[f32]) -> ColourPicture {
        let height = (values.len() / width as usize) as u32;
        assert_eq!(values.len(), (width * height) as usize, "rows are whole");
        let value = |x: u32, y: u32| values[(y * width + x) as usize];
        let steps: Vec<u32> = smoothed(width as usize, values).map(|mean| self.step(mean)).collect();
        let step = |x: u32, y: u32| steps[(y * width + x) as usize];
        // A low picture has no room for the values of a legend.
        let legend = if height >= LEAST_ROWS { LEGEND } else { 0 };
        let mut pixels = Vec::with_capacity(((width + legend) * height) as usize);
        for y in 0..height {
            for x in 0..width {
                let differs =
                    |other: u32, row: u32| other < width && row < height && step(other, row) != step(x, y);
                let is_contour = differs(x + 1, y) || differs(x, y + 1);
                pixels.push(if is_contour { CONTOUR } else { self.colour(value(x, y)) });
            }
            pixels.extend(std::iter::repeat_n(PAPER, legend as usize));
        }
        let mut picture = ColourPicture { size: [width + legend, height], pixels };
        if legend > 0 {
            self.draw_legend(&mut picture, width);
        }
        picture
    }

    /// Share of the range below a value, 0 to 1; 0 for NaN.
    fn share(&self, value: f32) -> f32 {
        ((value - self.low) / (self.high - self.low)).clamp(0.0, 1.0).max(0.0)
    }

    /// Number of contours below a value.
    fn step(&self, value: f32) -> u32 {
        ((self.share(value) * STEPS as f32) as u32).min(STEPS - 1)
    }

    fn colour(&self, value: f32) -> [u8; 3] {
        let place = self.share(value) * (COLOURS.len() - 1) as f32;
        let index = (place as usize).min(COLOURS.len() - 2);
        let part = place - index as f32;
        std::array::from_fn(|channel| {
            let [from, to] = [index, index + 1].map(|index| f32::from(COLOURS[index][channel]));
            (from + (to - from) * part + 0.5) as u8
        })
    }

    /// Draws the bar of the colours, the values of the contours beside it, and the unit.
    fn draw_legend(&self, picture: &mut ColourPicture, left: u32) {
        let [_, height] = picture.size;
        let rows = LETTER_ROWS * DOT;
        picture.draw_text(self.unit, left + 8, 2);
        let [top, bottom] = [2 + rows + rows / 2, height - rows / 2];
        let value_of = |y: u32| {
            let share = (bottom - y) as f32 / (bottom - top) as f32;
            self.low + share * (self.high - self.low)
        };
        for y in top..bottom {
            for x in left + 8..left + 8 + BAR {
                picture.set(x, y, self.colour(value_of(y)));
            }
        }
        // As many values as there is room for.
        let step =
            [1, 2, 4, 8].into_iter().find(|step| (bottom - top) * step / STEPS >= rows).unwrap_or(STEPS);
        for number in (0..=STEPS).step_by(step as usize) {
            let y = bottom - (bottom - top) * number / STEPS;
            for x in left + 8..left + 8 + BAR + 3 {
                picture.set(x, y.min(height - 1), CONTOUR);
            }
            let value = self.low + (self.high - self.low) * number as f32 / STEPS as f32;
            picture.draw_text(&text_of(value), left + 8 + BAR + 6, y.saturating_sub(5));
        }
    }
}

/// Mean of the finite values within [`SMOOTH`] pixels of each pixel, on both axes. Contours of a noisy
/// picture then are lines.
fn smoothed(width: usize, values: &[f32]) -> impl Iterator<Item = f32> {
    let height = values.len() / width;
    let around = |place: usize, side: usize| place.saturating_sub(SMOOTH)..(place + SMOOTH + 1).min(side);
    (0..values.len()).map(move |index| {
        let [x, y] = [index % width, index / width];
        let near = around(y, height).flat_map(|y| around(x, width).map(move |x| values[y * width + x]));
        let (sum, count) = near
            .filter(|value| value.is_finite())
            .fold((0.0, 0), |(sum, count), value| (sum + f64::from(value), count + 1));
        if count == 0 { f32::NAN } else { (sum / f64::from(count)) as f32 }
    })
}

/// A value in at most seven letters.
fn text_of(value: f32) -> String {
    if value != 0.0 && !(0.01..1e5).contains(&value.abs()) {
        return format!("{value:.1e}");
    }
    let decimals = match value.abs() {
        size if size >= 100.0 || value == 0.0 => 0,
        size if size >= 10.0 => 1,
        size if size >= 1.0 => 2,
        _ => 3,
    };
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

impl ColourPicture {
    fn set(&mut self, x: u32, y: u32, colour: [u8; 3]) {
        let [width, height] = self.size;
        if x < width && y < height {
            self.pixels[(y * width + x) as usize] = colour;
        }
    }

    /// Draws a text whose upper left corner is at `(x, y)`.
    fn draw_text(&mut self, text: &str, x: u32, y: u32) {
        for (index, letter) in (0..).zip(text.chars()) {
            let dots = dots_of(letter);
            for dot in (0..15).filter(|dot| dots >> (14 - dot) & 1 != 0) {
                let [column, row] = [index * 4 + dot % 3, dot / 3];
                for part in 0..DOT * DOT {
                    self.set(x + column * DOT + part % DOT, y + row * DOT + part / DOT, CONTOUR);
                }
            }
        }
    }
}

/// Dots of a letter, five rows of three, the upper left one in bit 14; none for other letters.
fn dots_of(letter: char) -> u32 {
    match letter {
        '0' => 0b111_101_101_101_111,
        '1' => 0b010_110_010_010_111,
        '2' => 0b111_001_111_100_111,
        '3' => 0b111_001_111_001_111,
        '4' => 0b101_101_111_001_001,
        '5' => 0b111_100_111_001_111,
        '6' => 0b111_100_111_101_111,
        '7' => 0b111_001_010_010_010,
        '8' => 0b111_101_111_101_111,
        '9' => 0b111_101_111_001_111,
        '.' => 0b000_000_000_000_010,
        '-' => 0b000_000_111_000_000,
        '/' => 0b001_001_010_100_100,
        'c' => 0b000_111_100_100_111,
        'W' => 0b101_101_111_111_101,
        'e' => 0b000_111_101_110_011,
        'd' => 0b001_001_111_101_111,
        'l' => 0b100_100_100_100_111,
        'm' => 0b000_111_111_101_101,
        'x' => 0b000_101_010_101_000,
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LUX: FalseColor<'static> = FalseColor { low: 0.0, high: 800.0, unit: "lx" };

    #[test]
    fn values_have_the_colours_of_the_map_and_those_beyond_its_ends() {
        for (value, colour) in [
            (0.0, COLOURS[0]),
            (100.0, COLOURS[1]),
            (800.0, COLOURS[8]),
            (-5.0, COLOURS[0]),
            (1e9, COLOURS[8]),
        ] {
            assert_eq!(LUX.colour(value), colour);
        }
        assert_eq!(LUX.colour(f32::NAN), COLOURS[0]);
        assert_eq!(LUX.colour(50.0), [70, 23, 103]);
    }

    #[test]
    fn contours_lie_between_steps_and_the_legend_beside_the_picture() {
        let values: Vec<f32> = (0..64 * 80).map(|index| 12.5 * (index % 64) as f32).collect();
        let picture = LUX.picture(64, &values);
        assert_eq!(picture.size, [64 + LEGEND, 80]);
        let row = &picture.pixels[..64];
        let contours: Vec<usize> = (0..64).filter(|&x| row[x] == CONTOUR).collect();
        assert_eq!(contours, [7, 15, 23, 31, 39, 47, 55]);
        let legend = picture.pixels.chunks(64 + LEGEND as usize).flat_map(|row| &row[64..]);
        let mut drawn: Vec<_> = legend.filter(|colour| **colour != PAPER).collect();
        drawn.dedup();
        assert!(drawn.len() > 40, "{}", drawn.len());
    }

    #[test]
    fn a_low_picture_has_no_legend_and_numbers_are_short() {
        assert_eq!(LUX.picture(5, &[1.0; 10]).size, [5, 2]);
        let texts = [0.0, 0.125, 2.5, 37.5, 150.0, 2000.0, -1_234_567.0, 6e-6].map(text_of);
        assert_eq!(texts, ["0", "0.125", "2.5", "37.5", "150", "2000", "-1.2e6", "6.0e-6"]);
    }
}
