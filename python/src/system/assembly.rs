//! The sum behind a `System`, without Python.

use std::sync::{Arc, Mutex};

use energy_compiler::Elements as Tapes;
use energy_dsl::{Kind, Vector3};
use energy_solve::{
    BlockMatrix, Curvature, EvaluationError, LinearisationOptions, OwnTerm, State, SteeredTapeTerm, SteeredTapes,
    StepStart, System as Assembled, SystemError, TapeTerm, Term, Weights,
};
use pyo3::PyErr;

use super::laws::{SharedElements, TextForce, TextResidual};
use crate::errors::{failed, wrong};

/// Terms, pins and masses, and their sum.
pub struct Assembly {
    pub terms: Vec<TermSource>,
    pub pinned: Vec<bool>,
    /// Masses of the vertices, in kg; empty for none.
    pub masses: Vec<f64>,
    pub threads: usize,
    /// The sum, with its matrix; made when it is first needed.
    sum: Option<(Assembled, BlockMatrix)>,
    /// Whether parameters changed since the last evaluation.
    is_stale: bool,
}

/// A term as it was added.
pub struct TermSource {
    pub name: String,
    /// The vertices of one element after the other.
    pub vertices: Vec<u32>,
    /// Vertices of one element.
    pub points: usize,
    /// The elements, with their inputs of now.
    pub elements: Tapes<f64>,
    handle: Handle,
}

/// How new parameters reach the term.
enum Handle {
    /// They never changed. Constant Hessians are evaluated once.
    Constant,
    Steered(SteeredTapes),
    Shared(SharedElements),
}

/// Why a sum cannot be evaluated. It becomes an exception once the interpreter's lock is held.
pub enum Failure {
    System(SystemError),
    Evaluation(EvaluationError),
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::System(error) => wrong(error),
            Failure::Evaluation(error) => failed(error),
        }
    }
}

/// α and β of α ∂f/∂x + β ∂f/∂v, the factor of the masses, and the treatment of negative curvature.
#[derive(Clone, Copy)]
pub struct Wanted {
    pub position: f64,
    pub velocity: f64,
    pub mass: f64,
    pub curvature: Curvature,
}

impl TermSource {
    pub fn new(name: String, vertices: Vec<u32>, points: usize, elements: Tapes<f64>) -> Self {
        let handle = match elements.element().declaration().kind {
            Kind::Energy | Kind::Constraint => Handle::Constant,
            Kind::Force | Kind::Residual => Handle::Shared(Arc::new(Mutex::new(elements.clone()))),
        };
        Self { name, vertices, points, elements, handle }
    }

    pub fn kind(&self) -> Kind {
        self.elements.element().declaration().kind
    }

    fn term(&self) -> Box<dyn Term> {
        let (name, declaration) = (self.name.clone(), self.elements.element().declaration());
        let vertices = self.vertices.iter().map(|&vertex| vertex as usize);
        match &self.handle {
            Handle::Constant => Box::new(TapeTerm::new(name, declaration, self.elements.tape().clone(), vertices)),
            Handle::Steered(tapes) => Box::new(SteeredTapeTerm::new(name, declaration, tapes.clone(), vertices)),
            Handle::Shared(elements) if declaration.kind == Kind::Force => {
                Box::new(OwnTerm::new(name, TextForce::new(Arc::clone(elements)), self.vertices.clone()))
            }
            Handle::Shared(elements) => {
                let law = TextResidual::new(Arc::clone(elements), self.points);
                Box::new(OwnTerm::new(name, law, self.vertices.clone()))
            }
        }
    }
}

impl Assembly {
    pub fn new(pinned: Vec<bool>, masses: Vec<f64>) -> Self {
        Self { terms: Vec::new(), pinned, masses, threads: 1, sum: None, is_stale: false }
    }

    pub fn add(&mut self, term: TermSource) {
        self.terms.push(term);
        self.sum = None;
    }

