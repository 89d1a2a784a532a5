//! Random edits of inputs, without coverage.

use fastrand::Rng;

/// The longest edited input, in bytes.
const LONGEST: usize = 16_384;

/// Applies one or more edits to one of the inputs. `words` are pieces of text to insert.
///
/// # Panics
/// If `inputs` is empty.
///
/// ```
/// let mut random = fastrand::Rng::with_seed(1);
/// let edited = fuzz_targets::edits::edited(&[b"v 0 0 1".to_vec()], &["f "], &mut random);
/// assert_ne!(edited, b"v 0 0 1");
/// ```
#[must_use]
pub fn edited(inputs: &[Vec<u8>], words: &[&str], random: &mut Rng) -> Vec<u8> {
    let mut pieces = pieces(random.choice(inputs).expect("there are inputs"));
    // Most inputs with many edits are refused at the first of them.
    while {
        edit(&mut pieces, inputs, words, random);
        random.bool()
    } {}
    let mut bytes = pieces.concat();
    bytes.truncate(LONGEST);
    bytes
}

fn edit(pieces: &mut Vec<Vec<u8>>, inputs: &[Vec<u8>], words: &[&str], random: &mut Rng) {
    let at = random.usize(..=pieces.len());
    let until = (at + random.usize(..6)).min(pieces.len());
    match random.u8(..12) {
        0 => drop(pieces.drain(at..until)),
        1 => {
            let repeated = pieces[at..until].to_vec();
            let place = random.usize(..=pieces.len());
            pieces.splice(place..place, repeated);
        }
        2 | 3 => {
            let word = random.choice(words).or_else(|| random.choice(NUMBERS)).expect("there are numbers");
            pieces.splice(at..until.min(at + random.usize(..2)), [word.as_bytes().to_vec()]);
        }
        4 | 5 => {
            let number = random.choice(NUMBERS).expect("there are numbers");
            // In the place of another number, if there is one nearby.
            let other = (at..pieces.len()).find(|&piece| pieces[piece][0].is_ascii_digit()).unwrap_or(at);
            pieces.splice(other..(other + 1).min(pieces.len()), [number.as_bytes().to_vec()]);
        }
        6 => {
            let other = self::pieces(random.choice(inputs).expect("there are inputs"));
            let from = random.usize(..=other.len());
            let to = (from + random.usize(..20)).min(other.len());
            pieces.splice(at..at, other[from..to].iter().cloned());
        }
        7 if at < pieces.len() => {
            let other = random.usize(..pieces.len());
            pieces.swap(at, other);
        }
        // Deep nesting, to overflow a careless parser's stack.
        8 if until > at && random.u8(..8) == 0 => {
            let repeated = pieces[at..until].concat().repeat(200);
            pieces.insert(at, repeated);
        }
        9 if at < pieces.len() => {
            let byte = random.usize(..pieces[at].len());
            pieces[at][byte] ^= 1 << random.u8(..8);
        }
        10 if random.u8(..4) == 0 => pieces.truncate(at),
        // Another digit: most readers accept it.
        11 => {
            if let Some(piece) = (at..pieces.len()).find(|&piece| pieces[piece][0].is_ascii_digit()) {
                pieces[piece][0] = random.u8(b'0'..=b'9');
            }
        }
        _ => {
            let character = match random.u8(..3) {
                0 => char::from(random.u8(32..127)),
                1 => char::from(random.u8(..32)),
                _ => random.char(..),
            };
            pieces.insert(at, character.to_string().into_bytes());
        }
    }
}

const NUMBERS: &[&str] = &[
    "0",
    "-1",
    "1",
    "2",
    "255",
    "65535",
    "1e308",
    "1e400",
    "1e-400",
    "nan",
    "inf",
    "null",
    "4294967296",
    "18446744073709551616",
    "-9223372036854775809",
    "0.1",
];

/// Splits an input into words, runs of blanks, and single other bytes.
fn pieces(input: &[u8]) -> Vec<Vec<u8>> {
    let class = |byte: u8| match byte {
        b'_' | 128.. => 1,
        b' ' => 2,
        byte => u8::from(byte.is_ascii_alphanumeric()),
    };
    let same = |a: &u8, b: &u8| class(*a) != 0 && class(*a) == class(*b);
    input.chunk_by(same).map(<[u8]>::to_vec).collect()
}
