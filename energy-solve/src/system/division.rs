//! Sums of terms, divided among threads.
//!
//! Each thread sums the entries of the vertices and rows assigned to it, in the order of terms and elements. Every
//! entry is therefore the same sum for any number of threads, and is written by one thread only.

use energy_dsl::{Block, Vector3};

use super::constant::ConstantPart;
use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::Pattern;
use crate::matrix::precision::Precision;
use crate::terms::counts::Tally;
use crate::terms::curvature::Curvature;
use crate::terms::linearisation::{Linearisation, Weights};
use crate::terms::share::{Divisible, Share};
use crate::terms::state::State;
use crate::threads::{for_each, split_mut};

/// Free vertices per thread, at least: fewer do not repay the cost of waking a thread.
const MIN_VERTICES_PER_THREAD: usize = 512;

/// One entry per term: its parallel form, if it has one, and whether to assemble its Jacobian.
type Terms<'a> = [Option<(&'a dyn Divisible, bool)>];

/// Divides vertices and rows into at most `threads` shares.
pub(crate) fn shares(dofs: &DofMap, pattern: &Pattern, threads: usize) -> Vec<Share> {
    let (rows, vertices) = (dofs.free().len(), dofs.vertex_count());
    let count = threads.min(rows / MIN_VERTICES_PER_THREAD).max(1);
    let first_row = |number: usize| number * rows / count;
    let first_vertex = |number: usize| match number {
        0 => 0,
        _ if number == count => vertices,
        _ => dofs.free()[first_row(number)],
    };
    let first_block = |number: usize| pattern.first_in(first_row(number));
    let share = |number: usize| Share {
        number,
        vertices: first_vertex(number)..first_vertex(number + 1),
        blocks: first_block(number)..first_block(number + 1),
    };
    (0..count).map(share).collect()
}

/// Returns the energy of each divisible term.
pub(crate) fn energies(terms: &Terms<'_>, threads: usize, x: &[Vector3<f64>]) -> Vec<Option<(f64, Tally)>> {
    let numbered = terms.iter().enumerate().filter_map(|(number, term)| term.map(|(term, _)| (number, term)));
    let parts = numbered.flat_map(|(number, term)| (0..term.energy_parts()).map(move |part| (number, term, part)));
    let evaluated = for_each(threads, parts.collect(), |(number, term, part)| (number, term.energy_part(part, x)));
    let mut sums: Vec<_> = terms.iter().map(|term| term.map(|_| (0.0, Tally::default()))).collect();
    for (number, (energy, tally)) in evaluated {
        if let Some((sum, total)) = &mut sums[number] {
            *sum += energy;
            *total += tally;
        }
    }
    sums
}

/// Adds the forces of the divisible terms.
pub(crate) fn forces(
    terms: &Terms<'_>,
    shares: &[Share],
    state: State<'_>,
    force: &mut [Vector3<f64>],
) -> Vec<Option<Tally>> {
    let parts = split_mut(force, shares.iter().map(|share| share.vertices.len()));
    let tallies = for_each(shares.len(), shares.iter().zip(parts).collect(), |(share, force)| {
        terms.iter().map(|term| term.map(|(term, _)| term.add_force_of(share, state, force))).collect()
    });
    total(tallies)
}

/// The sums that terms are added to.
pub(crate) struct Sums<'a, T> {
    pub(crate) weights: Weights,
    pub(crate) curvature: Curvature,
    pub(crate) matrix: &'a mut [Block<T>],
    pub(crate) force: &'a mut [Vector3<f64>],
    pub(crate) product: Option<&'a mut [Vector3<f64>]>,
}

impl<T: Precision> Sums<'_, T> {
    /// Returns the sums in the form that terms take.
    pub(crate) fn linearisation(&mut self) -> Linearisation<'_> {
        Linearisation {
            weights: self.weights,
            curvature: self.curvature,
            matrix: T::blocks(self.matrix),
            force: self.force,
            stiffness_times_velocity: self.product.as_deref_mut(),
        }
    }
}

/// Resets the matrix to its constant part, or to zero, and adds the divisible terms' forces and requested Jacobians.
pub(crate) fn linearisations<T: Precision>(
    terms: &Terms<'_>,
    shares: &[Share],
    state: State<'_>,
    constant: Option<&ConstantPart>,
    sums: &mut Sums<'_, T>,
) -> Vec<Option<Tally>> {
    let vertices = || shares.iter().map(|share| share.vertices.len());
    let matrices = split_mut(sums.matrix, shares.iter().map(|share| share.blocks.len()));
    let forces = split_mut(sums.force, vertices());
    let products: Vec<Option<&mut [Vector3<f64>]>> = match &mut sums.product {
        Some(product) => split_mut(product, vertices()).into_iter().map(Some).collect(),
        None => shares.iter().map(|_| None).collect(),
    };
    let (weights, curvature) = (sums.weights, sums.curvature);
    let parts = shares.iter().zip(matrices).zip(forces).zip(products);
    let tallies = for_each(shares.len(), parts.collect(), |(((share, matrix), force), product)| {
        match constant {
            Some(constant) => constant.restore(share.blocks.start, T::blocks(matrix)),
            None => matrix.fill([[T::from_f64(0.0); 3]; 3]),
        }
        let mut sums = Sums { weights, curvature, matrix, force, product };
        let mut sum = sums.linearisation();
        let mut add = |term: &dyn Divisible, linear: bool| {
            if linear {
                term.add_linearisation_of(share, state, &mut sum)
            } else {
                term.add_force_of(share, state, sum.force)
            }
        };
        terms.iter().map(|term| term.map(|(term, linear)| add(term, linear))).collect()
    });
    total(tallies)
}

/// Sums the tallies of all shares, term by term.
fn total(shares: Vec<Vec<Option<Tally>>>) -> Vec<Option<Tally>> {
    let add = |mut sums: Vec<Option<Tally>>, share: Vec<Option<Tally>>| {
        for (sum, tally) in sums.iter_mut().zip(share) {
            if let (Some(sum), Some(tally)) = (sum, tally) {
                *sum += tally;
            }
        }
        sums
    };
    shares.into_iter().reduce(add).expect("there is at least one share")
}
