//! Elements of one type, packed for lanes, with their states.

use std::fmt::Debug;
use std::marker::PhantomData;
use std::ops::Range;

use energy_dsl::{
    Array, Flagged, MixedPotential, Packed, PackedMixed, PackedPotential, Potential, Stateful, Stored, Vector3,
    triangle_index,
};

/// Batches check their arguments; terms pass ranges and outputs that fit.
const FITS: &str = "ranges, unknowns and outputs fit";

/// Values of the unknowns at which elements are evaluated.
#[derive(Clone, Copy, Debug)]
pub(super) struct Configuration<'a> {
    /// The numbers of all unknowns.
    pub(super) u: &'a [f64],
    /// The unknowns that are vectors of 3, for elements on points.
    pub(super) points: &'a [Vector3<f64>],
}

/// Evaluates elements of type `E` in lanes. Ranges start at multiples of [`energy_dsl::BLOCK`].
pub(super) trait Kernels<E>: Debug + Send + Sync + 'static {
    /// Whether stencils index points.
    const ON_POINTS: bool;

    /// Returns the count of increments of an element.
    fn increments() -> usize;
    /// Writes U.
    fn values(packed: &Packed<E>, range: Range<usize>, at: Configuration<'_>, energies: &mut [f64]) -> Flagged;
    /// Writes U and ∂U/∂u.
    fn gradients(
        packed: &Packed<E>,
        range: Range<usize>,
        at: Configuration<'_>,
        energies: &mut [f64],
        gradients: &mut [f64],
    ) -> Flagged;
    /// Writes U, ∂U/∂u and the upper triangle of ∂²U/∂u², row by row.
    fn hessians(
        packed: &Packed<E>,
        range: Range<usize>,
        at: Configuration<'_>,
        energies: &mut [f64],
        gradients: &mut [f64],
        triangles: &mut [f64],
    ) -> Flagged;
}

/// Potentials of mixed unknowns. Stencils index the numbers of unknowns.
#[derive(Debug)]
pub(super) struct OfMixed;

impl<E: PackedMixed<f64>> Kernels<E> for OfMixed {
    const ON_POINTS: bool = false;

    fn increments() -> usize {
        <<E as MixedPotential<f64>>::Increments as Array<f64>>::LEN
    }

    fn values(packed: &Packed<E>, range: Range<usize>, at: Configuration<'_>, energies: &mut [f64]) -> Flagged {
        packed.mixed_values(range, at.u, energies).expect(FITS)
    }

    fn gradients(
        packed: &Packed<E>,
        range: Range<usize>,
        at: Configuration<'_>,
        energies: &mut [f64],
        gradients: &mut [f64],
    ) -> Flagged {
        packed.mixed_gradients(range, at.u, energies, gradients).expect(FITS)
    }

    fn hessians(
        packed: &Packed<E>,
        range: Range<usize>,
        at: Configuration<'_>,
        energies: &mut [f64],
        gradients: &mut [f64],
        triangles: &mut [f64],
    ) -> Flagged {
        packed.mixed_hessians(range, at.u, energies, gradients, triangles).expect(FITS)
    }
}

/// Potentials of points. Stencils index the points.
#[derive(Debug)]
pub(super) struct OfPoints;

impl<E: PackedPotential<f64>> Kernels<E> for OfPoints {
    const ON_POINTS: bool = true;

    fn increments() -> usize {
        3 * <<E as Potential<f64>>::Points as Array<Vector3<f64>>>::LEN
    }

    fn values(packed: &Packed<E>, range: Range<usize>, at: Configuration<'_>, energies: &mut [f64]) -> Flagged {
        packed.values(range, at.points, energies).expect(FITS)
    }

    fn gradients(
        packed: &Packed<E>,
        range: Range<usize>,
        at: Configuration<'_>,
        energies: &mut [f64],
        gradients: &mut [f64],
    ) -> Flagged {
        packed.gradients(range, at.points, energies, gradients).expect(FITS)
    }

