//! The logical lines of an OBJ file.

use std::borrow::Cow;

/// Decodes a file: UTF-8, or else Latin-1, which some exporters write.
pub(super) fn decoded(contents: Vec<u8>) -> String {
    String::from_utf8(contents).unwrap_or_else(|error| error.as_bytes().iter().copied().map(char::from).collect())
}

/// Returns the lines with their numbers from 1, without comments. A line that ends with a backslash continues on the
/// next one.
pub(super) fn logical(text: &str) -> impl Iterator<Item = (usize, Cow<'_, str>)> {
    let mut lines = text.lines().enumerate();
    std::iter::from_fn(move || {
        let (index, line) = lines.next()?;
        let (part, mut continues) = split(line);
        let mut whole = Cow::Borrowed(part);
        while continues {
            let Some((_, line)) = lines.next() else { break };
            let (part, again) = split(line);
            whole.to_mut().extend([" ", part]);
            continues = again;
        }
        Some((index + 1, whole))
    })
}

/// Returns a line without comment and backslash, and whether it continues on the next one.
fn split(line: &str) -> (&str, bool) {
    let line = without_comment(line);
    line.strip_suffix('\\').map_or((line, false), |part| (part, true))
}

/// Cuts a comment off, which starts with `#` at the start of a word: names may contain the character.
fn without_comment(line: &str) -> &str {
    let starts = |at: usize| line[..at].chars().next_back().is_none_or(char::is_whitespace);
    let end = line.match_indices('#').map(|(at, _)| at).find(|&at| starts(at));
    line[..end.unwrap_or(line.len())].trim_end()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_and_continuations_are_resolved() {
        let text = "# head\r\nv 1 2 3 # first\nf 1 \\\r\n 2 \\\n3\ng part#1\nv 1 \\";
        let lines: Vec<(usize, Cow<'_, str>)> = logical(text).collect();
        let expected = [(1, ""), (2, "v 1 2 3"), (3, "f 1   2  3"), (6, "g part#1"), (7, "v 1 ")];
        assert_eq!(lines.iter().map(|(line, text)| (*line, text.as_ref())).collect::<Vec<_>>(), expected);
        assert_eq!(decoded(b"g \xc4rmel".to_vec()), "g Ärmel");
        assert_eq!(decoded("g Ärmel".into()), "g Ärmel");
    }
}
