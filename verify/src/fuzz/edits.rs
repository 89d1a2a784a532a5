//! Random edits of text.

use fastrand::Rng;

/// Applies a few edits to one of the inputs and cuts it to `longest` bytes.
pub(super) fn edited(inputs: &[String], words: &[&str], longest: usize, random: &mut Rng) -> String {
    let mut pieces = pieces(&inputs[random.usize(..inputs.len())]);
    for _ in 0..random.usize(1..6) {
        edit(&mut pieces, inputs, words, random);
    }
    let mut text = pieces.concat();
    let mut end = longest.min(text.len());
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    text.truncate(end);
    text
}

fn edit(pieces: &mut Vec<String>, inputs: &[String], words: &[&str], random: &mut Rng) {
    let at = random.usize(..=pieces.len());
    let until = (at + random.usize(..6)).min(pieces.len());
    match random.u8(..9) {
        0 => drop(pieces.drain(at..until)),
        1 => {
            let repeated = pieces[at..until].to_vec();
            let place = random.usize(..=pieces.len());
            pieces.splice(place..place, repeated);
        }
        2 if !words.is_empty() => pieces.insert(at, words[random.usize(..words.len())].to_owned()),
        3 if !words.is_empty() && at < pieces.len() => pieces[at] = words[random.usize(..words.len())].to_owned(),
        4 => {
            let other = self::pieces(&inputs[random.usize(..inputs.len())]);
            let from = random.usize(..=other.len());
            let to = (from + random.usize(..20)).min(other.len());
            pieces.splice(at..at, other[from..to].iter().cloned());
        }
        5 if at < pieces.len() => {
            let other = random.usize(..pieces.len());
            pieces.swap(at, other);
        }
        6 => pieces.insert(at, NUMBERS[random.usize(..NUMBERS.len())].to_owned()),
        // Deep nesting, to overflow a careless parser's stack.
        7 if until > at && random.u8(..8) == 0 => {
            let repeated = pieces[at..until].concat().repeat(200);
            pieces.insert(at, repeated);
        }
        _ => {
            let character = match random.u8(..3) {
                0 => char::from(random.u8(32..127)),
                1 => char::from(random.u8(..32)),
                _ => random.char(..),
            };
            pieces.insert(at, character.to_string());
        }
    }
}

const NUMBERS: &[&str] =
    &["0", "-1", "1e400", "1e-400", "NaN", "inf", "4294967296", "18446744073709551616", "-9223372036854775809", "0.1"];

/// Splits a text into words, runs of blanks, and single other characters.
fn pieces(text: &str) -> Vec<String> {
    let mut pieces: Vec<String> = Vec::new();
    let mut last = None;
    for character in text.chars() {
        let class = if character.is_alphanumeric() || character == '_' {
            1
        } else if character == ' ' {
            2
        } else {
            0
        };
        match pieces.last_mut() {
            Some(piece) if class != 0 && last == Some(class) => piece.push(character),
            _ => pieces.push(character.to_string()),
        }
        last = Some(class);
    }
    pieces
}
