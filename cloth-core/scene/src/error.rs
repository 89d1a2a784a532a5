use std::path::{Path, PathBuf};

/// A scene file that cannot be used.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum SceneError {
    /// The file cannot be read.
    #[error("cannot read the scene {}", .path.display())]
    Unreadable { path: PathBuf, source: std::io::Error },
    /// The text is not a valid scene.
    #[error("{}:{line}:{column}: {message}", .path.display())]
    Invalid {
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// The column in characters, from 1.
        column: usize,
        /// The problem, with a remedy if one is known.
        message: String,
    },
    /// The scene names a file outside the folders that it may read.
    #[error(
        "{} is outside the scene's folder; move it there, or allow its folder by --allow-path {}",
        .file.display(), .file.parent().unwrap_or(.file).display()
    )]
    Outside {
        /// The path as the scene names it, within its folder.
        file: PathBuf,
    },
}

impl SceneError {
    pub(crate) fn invalid(path: &Path, text: &str, error: &toml::de::Error) -> Self {
        let start = error.span().map_or(0, |span| span.start.min(text.len()));
        let before = &text[..start];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().map_or(0, |rest| rest.chars().count()) + 1;
        let suggestion = suggest(error.message()).map(|name| format!("; did you mean `{name}`?")).unwrap_or_default();
        let message = format!("{}{suggestion}", error.message().replace('\n', " "));
        Self::Invalid { path: path.to_owned(), line, column, message }
    }
}

/// Returns the known name closest to the unknown one in "unknown field `a`, expected one of `b`, `c`".
fn suggest(message: &str) -> Option<&str> {
    let mut names = message.strip_prefix("unknown ")?.split('`').skip(1).step_by(2);
    let unknown = names.next()?;
    let distance = |known: &&str| strsim::damerau_levenshtein(unknown, known);
    names.min_by_key(distance).filter(|known| distance(known) <= (unknown.chars().count() / 2).max(1))
}

#[cfg(test)]
mod tests {
    use crate::Scene;

    const SCENE: &str = r#"dt = 0.01
duration = 1.0
[mesh.sheet]
cells = [4, 4]
size = [1.0, 1.0]
[fabric]
density = 0.15
[fabric.material.stvk]
stretch_stiffness = 50.0
poisson_ratio = 0.3
[fabric.material.stvk.bending.bridson]
stiffness = 1e-5
"#;

    fn message(from: &str, to: &str) -> String {
        assert!(SCENE.contains(from));
        Scene::parse(&SCENE.replace(from, to), "s.toml".as_ref()).unwrap_err().to_string()
    }

    #[test]
    fn a_good_scene_passes() {
        assert_eq!(Scene::parse(SCENE, "s.toml".as_ref()).unwrap().steps(), 100);
    }

    #[test]
    fn unknown_keys_are_refused_with_a_suggestion() {
        let text = message("density", "densty");
        assert!(text.starts_with("s.toml:7:1: unknown field `densty`"), "{text}");
        assert!(text.ends_with("did you mean `density`?"), "{text}");
        let text = message("material.stvk", "material.stkv");
        assert!(text.starts_with("s.toml:8:") && text.ends_with("did you mean `stvk`?"), "{text}");
        let text = message("poisson_ratio", "poison_ratio");
        assert!(text.starts_with("s.toml:10:1: ") && text.ends_with("did you mean `poisson_ratio`?"), "{text}");
        let text = message("[fabric.material.stvk]", "[fabric.material.mass-spring]\n[fabric.material.stvk]");
        assert!(
            text.starts_with("s.toml:8:") && text.ends_with("got `mass-spring`, `stvk`") && text.contains("`arap`"),
            "{text}"
        );
        assert!(!message("density", "colour").contains("did you mean"));
    }

    #[test]
    fn impossible_numbers_are_refused_where_they_stand() {
        let expect = |from, to, start: &str, part: &str| {
            let text = message(from, to);
            assert!(text.starts_with(start) && text.contains(part), "{text}");
        };
        expect("dt = 0.01", "dt = nan", "s.toml:1:6: ", "expected a finite number greater than 0, got NaN");
        expect("0.15", "-0.15", "s.toml:7:11: ", "expected a finite number greater than 0, got -0.15");
        expect("50.0", "inf", "s.toml:9:21: ", "expected a finite number of at least 0, got inf");
        expect("0.3", "1.0", "s.toml:10:17: ", "between −1 and 1");
        expect("[4, 4]", "[0, 4]", "s.toml:4:9: ", "from 1 to 4096");
        expect("[1.0, 1.0]", "[1.0, nan]", "s.toml:5:8: ", "greater than 0 only");
        expect("density = 0.15", "", "s.toml:6:1: ", "missing field `density`");
        expect("dt = 0.01", "dt = ", "s.toml:1:", "");
        expect("1e-5", "\"soft\"", "s.toml:12:13: ", "invalid type");
    }
}