    fn hessians(
        packed: &Packed<E>,
        range: Range<usize>,
        at: Configuration<'_>,
        energies: &mut [f64],
        gradients: &mut [f64],
        triangles: &mut [f64],
    ) -> Flagged {
        let (count, points) = (range.len(), <Self as Kernels<E>>::increments() / 3);
        let blocks = points * (points + 1) / 2;
        let mut by_blocks = vec![0.0; 9 * blocks * count];
        let flagged = packed.hessians(range, at.points, energies, gradients, &mut by_blocks).expect(FITS);
        let own = triangles.chunks_exact_mut(3 * points * (3 * points + 1) / 2);
        for (upper, blocks) in own.zip(by_blocks.chunks_exact(9 * blocks)) {
            let mut next = upper.iter_mut();
            for row in 0..3 * points {
                for column in row..3 * points {
                    let block = triangle_index(points, row / 3, column / 3);
                    *next.next().expect("a triangle has an entry per pair") =
                        blocks[9 * block + 3 * (row % 3) + column % 3];
                }
            }
        }
        flagged
    }
}

/// The routines of elements with a state.
#[derive(Debug)]
pub(super) struct StateRoutines<E> {
    /// Numbers of one element's state.
    len: usize,
    read: fn(&E, &mut Vec<f64>),
    write: fn(&mut E, &[f64]),
    /// Sets the time step; `None` if the elements do not know it.
    set_time_step: Option<fn(&mut E, f64)>,
    /// Appends the next state. Returns whether it is flagged.
    next: fn(&E, &[f64], &mut Vec<f64>) -> bool,
}

impl<E: Stateful<f64>> StateRoutines<E> {
    pub(super) fn new() -> Self {
        Self {
            len: <E::State as Array<f64>>::LEN,
            read: |element, to| to.extend_from_slice(element.state().as_ref()),
            write: |element, from| element.set_state(&<E::State as Array<f64>>::from_fn(|number| from[number])),
            set_time_step: E::DECLARATION.time_step().map(|_| E::set_time_step as fn(&mut E, f64)),
            next: |element, u, to| {
                let next = element.next(&<E::Unknowns as Array<f64>>::from_fn(|number| u[number]));
                to.extend_from_slice(next.state.as_ref());
                next.flags.any()
            },
        }
    }
}

/// Elements that are not packed yet.
pub(super) trait Unplaced: Debug + Send + Sync {
    /// Packs the elements with the indices `active`. Element i has the stencil `stencils[i]`, of the unknowns' numbers
    /// or of points; `numbers[i]` are its unknowns' numbers. Both follow each other, `per_element` for each.
    fn place(self: Box<Self>, active: &[u32], stencils: &[u32], numbers: Vec<u32>) -> Box<dyn Elements>;
}

