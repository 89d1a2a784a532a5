use energy_dsl::BLOCK;

/// The vertices of a term's elements, `arity` per element.
///
/// ```
/// use energy_solve::Stencils;
///
/// let springs = Stencils::new(2, &[0, 1, 1, 2, 2, 0]);
/// assert_eq!(springs.len(), 3);
/// assert!(springs.stencil(1).eq([1, 2]));
/// assert_eq!(springs.vertex(2, 0), 2);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Stencils<'a> {
    count: usize,
    arity: usize,
    vertices: &'a [u32],
    layout: Layout,
}

#[derive(Clone, Copy, Debug)]
enum Layout {
    /// One stencil after the other.
    ByElement,
    /// Sorted by pack of elements, then point, then element.
    InLanes,
}

impl<'a> Stencils<'a> {
    /// Wraps vertices that are stored one stencil after the other.
    ///
    /// # Panics
    /// If `arity` is zero.
    #[must_use]
    pub fn new(arity: usize, vertices: &'a [u32]) -> Self {
        Self { count: vertices.len() / arity, arity, vertices, layout: Layout::ByElement }
    }

    /// Wraps vertices in the layout of [`Packed`](energy_dsl::Packed).
    pub(crate) fn in_lanes(count: usize, arity: usize, vertices: &'a [u32]) -> Self {
        Self { count, arity, vertices, layout: Layout::InLanes }
    }

    /// Returns the number of points of an element.
    #[must_use]
    pub fn arity(&self) -> usize {
        self.arity
    }

    /// Returns the number of elements.
    #[must_use]
    pub fn len(&self) -> usize {
        self.count
    }

    /// Whether the list is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Returns the vertex at a point of an element.
    #[inline(always)]
    #[must_use]
    pub fn vertex(&self, element: usize, point: usize) -> u32 {
        self.vertices[match self.layout {
            Layout::ByElement => element * self.arity + point,
            Layout::InLanes => (element / BLOCK * self.arity + point) * BLOCK + element % BLOCK,
        }]
    }

    /// Returns the vertices of one element.
    pub fn stencil(self, element: usize) -> impl ExactSizeIterator<Item = u32> + Clone + use<'a> {
        (0..self.arity).map(move |point| self.vertex(element, point))
    }

    /// Returns the stencil of each element.
    pub fn iter(self) -> impl ExactSizeIterator<Item = impl ExactSizeIterator<Item = u32> + Clone + use<'a>> + use<'a> {
        (0..self.count).map(move |element| self.stencil(element))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_layouts_hold_the_same() {
        // 18 triangles: one full pack and two more.
        let vertex = |element: usize, point: usize| (3 * element + point) as u32;
        let by_element: Vec<u32> = (0..54).collect();
        let mut in_lanes = vec![u32::MAX; 2 * 3 * BLOCK];
        for element in 0..18 {
            for point in 0..3 {
                in_lanes[(element / BLOCK * 3 + point) * BLOCK + element % BLOCK] = vertex(element, point);
            }
        }
        let (one, other) = (Stencils::new(3, &by_element), Stencils::in_lanes(18, 3, &in_lanes));
        assert_eq!((one.len(), other.len()), (18, 18));
        for (element, (a, b)) in one.iter().zip(other.iter()).enumerate() {
            assert!(a.clone().eq(b) && a.eq((0..3).map(|point| vertex(element, point))));
        }
    }
}
