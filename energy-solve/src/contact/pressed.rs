use std::fmt;

/// The feature of a body that contact presses the most. Messages about failed steps name it.
///
/// ```
/// use energy_solve::{Pressed, Presser};
///
/// let by = vec![Presser::Obstacle("press".into()), Presser::Vertices(vec![7, 8])];
/// let pressed = Pressed { vertices: vec![3], by };
/// assert_eq!(pressed.to_string(), "presses vertex 3 between press and the vertices 7, 8");
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pressed {
    /// The vertices of the pressed feature.
    pub vertices: Vec<usize>,
    /// The things that press it: one, or two from opposite sides.
    pub by: Vec<Presser>,
}

/// Something that presses a feature.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Presser {
    /// An obstacle with this name.
    Obstacle(String),
    /// Another feature of the body, with these vertices.
    Vertices(Vec<usize>),
}

impl Pressed {
    /// Renumbers the vertices, from the numbering of a body to `vertices[…]`.
    #[must_use]
    pub fn on_vertices(mut self, vertices: &[usize]) -> Self {
        let own = self.by.iter_mut().filter_map(|presser| match presser {
            Presser::Obstacle(_) => None,
            Presser::Vertices(own) => Some(own),
        });
        own.chain([&mut self.vertices]).flatten().for_each(|vertex| *vertex = vertices[*vertex]);
        self
    }
}

impl fmt::Display for Pressed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "presses {}", Named(&self.vertices))?;
        match &self.by[..] {
            [] => Ok(()),
            [one] => write!(f, " against {one}"),
            [one, other, ..] => write!(f, " between {one} and {other}"),
        }
    }
}

impl fmt::Display for Presser {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Obstacle(name) => f.write_str(name),
            Self::Vertices(vertices) => Named(vertices).fmt(f),
        }
    }
}

/// Names a feature by its vertices.
struct Named<'a>(&'a [usize]);

impl fmt::Display for Named<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let numbers: Vec<String> = self.0.iter().map(ToString::to_string).collect();
        write!(f, "{} {}", if numbers.len() == 1 { "vertex" } else { "the vertices" }, numbers.join(", "))
    }
}
