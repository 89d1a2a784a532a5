use std::sync::Arc;

use energy_dsl::Vector3;

use crate::counts::{Counts, Tally};
use crate::dofs::DofMap;
use crate::matrix::{BlockMatrix, Pattern};
use crate::term::{Character, Curvature, Linearisation, State, Term, Weights};

/// Terms that do not fit the vertices.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SystemError {
    /// An element acts on a vertex that does not exist.
    #[error("{term}: element {element} names vertex {vertex}, but there are only {vertex_count} vertices (0 to {})", .vertex_count.saturating_sub(1))]
    VertexOutOfRange {
        /// The term's name.
        term: String,
        /// Which element, from 0.
        element: usize,
        /// The vertex it names.
        vertex: usize,
        /// The number of vertices.
        vertex_count: usize,
    },
}

/// A sum that could not be evaluated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EvaluationError {
    /// Positions or velocities for another number of vertices.
    #[error("the system has {expected} vertices, but {found} {what} were given")]
    WrongLength {
        /// Positions or velocities.
        what: &'static str,
        /// The number of vertices.
        expected: usize,
        /// Vectors given.
        found: usize,
    },
    /// A position or velocity is infinite or NaN.
    #[error("vertex {vertex} has a non-finite {what}: {value:?}")]
    NonFiniteState {
        /// Position or velocity.
        what: &'static str,
        /// The vertex.
        vertex: usize,
        /// What it holds.
        value: Vector3<f64>,
    },
    /// An element returned an infinite or NaN force or energy.
    #[error(
        "{term}: element {element} on vertices {vertices:?} has a non-finite {what} at finite positions and velocities"
    )]
    NonFiniteElement {
        /// The term's name.
        term: String,
        /// Which element, from 0.
        element: usize,
        /// Its vertices.
        vertices: Vec<usize>,
        /// Energy, force or Jacobian.
        what: &'static str,
    },
}

/// The energy of one term.
#[derive(Clone, Debug, PartialEq)]
pub struct TermEnergy<'a> {
    /// The term's name.
    pub term: &'a str,
    /// Σ U in J; `None` for a force law.
    pub energy: Option<f64>,
}

/// The vectors that [`System::linearise`] returns, of all vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearisedForces {
    /// f, in N.
    pub force: Vec<Vector3<f64>>,
    /// (∂f/∂x) v, in N/s.
    pub stiffness_times_velocity: Vec<Vector3<f64>>,
}

/// A sum of terms over the vertices of one body.
#[derive(Debug)]
pub struct System {
    dofs: DofMap,
    pattern: Arc<Pattern>,
    terms: Vec<Assembled>,
}

/// A term, its elements with a free vertex, and where their blocks go.
#[derive(Debug)]
struct Assembled {
    term: Box<dyn Term>,
    active: Vec<usize>,
    slots: Vec<Option<usize>>,
    skipped: u64,
    counts: Counts,
}

impl System {
    /// The sum of the terms; vertex i does not move where `pinned[i]`.
    ///
    /// # Errors
    /// When an element names a vertex that does not exist.
    pub fn new(terms: Vec<Box<dyn Term>>, pinned: &[bool]) -> Result<Self, SystemError> {
        for term in &terms {
            check_range(&**term, pinned.len())?;
        }
        let dofs = DofMap::new(pinned);
        let coupled: Vec<Vec<usize>> = terms
            .iter()
            .filter(|term| term.character().curved)
            .flat_map(|term| term.stencils().iter().map(|stencil| free_places(stencil, &dofs)).collect::<Vec<_>>())
            .collect();
        let pattern = Arc::new(Pattern::from_stencils(dofs.free().len(), &coupled));
        let terms = terms.into_iter().map(|term| Assembled::new(term, &dofs, &pattern)).collect();
        Ok(Self { dofs, pattern, terms })
    }

    /// Which vertices move.
    #[must_use]
    pub fn dofs(&self) -> &DofMap {
        &self.dofs
    }

    /// A zero matrix of the free vertices, for [`System::linearise`].
    #[must_use]
    pub fn matrix(&self) -> BlockMatrix {
        BlockMatrix::zeros(Arc::clone(&self.pattern))
    }

    /// Whether a matrix comes from [`System::matrix`] of this system.
    #[must_use]
    pub fn owns(&self, matrix: &BlockMatrix) -> bool {
        Arc::ptr_eq(matrix.pattern(), &self.pattern)
    }

    /// What all terms' forces have in common.
    #[must_use]
    pub fn character(&self) -> Character {
        let all = || self.terms.iter().map(|assembled| assembled.term.character());
        Character {
            symmetric: all().all(|one| one.symmetric),
            velocity_dependent: all().any(|one| one.velocity_dependent),
            curved: all().any(|one| one.curved),
        }
    }

    /// The terms in order, each with what it evaluated so far.
    pub fn terms(&self) -> impl Iterator<Item = (&dyn Term, Counts)> {
        self.terms.iter().map(|assembled| (&*assembled.term, assembled.counts))
    }

