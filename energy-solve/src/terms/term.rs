use energy_dsl::{Declaration, Vector3};

use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::Pattern;
use crate::terms::counts::Tally;
use crate::terms::linearisation::Linearisation;
use crate::terms::restriction::Restriction;
use crate::terms::share::{Divisible, Share};
use crate::terms::state::{State, StepStart};
use crate::terms::stencils::Stencils;

/// Properties of a term's force that let a system skip work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Character {
    /// Whether ∂f/∂x and ∂f/∂v are symmetric, so that conjugate gradients apply.
    pub symmetric: bool,
    /// Whether f depends on velocities.
    pub velocity_dependent: bool,
    /// Whether ∂f/∂x and ∂f/∂v are constant. They are then evaluated once for all steps of one size.
    pub quadratic: bool,
    /// Whether f depends on positions or velocities at all. Gravity does not, and has no Jacobians to assemble.
    pub curved: bool,
}

/// A quantity that may turn out to be infinite or NaN.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// The energy U.
    Energy,
    /// The force f.
    Force,
}

impl std::fmt::Display for Quantity {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Energy => "energy",
            Self::Force => "force",
        })
    }
}

/// The properties of a term that do not depend on the vertices' state.
pub trait TermDescription: std::fmt::Debug + Send {
    /// The term's name, for people: "structural springs".
    fn name(&self) -> &str;
    /// The declaration of the term's elements.
    fn declaration(&self) -> &Declaration;
    /// The properties of the term's force.
    fn character(&self) -> Character;
    /// The vertices of each element.
    fn stencils(&self) -> Stencils<'_>;
}

/// A placed term that keeps the term from which it was made. It has the same description.
pub(crate) trait MadeFromTerm: std::fmt::Debug + Send {
    /// Returns the term.
    fn term(&self) -> &dyn TermDescription;
}

impl<P: MadeFromTerm> TermDescription for P {
    fn name(&self) -> &str {
        self.term().name()
    }

    fn declaration(&self) -> &Declaration {
        self.term().declaration()
    }

    fn character(&self) -> Character {
        self.term().character()
    }

    fn stencils(&self) -> Stencils<'_> {
        self.term().stencils()
    }
}

/// Elements of one type, to become part of a [`System`](crate::System).
///
/// A term cannot be evaluated until [`Term::place`] turns it into a [`PlacedTerm`].
pub trait Term: TermDescription {
    /// Returns the term bound to a system: it evaluates the elements with a free vertex, and knows where their blocks
    /// are stored.
    fn place(self: Box<Self>, dofs: &DofMap, pattern: &Pattern) -> Box<dyn PlacedTerm>;
}

/// A term of a [`System`](crate::System), ready for evaluation.
///
/// Elements whose vertices are all pinned are skipped.
pub trait PlacedTerm: TermDescription {
    /// Looks up where the blocks are stored, if the term does not know. Terms with constant Jacobians may delay this
    /// until a system calls it, just before [`PlacedTerm::add_linearisation`].
    fn place_blocks(&mut self, _dofs: &DofMap, _pattern: &Pattern) {}
    /// Lets a term with constant Jacobians free the memory that [`PlacedTerm::place_blocks`] filled.
    fn forget_blocks(&mut self) {}
    /// Assigns elements to the shares of several threads, if the term is [`Divisible`].
    fn divide(&mut self, _shares: &[Share]) {}
    /// The term as one that several threads can sum; `None` if a single thread must.
    fn divisible(&self) -> Option<&dyn Divisible> {
        None
    }
    /// Returns the elements with a chosen vertex, as a term of the restricted system until the end of the step. `None`
    /// if the term cannot be restricted.
    fn restricted(&self, _restriction: &Restriction<'_>) -> Option<Box<dyn PlacedTerm>> {
        None
    }
    /// Updates what stays fixed over a step, such as the normal force of friction or the pose of an obstacle.
    fn begin_step(&mut self, _start: StepStart<'_>) {}
    /// Advances the history, such as plastic strains, at the end of a step.
    fn end_step(&mut self, _end: State<'_>) {}
    /// Whether the energy at fixed positions may change at the start or the end of a step. That change is work done on
    /// the body.
    fn is_driven(&self) -> bool {
        false
    }
    /// Whether the energy at fixed positions changes between two times, in s, without a change of the history.
    fn varies(&self, _from: f64, _to: f64) -> bool {
        false
    }
    /// Returns the history, from which [`PlacedTerm::restore_history`] restores the term; empty for a term without one.
    fn history(&self) -> Vec<f64> {
        Vec::new()
    }
    /// Restores a history. It takes effect with the next [`PlacedTerm::begin_step`].
    fn restore_history(&mut self, _history: &[f64]) {}
    /// Returns Rayleigh's dissipation function R(x, v), in W, with f(x, v) − f(x, 0) = −∂R/∂v. For a force proportional
    /// to velocity, R is half the dissipated power. `None` if the force does not depend on velocity.
    fn dissipation(&self, _state: State<'_>) -> Option<(f64, Tally)> {
        None
    }
    /// Whether the term has an energy.
    fn has_energy(&self) -> bool;
    /// Returns Σ U, in J; `None` for a force law.
    fn energy(&self, x: &[Vector3<f64>]) -> Option<(f64, Tally)>;
    /// Returns Σ U at the positions where forces or Jacobians were last evaluated; `None` if they do not yield it.
    fn energy_found(&self) -> Option<f64> {
        None
    }
    /// Returns U of each evaluated element with the element's index, for plots of the energy density. `None` if the
    /// energy is not known by element.
    fn element_energies(&self, _x: &[Vector3<f64>]) -> Option<Vec<(usize, f64)>> {
        None
    }
    /// Adds f to `force`.
    fn add_force(&self, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally;
    /// Adds f and its Jacobians to `sum`.
    fn add_linearisation(&self, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally;
    /// Returns the index of the first evaluated element with an infinite or NaN quantity.
    fn find_non_finite(&self, quantity: Quantity, state: State<'_>) -> Option<usize>;
}
