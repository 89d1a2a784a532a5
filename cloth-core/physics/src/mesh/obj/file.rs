//! The contents of an OBJ file as they stand there.

use std::collections::BTreeSet;

use energy_dsl::Vector3;

/// A corner of a face: indices from 0 of its vertex, texture coordinates and normal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Corner {
    pub vertex: usize,
    pub uv: Option<usize>,
    pub normal: Option<usize>,
}

/// A polygon.
#[derive(Clone, Debug)]
pub(super) struct Face {
    pub corners: Vec<Corner>,
    /// Its line, from 1.
    pub line: usize,
    /// Its groups, object and material, as indices into [`ObjFile::names`].
    pub groups: Vec<usize>,
}

/// The parts of a file that describe a surface.
#[derive(Debug, Default)]
pub(super) struct ObjFile {
    pub vertices: Vec<Vector3<f64>>,
    /// The line of each vertex, from 1.
    pub vertex_lines: Vec<usize>,
    pub uvs: Vec<[f64; 2]>,
    pub normal_count: usize,
    pub faces: Vec<Face>,
    /// Names of groups, objects and materials, in the order of the file.
    pub names: Vec<String>,
}

/// A malformed line: its number from 1, the problem, and its text.
#[derive(Debug, PartialEq)]
pub(super) struct Malformed {
    pub line: usize,
    pub reason: String,
    pub text: String,
}

/// The groups, object and material of the following faces.
#[derive(Default)]
struct Current {
    groups: Vec<usize>,
    object: Option<usize>,
    material: Option<usize>,
}

impl ObjFile {
    /// Parses the lines of a file. Statements that do not describe a surface are ignored.
    pub(super) fn parse(lines: &[(usize, String)]) -> Result<Self, Malformed> {
        let (mut file, mut current) = (Self::default(), Current::default());
        for (line, text) in lines {
            let malformed = |reason: String| Malformed { line: *line, reason, text: text.trim().to_owned() };
            file.add(*line, text, &mut current).map_err(malformed)?;
        }
        let broken = file.faces.iter().find_map(|face| Some((face.line, file.missing(face)?)));
        match broken {
            Some((line, reason)) => {
                let text = lines.iter().find(|(number, _)| *number == line).map(|(_, text)| text.trim().to_owned());
                Err(Malformed { line, reason, text: text.unwrap_or_default() })
            }
            None => Ok(file),
        }
    }

    fn add(&mut self, line: usize, text: &str, current: &mut Current) -> Result<(), String> {
        let mut words = text.split_whitespace();
        match words.next() {
            Some("v") => {
                self.vertices.push(numbers(words)?);
                self.vertex_lines.push(line);
            }
            Some("vt") => {
                // A missing second coordinate is 0.
                let [u, v] = numbers(words.chain(["0"]).take(2))?;
                self.uvs.push([u, v]);
            }
            Some("vn") => self.normal_count += 1,
            Some("f") => {
                let corners: Vec<Corner> = words.map(|word| self.corner(word)).collect::<Result<_, _>>()?;
                if corners.len() < 3 {
                    return Err(format!("a face needs at least three corners, got {}", corners.len()));
                }
                let named = current.groups.iter().copied().chain(current.object).chain(current.material);
                let groups = named.collect::<BTreeSet<usize>>().into_iter().collect();
                self.faces.push(Face { corners, line, groups });
            }
            Some("g") => current.groups = words.map(|name| self.name(name)).collect(),
            Some(keyword @ ("o" | "usemtl")) => {
                let name = text.trim_start()[keyword.len()..].trim();
                let named = (!name.is_empty()).then(|| self.name(name));
                *(if keyword == "o" { &mut current.object } else { &mut current.material }) = named;
            }
            _ => {}
        }
        Ok(())
    }

    fn name(&mut self, name: &str) -> usize {
        self.names.iter().position(|known| known == name).unwrap_or_else(|| {
            self.names.push(name.to_owned());
            self.names.len() - 1
        })
    }

    /// Parses `vertex`, `vertex/uv`, `vertex//normal` or `vertex/uv/normal`.
    fn corner(&self, word: &str) -> Result<Corner, String> {
        let mut fields = word.split('/');
        let mut index = |count: usize| match fields.next() {
            None | Some("") => Ok(None),
            Some(field) => index(field, count).map(Some),
        };
        let (vertex, uv, normal) = (index(self.vertices.len())?, index(self.uvs.len())?, index(self.normal_count)?);
        let vertex = vertex.ok_or_else(|| format!("expected the number of a vertex, got `{word}`"))?;
        Ok(Corner { vertex, uv, normal })
    }

    /// Describes what a face refers to in vain; `None` if everything exists.
    fn missing(&self, face: &Face) -> Option<String> {
        let reason =
            |what: &str, count: usize| format!("the face refers to a {what} that is not among the {count} of the file");
        let counts = (self.vertices.len(), self.uvs.len(), self.normal_count);
        face.corners.iter().find_map(|corner| match corner {
            corner if corner.vertex >= counts.0 => Some(reason("vertex", counts.0)),
            corner if corner.uv.is_some_and(|uv| uv >= counts.1) => Some(reason("texture coordinate", counts.1)),
            corner if corner.normal.is_some_and(|normal| normal >= counts.2) => Some(reason("normal", counts.2)),
            _ => None,
        })
    }
}

/// Parses an index: from 1, or from −1 backwards among the `count` before the line. Returns it from 0.
fn index(field: &str, count: usize) -> Result<usize, String> {
    let number: i64 = field.parse().map_err(|_| format!("expected a whole number, got `{field}`"))?;
    let from_zero = if number > 0 { number - 1 } else { count as i64 + number };
    match usize::try_from(from_zero) {
        Ok(index) if number != 0 => Ok(index),
        _ => Err(format!("the face refers to a vertex that is not among the {count} of the file")),
    }
}

/// Parses the first N words as numbers; ignores the others, such as weights and colours.
fn numbers<'a, const N: usize>(words: impl Iterator<Item = &'a str>) -> Result<[f64; N], String> {
    let number = |word: &str| word.parse::<f64>().map_err(|_| format!("expected a number, got `{word}`"));
    let numbers: Vec<f64> = words.take(N).map(number).collect::<Result<_, _>>()?;
    let count = numbers.len();
    numbers.try_into().map_err(|_| format!("expected {N} numbers, got {count}"))
}
