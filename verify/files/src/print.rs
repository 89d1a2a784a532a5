use std::borrow::Cow;

/// Returns a text without control characters except line breaks and tabs: names of strangers must not move the cursor,
/// change colours or rewrite what a terminal shows. Characters that reverse the direction of text count as well.
///
/// ```
/// assert_eq!(energy_files::printable("sleeve"), "sleeve");
/// assert_eq!(energy_files::printable("\u{1b}[2Jsleeve"), "\\u{1b}[2Jsleeve");
/// ```
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.contains(is_unprintable) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len());
    for character in text.chars() {
        if is_unprintable(character) {
            shown.extend(character.escape_unicode());
        } else {
            shown.push(character);
        }
    }
    Cow::Owned(shown)
}

/// The longest text that messages quote, in characters.
const LONGEST_QUOTE: usize = 120;

/// Returns the start of a text for a message: printable, and at most 120 characters.
///
/// ```
/// assert_eq!(energy_files::excerpt("f 1 2 3"), "f 1 2 3");
/// assert_eq!(energy_files::excerpt(&"9".repeat(1000)).chars().count(), 121);
/// ```
#[must_use]
pub fn excerpt(text: &str) -> Cow<'_, str> {
    match text.char_indices().nth(LONGEST_QUOTE) {
        None => printable(text),
        Some((end, _)) => Cow::Owned(format!("{}…", printable(&text[..end]))),
    }
}

fn is_unprintable(character: char) -> bool {
    let is_control = character.is_control() && character != '\n' && character != '\t';
    let turns_text = matches!(character, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    is_control || turns_text
}
