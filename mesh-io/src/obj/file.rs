//! The unprocessed contents of an OBJ file.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use energy_files::excerpt;

use super::lines;

/// The largest size of a file, in bytes: some three million vertices with faces.
pub const LARGEST_FILE: u64 = 256 << 20;
/// The largest number of corners of a face.
pub const MOST_CORNERS: usize = 1 << 16;
/// The largest number of groups of a face.
pub const MOST_NAMES: usize = 16;
/// The largest number of names of groups, objects and materials of a file.
pub const MOST_FILE_NAMES: usize = 1 << 18;
/// The largest texture coordinate. Files of results hold them in single precision.
pub const LARGEST_UV: f64 = 1e9;

/// An OBJ file that cannot be read.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum ObjFileError {
    /// The file cannot be read.
    #[error("cannot read {}", .path.display())]
    Unreadable { path: PathBuf, source: std::io::Error },
    /// A line is malformed.
    #[error("{}:{line}: {reason}: `{text}`", .path.display())]
    Line {
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        reason: String,
        /// The start of the line.
        text: String,
    },
}

/// A corner of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Corner {
    vertex: u32,
    /// [`NONE`] without one.
    uv: u32,
    normal: u32,
}

/// Marks a missing texture coordinate or normal. Files are too small to have this index.
const NONE: u32 = u32::MAX;

impl Corner {
    /// Index of the vertex, from 0.
    #[must_use]
    pub fn vertex(self) -> usize {
        self.vertex as usize
    }

    /// Index of the texture coordinates, from 0; `None` without.
    #[must_use]
    pub fn uv(self) -> Option<usize> {
        (self.uv != NONE).then_some(self.uv as usize)
    }

    /// Index of the normal, from 0; `None` without.
    #[must_use]
    pub fn normal(self) -> Option<usize> {
        (self.normal != NONE).then_some(self.normal as usize)
    }
}

/// A polygon of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Face {
    /// Range of its corners in the file's.
    corners: (u32, u32),
    line: u32,
    /// Index of its set of groups.
    groups: u32,
}

impl Face {
    /// Its line, from 1.
    #[must_use]
    pub fn line(self) -> usize {
        self.line as usize
    }
}

/// The parts of a file that describe a surface.
#[derive(Debug, Default)]
pub struct ObjFile {
    /// Positions of the vertices, in the unit of the file.
    pub vertices: Vec<[f64; 3]>,
    /// The line of each vertex, from 1.
    pub vertex_lines: Vec<u32>,
    /// Texture coordinates.
    pub uvs: Vec<[f64; 2]>,
    /// Number of normals.
    pub normal_count: usize,
    /// The faces, in the order of the file.
    pub faces: Vec<Face>,
    /// Names of groups, objects and materials, in the order of the file.
    pub names: Vec<String>,
    corners: Vec<Corner>,
    /// Sets of groups, object and material that faces have: ranges of [`Self::set_names`].
    group_sets: Vec<(u32, u32)>,
    /// Indices of names.
    set_names: Vec<u32>,
}

/// A malformed line: its number from 1, the problem, and its text.
struct Malformed {
    line: usize,
    reason: String,
    text: String,
}

/// The groups, object and material of the following faces, and the remaining budgets of the file.
#[derive(Default)]
struct Current {
    groups: Vec<u32>,
    object: Option<u32>,
    material: Option<u32>,
    /// Index of their set; `None` before the first face.
    set: Option<u32>,
    /// Index of each name.
    known: BTreeMap<String, u32>,
    /// Number of triangles that the file may still have. Polygons of short numbers would have one for every two bytes,
    /// and programs take a hundred bytes for each.
    triangles: usize,
    /// Number of triangles that it may still have in groups, each counted as often as it has names.
    named: usize,
}

impl ObjFile {
    /// Reads a file. The text is UTF-8 or Latin-1.
    ///
    /// # Errors
    /// If the file cannot be read, is not a regular file, is too large, or has a malformed line.
    pub fn read(path: &Path) -> Result<Self, ObjFileError> {
        let contents = energy_files::read(path, LARGEST_FILE);
        let contents = contents.map_err(|source| ObjFileError::Unreadable { path: path.to_owned(), source })?;
        Self::parse(&lines::decoded(contents), path)
    }

