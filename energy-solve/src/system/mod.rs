mod constant;
mod division;

use std::ops::Range;
use std::sync::Arc;

use energy_dsl::{Block, Vector3};

use self::constant::{ConstantPart, coupled_runs};
use self::division::Sums;
use crate::matrix::block_matrix::{BlockMatrix, Contents};
use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::{Pattern, Storage, index};
use crate::matrix::precision::Precision;
use crate::terms::counts::{Counts, Tally};
use crate::terms::curvature::Curvature;
use crate::terms::linearisation::{Linearisation, Weights};
use crate::terms::share::{Divisible, Share};
use crate::terms::state::{State, StepStart};
use crate::terms::term::{Character, PlacedTerm, Quantity, Term, TermDescription};

/// An element that does not fit the vertices of its system.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SystemError {
    /// An element acts on a vertex that does not exist.
    #[error(
        "{term}: element {element} names vertex {vertex}, but there are only {vertex_count} vertices (0 to {})",
        .vertex_count.saturating_sub(1)
    )]
    VertexOutOfRange {
        /// Name of the term.
        term: String,
        /// Index of the element.
        element: usize,
        /// Index of the missing vertex.
        vertex: usize,
        /// Number of vertices of the system.
        vertex_count: usize,
    },
}

/// A sum that could not be evaluated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EvaluationError {
    /// The number of positions or velocities is not the number of vertices.
    #[error("the system has {expected} vertices, but {found} {what} were given")]
    WrongLength {
        /// "positions" or "velocities".
        what: &'static str,
        /// Number of vertices of the system.
        expected: usize,
        /// Number of vectors given.
        found: usize,
    },
    /// A position or velocity is infinite or NaN.
    #[error("vertex {vertex} has a non-finite {what}: {value:?}")]
    NonFiniteState {
        /// "position" or "velocity".
        what: &'static str,
        /// Index of the vertex.
        vertex: usize,
        /// The position or velocity.
        value: Vector3<f64>,
    },
    /// The force or energy of an element is infinite or NaN.
    #[error(
        "{term}: element {element} on vertices {vertices:?} has a non-finite {what} at finite positions and velocities"
    )]
    NonFiniteElement {
        /// Name of the term.
        term: String,
        /// Index of the element.
        element: usize,
        /// Vertices of the element.
        vertices: Vec<usize>,
        /// Whether the energy or the force is not finite.
        what: Quantity,
    },
    /// Each element's energy or force is finite, but the sum is not.
    #[error("the {what} of each element is finite, but their sum overflows")]
    NonFiniteSum {
        /// Whether the energy or the force is not finite.
        what: Quantity,
    },
}

/// The energy of one term.
#[derive(Clone, Debug, PartialEq)]
pub struct TermEnergy<'a> {
    /// Name of the term.
    pub term: &'a str,
    /// Σ U, in J; `None` for a force law.
    pub energy: Option<f64>,
}

/// The vectors that [`System::linearise`] returns, one entry per vertex.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearisedForces {
    /// f, in N.
    pub force: Vec<Vector3<f64>>,
    /// (∂f/∂x) v, in N/s; empty if it was not requested.
    pub stiffness_times_velocity: Vec<Vector3<f64>>,
}

/// Options of [`System::linearise`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearisationOptions {
    /// α and β.
    pub weights: Weights,
    /// Treatment of negative eigenvalues of element Hessians.
    pub curvature: Curvature,
    /// Whether to compute (∂f/∂x) v.
    pub stiffness_times_velocity: bool,
}

/// A sum of terms over the vertices of one body.
#[derive(Debug)]
pub struct System {
    dofs: DofMap,
    pattern: Arc<Pattern>,
    terms: Vec<Counted>,
    threads: usize,
    shares: Vec<Share>,
    /// Positions of the last evaluation of forces, with which some terms keep their energies; empty if none is valid.
    evaluated_at: Vec<Vector3<f64>>,
    /// The blocks that terms with non-constant Jacobians write; `None` until first needed.
    changing: Option<Arc<[Range<u32>]>>,
    /// The constant parts of the matrices in use.
    constants: Vec<ConstantPart>,
}

/// A term and its evaluation counts.
#[derive(Debug)]
struct Counted {
    term: Box<dyn PlacedTerm>,
    counts: Counts,
}

