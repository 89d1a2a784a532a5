use energy_dsl::Element;

use crate::matrix::pattern::index;
use crate::terms::stencils::Stencils;

/// Stencils that do not fit their elements.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ListError {
    /// The numbers of stencils and elements differ.
    #[error("{list}: expected one stencil per element, got {stencils} stencils for {elements} elements")]
    CountMismatch {
        /// Name of the list.
        list: String,
        /// Number of elements.
        elements: usize,
        /// Number of stencils.
        stencils: usize,
    },
    /// The stencils and the element have different numbers of points.
    #[error("{list}: {element} acts on {expected} points, but its stencils have {found} vertices")]
    WrongArity {
        /// Name of the list.
        list: String,
        /// Type of the element.
        element: &'static str,
        /// Points of the element.
        expected: usize,
        /// Vertices of a stencil.
        found: usize,
    },
    /// A stencil names a vertex twice.
    #[error("{list}: element {index} names vertex {vertex} twice")]
    RepeatedVertex {
        /// Name of the list.
        list: String,
        /// Index of the element.
        index: usize,
        /// Index of the vertex.
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
    /// Creates a list in which element i acts on the vertices `stencils[i]`, in the order of its declared points. The
    /// name tells people what the list represents: "structural springs".
    ///
    /// # Errors
    /// If the numbers of elements and stencils, or of points and vertices, differ, or if a stencil repeats a vertex.
    pub fn new<const N: usize>(
        name: impl Into<String>,
        elements: Vec<E>,
        stencils: &[[usize; N]],
    ) -> Result<Self, ListError> {
        let list = name.into();
        let (declared, expected) = (E::DECLARATION, E::DECLARATION.points.len());
        if expected != N {
            return Err(ListError::WrongArity { list, element: &declared.name, expected, found: N });
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

    /// Returns the name of the list.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the elements in order.
    #[must_use]
    pub fn elements(&self) -> &[E] {
        &self.elements
    }

    /// Returns the name and the vertices of all stencils, and drops the elements.
    pub(crate) fn into_name_and_vertices(self) -> (String, Vec<u32>) {
        (self.name, self.vertices)
    }

    /// Returns the vertices of all elements.
    #[must_use]
    pub fn stencils(&self) -> Stencils<'_> {
        Stencils::new(self.arity, &self.vertices)
    }

    /// Returns the number of points of an element.
    #[must_use]
    pub fn arity(&self) -> usize {
        self.arity
    }

    /// Returns the vertices of one element.
    #[must_use]
    pub fn stencil(&self, index: usize) -> &[u32] {
        &self.vertices[index * self.arity..][..self.arity]
    }
}

fn repeated(stencil: &[usize]) -> Option<usize> {
    (1..stencil.len()).find(|&at| stencil[..at].contains(&stencil[at])).map(|at| stencil[at])
}