    /// Parses a text. Statements that do not describe a surface are ignored. The path is used in messages.
    ///
    /// # Errors
    /// If a line is malformed, or a face refers to something that the file lacks.
    ///
    /// ```
    /// use std::path::Path;
    /// let file = mesh_io::obj::ObjFile::parse("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", Path::new("a.obj"))?;
    /// let corners = file.corners(file.faces[0]);
    /// assert_eq!(corners.iter().map(|corner| corner.vertex()).collect::<Vec<_>>(), [0, 1, 2]);
    /// let error = mesh_io::obj::ObjFile::parse("v 0 0 zero\n", Path::new("a.obj")).unwrap_err();
    /// assert_eq!(error.to_string(), "a.obj:1: expected a number, got `zero`: `v 0 0 zero`");
    /// # Ok::<(), mesh_io::obj::ObjFileError>(())
    /// ```
    pub fn parse(text: &str, path: &Path) -> Result<Self, ObjFileError> {
        Self::parse_lines(text).map_err(|Malformed { line, reason, text }| {
            let path = path.to_owned();
            ObjFileError::Line { path, line, reason, text }
        })
    }

    /// The corners of a face.
    ///
    /// # Panics
    /// If the face belongs to another file.
    #[must_use]
    pub fn corners(&self, face: Face) -> &[Corner] {
        &self.corners[face.corners.0 as usize..face.corners.1 as usize]
    }

    /// The groups, object and material of a face, as indices of names.
    ///
    /// # Panics
    /// If the face belongs to another file.
    #[must_use]
    pub fn groups(&self, face: Face) -> &[u32] {
        let (start, end) = self.group_sets[face.groups as usize];
        &self.set_names[start as usize..end as usize]
    }

    fn parse_lines(text: &str) -> Result<Self, Malformed> {
        let (triangles, named) = (1_000_000 + text.len() / 16, 2_000_000 + text.len() / 4);
        let (mut file, mut current) = (Self::default(), Current { triangles, named, ..Current::default() });
        let malformed = |line: usize, text: &str, reason: String| {
            let text = excerpt(text.trim()).into_owned();
            Malformed { line, reason, text }
        };
        for (line, text) in lines::logical(text) {
            file.add(line, &text, &mut current).map_err(|reason| malformed(line, &text, reason))?;
        }
        let broken = file.faces.iter().find_map(|face| Some((face.line(), file.missing(*face)?)));
        let Some((line, reason)) = broken else { return Ok(file) };
        let text = lines::logical(text).find(|(number, _)| *number == line);
        Err(malformed(line, &text.map_or("".into(), |(_, text)| text), reason))
    }

    fn add(&mut self, line: usize, text: &str, current: &mut Current) -> Result<(), String> {
        let mut words = text.split_whitespace();
        match words.next() {
            Some("v") => {
                self.vertices.push(numbers(words)?);
                self.vertex_lines.push(line as u32);
            }
            Some("vt") => {
                // A missing second coordinate is 0.
                let [u, v] = numbers(words.chain(["0"]).take(2))?;
                if let Some(other) = [u, v].into_iter().find(|x| x.is_nan() || x.abs() > LARGEST_UV) {
                    return Err(format!("expected a texture coordinate of at most {LARGEST_UV:e}, got {other:e}"));
                }
                self.uvs.push([u, v]);
            }
            Some("vn") => self.normal_count += 1,
            Some("f") => self.add_face(line, words, current)?,
            Some("g") => {
                let names: Vec<&str> = words.take(MOST_NAMES + 1).collect();
                if names.len() > MOST_NAMES {
                    return Err(format!("expected at most {MOST_NAMES} groups"));
                }
                current.groups = names.into_iter().map(|name| self.name(name, current)).collect::<Result<_, _>>()?;
                current.set = None;
            }
            Some(keyword @ ("o" | "usemtl")) => {
                let name = text.trim_start()[keyword.len()..].trim();
                let named = if name.is_empty() { None } else { Some(self.name(name, current)?) };
                *(if keyword == "o" { &mut current.object } else { &mut current.material }) = named;
                current.set = None;
            }
            _ => {}
        }
        Ok(())
    }

