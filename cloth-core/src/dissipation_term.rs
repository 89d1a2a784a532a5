//! Non-linear damping forces, declared as dissipation functions.

use energy_dsl::{Array, Declaration, Element, Potential, Vector3};
use energy_solve::{
    Character, DofMap, Linearisation, Pattern, PlacedTerm, Quantity, State, Stencils, StepStart, Tally, Term,
    TermDescription, TrianglePlaces, index,
};

/// Selects the elements that act during a step. Their parameters are fixed at its start; only velocities vary.
pub(crate) trait DissipationLaw: std::fmt::Debug + Send {
    /// The element: a convex Rayleigh dissipation function, declared as an energy of the displacements per unit of
    /// time.
    type Element: Potential<f64> + std::fmt::Debug + Send;
    /// Returns the elements that act on stencils with a free vertex, each with the index of its stencil, in ascending
    /// order.
    fn elements(&self, start: &StepStart<'_>, is_free: &[bool]) -> Vec<(usize, Self::Element)>;
}

/// The forces −∂R/∂v of dissipation functions R.
#[derive(Debug)]
pub(crate) struct DissipativeTerm<L: DissipationLaw> {
    name: String,
    law: L,
    stencils: Vec<u32>,
    arity: usize,
    places: TrianglePlaces,
    is_free: Vec<bool>,
    acting: Vec<(usize, L::Element)>,
}

impl<L: DissipationLaw> DissipativeTerm<L> {
    /// Creates a term for a law whose element has N points. No element acts before the first step begins.
    pub(crate) fn new<const N: usize>(name: String, law: L, stencils: &[[usize; N]]) -> Self {
        let stencils = stencils.as_flattened().iter().copied().map(index).collect();
        let acting = Vec::new();
        Self { name, law, stencils, arity: N, places: TrianglePlaces::default(), is_free: Vec::new(), acting }
    }

    fn stencil(&self, number: usize) -> &[u32] {
        &self.stencils[number * self.arity..][..self.arity]
    }

    fn velocities(&self, number: usize, v: &[Vector3<f64>]) -> <L::Element as Potential<f64>>::Points {
        let stencil = self.stencil(number);
        Array::from_fn(|point| v[stencil[point] as usize])
    }

    fn tally(&self, flagged: u64) -> Tally {
        let evaluated = self.acting.len() as u64;
        Tally { evaluated, skipped: self.is_free.len() as u64 - evaluated, flagged, projected: 0 }
    }
}

impl<L: DissipationLaw> TermDescription for DissipativeTerm<L> {
    fn name(&self) -> &str {
        &self.name
    }

    fn declaration(&self) -> &'static Declaration {
        <L::Element as Element>::DECLARATION
    }

    fn character(&self) -> Character {
        Character { symmetric: true, velocity_dependent: true, quadratic: false, curved: true }
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils::new(self.arity, &self.stencils)
    }
}

impl<L: DissipationLaw + 'static> Term for DissipativeTerm<L> {
    fn place(mut self: Box<Self>, dofs: &DofMap, pattern: &Pattern) -> Box<dyn PlacedTerm> {
        let is_free = |vertex: u32| dofs.place(vertex as usize).is_some();
        self.acting.clear();
        self.is_free = self.stencils().iter().map(|mut stencil| stencil.any(is_free)).collect();
        self.places = TrianglePlaces::new(self.stencils(), dofs, pattern);
        self
    }
}

impl<L: DissipationLaw> PlacedTerm for DissipativeTerm<L> {
    fn begin_step(&mut self, start: StepStart<'_>) {
        self.acting = self.law.elements(&start, &self.is_free);
    }

    fn dissipation(&self, State { v, .. }: State<'_>) -> Option<(f64, Tally)> {
        let (mut sum, mut flagged) = (0.0, 0);
        for (number, element) in &self.acting {
            let result = element.value(&self.velocities(*number, v));
            sum += result.value;
            flagged += u64::from(result.flags.any());
        }
        Some((sum, self.tally(flagged)))
    }

    fn has_energy(&self) -> bool {
        false
    }

    fn energy(&self, _: &[Vector3<f64>]) -> Option<(f64, Tally)> {
        None
    }

    fn add_force(&self, State { v, .. }: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        let mut flagged = 0;
        for (number, element) in &self.acting {
            let result = element.gradient(&self.velocities(*number, v));
            for (&vertex, gradient) in self.stencil(*number).iter().zip(result.gradient.as_ref()) {
                (0..3).for_each(|axis| force[vertex as usize][axis] -= gradient[axis]);
            }
            flagged += u64::from(result.flags.any());
        }
        self.tally(flagged)
    }

    fn add_linearisation(&self, State { v, .. }: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        let mut flagged = 0;
        for (number, element) in &self.acting {
            let result = element.hessian(&self.velocities(*number, v));
            for (&vertex, gradient) in self.stencil(*number).iter().zip(result.gradient.as_ref()) {
                (0..3).for_each(|axis| sum.force[vertex as usize][axis] -= gradient[axis]);
            }
            self.places.add(*number, -sum.weights.velocity, result.hessian.as_ref(), &mut sum.matrix);
            flagged += u64::from(result.flags.any());
        }
        self.tally(flagged)
    }

    fn find_non_finite(&self, _: Quantity, State { v, .. }: State<'_>) -> Option<usize> {
        let is_finite = |(number, element): &(usize, L::Element)| {
            let result = element.gradient(&self.velocities(*number, v));
            result.gradient.as_ref().as_flattened().iter().all(|component| component.is_finite())
        };
        self.acting.iter().find(|acting| !is_finite(acting)).map(|(number, _)| *number)
    }
}