impl System {
    /// Creates the sum of the terms; vertex i does not move if `pinned[i]`.
    ///
    /// # Errors
    /// If an element names a vertex that does not exist.
    pub fn new(terms: Vec<Box<dyn Term>>, pinned: &[bool]) -> Result<Self, SystemError> {
        for term in &terms {
            check_range(&**term, pinned.len())?;
        }
        let dofs = DofMap::new(pinned);
        let symmetric = terms.iter().all(|term| term.character().symmetric);
        let storage = if symmetric { Storage::Upper } else { Storage::Whole };
        let curved = terms.iter().filter(|term| term.character().curved);
        let (mut coupled, mut ends) = (Vec::new(), vec![0]);
        for stencil in curved.flat_map(|term| term.stencils().iter()) {
            coupled.extend(stencil.filter_map(|vertex| dofs.place(vertex as usize)).map(index));
            ends.push(coupled.len());
        }
        let stencils = ends.windows(2).map(|ends| &coupled[ends[0]..ends[1]]);
        let pattern = Arc::new(Pattern::from_stencils(storage, dofs.free().len(), stencils));
        let placed = |term: Box<dyn Term>| Counted { term: term.place(&dofs, &pattern), counts: Counts::default() };
        let terms = terms.into_iter().map(placed).collect();
        let mut system = Self {
            dofs,
            pattern,
            terms,
            threads: 1,
            shares: Vec::new(),
            evaluated_at: Vec::new(),
            changing: None,
            constants: Vec::new(),
        };
        system.set_threads(1);
        Ok(system)
    }

    /// Sets the largest number of threads. Small systems use fewer. Results are bit-identical for any number.
    pub fn set_threads(&mut self, threads: usize) {
        self.threads = threads.max(1);
        self.shares = division::shares(&self.dofs, &self.pattern, self.threads);
        for counted in &mut self.terms {
            counted.term.divide(&self.shares);
        }
    }

    /// Returns the largest number of threads.
    #[must_use]
    pub fn threads(&self) -> usize {
        self.threads
    }

    /// Returns one entry per term: its parallel form, if it has one, and whether `wanted` selects its Jacobian.
    fn divisible(&self, wanted: impl Fn(&dyn PlacedTerm) -> bool) -> Vec<Option<(&dyn Divisible, bool)>> {
        let terms = self.terms.iter().map(|counted| &*counted.term);
        terms.map(|term| term.divisible().map(|divisible| (divisible, wanted(term)))).collect()
    }

    /// Returns the map between vertices and matrix rows.
    #[must_use]
    pub fn dofs(&self) -> &DofMap {
        &self.dofs
    }

    /// Creates a zero matrix over the free vertices, for [`System::linearise`].
    #[must_use]
    pub fn matrix(&self) -> BlockMatrix {
        self.matrix_in()
    }

    /// Creates a zero matrix in the given precision. Single precision takes half the memory; it suffices if the linear
    /// system is solved to a few digits only.
    #[must_use]
    pub fn matrix_in<T: Precision>(&self) -> BlockMatrix<T> {
        BlockMatrix::zeros(Arc::clone(&self.pattern))
    }

    /// Whether the matrix was created by [`System::matrix`] or [`System::matrix_in`] of this system.
    #[must_use]
    pub fn owns<T: Precision>(&self, matrix: &BlockMatrix<T>) -> bool {
        Arc::ptr_eq(matrix.pattern(), &self.pattern)
    }

    /// Returns the properties of the summed force.
    #[must_use]
    pub fn character(&self) -> Character {
        let all = || self.terms.iter().map(|counted| counted.term.character());
        Character {
            symmetric: all().all(|one| one.symmetric),
            velocity_dependent: all().any(|one| one.velocity_dependent),
            quadratic: all().all(|one| one.quadratic),
            curved: all().any(|one| one.curved),
        }
    }

    /// Returns the terms in order, each with its evaluation counts so far.
    pub fn terms(&self) -> impl Iterator<Item = (&dyn PlacedTerm, Counts)> {
        self.terms.iter().map(|counted| (&*counted.term, counted.counts))
    }