    fn add_face<'a>(
        &mut self,
        line: usize,
        words: impl Iterator<Item = &'a str>,
        current: &mut Current,
    ) -> Result<(), String> {
        let start = self.corners.len();
        for word in words {
            if self.corners.len() - start == MOST_CORNERS {
                return Err(format!("a face has at most {MOST_CORNERS} corners"));
            }
            let corner = self.corner(word)?;
            self.corners.push(corner);
        }
        let count = self.corners.len() - start;
        if count < 3 {
            return Err(format!("a face needs at least three corners, got {count}"));
        }
        let groups = *current.set.get_or_insert_with(|| {
            let named = current.groups.iter().copied().chain(current.object).chain(current.material);
            let start = self.set_names.len() as u32;
            self.set_names.extend(named.collect::<BTreeSet<u32>>());
            self.group_sets.push((start, self.set_names.len() as u32));
            self.group_sets.len() as u32 - 1
        });
        let (start_name, end_name) = self.group_sets[groups as usize];
        let named = (count - 2) * (end_name - start_name) as usize;
        charge(&mut current.triangles, count - 2, "1,000,000 triangles and one for every 16 bytes")?;
        charge(&mut current.named, named, "2,000,000 triangles in groups and one for every 4 bytes")?;
        let corners = (start as u32, self.corners.len() as u32);
        self.faces.push(Face { corners, line: line as u32, groups });
        Ok(())
    }

    /// Returns the index of a name, after adding it if it is new.
    fn name(&mut self, name: &str, current: &mut Current) -> Result<u32, String> {
        if let Some(&known) = current.known.get(name) {
            return Ok(known);
        }
        let index = self.names.len();
        if index == MOST_FILE_NAMES {
            return Err(format!("a file has at most {MOST_FILE_NAMES} names of groups, objects and materials"));
        }
        self.names.push(name.to_owned());
        current.known.insert(name.to_owned(), index as u32);
        Ok(index as u32)
    }

    /// Parses `vertex`, `vertex/uv`, `vertex//normal` or `vertex/uv/normal`.
    fn corner(&self, word: &str) -> Result<Corner, String> {
        let mut fields = word.split('/');
        let mut index = |count: usize| match fields.next() {
            None | Some("") => Ok(NONE),
            Some(field) => index(field, count),
        };
        let (vertex, uv, normal) = (index(self.vertices.len())?, index(self.uvs.len())?, index(self.normal_count)?);
        if vertex == NONE {
            return Err(format!("expected the number of a vertex, got `{}`", excerpt(word)));
        }
        Ok(Corner { vertex, uv, normal })
    }

    /// Describes what a face refers to in vain; `None` if everything exists.
    fn missing(&self, face: Face) -> Option<String> {
        let reason =
            |what: &str, count: usize| format!("the face refers to a {what} that is not among the {count} of the file");
        let counts = (self.vertices.len(), self.uvs.len(), self.normal_count);
        self.corners(face).iter().find_map(|corner| match corner {
            corner if corner.vertex() >= counts.0 => Some(reason("vertex", counts.0)),
            corner if corner.uv().is_some_and(|uv| uv >= counts.1) => Some(reason("texture coordinate", counts.1)),
            corner if corner.normal().is_some_and(|normal| normal >= counts.2) => Some(reason("normal", counts.2)),
            _ => None,
        })
    }
}

/// Takes triangles from those that are left.
fn charge(left: &mut usize, count: usize, most: &str) -> Result<(), String> {
    *left = left.checked_sub(count).ok_or_else(|| format!("a file has at most {most}; are faces repeated?"))?;
    Ok(())
}

