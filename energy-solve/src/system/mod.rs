//! Sums of terms over the vertices of a body.

mod constant;
mod division;
mod error;
mod linearise;
mod restriction;

use std::ops::Range;
use std::sync::Arc;

use energy_dsl::Vector3;

use self::constant::ConstantPart;
pub use self::error::{EvaluationError, SystemError};
pub use self::linearise::{LinearisationOptions, LinearisedForces};
use crate::contact::{ContactMemory, ContactModel, Touching};
use crate::matrix::block_matrix::BlockMatrix;
use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::{Pattern, Storage, index};
use crate::matrix::precision::Precision;
use crate::terms::counts::{Counts, Tally};
use crate::terms::share::{Divisible, Share};
use crate::terms::state::{State, StepStart};
use crate::terms::term::{Character, PlacedTerm, Quantity, Term};

/// The energy of one term.
#[derive(Clone, Debug, PartialEq)]
pub struct TermEnergy<'a> {
    /// Name of the term.
    pub term: &'a str,
    /// Σ U, in J; `None` for a force law.
    pub energy: Option<f64>,
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
    contact: Option<Box<dyn ContactModel>>,
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
            coupled.extend(stencil.filter_map(|vertex| dofs.row(vertex as usize)).map(index));
            ends.push(coupled.len());
        }
        let stencils = ends.windows(2).map(|ends| &coupled[ends[0]..ends[1]]);
        let pattern = Arc::new(Pattern::from_stencils(storage, dofs.free().len(), stencils));
        let placed = |term: Box<dyn Term>| Counted { term: term.place(&dofs, &pattern), counts: Counts::default() };
        let terms = terms.into_iter().map(placed).collect();
        Ok(Self::with_placed(terms, dofs, pattern, 1))
    }

    /// Creates the sum of placed terms.
    fn with_placed(terms: Vec<Counted>, dofs: DofMap, pattern: Arc<Pattern>, threads: usize) -> Self {
        let mut system = Self {
            dofs,
            pattern,
            terms,
            threads,
            shares: Vec::new(),
            evaluated_at: Vec::new(),
            changing: None,
            constants: Vec::new(),
            contact: None,
        };
        system.set_threads(threads);
        system
    }

    /// Sets the largest number of threads. Small systems use fewer. Results are bit-identical for any number.
    pub fn set_threads(&mut self, threads: usize) {
        self.threads = threads.max(1);
        self.shares = division::shares(&self.dofs, &self.pattern, self.threads);
        for counted in &mut self.terms {
            counted.term.divide(&self.shares);
        }
        self.contact.iter_mut().for_each(|contact| contact.set_threads(self.threads));
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

    /// Adds contact. The sums of this system do not include it. An integrator takes it for each step, because contact
    /// also limits the moves that lead from state to state.
    pub fn set_contact(&mut self, mut contact: Box<dyn ContactModel>) {
        contact.set_threads(self.threads);
        self.contact = Some(contact);
    }

    /// Removes and returns the contact, if there is one.
    pub fn take_contact(&mut self) -> Option<Box<dyn ContactModel>> {
        self.contact.take()
    }

    /// Returns the energy of the contacts of the last step at x, in J; `None` if the body does not collide.
    #[must_use]
    pub fn contact_energy(&self, x: &[Vector3<f64>]) -> Option<f64> {
        self.contact.as_ref().map(|contact| contact.energy(x))
    }

    /// Returns what contact keeps from step to step, at x, where the last step ended. Empty without contact.
    #[must_use]
    pub fn contact_memory(&self, x: &[Vector3<f64>]) -> ContactMemory {
        self.contact.as_ref().map_or_else(ContactMemory::default, |contact| contact.memory(x))
    }

    /// Restores what contact keeps from step to step.
    pub fn restore_contact(&mut self, memory: ContactMemory) {
        if let Some(contact) = &mut self.contact {
            contact.restore(memory);
        }
    }

    /// Adds the forces of the contacts of the last step at x, in N.
    pub fn add_contact_force(&self, x: &[Vector3<f64>], force: &mut [Vector3<f64>]) {
        if let Some(contact) = &self.contact {
            contact.add_force(x, force);
        }
    }

    /// Returns the pairs in contact at x, where the last step ended; none if the body does not collide.
    #[must_use]
    pub fn touching(&self, x: &[Vector3<f64>]) -> Vec<Touching> {
        self.contact.as_ref().map_or_else(Vec::new, |contact| contact.touching(x))
    }

    /// Whether the body collides.
    #[must_use]
    pub fn has_contact(&self) -> bool {
        self.contact.is_some()
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
    /// A term is infinite if one of its elements is outside of its formula's domain, such as an inverted element with a
    /// logarithm of its volume. A line search that compares energies rejects such positions.
    ///
    /// # Errors
    /// If positions are missing or not finite, or an energy is not a number.
    pub fn energies(&mut self, x: &[Vector3<f64>]) -> Result<Vec<TermEnergy<'_>>, EvaluationError> {
        self.check_state("position", x)?;
        let known = self.evaluated_at == x;
        if !known {
            self.evaluated_at.clear();
        }
        let found = |term: &dyn PlacedTerm| if known { term.energy_found() } else { None };
        let found: Vec<Option<f64>> = self.terms.iter().map(|counted| found(&*counted.term)).collect();
        let mut divisible = self.divisible(|_| false);
        for ((divisible, found), Counted { term, .. }) in divisible.iter_mut().zip(&found).zip(&self.terms) {
            if found.is_some() || !term.has_energy() {
                *divisible = None;
            }
        }
        let divided = division::energies(&divisible, self.shares.len(), x);
        let mut energies = Vec::with_capacity(self.terms.len());
        for ((Counted { term, counts }, divided), found) in self.terms.iter_mut().zip(divided).zip(found) {
            let evaluated = if found.is_some() { None } else { divided.or_else(|| term.energy(x)) };
            counts.value += evaluated.map_or_else(Tally::default, |(_, tally)| tally);
            let energy = found.or(evaluated.map(|(energy, _)| energy));
            if energy.is_some_and(|energy| energy.is_nan() || energy == f64::NEG_INFINITY) {
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

    /// Notifies every term of the end of a step; see [`PlacedTerm::end_step`].
    ///
    /// # Errors
    /// If the state is incomplete or not finite.
    pub fn end_step(&mut self, end: State<'_>) -> Result<(), EvaluationError> {
        self.check(end)?;
        if self.terms.iter().any(|counted| counted.term.is_driven()) {
            self.evaluated_at.clear();
            self.terms.iter_mut().for_each(|counted| counted.term.end_step(end));
        }
        Ok(())
    }

    /// Returns the history of each term; see [`PlacedTerm::history`].
    #[must_use]
    pub fn histories(&self) -> Vec<Vec<f64>> {
        self.terms.iter().map(|counted| counted.term.history()).collect()
    }

    /// Restores what [`System::histories`] returned for a system with the same terms.
    pub fn restore_histories(&mut self, histories: &[Vec<f64>]) {
        self.evaluated_at.clear();
        for (counted, history) in self.terms.iter_mut().zip(histories).filter(|(_, history)| !history.is_empty()) {
            counted.term.restore_history(history);
        }
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
    /// If the state or a force is incomplete or not finite, or an element is outside of its formula's domain.
    pub fn forces(&mut self, state: State<'_>) -> Result<Vec<Vector3<f64>>, EvaluationError> {
        self.check(state)?;
        let mut force = vec![[0.0; 3]; self.dofs.vertex_count()];
        state.x.clone_into(&mut self.evaluated_at);
        let divided = division::forces(&self.divisible(|_| false), &self.shares, state, &mut force);
        let mut flagged = 0;
        for (Counted { term, counts }, divided) in self.terms.iter_mut().zip(divided) {
            let tally = divided.unwrap_or_else(|| term.add_force(state, &mut force));
            flagged += tally.flagged;
            counts.gradient += tally;
        }
        self.check_results(state, flagged, &force)?;
        Ok(force)
    }

    /// Checks the results of a sum with this number of flagged elements: forces must be finite, and so must be the
    /// energies that came with them. Outside of a formula's domain, forces are 0.
    fn check_results(&self, state: State<'_>, flagged: u64, force: &[Vector3<f64>]) -> Result<(), EvaluationError> {
        let terms = || self.terms.iter().map(|counted| &*counted.term);
        if force.iter().flatten().any(|component| !component.is_finite()) {
            return Err(blame(terms(), Quantity::Force, state));
        }
        let is_outside = |term: &&dyn PlacedTerm| term.energy_found() == Some(f64::INFINITY);
        match terms().find(|term| flagged > 0 && is_outside(term)) {
            Some(term) => Err(blame(std::iter::once(term), Quantity::Energy, state)),
            None => Ok(()),
        }
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