    /// Returns the energy of each term, summed over the elements with a free vertex; the energy of the others is
    /// constant. Energies that came with forces or Jacobians at the same positions are reused.
    ///
    /// # Errors
    /// If positions are missing or not finite, or an energy is not finite.
    pub fn energies(&mut self, x: &[Vector3<f64>]) -> Result<Vec<TermEnergy<'_>>, EvaluationError> {
        self.check_state("position", x)?;
        let known = self.evaluated_at == x;
        if !known {
            self.evaluated_at.clear();
        }
        let found = |term: &dyn PlacedTerm| if known { term.energy_found() } else { None };
        let found: Vec<Option<f64>> = self.terms.iter().map(|counted| found(&*counted.term)).collect();
        let mut divisible = self.divisible(|_| false);
        divisible.iter_mut().zip(&found).filter(|(_, found)| found.is_some()).for_each(|(term, _)| *term = None);
        let divided = division::energies(&divisible, self.shares.len(), x);
        let mut energies = Vec::with_capacity(self.terms.len());
        for ((Counted { term, counts }, divided), found) in self.terms.iter_mut().zip(divided).zip(found) {
            let evaluated = if found.is_some() { None } else { divided.or_else(|| term.energy(x)) };
            counts.value += evaluated.map_or_else(Tally::default, |(_, tally)| tally);
            let energy = found.or(evaluated.map(|(energy, _)| energy));
            if energy.is_some_and(|energy| !energy.is_finite()) {
                return Err(blame(std::iter::once(&**term), Quantity::Energy, State { x, v: &[] }));
            }
            energies.push(TermEnergy { term: term.name(), energy });
        }
        Ok(energies)
    }

    /// Notifies every term of the start of a step; see [`PlacedTerm::begin_step`].
    ///
    /// # Errors
    /// If the state is incomplete or not finite.
    pub fn begin_step(&mut self, start: StepStart<'_>) -> Result<(), EvaluationError> {
        self.check(start.state)?;
        self.evaluated_at.clear();
        self.terms.iter_mut().for_each(|counted| counted.term.begin_step(start));
        Ok(())
    }

    /// Returns Rayleigh's dissipation function R(x, v), in W, with f(x, v) − f(x, 0) = −∂R/∂v. For drag proportional to
    /// velocity, R is half the dissipated power. Terms without dissipation are not evaluated.
    ///
    /// # Errors
    /// If the state is incomplete or not finite.
    pub fn dissipation(&mut self, state: State<'_>) -> Result<f64, EvaluationError> {
        self.check(state)?;
        let mut sum = 0.0;
        for Counted { term, counts } in self.terms.iter_mut().filter(|c| c.term.character().velocity_dependent) {
            if let Some((dissipation, tally)) = term.dissipation(state) {
                sum += dissipation;
                counts.value += tally;
            }
        }
        Ok(sum)
    }

    /// Returns f(x, v) of all vertices, in N. Pinned vertices get the force of the elements they share with free ones.
    ///
    /// # Errors
    /// If the state or a force is incomplete or not finite.
    pub fn forces(&mut self, state: State<'_>) -> Result<Vec<Vector3<f64>>, EvaluationError> {
        self.check(state)?;
        let mut force = vec![[0.0; 3]; self.dofs.vertex_count()];
        state.x.clone_into(&mut self.evaluated_at);
        let divided = division::forces(&self.divisible(|_| false), &self.shares, state, &mut force);
        for (Counted { term, counts }, divided) in self.terms.iter_mut().zip(divided) {
            counts.gradient += divided.unwrap_or_else(|| term.add_force(state, &mut force));
        }
        if force.iter().flatten().any(|component| !component.is_finite()) {
            return Err(self.find_non_finite_force(state));
        }
        Ok(force)
    }

    /// Writes α ∂f/∂x + β ∂f/∂v over the free vertices to `matrix` and returns f and (∂f/∂x) v of all vertices.
    ///
    /// The system keeps the constant part of each matrix, so pass the same matrix to every step.
    ///
    /// # Errors
    /// If the state is incomplete or not finite, or a force is not finite.
    ///
    /// # Panics
    /// If the matrix was not created by this system.
    pub fn linearise(
        &mut self,
        state: State<'_>,
        options: LinearisationOptions,
        matrix: &mut BlockMatrix<impl Precision>,
    ) -> Result<LinearisedForces, EvaluationError> {
        self.linearise_with_masses(state, options, &[], matrix)
    }

    /// Writes M + α ∂f/∂x + β ∂f/∂v, with the vertices' masses, in kg, on the diagonal; otherwise as
    /// [`System::linearise`]. Masses belong to the constant part of the matrix.
    ///
    /// # Errors
    /// If the state is incomplete or not finite, or a force is not finite.
    ///
    /// # Panics
    /// If the matrix was not created by this system, or the number of masses is neither zero nor that of the vertices.
    pub fn linearise_with_masses<T: Precision>(
        &mut self,
        state: State<'_>,
        options: LinearisationOptions,
        masses: &[f64],
        matrix: &mut BlockMatrix<T>,
    ) -> Result<LinearisedForces, EvaluationError> {
        self.check(state)?;
        assert!(
            masses.is_empty() || masses.len() == self.dofs.vertex_count(),
            "expected a mass for every vertex, or no masses"
        );
        assert!(self.owns(matrix), "the matrix belongs to another system");
        let mut force = vec![[0.0; 3]; self.dofs.vertex_count()];
        let LinearisationOptions { weights, curvature, stiffness_times_velocity: wanted } = options;
        // The product (∂f/∂x) v needs the Jacobian of every term, so none is reused.
        let with_constant = !wanted && self.terms.iter().any(|counted| is_constant(&*counted.term));
        if !with_constant {
            self.terms.iter_mut().for_each(|counted| counted.term.place_blocks(&self.dofs, &self.pattern));
        }
        let contents = matrix.take_contents();
        let known = contents.and_then(|contents| Some((self.take_constant(&contents)?, contents)));
        let constant = with_constant.then(|| match known {
            Some((known, contents)) if known.matches(weights, curvature, masses) => (known, contents),
            _ => self.constant(state, (weights, curvature), masses, matrix),
        });
        let linear = |term: &dyn PlacedTerm| term.character().curved && !(with_constant && is_constant(term));
        let mut product = if wanted { force.clone() } else { Vec::new() };
        let product_wanted = wanted.then_some(&mut product[..]);
        state.x.clone_into(&mut self.evaluated_at);
        let values = matrix.values_and_nowhere();
        let mut sums = Sums { weights, curvature, matrix: values, force: &mut force, product: product_wanted };
        let part = constant.as_ref().map(|(part, _)| part);
        let divided = division::linearisations(&self.divisible(linear), &self.shares, state, part, &mut sums);
        let mut sum = sums.linearisation();
        for (Counted { term, counts }, divided) in self.terms.iter_mut().zip(divided) {
            if linear(&**term) {
                counts.hessian += divided.unwrap_or_else(|| term.add_linearisation(state, &mut sum));
            } else {
                let tally = divided.unwrap_or_else(|| term.add_force(state, sum.force));
                counts.reused += if term.character().curved { tally.evaluated } else { 0 };
                counts.gradient += tally;
            }
        }
        if let Some((part, contents)) = constant {
            self.constants.push(part);
            matrix.set_contents(Some(contents));
        }
        if force.iter().flatten().any(|component| !component.is_finite()) {
            return Err(self.find_non_finite_force(state));
        }
        if !with_constant {
            add_masses(&self.dofs, &self.pattern, masses, matrix.values_mut());
        }
        Ok(LinearisedForces { force, stiffness_times_velocity: product })
    }

    /// Removes and returns the constant part of a matrix with these contents.
    fn take_constant(&mut self, contents: &Arc<Contents>) -> Option<ConstantPart> {
        let found = self.constants.iter().position(|part| part.is_in(contents))?;
        Some(self.constants.swap_remove(found))
    }

    /// Evaluates the masses and the Jacobians of the quadratic terms, and writes them to the matrix.
    fn constant<T: Precision>(
        &mut self,
        state: State<'_>,
        (weights, curvature): (Weights, Curvature),
        masses: &[f64],
        matrix: &mut BlockMatrix<T>,
    ) -> (ConstantPart, Arc<Contents>) {
        self.constants.retain(ConstantPart::is_in_use);
        let runs = self.changing_places();
        // Projecting tells whether there was anything to project.
        let mut treated = Curvature::Clamped;
        let projected = self.evaluate_constant(state, weights, treated, masses, matrix);
        if projected && curvature != treated {
            treated = curvature;
            self.evaluate_constant(state, weights, treated, masses, matrix);
        }
        let contents = Arc::new(Contents);
        let part = (weights, treated);
        (ConstantPart::new(&contents, part, masses, projected, runs, T::blocks(matrix.values_mut())), contents)
    }

    /// Writes masses and quadratic Jacobians to the matrix. Returns whether the Hessian of some element was projected.
    fn evaluate_constant<T: Precision>(
        &mut self,
        state: State<'_>,
        weights: Weights,
        curvature: Curvature,
        masses: &[f64],
        matrix: &mut BlockMatrix<T>,
    ) -> bool {
        let blocks = matrix.values_and_nowhere();
        blocks.fill([[T::from_f64(0.0); 3]; 3]);
        add_masses(&self.dofs, &self.pattern, masses, blocks);
        let mut sum = Linearisation {
            weights,
            curvature,
            matrix: T::blocks(blocks),
            force: &mut vec![[0.0; 3]; self.dofs.vertex_count()],
            stiffness_times_velocity: None,
        };
        let mut projected = false;
        for Counted { term, counts } in self.terms.iter_mut().filter(|counted| is_constant(&*counted.term)) {
            term.place_blocks(&self.dofs, &self.pattern);
            let tally = term.add_linearisation(state, &mut sum);
            term.forget_blocks();
            projected |= tally.projected > 0;
            counts.hessian += tally;
        }
        projected
    }

    /// Returns the blocks that terms with non-constant Jacobians write.
    fn changing_places(&mut self) -> Arc<[Range<u32>]> {
        if let Some(known) = &self.changing {
            return Arc::clone(known);
        }
        let terms = self.terms.iter().map(|counted| &*counted.term);
        let changing = terms.filter(|term| term.character().curved && !is_constant(*term));
        let runs = coupled_runs(
            &self.pattern,
            |vertex| self.dofs.place(vertex as usize),
            changing.map(TermDescription::stencils),
        );
        Arc::clone(self.changing.insert(runs))
    }

    fn check(&self, state: State<'_>) -> Result<(), EvaluationError> {
        self.check_state("position", state.x)?;
        self.check_state("velocity", state.v)
    }

    fn check_state(&self, what: &'static str, vectors: &[Vector3<f64>]) -> Result<(), EvaluationError> {
        let (expected, found) = (self.dofs.vertex_count(), vectors.len());
        if expected != found {
            let what = if what == "position" { "positions" } else { "velocities" };
            return Err(EvaluationError::WrongLength { what, expected, found });
        }
        match vectors.iter().position(|vector| vector.iter().any(|component| !component.is_finite())) {
            Some(vertex) => Err(EvaluationError::NonFiniteState { what, vertex, value: vectors[vertex] }),
            None => Ok(()),
        }
    }

    fn find_non_finite_force(&self, state: State<'_>) -> EvaluationError {
        blame(self.terms.iter().map(|counted| &*counted.term), Quantity::Force, state)
    }
}