    /// The energy of each term, of all elements with a free vertex (the energy of the others is constant).
    ///
    /// # Errors
    /// When positions are missing or not finite, or an energy is not finite.
    pub fn energies(&mut self, x: &[Vector3<f64>]) -> Result<Vec<TermEnergy<'_>>, EvaluationError> {
        self.check_state("position", x)?;
        let mut energies = Vec::with_capacity(self.terms.len());
        for assembled in &mut self.terms {
            let energy = assembled.term.energy(&assembled.active, x).map(|(energy, tally)| {
                assembled.counts.value += tally.with_skipped(assembled.skipped);
                energy
            });
            if energy.is_some_and(|energy| !energy.is_finite()) {
                return Err(assembled
                    .blame("energy", |term, one| term.energy(one, x).is_some_and(|(energy, _)| !energy.is_finite())));
            }
            energies.push(TermEnergy { term: assembled.term.name(), energy });
        }
        Ok(energies)
    }

    /// f(x, v), in N, of all vertices. Pinned ones get the force of the elements they share with free ones.
    ///
    /// # Errors
    /// When the state is incomplete or not finite, or a force is not finite.
    pub fn forces(&mut self, state: State<'_>) -> Result<Vec<Vector3<f64>>, EvaluationError> {
        self.check(state)?;
        let mut force = vec![[0.0; 3]; self.dofs.vertex_count()];
        for assembled in &mut self.terms {
            let tally = assembled.term.add_force(&assembled.active, state, &mut force);
            assembled.counts.gradient += tally.with_skipped(assembled.skipped);
        }
        if force.iter().flatten().any(|component| !component.is_finite()) {
            return Err(self.find_non_finite_force(state));
        }
        Ok(force)
    }

    /// Writes α ∂f/∂x + β ∂f/∂v over the free vertices to `matrix` (which must come from [`System::matrix`]) and returns f and
    /// (∂f/∂x) v of all vertices.
    ///
    /// # Errors
    /// When the state is incomplete or not finite, or a force is not finite.
    ///
    /// # Panics
    /// When the matrix comes from elsewhere.
    pub fn linearise(
        &mut self,
        state: State<'_>,
        weights: Weights,
        curvature: Curvature,
        matrix: &mut BlockMatrix,
    ) -> Result<LinearisedForces, EvaluationError> {
        self.check(state)?;
        assert!(self.owns(matrix), "the matrix must come from the same system");
        matrix.clear();
        let mut force = vec![[0.0; 3]; self.dofs.vertex_count()];
        let mut stiffness_times_velocity = force.clone();
        let mut sum = Linearisation {
            weights,
            curvature,
            matrix: matrix.values_mut(),
            force: &mut force,
            stiffness_times_velocity: &mut stiffness_times_velocity,
        };
        for Assembled { term, active, slots, skipped, counts } in &mut self.terms {
            if term.character().curved {
                counts.hessian += term.add_linearisation(active, slots, state, &mut sum).with_skipped(*skipped);
            } else {
                counts.gradient += term.add_force(active, state, sum.force).with_skipped(*skipped);
            }
        }
        if force.iter().flatten().any(|component| !component.is_finite()) {
            return Err(self.find_non_finite_force(state));
        }
        Ok(LinearisedForces { force, stiffness_times_velocity })
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

    /// Evaluates element by element until one is found to blame.
    fn find_non_finite_force(&self, state: State<'_>) -> EvaluationError {
        let mut force = vec![[0.0; 3]; self.dofs.vertex_count()];
        let mut broken = |term: &dyn Term, one: &[usize]| {
            term.add_force(one, state, &mut force);
            let stencil = term.stencils().stencil(one[0]);
            let found = stencil.iter().any(|&vertex| force[vertex].iter().any(|component| !component.is_finite()));
            stencil.iter().for_each(|&vertex| force[vertex] = [0.0; 3]);
            found
        };
        let culprit = self
            .terms
            .iter()
            .find(|assembled| assembled.active.iter().any(|&element| broken(&*assembled.term, &[element])))
            .or(self.terms.last())
            .expect("a non-finite sum has terms");
        culprit.blame("force", broken)
    }
}

impl Assembled {
    fn new(term: Box<dyn Term>, dofs: &DofMap, pattern: &Pattern) -> Self {
        let stencils = term.stencils();
        let is_free = |stencil: &[usize]| stencil.iter().any(|&vertex| dofs.place(vertex).is_some());
        let active: Vec<usize> =
            stencils.iter().enumerate().filter(|(_, stencil)| is_free(stencil)).map(|(element, _)| element).collect();
        let mut slots = Vec::new();
        if term.character().curved {
            for &element in &active {
                let places: Vec<Option<usize>> =
                    stencils.stencil(element).iter().map(|&vertex| dofs.place(vertex)).collect();
                for &row in &places {
                    slots.extend(places.iter().map(|&column| pattern.slot(row?, column?)));
                }
            }
        }
        let skipped = (stencils.iter().len() - active.len()) as u64;
        Self { active, slots, skipped, counts: Counts::default(), term }
    }

    /// The error about the first element that is `broken` (the last one if none is on its own: only their sum overflows).
    fn blame(&self, what: &'static str, mut broken: impl FnMut(&dyn Term, &[usize]) -> bool) -> EvaluationError {
        let element = self.active.iter().copied().find(|&element| broken(&*self.term, &[element]));
        let element = element.or(self.active.last().copied()).unwrap_or(0);
        EvaluationError::NonFiniteElement {
            term: self.term.name().to_owned(),
            element,
            vertices: self.term.stencils().stencil(element).to_vec(),
            what,
        }
    }
}

impl Tally {
    fn with_skipped(self, skipped: u64) -> Self {
        Self { skipped, ..self }
    }
}

fn check_range(term: &dyn Term, vertex_count: usize) -> Result<(), SystemError> {
    for (element, stencil) in term.stencils().iter().enumerate() {
        if let Some(&vertex) = stencil.iter().find(|&&vertex| vertex >= vertex_count) {
            return Err(SystemError::VertexOutOfRange { term: term.name().to_owned(), element, vertex, vertex_count });
        }
    }
    Ok(())
}

fn free_places(stencil: &[usize], dofs: &DofMap) -> Vec<usize> {
    stencil.iter().filter_map(|&vertex| dofs.place(vertex)).collect()
}
