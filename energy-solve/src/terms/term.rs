use std::ops::Range;

use energy_dsl::{Declaration, Vector3};

use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::Pattern;
use crate::matrix::precision::Blocks;
use crate::terms::counts::Tally;
use crate::terms::curvature::Curvature;
use crate::terms::stencils::Stencils;

/// What a term's force is like, so that what is absent costs nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Character {
    /// ∂f/∂x and ∂f/∂v are symmetric: conjugate gradients will do.
    pub symmetric: bool,
    /// f depends on velocities.
    pub velocity_dependent: bool,
    /// ∂f/∂x and ∂f/∂v are the same at all positions and velocities: they are computed once for all steps of one size.
    pub quadratic: bool,
    /// f depends on positions or velocities at all; gravity does not, and has no Jacobians to assemble.
    pub curved: bool,
}

/// Positions (m) and velocities (m/s) of all vertices.
#[derive(Clone, Copy, Debug)]
pub struct State<'a> {
    /// Positions.
    pub x: &'a [Vector3<f64>],
    /// Velocities.
    pub v: &'a [Vector3<f64>],
}

/// Where a step starts.
#[derive(Clone, Copy, Debug)]
pub struct StepStart<'a> {
    /// When, in s.
    pub time: f64,
    /// Its size, in s.
    pub dt: f64,
    /// Positions and velocities then.
    pub state: State<'a>,
}

/// What one of several threads sums up: consecutive vertices, and the blocks in their rows of the matrix.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Share {
    /// Its number among all shares.
    pub number: usize,
    /// Its vertices.
    pub vertices: Range<usize>,
    /// Its blocks, by [`Pattern::place`].
    pub blocks: Range<usize>,
}

/// A term that can be summed up by shares, all at the same time: elements that act across their border are evaluated for both. Every entry is a sum in
/// the order of the elements, whatever the shares.
pub trait Divisible: Sync {
    /// The number of parts that its energy is the sum of, in their order. It depends on the elements alone.
    fn energy_parts(&self) -> usize;
    /// One part of the energy.
    fn energy_part(&self, part: usize, x: &[Vector3<f64>]) -> (f64, Tally);
    /// Adds f of the vertices of a share.
    fn add_force_of(&self, share: &Share, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally;
    /// Adds f and its Jacobians: `sum` holds vertices and blocks of a share.
    fn add_linearisation_of(&self, share: &Share, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally;
}

/// The factors α and β of α ∂f/∂x + β ∂f/∂v.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// α.
    pub position: f64,
    /// β.
    pub velocity: f64,
}

/// Where a linearised term is added.
#[derive(Debug)]
pub struct Linearisation<'a> {
    /// α and β.
    pub weights: Weights,
    /// How to treat negative curvature.
    pub curvature: Curvature,
    /// Blocks of α ∂f/∂x + β ∂f/∂v, by [`Pattern::place`], and one more at [`Pattern::nowhere`] for those of pinned vertices.
    pub matrix: Blocks<'a>,
    /// f, of all vertices.
    pub force: &'a mut [Vector3<f64>],
    /// (∂f/∂x) v, of all vertices, if it is asked for.
    pub stiffness_times_velocity: Option<&'a mut [Vector3<f64>]>,
}

/// What may turn out not to be finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// U.
    Energy,
    /// f.
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

/// Elements of one type within a [`crate::System`].
///
/// Nothing is evaluated before [`Term::place`]; from then on all elements but those on pinned vertices only are.
pub trait Term: std::fmt::Debug {
    /// What it stands for.
    fn name(&self) -> &str;
    /// The declaration of its elements.
    fn declaration(&self) -> &'static Declaration;
    /// What its force is like.
    fn character(&self) -> Character;
    /// The vertices of its elements.
    fn stencils(&self) -> Stencils<'_>;
    /// Finds out which elements have a free vertex, and where their blocks are stored; of constant ones that may wait for [`Term::place_blocks`].
    fn place(&mut self, dofs: &DofMap, pattern: &Pattern);
    /// Finds out where its blocks are stored, if it does not know. Called before constant Jacobians are evaluated.
    fn place_blocks(&mut self, _dofs: &DofMap, _pattern: &Pattern) {}
    /// May forget where its blocks are stored, until [`Term::place_blocks`] is called: its Jacobians are constant, and were evaluated.
    fn forget_blocks(&mut self) {}
    /// Finds out what elements each share needs, if it can be divided. Called after [`Term::place`], and whenever the number of threads changes.
    fn divide(&mut self, _shares: &[Share]) {}
    /// Its shares; `None` if one thread has to do it all.
    fn divisible(&self) -> Option<&dyn Divisible> {
        None
    }
    /// Called before each step: what a term holds fixed over a step (the normal force of friction, where an obstacle is) it takes from here.
    fn begin_step(&mut self, _start: StepStart<'_>) {}
    /// Rayleigh's dissipation function R(x, v), in W, with f(x, v) − f(x, 0) = −∂R/∂v: half the power that a force takes that grows in proportion to
    /// velocity. `None` for a force that does not depend on velocity.
    fn dissipation(&self, _state: State<'_>) -> Option<(f64, Tally)> {
        None
    }
    /// Whether it has an energy.
    fn has_energy(&self) -> bool;
    /// Σ U; `None` for a force law.
    fn energy(&self, x: &[Vector3<f64>]) -> Option<(f64, Tally)>;
    /// Σ U at the positions where forces or Jacobians were evaluated last, if it came with them.
    fn energy_found(&self) -> Option<f64> {
        None
    }
    /// U of each evaluated element, with its number among the stencils: for pictures of where energy is. `None` where it is not known by elements.
    fn element_energies(&self, _x: &[Vector3<f64>]) -> Option<Vec<(usize, f64)>> {
        None
    }
    /// Adds f.
    fn add_force(&self, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally;
    /// Adds f and its Jacobians.
    fn add_linearisation(&self, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally;
    /// The first evaluated element for which something is infinite or NaN.
    fn find_non_finite(&self, quantity: Quantity, state: State<'_>) -> Option<usize>;
}
