/// The longest message, in characters. Names of strangers can have megabytes.
const LONGEST: usize = 16_000;

/// Formats an error and its causes, without control characters except line breaks and tabs, and with at most 16,000
/// characters. A cause that the text before it already ends with is not repeated.
///
/// ```
/// use anyhow::Context;
/// let cause = anyhow::anyhow!("no such file");
/// let error = Err::<(), _>(cause).context("cloth.obj: no such file").context("hang.toml").unwrap_err();
/// assert_eq!(energy_cli::message(&error), "hang.toml: cloth.obj: no such file");
/// ```
#[must_use]
pub fn message(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for cause in error.chain().map(ToString::to_string) {
        if text.is_empty() {
            text = cause;
        } else if !text.ends_with(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    if let Some((end, _)) = text.char_indices().nth(LONGEST) {
        text.truncate(end);
        text.push('…');
    }
    energy_files::printable(&text).into_owned()
}