/// Packed elements.
pub(super) trait Elements: Debug + Send + Sync {
    /// Writes U of packed elements. Returns how many are flagged, as do the next two.
    fn values(&self, range: Range<usize>, at: Configuration<'_>, energies: &mut [f64]) -> usize;
    /// Writes U and ∂U/∂u.
    fn gradients(
        &self,
        range: Range<usize>,
        at: Configuration<'_>,
        energies: &mut [f64],
        gradients: &mut [f64],
    ) -> usize;
    /// Writes U, ∂U/∂u and the upper triangles of ∂²U/∂u².
    fn hessians(
        &self,
        range: Range<usize>,
        at: Configuration<'_>,
        energies: &mut [f64],
        gradients: &mut [f64],
        triangles: &mut [f64],
    ) -> usize;
    /// Returns the states of all elements; empty for elements without a state.
    fn states(&self) -> Vec<f64>;
    /// Replaces the states of all elements.
    fn set_states(&mut self, states: &[f64]);
    /// Sets the time step, in s, of elements that know it.
    fn set_time_step(&mut self, h: f64);
    /// Returns the states after a step that ends at u, and how many are flagged. Nothing changes yet.
    fn next_states(&self, u: &[f64]) -> (Vec<f64>, usize);
    /// Returns the numbers of one element's state.
    fn state_len(&self) -> usize;
}

/// Elements of a list, with the routines of their state if they have one.
#[derive(Debug)]
pub(super) struct Listed<E, K> {
    pub(super) elements: Vec<E>,
    pub(super) routines: Option<StateRoutines<E>>,
    pub(super) kernels: PhantomData<K>,
}

/// Packed elements of one type.
#[derive(Debug)]
struct PackedElements<E, K> {
    packed: Packed<E>,
    states: Option<States<E>>,
    kernels: PhantomData<K>,
}

/// All elements of a list, packed or not: fixed unknowns may be moved by hand, and then states change.
#[derive(Debug)]
struct States<E> {
    routines: StateRoutines<E>,
    elements: Vec<E>,
    /// The numbers of each element's unknowns.
    numbers: Vec<u32>,
    /// The packed elements.
    active: Vec<u32>,
    /// The time step, in s, once it is set.
    time_step: Option<f64>,
}

/// Packs the active ones of some elements after they changed.
fn pack_again<E: Stored<f64>>(packed: &mut Packed<E>, elements: &[E], active: &[u32]) {
    for (place, &element) in active.iter().enumerate() {
        packed.set(place, &elements[element as usize]);
    }
}

impl<E, K> Unplaced for Listed<E, K>
where
    E: Stored<f64> + Debug + Send + Sync + 'static,
    K: Kernels<E>,
{
    fn place(self: Box<Self>, active: &[u32], stencils: &[u32], numbers: Vec<u32>) -> Box<dyn Elements> {
        let Self { elements, routines, kernels } = *self;
        let per_element = stencils.len().checked_div(elements.len()).unwrap_or(0);
        let element = |place: usize| &elements[active[place] as usize];
        let index = |place: usize, number: usize| stencils[active[place] as usize * per_element + number];
        let packed = Packed::from_fn(active.len(), per_element, element, index);
        let states =
            routines.map(|routines| States { routines, elements, numbers, active: active.to_vec(), time_step: None });
        Box::new(PackedElements { packed, states, kernels })
    }
}

impl<E, K> Elements for PackedElements<E, K>
where
    E: Stored<f64> + Debug + Send + Sync + 'static,
    K: Kernels<E>,
{
    fn values(&self, range: Range<usize>, at: Configuration<'_>, energies: &mut [f64]) -> usize {
        K::values(&self.packed, range, at, energies).len()
    }

    fn gradients(
        &self,
        range: Range<usize>,
        at: Configuration<'_>,
        energies: &mut [f64],
        gradients: &mut [f64],
    ) -> usize {
        K::gradients(&self.packed, range, at, energies, gradients).len()
    }

    fn hessians(
        &self,
        range: Range<usize>,
        at: Configuration<'_>,
        energies: &mut [f64],
        gradients: &mut [f64],
        triangles: &mut [f64],
    ) -> usize {
        K::hessians(&self.packed, range, at, energies, gradients, triangles).len()
    }

    fn states(&self) -> Vec<f64> {
        let mut all = Vec::new();
        if let Some(States { routines, elements, .. }) = &self.states {
            elements.iter().for_each(|element| (routines.read)(element, &mut all));
        }
        all
    }

    fn set_states(&mut self, states: &[f64]) {
        let Some(States { routines, elements, active, .. }) = &mut self.states else { return };
        for (element, state) in elements.iter_mut().zip(states.chunks_exact(routines.len.max(1))) {
            (routines.write)(element, state);
        }
        pack_again(&mut self.packed, elements, active);
    }

    fn set_time_step(&mut self, h: f64) {
        let Some(States { routines, elements, active, time_step, .. }) = &mut self.states else { return };
        let Some(set) = routines.set_time_step.filter(|_| *time_step != Some(h)) else { return };
        *time_step = Some(h);
        elements.iter_mut().for_each(|element| set(element, h));
        pack_again(&mut self.packed, elements, active);
    }

    fn next_states(&self, u: &[f64]) -> (Vec<f64>, usize) {
        let (mut all, mut flagged) = (Vec::new(), 0);
        if let Some(States { routines, elements, numbers, .. }) = &self.states {
            let per_element = numbers.len().checked_div(elements.len()).unwrap_or(0);
            let mut own = vec![0.0; per_element];
            for (element, numbers) in elements.iter().zip(numbers.chunks_exact(per_element.max(1))) {
                own.iter_mut().zip(numbers).for_each(|(own, &number)| *own = u[number as usize]);
                flagged += usize::from((routines.next)(element, &own, &mut all));
            }
        }
        (all, flagged)
    }

    fn state_len(&self) -> usize {
        self.states.as_ref().map_or(0, |states| states.routines.len)
    }
}