    /// Replaces the elements of a term by others of the same declaration and number. The pattern stays.
    pub fn replace(&mut self, term: usize, elements: Tapes<f64>) {
        let source = &mut self.terms[term];
        match &source.handle {
            Handle::Constant => {
                source.handle = Handle::Steered(SteeredTapes::new(elements.tape().clone()));
                self.sum = None;
            }
            Handle::Steered(tapes) => tapes.replace(elements.tape().clone()),
            Handle::Shared(shared) => *super::laws::lock(shared) = elements.clone(),
        }
        source.elements = elements;
        self.is_stale = true;
    }

    pub fn set_pinned(&mut self, pinned: Vec<bool>) {
        self.pinned = pinned;
        self.sum = None;
    }

    pub fn set_threads(&mut self, threads: usize) {
        self.threads = threads;
        self.sum.iter_mut().for_each(|(sum, _)| sum.set_threads(threads));
    }

    /// The sum and its matrix, with the parameters of now.
    pub fn sum(&mut self, state: State<'_>) -> Result<(&mut Assembled, &mut BlockMatrix), Failure> {
        if self.sum.is_none() {
            let terms = self.terms.iter().map(TermSource::term).collect();
            let mut sum = Assembled::new(terms, &self.pinned).map_err(Failure::System)?;
            sum.set_threads(self.threads);
            let matrix = sum.matrix();
            self.sum = Some((sum, matrix));
            self.is_stale = false;
        }
        let (sum, matrix) = self.sum.as_mut().expect("made above");
        if self.is_stale {
            sum.begin_step(StepStart { time: 0.0, dt: 1.0, state }).map_err(Failure::Evaluation)?;
            self.is_stale = false;
        }
        Ok((sum, matrix))
    }

    pub fn energy(&mut self, x: &[Vector3<f64>]) -> Result<f64, Failure> {
        let v = vec![[0.0; 3]; x.len()];
        let (sum, _) = self.sum(State { x, v: &v })?;
        total(sum, x)
    }

    /// Returns U of each term; `None` for forces.
    pub fn energies(&mut self, x: &[Vector3<f64>]) -> Result<Vec<Option<f64>>, Failure> {
        let v = vec![[0.0; 3]; x.len()];
        let (sum, _) = self.sum(State { x, v: &v })?;
        Ok(sum.energies(x).map_err(Failure::Evaluation)?.iter().map(|term| term.energy).collect())
    }

    pub fn forces(&mut self, state: State<'_>) -> Result<Vec<Vector3<f64>>, Failure> {
        self.sum(state)?.0.forces(state).map_err(Failure::Evaluation)
    }

    /// Returns f, and leaves α ∂f/∂x + β ∂f/∂v + m M in the matrix.
    pub fn linearise(&mut self, state: State<'_>, wanted: Wanted) -> Result<Vec<Vector3<f64>>, Failure> {
        let masses = match wanted.mass {
            0.0 => Vec::new(),
            factor => self.masses.iter().map(|mass| factor * mass).collect(),
        };
        let (sum, matrix) = self.sum(state)?;
        let options = LinearisationOptions::new(
            Weights { position: wanted.position, velocity: wanted.velocity },
            wanted.curvature,
        );
        let forces = sum.linearise_with_masses(state, options, &masses, matrix).map_err(Failure::Evaluation)?;
        Ok(forces.force)
    }

    /// The matrix of the last linearisation.
    pub fn matrix(&self) -> &BlockMatrix {
        &self.sum.as_ref().expect("linearised before").1
    }

    pub fn dofs(&self) -> &energy_solve::DofMap {
        self.sum.as_ref().expect("linearised before").0.dofs()
    }
}

pub fn total(sum: &mut Assembled, x: &[Vector3<f64>]) -> Result<f64, Failure> {
    Ok(sum.energies(x).map_err(Failure::Evaluation)?.iter().filter_map(|term| term.energy).sum())
}
