//! The logical lines of an OBJ file.

/// Decodes a file: UTF-8, or else Latin-1, which some exporters write.
pub(super) fn decoded(contents: Vec<u8>) -> String {
    String::from_utf8(contents).unwrap_or_else(|error| error.as_bytes().iter().copied().map(char::from).collect())
}

/// Returns the lines with their numbers from 1, without comments. A line that ends with a backslash continues on the
/// next one.
pub(super) fn logical(text: &str) -> Vec<(usize, String)> {
    let mut lines: Vec<(usize, String)> = Vec::new();
    let mut continues = false;
    for (index, line) in text.lines().enumerate() {
        let line = without_comment(line);
        let part = line.strip_suffix('\\').unwrap_or(line);
        match lines.last_mut().filter(|_| continues) {
            Some((_, start)) => start.extend([" ", part]),
            None => lines.push((index + 1, part.to_owned())),
        }
        continues = part.len() < line.len();
    }
    lines
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
        let text = "# head\r\nv 1 2 3 # first\nf 1 \\\r\n 2 \\\n3\ng part#1";
        let lines = logical(text);
        let expected = [(1, ""), (2, "v 1 2 3"), (3, "f 1   2  3"), (6, "g part#1")];
        assert_eq!(lines.iter().map(|(line, text)| (*line, text.as_str())).collect::<Vec<_>>(), expected);
        assert_eq!(decoded(b"g \xc4rmel".to_vec()), "g Ärmel");
        assert_eq!(decoded("g Ärmel".into()), "g Ärmel");
    }
}
