use energy_dsl::Element;

use crate::matrix::pattern::index;
use crate::terms::stencils::Stencils;

/// Stencils that do not fit their elements.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ListError {
    /// As many stencils as elements are needed.
    #[error("{list}: {elements} elements but {stencils} stencils; give every element the vertices it acts on")]
    CountMismatch {
        /// The list's name.
        list: String,
        /// Elements given.
        elements: usize,
        /// Stencils given.
        stencils: usize,
    },
    /// The element acts on another number of points.
    #[error("{list}: {element} acts on {expected} points, but its stencils have {found} vertices")]
    WrongArity {
        /// The list's name.
        list: String,
        /// The element's type.
        element: &'static str,
        /// Points of the element.
        expected: usize,
        /// Vertices of the stencils.
        found: usize,
    },
    /// An element's points are different vertices.
    #[error("{list}: element {index} names vertex {vertex} twice")]
    RepeatedVertex {
        /// The list's name.
        list: String,
        /// Which element, from 0.
        index: usize,
        /// The vertex.
        vertex: usize,
    },
}

/// Elements of one type and the vertices each acts on.
#[derive(Clone, Debug)]
pub struct ElementList<E> {
    name: String,
    elements: Vec<E>,
    vertices: Vec<u32>,
    arity: usize,
}

impl<E: Element> ElementList<E> {
    /// Element i acts on the vertices `stencils[i]`, in the order of its declared points. The name, for people, says what
    /// the list stands for: "structural springs".
    ///
    /// # Errors
    /// When the numbers of elements and stencils, or of points and vertices, differ, or a stencil repeats a vertex.
    pub fn new<const N: usize>(
        name: impl Into<String>,
        elements: Vec<E>,
        stencils: &[[usize; N]],
    ) -> Result<Self, ListError> {
        let list = name.into();
        let (declared, expected) = (E::DECLARATION, E::DECLARATION.points.len());
        if expected != N {
            return Err(ListError::WrongArity { list, element: declared.name, expected, found: N });
        }
        if elements.len() != stencils.len() {
            return Err(ListError::CountMismatch { list, elements: elements.len(), stencils: stencils.len() });
        }
        for (element, stencil) in stencils.iter().enumerate() {
            if let Some(vertex) = repeated(stencil) {
                return Err(ListError::RepeatedVertex { list, index: element, vertex });
            }
        }
        Ok(Self {
            name: list,
            elements,
            vertices: stencils.as_flattened().iter().copied().map(index).collect(),
            arity: N,
        })
    }

    /// The list's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The elements, in order.
    #[must_use]
    pub fn elements(&self) -> &[E] {
        &self.elements
    }

    /// Returns the name and the vertices of all stencils, and drops the elements.
    pub(crate) fn into_name_and_vertices(self) -> (String, Vec<u32>) {
        (self.name, self.vertices)
    }

    /// The stencils of all elements.
    #[must_use]
    pub fn stencils(&self) -> Stencils<'_> {
        Stencils::new(self.arity, &self.vertices)
    }

    /// How many points an element has.
    #[must_use]
    pub fn arity(&self) -> usize {
        self.arity
    }

    /// The vertices of one element.
    #[must_use]
    pub fn stencil(&self, index: usize) -> &[u32] {
        &self.vertices[index * self.arity..][..self.arity]
    }
}

fn repeated(stencil: &[usize]) -> Option<usize> {
    (1..stencil.len()).find(|&at| stencil[..at].contains(&stencil[at])).map(|at| stencil[at])
}