/// Adds the masses, if there are any, to the diagonal.
fn add_masses<T: Precision>(dofs: &DofMap, pattern: &Pattern, masses: &[f64], blocks: &mut [Block<T>]) {
    let free = if masses.is_empty() { &[] } else { dofs.free() };
    for (row, &vertex) in free.iter().enumerate() {
        let diagonal = &mut blocks[pattern.diagonal(row)];
        for axis in 0..3 {
            diagonal[axis][axis] = diagonal[axis][axis] + T::from_f64(masses[vertex]);
        }
    }
}

/// Whether a term's Jacobians are constant, so that they are evaluated only once.
fn is_constant(term: &dyn PlacedTerm) -> bool {
    let Character { quadratic, curved, .. } = term.character();
    quadratic && curved
}

/// Evaluates element by element to find the first with a non-finite energy or force.
fn blame<'a>(terms: impl Iterator<Item = &'a dyn PlacedTerm>, what: Quantity, state: State<'_>) -> EvaluationError {
    for term in terms {
        if let Some(element) = term.find_non_finite(what, state) {
            let vertices = term.stencils().stencil(element).map(|vertex| vertex as usize).collect();
            return EvaluationError::NonFiniteElement { term: term.name().to_owned(), element, vertices, what };
        }
    }
    EvaluationError::NonFiniteSum { what }
}

fn check_range(term: &dyn Term, vertex_count: usize) -> Result<(), SystemError> {
    for (element, mut stencil) in term.stencils().iter().enumerate() {
        if let Some(vertex) = stencil.find(|&vertex| vertex as usize >= vertex_count) {
            let (term, vertex) = (term.name().to_owned(), vertex as usize);
            return Err(SystemError::VertexOutOfRange { term, element, vertex, vertex_count });
        }
    }
    Ok(())
}