/// Parses an index: from 1, or from −1 backwards among the `count` before the line. Returns it from 0.
fn index(field: &str, count: usize) -> Result<u32, String> {
    let number: i64 = field.parse().map_err(|_| format!("expected a whole number, got `{}`", excerpt(field)))?;
    let from_zero = if number > 0 { Some(number - 1) } else { (count as i64).checked_add(number) };
    match from_zero.map(u32::try_from) {
        Some(Ok(index)) if number != 0 && index != NONE => Ok(index),
        _ => Err(format!("the face refers to a vertex that is not among the {count} of the file")),
    }
}

/// Parses the first N words as numbers; ignores the others, such as weights and colours.
fn numbers<'a, const N: usize>(words: impl Iterator<Item = &'a str>) -> Result<[f64; N], String> {
    let (mut numbers, mut count) = ([0.0; N], 0);
    for (number, word) in numbers.iter_mut().zip(words) {
        *number = word.parse().map_err(|_| format!("expected a number, got `{}`", excerpt(word)))?;
        count += 1;
    }
    if count == N { Ok(numbers) } else { Err(format!("expected {N} numbers, got {count}")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> String {
        ObjFile::parse(text, Path::new("a.obj")).unwrap_err().to_string()
    }

    #[test]
    fn faces_have_a_limit_and_messages_are_short() {
        let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
        let error = message(&format!("{triangle}f {}\n", "1 ".repeat(10_000_000)));
        assert!(error.starts_with("a.obj:4: a face has at most 65536 corners: `f 1 1"), "{error}");
        assert!(error.len() < 300, "{} bytes", error.len());
        for long in ["v 0 0 x", "f 1 2 ", "f 1 2 3 4/"] {
            let error = message(&format!("{triangle}{long}{}\n", "9".repeat(1_000_000)));
            assert!(error.len() < 500, "{long}: {} bytes", error.len());
        }
        let error = message(&format!("g {}\n", "a ".repeat(17)));
        assert!(error.contains("at most 16 groups"), "{error}");
        assert!(message(&format!("{triangle}f 1 2 {}\n", i64::MIN)).contains("not among the 3"));
        assert!(message(&format!("{triangle}f 1 2 4294967296\n")).contains("not among the 3"));
    }

    #[test]
    fn texture_coordinates_are_finite_in_single_precision() {
        for (uv, shown) in [("nan 0", "NaN"), ("0 inf", "inf"), ("-1e300 0", "-1e300"), ("0 1.1e9", "1.1e9")] {
            let error = message(&format!("v 0 0 0\nvt {uv}\n"));
            let expected = format!("a.obj:2: expected a texture coordinate of at most 1e9, got {shown}: `vt {uv}`");
            assert_eq!(error, expected);
        }
        let file = ObjFile::parse("vt -1e9 0.5\nvt 3\n", Path::new("a.obj")).unwrap();
        assert_eq!(file.uvs, [[-1e9, 0.5], [3.0, 0.0]]);
    }

    #[test]
    fn triangles_and_names_are_limited_by_the_size_of_the_file() {
        let fan = format!("f {}\n", "1 2 3 ".repeat(20_000)).repeat(20);
        let error = message(&format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{fan}"));
        assert!(error.contains("at most 1,000,000 triangles and one for every 16 bytes"), "{error}");
        let error = message(&format!("g a b c d\nv 0 0 0\nv 1 0 0\nv 0 1 0\n{fan}"));
        assert!(error.contains("at most 2,000,000 triangles in groups"), "{error}");
        let names: String = (0..=MOST_FILE_NAMES).map(|name| format!("o {name}\n")).collect();
        assert!(message(&names).contains("a.obj:262145: a file has at most 262144 names"), "{}", message(&names));
    }

    #[test]
    fn many_names_take_no_time() {
        let text: String = (0..200_000).map(|i| format!("usemtl m{i}\nv 0 0 0\n")).collect();
        let start = std::time::Instant::now();
        assert_eq!(ObjFile::parse(&text, Path::new("a.obj")).unwrap().names.len(), 200_000);
        assert!(start.elapsed().as_secs_f64() < 5.0, "{:?}", start.elapsed());
    }
}
