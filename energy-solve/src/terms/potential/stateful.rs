//! Potentials with memory: their states stay fixed during a step and advance at its end.

use std::fmt::Debug;

use energy_dsl::tape::{Column, Output, Places, stencil_blocks};
use energy_dsl::{Array, Declaration, PackedPotential, RoutineKind, Stateful, Vector3};

use super::TapeTerm;
use super::changing::Changing;
use super::driven::{DrivenLaw, DrivenTerm};
use super::named_stencils::NamedStencils;
use super::placed::PlacedPotentialTerm;
use super::tapes::TapePacks;
use crate::terms::active::Active;
use crate::terms::element_list::ElementList;
use crate::terms::scatter_map::ScatterMaps;
use crate::terms::stencils::Stencils;
use crate::terms::term::{MadeFromTerm, TermDescription};

/// Elements with a state, each advanced by its `next` at the end of a step; see [`DrivenTerm::with_memory`].
#[derive(Clone, Debug)]
pub struct StatefulLaw<E> {
    elements: Vec<E>,
    /// The time step, in s, of elements that know it.
    time_step: Option<f64>,
}

impl<E> DrivenLaw for StatefulLaw<E>
where
    E: PackedPotential<f64> + Stateful<f64> + Copy + Debug + Send + Sync + 'static,
{
    type Element = E;

    fn element(&self, stencil: usize, _: f64) -> E {
        self.elements[stencil]
    }

    fn begin_step(&mut self, dt: f64) -> bool {
        let changes = E::DECLARATION.time_step().is_some() && self.time_step != Some(dt);
        if changes {
            self.time_step = Some(dt);
            self.elements.iter_mut().for_each(|element| element.set_time_step(dt));
        }
        changes
    }

    fn advance(&mut self, stencils: Stencils<'_>, x: &[Vector3<f64>]) -> bool {
        let mut changes = false;
        for (number, element) in self.elements.iter_mut().enumerate() {
            let u = |place: usize| x[stencils.vertex(number, place / 3) as usize][place % 3];
            let next = element.next(&E::Unknowns::from_fn(u)).state;
            changes |= differ(next.as_ref(), element.state().as_ref());
            element.set_state(&next);
        }
        changes
    }

    fn history(&self) -> Vec<f64> {
        self.elements.iter().flat_map(|element| element.state().as_ref().to_vec()).collect()
    }

    fn restore(&mut self, history: &[f64]) {
        if history.len() == self.elements.len() * E::State::LEN {
            for (element, state) in self.elements.iter_mut().zip(history.chunks_exact(E::State::LEN)) {
                element.set_state(&E::State::from_fn(|number| state[number]));
            }
        }
    }
}

impl<E> DrivenTerm<StatefulLaw<E>>
where
    E: PackedPotential<f64> + Stateful<f64> + Copy + Debug + Send + Sync + 'static,
{
    /// Creates the sum of the potentials of elements with memory. At the end of each step every element takes its next
    /// state, also those whose vertices are all pinned.
    #[must_use]
    pub fn with_memory(list: ElementList<E>) -> Self {
        let (elements, arity) = (list.elements().to_vec(), list.arity());
        let (name, vertices) = list.into_name_and_vertices();
        Self { law: StatefulLaw { elements, time_step: None }, on: NamedStencils { name, vertices, arity } }
    }
}

/// A [`TapeTerm`] whose elements have a state.
#[derive(Debug)]
pub(super) struct StatefulTapes {
    /// All elements, with their present states.
    term: TapeTerm,
    /// The states of all elements, one after the other.
    states: Vec<f64>,
    /// Index of the time step among the parameters' numbers.
    time_step: Option<usize>,
    /// The vertices of all elements, by block.
    stencils: Vec<u32>,
}

impl StatefulTapes {
    pub(super) fn new(term: TapeTerm) -> Self {
        let size = state_size(&term.declaration);
        let own = term.elements.routines().parameters - size;
        let states = (0..term.elements.len())
            .flat_map(|element| term.elements.numbers_of(element)[own..own + size].to_vec())
            .collect();
        let vertex = |number: usize, point: usize| term.stencils().vertex(number, point);
        let stencils = stencil_blocks(term.elements.len(), term.declaration.points.len(), vertex);
        Self { states, time_step: term.declaration.time_step(), stencils, term }
    }

    fn set_states(&mut self, states: Vec<f64>) {
        let (size, elements) = (state_size(&self.term.declaration), &mut self.term.elements);
        elements.set_parameters(elements.routines().parameters - size, size, Column::Each(&states));
        self.states = states;
    }
}

impl MadeFromTerm for StatefulTapes {
    fn term(&self) -> &dyn TermDescription {
        &self.term
    }
}

impl Changing for StatefulTapes {
    type Packs = TapePacks;

    fn pack(&mut self, _: f64, active: &Active, maps: &ScatterMaps) -> PlacedPotentialTerm<TapePacks> {
        self.term.packed(active, maps)
    }

    fn varies(&self, _: f64, _: f64) -> bool {
        false
    }

    fn begin_step(&mut self, dt: f64) -> bool {
        let Some(place) = self.time_step else { return false };
        let elements = &mut self.term.elements;
        // All elements have the same one.
        let changes = !elements.is_empty() && elements.numbers_of(0)[place] != dt;
        if changes {
            elements.set_parameters(place, 1, Column::Same(&[dt]));
        }
        changes
    }

    fn advance(&mut self, x: &[Vector3<f64>]) -> bool {
        let size = state_size(&self.term.declaration);
        let layout: Vec<u16> = (0..=u16::MAX).take(size).collect();
        let mut states = vec![0.0; self.states.len()];
        let output = Output { name: "states", layout: &layout, numbers: &mut states };
        let places = Places::Gathered { vectors: x, stencils: &self.stencils };
        let all = 0..self.term.elements.len();
        self.term
            .elements
            .evaluate(RoutineKind::Next, all, places, None, &mut [output])
            .expect("stencils and states fit the elements");
        let changes = differ(&states, &self.states);
        if changes {
            self.set_states(states);
        }
        changes
    }

    fn history(&self) -> Vec<f64> {
        self.states.clone()
    }

    fn restore(&mut self, history: &[f64]) {
        if history.len() == self.states.len() {
            self.set_states(history.to_vec());
        }
    }
}

/// Returns the numbers of one element's state.
fn state_size(declaration: &Declaration) -> usize {
    declaration.state.iter().map(|field| field.size).sum()
}

/// Whether two states differ in any bit: checkpoints keep bits.
fn differ(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).any(|(a, b)| a.to_bits() != b.to_bits())
}
