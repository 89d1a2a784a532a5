//! Characters that no formula contains although they look as if they belonged: invisible ones, fullwidth forms, and
//! letters that look like others.

/// Invisible characters, with their names.
const INVISIBLE: &[(char, &str)] = &[
    ('\u{ad}', "soft hyphen"),
    ('\u{34f}', "combining grapheme joiner"),
    ('\u{61c}', "Arabic letter mark"),
    ('\u{180e}', "Mongolian vowel separator"),
    ('\u{200b}', "zero width space"),
    ('\u{200c}', "zero width non-joiner"),
    ('\u{200d}', "zero width joiner"),
    ('\u{200e}', "left-to-right mark"),
    ('\u{200f}', "right-to-left mark"),
    ('\u{202a}', "left-to-right embedding"),
    ('\u{202b}', "right-to-left embedding"),
    ('\u{202c}', "pop directional formatting"),
    ('\u{202d}', "left-to-right override"),
    ('\u{202e}', "right-to-left override"),
    ('\u{2060}', "word joiner"),
    ('\u{2061}', "function application"),
    ('\u{2062}', "invisible times"),
    ('\u{2063}', "invisible separator"),
    ('\u{2064}', "invisible plus"),
    ('\u{2066}', "left-to-right isolate"),
    ('\u{2067}', "right-to-left isolate"),
    ('\u{2068}', "first strong isolate"),
    ('\u{2069}', "pop directional isolate"),
    ('\u{feff}', "zero width no-break space"),
];

/// Signs that a keyboard or a word processor writes for those of a formula.
const SIGNS: &[(char, &str)] = &[
    ('“', "\""),
    ('”', "\""),
    ('„', "\""),
    ('‘', "′"),
    ('’', "′"),
    ('—', "-"),
    ('―', "-"),
    ('‐', "-"),
    ('⋆', "*"),
    ('★', "*"),
    ('∥', "‖"),
    ('∣', "|"),
    ('⟨', "("),
    ('⟩', ")"),
    ('△', "Δ"),
    ('∆', "Δ"),
    ('∑', "sum(j in 0..4, …)"),
    ('∏', "a product of the factors"),
    ('∂', "gradient(U, p)"),
    ('∇', "gradient(U, p)"),
    ('∞', "infinity"),
    ('∧', "&&"),
    ('∨', "||"),
];

/// Returns the message and the remedy for a character that has no place in a formula.
pub(super) fn misplaced(c: char) -> (String, Option<String>) {
    let code = format!("U+{:04X}", c as u32);
    if let Some((_, name)) = INVISIBLE.iter().find(|(invisible, _)| *invisible == c) {
        return (format!("an invisible character, {name} ({code})"), Some("delete it".into()));
    }
    if let Some(plain) = halfwidth(c) {
        let plain = if plain == ' ' { "a space".into() } else { format!("`{plain}`") };
        return (format!("the fullwidth character `{c}` ({code})"), Some(format!("write {plain}")));
    }
    let code = if c.is_ascii() { String::new() } else { format!(" ({code})") };
    let message = format!("the character `{c}`{code} has no meaning here");
    let sign = SIGNS.iter().find(|(sign, _)| *sign == c).map(|(_, here)| format!("write {here}"));
    (message, sign)
}

/// Returns the ASCII character of a fullwidth form: `k` of `ｋ`.
pub(super) fn halfwidth(c: char) -> Option<char> {
    match c {
        '\u{3000}' => Some(' '),
        '！'..='～' => char::from_u32(c as u32 - '！' as u32 + '!' as u32),
        _ => None,
    }
}

/// Returns whether a character is a mark on the letter before it, as the tilde of x̃. Few such letters have a code of
/// their own.
pub(super) fn is_accent(c: char) -> bool {
    ('\u{300}'..='\u{36f}').contains(&c) && c != '\u{34f}'
}

/// Letters that look like Latin ones: each is followed by the Latin letter.
const LOOK_ALIKES: &str = "\
    аaеeоoрpсcуyхxіiјjѕsкkԁdһhԛqԝwАAВBЕEКKМMНHОOРPСCТTХXУYІIЈJЅS\
    αaιiκkνvοoρpτtυuχxωwγyηnΑAΒBΕEΖZΗHΙIΚKΜMΝNΟOΡPΤTΥYΧX\
    ɑaɡgɩiℎhℓlıiℓl";

/// Returns a name with each letter replaced by the Latin one that it looks like. Names of one picture look the same.
pub(crate) fn picture(name: &str) -> String {
    let letters: Vec<char> = LOOK_ALIKES.chars().collect();
    let latin = |c: char| letters.chunks_exact(2).find(|pair| pair[0] == c).map(|pair| pair[1]);
    name.chars().map(|c| latin(c).or_else(|| halfwidth(c)).unwrap_or(c)).collect()
}

/// Describes the first letter in which two names of one picture differ: "`ν` is the Greek letter nu (U+03BD), `v` the
/// Latin letter v". `None` if the names are equal.
pub(crate) fn difference(written: &str, declared: &str) -> Option<String> {
    let (a, b) = written.chars().zip(declared.chars()).find(|(a, b)| a != b)?;
    Some(format!("`{a}` is {}, `{b}` is {}", letter(a), letter(b)))
}

/// Returns alphabet, name and code point of a letter.
fn letter(c: char) -> String {
    let code = format!("U+{:04X}", c as u32);
    let greek = super::name::GREEK.iter().find(|(greek, _)| *greek == c).map(|(_, name)| *name);
    match c {
        _ if c.is_ascii() => "a Latin letter".into(),
        _ if greek.is_some() => format!("the Greek letter {} ({code})", greek.unwrap_or_default()),
        'Ͱ'..='Ͽ' => format!("a Greek letter ({code})"),
        'Ѐ'..='ԯ' => format!("a Cyrillic letter ({code})"),
        '！'..='～' => format!("a fullwidth letter ({code})"),
        _ => format!("another letter ({code})"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_one_picture_look_the_same() {
        for (written, declared) in [("р_k", "p_k"), ("ν", "v"), ("v", "ν"), ("ｋ1", "k1"), ("ρ", "р"), ("Α", "A")]
        {
            assert_eq!(picture(written), picture(declared), "{written}, {declared}");
            assert!(difference(written, declared).is_some());
        }
        assert_ne!(picture("β"), picture("B"));
        assert_eq!(difference("p_k", "p_k"), None);
    }

    #[test]
    fn misplaced_characters_have_names() {
        assert_eq!(misplaced('\u{200b}').0, "an invisible character, zero width space (U+200B)");
        assert_eq!(misplaced('＋'), ("the fullwidth character `＋` (U+FF0B)".into(), Some("write `+`".into())));
        assert_eq!(misplaced('§').1, None);
    }
}
