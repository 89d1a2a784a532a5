use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::perm::PermRef;
use faer::sparse::linalg::amd;
use faer::sparse::linalg::cholesky::{LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky};
use faer::sparse::{FaerError, SparseColMatRef, SymbolicSparseColMat, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

/// A sparse Cholesky factor, for matrices of one pattern: elimination order and fill are found once.
pub(crate) struct SparseFactor {
    /// The lower triangle by columns.
    structure: SymbolicSparseColMat<usize>,
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
    factor: Vec<f64>,
    memory: MemBuffer,
}

/// A pivot that is not positive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NotPositiveDefinite;

impl std::fmt::Debug for SparseFactor {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SparseFactor").field("entries", &self.factor.len()).finish_non_exhaustive()
    }
}

impl SparseFactor {
    /// Of lower triangles whose columns start here and have these rows. The unknowns are eliminated in the order given, or else in one found by
    /// approximate minimum degree.
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

    /// The entries of the triangle, to be set before it is factored.
    pub(crate) fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// The entries of the factor.
    pub(crate) fn entries(&self) -> usize {
        self.factor.len()
    }

    /// Factors the matrix with the values that are set.
    pub(crate) fn factor(&mut self) -> Result<(), NotPositiveDefinite> {
        let Self { structure, symbolic, values, factor, memory } = self;
        let a = SparseColMatRef::new(structure.as_ref(), values.as_slice());
        let (regularisation, parameters) = (LltRegularization::default(), Default::default());
        symbolic
            .factorize_numeric_llt(factor, a, Side::Lower, regularisation, Par::Seq, MemStack::new(memory), parameters)
            .map(|_| ())
            .map_err(|_| NotPositiveDefinite)
    }

    /// x ← A⁻¹ x, A the matrix that was factored.
    pub(crate) fn solve(&mut self, x: &mut [f64]) {
        Self::solve_with(&self.symbolic, &self.factor, x, MemStack::new(&mut self.memory));
    }

    /// The same with memory of its own.
    pub(crate) fn solve_apart(&self, x: &mut [f64]) {
        let mut memory = MemBuffer::new(self.symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        Self::solve_with(&self.symbolic, &self.factor, x, MemStack::new(&mut memory));
    }

    fn solve_with(symbolic: &SymbolicCholesky<usize>, factor: &[f64], x: &mut [f64], stack: &mut MemStack) {
        let rows = x.len();
        let x = MatMut::from_column_major_slice_mut(x, rows, 1);
        LltRef::new(symbolic, factor).solve_in_place_with_conj(Conj::No, x, Par::Seq, stack);
    }
}

/// An order of elimination: the unknown that comes at each place, and the place of each unknown.
pub(crate) struct Order {
    forward: Vec<usize>,
    inverse: Vec<usize>,
}

impl Order {
    /// By approximate minimum degree, of groups of `size` unknowns whose triangle's columns start here and have these rows.
    pub(crate) fn of_groups(size: usize, columns: &[usize], rows: &[usize]) -> Result<Self, FaerError> {
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
