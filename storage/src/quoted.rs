//! How much errors quote of what they refuse.

use std::fmt::Write as _;

/// How long an error may be, characters: names and values in it are the user's.
pub const ERROR_CHARS_MAX: usize = 3000;
/// A number of more digits is quoted in part: the largest `f32` has 39.
const DIGITS_MAX: usize = 40;
/// The digits that are quoted of such a number.
const DIGITS_QUOTED: usize = 12;

/// As much of a text as an error needs: its first `chars_max` characters, and of a number of more than 40 digits the first
/// twelve and how many there are.
///
/// ```
/// let problem = format!("scale is {}", 1e300);
/// assert_eq!(storage::shortened(&problem, 400), "scale is 100000000000… (301 digits)");
/// assert_eq!(storage::shortened("a long story", 6), "a long …");
/// ```
pub fn shortened(text: &str, chars_max: usize) -> String {
    let mut short = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(start) = rest.find(|c: char| c.is_ascii_digit()) {
        let (before, number) = rest.split_at(start);
        let digits = number.find(|c: char| !c.is_ascii_digit()).unwrap_or(number.len());
        short.push_str(before);
        if digits > DIGITS_MAX {
            let _ = write!(short, "{}… ({digits} digits)", &number[..DIGITS_QUOTED]);
        } else {
            short.push_str(&number[..digits]);
        }
        rest = &number[digits..];
    }
    short.push_str(rest);
    if let Some((end, _)) = short.char_indices().nth(chars_max) {
        short.truncate(end);
        short.push_str(" …");
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    /// It was quoted whole, and filled a screen.
    #[test]
    fn a_long_number_is_quoted_in_part() {
        let sevens = |count: usize| "7".repeat(count);
        let first = sevens(12);
        assert_eq!(shortened(&format!("x is {}", f32::MIN), 400), format!("x is {}", f32::MIN));
        assert_eq!(shortened(&sevens(40), 400), sevens(40));
        assert_eq!(
            shortened(&format!("[{}, 0.{}]", sevens(41), sevens(300)), 400),
            format!("[{first}… (41 digits), 0.{first}… (300 digits)]")
        );
    }

    #[test]
    fn a_long_text_ends_after_so_many_characters() {
        assert_eq!(shortened(&"τ".repeat(50), 50), "τ".repeat(50));
        assert_eq!(shortened(&"τ".repeat(51), 50), "τ".repeat(50) + " …");
        assert_eq!(shortened("", 0), "");
    }
}
