use energy_dsl::{Array, Block, Declaration, Element, ForceLaw, Potential, Value, Vector3, triangle_index};

use crate::counts::Tally;
use crate::list::ElementList;
use crate::projection::project_to_positive;
use crate::vector::{add_scaled_block, block_times, transposed};

/// What a term's force is like, so that what is absent costs nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Character {
    /// ∂f/∂x and ∂f/∂v are symmetric: conjugate gradients will do.
    pub symmetric: bool,
    /// f depends on velocities.
    pub velocity_dependent: bool,
    /// f depends on positions or velocities at all; gravity does not, and has no Jacobians to assemble.
    pub curved: bool,
}

/// Whether Hessians are used as they are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Curvature {
    /// As they are; the sum may be indefinite.
    #[default]
    Exact,
    /// Each element's Hessian with its negative eigenvalues set to zero; see [`project_to_positive`]. Force laws have no Hessian
    /// and are used as they are.
    Projected,
}

/// Positions (m) and velocities (m/s) of all vertices.
#[derive(Clone, Copy, Debug)]
pub struct State<'a> {
    /// Positions.
    pub x: &'a [Vector3<f64>],
    /// Velocities.
    pub v: &'a [Vector3<f64>],
}

/// The vertices of a term's elements, `arity` to an element.
#[derive(Clone, Copy, Debug)]
pub struct Stencils<'a> {
    /// Points of an element.
    pub arity: usize,
    /// All stencils one after the other.
    pub vertices: &'a [usize],
}

impl<'a> Stencils<'a> {
    /// The stencils one by one.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &'a [usize]> {
        self.vertices.chunks_exact(self.arity)
    }

    /// The vertices of one element.
    #[must_use]
    pub fn stencil(&self, element: usize) -> &'a [usize] {
        &self.vertices[element * self.arity..][..self.arity]
    }
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
    /// Blocks of α ∂f/∂x + β ∂f/∂v.
    pub matrix: &'a mut [Block<f64>],
    /// f, of all vertices.
    pub force: &'a mut [Vector3<f64>],
    /// (∂f/∂x) v, of all vertices.
    pub stiffness_times_velocity: &'a mut [Vector3<f64>],
}

/// For each active element the places of its blocks in the matrix, row by row; `None` where a vertex is pinned.
pub type Slots = [Option<usize>];

/// Elements of one type within a [`crate::System`]. `active` lists the elements to evaluate.
pub trait Term: std::fmt::Debug {
    /// What it stands for.
    fn name(&self) -> &str;
    /// The declaration of its elements.
    fn declaration(&self) -> &'static Declaration;
    /// What its force is like.
    fn character(&self) -> Character;
    /// The vertices of its elements.
    fn stencils(&self) -> Stencils<'_>;
    /// Σ U; `None` for a force law.
    fn energy(&self, active: &[usize], x: &[Vector3<f64>]) -> Option<(f64, Tally)>;
    /// Adds f.
    fn add_force(&self, active: &[usize], state: State<'_>, force: &mut [Vector3<f64>]) -> Tally;
    /// Adds f and its Jacobians; `slots` holds arity² places per active element.
    fn add_linearisation(
        &self,
        active: &[usize],
        slots: &Slots,
        state: State<'_>,
        sum: &mut Linearisation<'_>,
    ) -> Tally;
}

/// A term with f = −∇U: never dependent on velocity, always with symmetric Jacobians.
#[derive(Clone, Debug)]
pub struct PotentialTerm<E> {
    list: ElementList<E>,
}

impl<E: Potential<f64>> PotentialTerm<E> {
    /// The sum of the potentials of a list. Hessians that the declaration proves zero (gravity's) are never evaluated.
    #[must_use]
    pub fn new(list: ElementList<E>) -> Self {
        Self { list }
    }
}

/// A method that evaluates an element's energy.
type ValueOf<E, Points> = fn(&E, &Points) -> Value<f64>;

/// A term with a force law f(x, v).
#[derive(Clone)]
pub struct ForceTerm<E: ForceLaw<f64>> {
    list: ElementList<E>,
    energy: Option<ValueOf<E, E::Points>>,
}

impl<E: ForceLaw<f64>> ForceTerm<E> {
    /// The sum of the forces of a list. What they depend on, and whether conjugate gradients may be used, is what the declaration
    /// proves.
    #[must_use]
    pub fn new(list: ElementList<E>) -> Self {
        Self { list, energy: None }
    }

    /// Reports the potential of the elements (damped springs have one) as the term's energy.
    #[must_use]
    pub fn with_energy(mut self) -> Self
    where
        E: Potential<f64, Points = <E as ForceLaw<f64>>::Points>,
    {
        self.energy = Some(<E as Potential<f64>>::value);
        self
    }
}

impl<E: ForceLaw<f64> + std::fmt::Debug> std::fmt::Debug for ForceTerm<E> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ForceTerm").field("list", &self.list).finish_non_exhaustive()
    }
}

impl<E: Potential<f64> + std::fmt::Debug> Term for PotentialTerm<E> {
    fn name(&self) -> &str {
        self.list.name()
    }

