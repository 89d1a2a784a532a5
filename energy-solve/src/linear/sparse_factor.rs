use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::perm::PermRef;
use faer::sparse::linalg::amd;
use faer::sparse::linalg::cholesky::{LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky};
use faer::sparse::{FaerError, SparseColMatRef, SymbolicSparseColMat, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

/// A sparse Cholesky factor for matrices of one pattern. The elimination order and the fill-in are computed once.
pub(crate) struct SparseFactor {
    /// Pattern of the lower triangle, by columns.
    structure: SymbolicSparseColMat<usize>,
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
    factor: Vec<f64>,
    memory: MemBuffer,
}

/// A pivot is not positive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NotPositiveDefinite;

impl std::fmt::Debug for SparseFactor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SparseFactor").field("entries", &self.factor.len()).finish_non_exhaustive()
    }
}

impl SparseFactor {
    /// Analyses lower triangles with these column starts and row indices. Unknowns are eliminated in the given order,
    /// or in an approximate minimum degree order.
    pub(crate) fn new(columns: Vec<usize>, rows: Vec<usize>, order: Option<&Order>) -> Result<Self, FaerError> {
        let unknowns = columns.len() - 1;
        let structure = SymbolicSparseColMat::new_checked(unknowns, unknowns, columns, None, rows);
        let order = match order {
            Some(Order { forward, inverse }) => {
                SymmetricOrdering::Custom(PermRef::new_checked(forward, inverse, unknowns))
            }
            None => SymmetricOrdering::Amd,
        };
        let symbolic = factorize_symbolic_cholesky(structure.as_ref(), Side::Lower, order, Default::default())?;
        let scratch = symbolic
            .factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default())
            .or(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        let memory = MemBuffer::try_new(scratch).map_err(|_| FaerError::OutOfMemory)?;
        let values = vec![0.0; structure.row_idx().len()];
        let factor = vec![0.0; symbolic.len_val()];
        Ok(Self { structure, symbolic, values, factor, memory })
    }

    /// Returns the entries of the lower triangle, to be set before [`SparseFactor::factor`].
    pub(crate) fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Returns the number of entries of the factor.
    pub(crate) fn entries(&self) -> usize {
        self.factor.len()
    }

    /// Factors the matrix with the current values.
    pub(crate) fn factor(&mut self) -> Result<(), NotPositiveDefinite> {
        let Self { structure, symbolic, values, factor, memory } = self;
        let a = SparseColMatRef::new(structure.as_ref(), values.as_slice());
        let (regularisation, parameters) = (LltRegularization::default(), Default::default());
        symbolic
            .factorize_numeric_llt(factor, a, Side::Lower, regularisation, Par::Seq, MemStack::new(memory), parameters)
            .map(|_| ())
            .map_err(|_| NotPositiveDefinite)
    }

    /// x ← A⁻¹ x for the last factored matrix A.
    pub(crate) fn solve(&mut self, x: &mut [f64]) {
        Self::solve_with(&self.symbolic, &self.factor, x, MemStack::new(&mut self.memory));
    }

    /// x ← A⁻¹ x for the last factored matrix A, with scratch memory that is allocated for this call.
    pub(crate) fn solve_with_new_scratch(&self, x: &mut [f64]) {
        let mut memory = MemBuffer::new(self.symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        Self::solve_with(&self.symbolic, &self.factor, x, MemStack::new(&mut memory));
    }

    fn solve_with(symbolic: &SymbolicCholesky<usize>, factor: &[f64], x: &mut [f64], stack: &mut MemStack) {
        let rows = x.len();
        let x = MatMut::from_column_major_slice_mut(x, rows, 1);
        LltRef::new(symbolic, factor).solve_in_place_with_conj(Conj::No, x, Par::Seq, stack);
    }
}

/// An elimination order: the unknown at each position, and the position of each unknown.
pub(crate) struct Order {
    forward: Vec<usize>,
    inverse: Vec<usize>,
}

impl Order {
    /// Computes an approximate minimum degree order for groups of `size` unknowns. `columns` and `rows` are the lower
    /// triangle of the groups' pattern.
    pub(crate) fn by_minimum_degree(size: usize, columns: &[usize], rows: &[usize]) -> Result<Self, FaerError> {
        let groups = columns.len() - 1;
        let structure = SymbolicSparseColMatRef::new_checked(groups, groups, columns, None, rows);
        let (mut order, mut places) = (vec![0; groups], vec![0; groups]);
        let scratch: StackReq = amd::order_maybe_unsorted_scratch::<usize>(groups, rows.len());
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| FaerError::OutOfMemory)?;
        amd::order_maybe_unsorted(&mut order, &mut places, structure, Default::default(), MemStack::new(&mut memory))?;
        let expanded = |groups: Vec<usize>| -> Vec<usize> {
            groups.into_iter().flat_map(|group| (0..size).map(move |unknown| size * group + unknown)).collect()
        };
        Ok(Self { forward: expanded(order), inverse: expanded(places) })
    }
}