    fn declaration(&self) -> &'static Declaration {
        E::DECLARATION
    }

    fn character(&self) -> Character {
        Character { symmetric: true, velocity_dependent: false, curved: E::DECLARATION.curved }
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: self.list.arity(), vertices: self.list.vertices() }
    }

    fn energy(&self, active: &[usize], x: &[Vector3<f64>]) -> Option<(f64, Tally)> {
        Some(sum_of_values(&self.list, active, x, E::value))
    }

    fn add_force(&self, active: &[usize], state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        let mut tally = Tally::default();
        for &index in active {
            let stencil = self.list.stencil(index);
            let result = self.list.elements()[index].gradient(&gather(stencil, state.x));
            scatter(stencil, -1.0, result.gradient.as_ref(), force);
            count(&mut tally, result.flags.any());
        }
        tally
    }

    fn add_linearisation(
        &self,
        active: &[usize],
        slots: &Slots,
        state: State<'_>,
        sum: &mut Linearisation<'_>,
    ) -> Tally {
        let points = self.list.arity();
        let mut tally = Tally::default();
        for (&index, slots) in active.iter().zip(slots.chunks_exact(points * points)) {
            let stencil = self.list.stencil(index);
            let mut result = self.list.elements()[index].hessian(&gather(stencil, state.x));
            if sum.curvature == Curvature::Projected {
                project_to_positive(result.hessian.as_mut(), points);
            }
            scatter(stencil, -1.0, result.gradient.as_ref(), sum.force);
            let triangle = result.hessian.as_ref();
            for i in 0..points {
                for j in i..points {
                    let block = negated(&triangle[triangle_index(points, i, j)]);
                    sum.add_by_position(stencil, (i, j), slots[i * points + j], &block, state.v);
                    if i != j {
                        sum.add_by_position(stencil, (j, i), slots[j * points + i], &transposed(&block), state.v);
                    }
                }
            }
            count(&mut tally, result.flags.any());
        }
        tally
    }
}

impl<E: ForceLaw<f64> + std::fmt::Debug> Term for ForceTerm<E> {
    fn name(&self) -> &str {
        self.list.name()
    }

    fn declaration(&self) -> &'static Declaration {
        E::DECLARATION
    }

    fn character(&self) -> Character {
        let Declaration { symmetric, velocity_dependent, curved, .. } = *E::DECLARATION;
        Character { symmetric, velocity_dependent, curved: curved || velocity_dependent }
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: self.list.arity(), vertices: self.list.vertices() }
    }

    fn energy(&self, active: &[usize], x: &[Vector3<f64>]) -> Option<(f64, Tally)> {
        self.energy.map(|value| sum_of_values(&self.list, active, x, value))
    }

    fn add_force(&self, active: &[usize], state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        let mut tally = Tally::default();
        for &index in active {
            let stencil = self.list.stencil(index);
            let result = self.list.elements()[index].force(&gather(stencil, state.x), &gather(stencil, state.v));
            scatter(stencil, 1.0, result.force.as_ref(), force);
            count(&mut tally, result.flags.any());
        }
        tally
    }

    fn add_linearisation(
        &self,
        active: &[usize],
        slots: &Slots,
        state: State<'_>,
        sum: &mut Linearisation<'_>,
    ) -> Tally {
        let points = self.list.arity();
        let mut tally = Tally::default();
        for (&index, slots) in active.iter().zip(slots.chunks_exact(points * points)) {
            let stencil = self.list.stencil(index);
            let result = self.list.elements()[index].jacobians(&gather(stencil, state.x), &gather(stencil, state.v));
            scatter(stencil, 1.0, result.force.as_ref(), sum.force);
            for (place, block) in result.by_position.as_ref().iter().enumerate() {
                sum.add_by_position(stencil, (place / points, place % points), slots[place], block, state.v);
            }
            if E::DECLARATION.velocity_dependent {
                for (slot, block) in slots.iter().zip(result.by_velocity.as_ref()) {
                    if let Some(slot) = *slot {
                        add_scaled_block(&mut sum.matrix[slot], sum.weights.velocity, block);
                    }
                }
            }
            count(&mut tally, result.flags.any());
        }
        tally
    }
}

impl Linearisation<'_> {
    /// Adds block (i, j) of an element's ∂f/∂x to the matrix and to (∂f/∂x) v.
    fn add_by_position(
        &mut self,
        stencil: &[usize],
        (i, j): (usize, usize),
        slot: Option<usize>,
        block: &Block<f64>,
        v: &[Vector3<f64>],
    ) {
        if let Some(slot) = slot {
            add_scaled_block(&mut self.matrix[slot], self.weights.position, block);
        }
        let product = block_times(block, &v[stencil[j]]);
        for axis in 0..3 {
            self.stiffness_times_velocity[stencil[i]][axis] += product[axis];
        }
    }
}

fn sum_of_values<E: Element, Points: Array<Vector3<f64>>>(
    list: &ElementList<E>,
    active: &[usize],
    x: &[Vector3<f64>],
    value: ValueOf<E, Points>,
) -> (f64, Tally) {
    let (mut sum, mut tally) = (0.0, Tally::default());
    for &index in active {
        let result = value(&list.elements()[index], &gather(list.stencil(index), x));
        sum += result.value;
        count(&mut tally, result.flags.any());
    }
    (sum, tally)
}

fn gather<Points: Array<Vector3<f64>>>(stencil: &[usize], all: &[Vector3<f64>]) -> Points {
    Points::from_fn(|point| all[stencil[point]])
}

fn scatter(stencil: &[usize], sign: f64, parts: &[Vector3<f64>], all: &mut [Vector3<f64>]) {
    for (&vertex, part) in stencil.iter().zip(parts) {
        for axis in 0..3 {
            all[vertex][axis] += sign * part[axis];
        }
    }
}

fn negated(block: &Block<f64>) -> Block<f64> {
    block.map(|row| row.map(|entry| -entry))
}

fn count(tally: &mut Tally, flagged: bool) {
    tally.evaluated += 1;
    tally.flagged += u64::from(flagged);
}
