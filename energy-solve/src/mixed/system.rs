//! Sums of terms over the unknowns of a body.

use std::ops::{AddAssign, Range};
use std::sync::Arc;

use energy_dsl::{BLOCK, Number, Vector3};

use super::body::{Extremum, MixedBody, UnknownKind};
use super::elements::Configuration;
use super::error::MixedError;
use super::scatter::{Rows, Scatter};
use super::states::ElementStates;
use super::term::{MixedTerm, Placed};
use crate::matrix::kinds::KindPattern;
use crate::matrix::{BorderedMatrix, index};
use crate::terms::{Counts, Curvature, Tally};

/// Elements that are evaluated before they are added: their Hessians stay in the cache.
const CHUNK: usize = 4 * BLOCK;

/// A potential energy.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MixedEnergy {
    /// U, in J; +∞ outside of a formula's domain.
    pub value: f64,
    /// Σ |U_e| over the elements: rounding moves the value by about 10⁻¹⁶ of it.
    pub magnitude: f64,
}

impl AddAssign for MixedEnergy {
    fn add_assign(&mut self, other: Self) {
        self.value += other.value;
        self.magnitude += other.magnitude;
    }
}

/// A running sum of energies, compensated (Neumaier 1974): bodies of many elements would lose digits that line searches
/// need.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct EnergySum {
    sum: f64,
    /// The rounding errors of the sum.
    errors: f64,
    magnitude: f64,
}

impl EnergySum {
    pub(super) fn add(&mut self, energy: f64) {
        self.errors += self.sum.sum_error(energy);
        self.sum += energy;
        self.magnitude += energy.abs();
    }

    pub(super) fn energy(self) -> MixedEnergy {
        let value = if self.sum.is_finite() { self.sum + self.errors } else { self.sum };
        MixedEnergy { value, magnitude: self.magnitude }
    }
}

/// The sum of terms over a body: U(u), its gradient and its Hessian.
///
/// Fixed unknowns are left out of the matrix, and elements whose unknowns are all fixed are never evaluated. Elements
/// are evaluated in SIMD lanes and added in order, so results do not depend on the number of lanes.
#[derive(Debug)]
pub struct MixedSystem {
    body: MixedBody,
    terms: Vec<Summed>,
    rows: Rows,
    /// The position in gradients of each entry of the matrix's vectors.
    increments: Vec<u32>,
    /// Whether some elements are on points alone.
    with_points: bool,
}

#[derive(Debug)]
struct Summed {
    term: Placed,
    scatter: Scatter,
    counts: Counts,
}

impl MixedSystem {
    /// Finds the terms' unknowns in the body.
    ///
    /// # Errors
    /// If a stencil has too few or too many unknowns, names one twice, one that does not exist, or one of another kind
    /// than the element declares; or if a scale of the body is not positive.
    pub fn new(body: MixedBody, terms: Vec<MixedTerm>) -> Result<Self, MixedError> {
        body.check_scales()?;
        let placed = terms.into_iter().map(|term| term.place(&body)).collect::<Result<Vec<_>, _>>()?;
        let rows = rows(&body, &placed);
        let summed = placed.into_iter().map(|term| {
            let scatter = Scatter::new(&term, &body, &rows);
            Summed { scatter, term, counts: Counts::default() }
        });
        let terms: Vec<Summed> = summed.collect();
        let with_points = terms.iter().any(|summed| summed.term.on_points);
        let increments = increments(&body, &rows);
        Ok(Self { body, terms, rows, increments, with_points })
    }

    /// Returns the unknowns.
    #[must_use]
    pub fn body(&self) -> &MixedBody {
        &self.body
    }

    /// Returns the free unknowns of the sparse part and their couplings.
    #[must_use]
    pub fn pattern(&self) -> &Arc<KindPattern> {
        &self.rows.pattern
    }

    /// Returns a zero matrix over the free unknowns.
    #[must_use]
    pub fn matrix(&self) -> BorderedMatrix {
        BorderedMatrix::zeros(&self.rows.pattern, &self.rows.maximised).with_multipliers(&self.rows.multipliers)
    }

    /// Returns the name of each term, and its counts of evaluated and skipped elements since the system was created.
    pub fn counts(&self) -> impl Iterator<Item = (&str, Counts)> {
        self.terms.iter().map(|summed| (summed.term.name.as_str(), summed.counts))
    }

    /// Returns the entries of the free unknowns of a gradient, in the order of the matrix.
    #[must_use]
    pub fn free_part(&self, gradient: &[f64]) -> Vec<f64> {
        self.increments.iter().map(|&increment| gradient[increment as usize]).collect()
    }

    /// Returns increments of all unknowns, zero for the fixed ones, from a vector in the order of the matrix.
    #[must_use]
    pub fn spread(&self, part: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; self.body.increments()];
        self.increments.iter().zip(part).for_each(|(&increment, entry)| all[increment as usize] = *entry);
        all
    }

    /// The place of the free unknowns in matrices.
    pub(super) fn rows(&self) -> &Rows {
        &self.rows
    }

    /// Returns U.
    ///
    /// # Errors
    /// If u is not a configuration of the body.
    pub fn energy(&mut self, u: &[f64]) -> Result<MixedEnergy, MixedError> {
        self.body.check(u)?;
        let points = self.points(u);
        let at = Configuration { u, points: &points };
        let mut sum = EnergySum::default();
        let mut energies = [0.0; CHUNK];
        for Summed { term, counts, .. } in &mut self.terms {
            let mut flagged = 0;
            for range in chunks(term) {
                let energies = &mut energies[..range.len()];
                flagged += term.elements.values(range, at, energies);
                energies.iter().for_each(|energy| sum.add(*energy));
            }
            counts.value += tally(term, flagged);
        }
        Ok(sum.energy())
    }

    /// Returns U and ∂U/∂u, one number per increment of the body: in N for points, in N m for angles and rotations. The
    /// entries of fixed unknowns are the forces that hold them.
    ///
    /// # Errors
    /// If u is not a configuration of the body, or an element's gradient is not finite.
    pub fn gradient(&mut self, u: &[f64]) -> Result<(MixedEnergy, Vec<f64>), MixedError> {
        self.body.check(u)?;
        let points = self.points(u);
        let at = Configuration { u, points: &points };
        let mut sum = EnergySum::default();
        let mut gradient = vec![0.0; self.body.increments()];
        let mut energies = [0.0; CHUNK];
        for Summed { term, scatter, counts } in &mut self.terms {
            let (n, mut flagged) = (term.increments, 0);
            let mut gradients = vec![0.0; n * CHUNK];
            for range in chunks(term) {
                let (energies, gradients) = (&mut energies[..range.len()], &mut gradients[..n * range.len()]);
                flagged += term.elements.gradients(range.clone(), at, energies, gradients);
                for ((place, energy), own) in range.zip(energies).zip(gradients.chunks_exact(n)) {
                    sum.add(*energy);
                    check_finite(term, place, "gradient", own)?;
                    scatter.add_gradient(place, own, &mut gradient);
                }
            }
            counts.gradient += tally(term, flagged);
        }
        Ok((sum.energy(), gradient))
    }

    /// Writes ∂²U/∂u² over the free unknowns to `matrix` and returns U and ∂U/∂u, as [`MixedSystem::gradient`] does.
    ///
    /// A `curvature` other than [`Curvature::Exact`] changes the negative eigenvalues of element Hessians by increments
    /// in m: those of scalars and rotations are multiplied by their scale. The nearest semi-definite matrix depends on
    /// it. Rows of maximised unknowns stay exact.
    ///
    /// # Errors
    /// If u is not a configuration of the body, or an element's gradient or Hessian is not finite.
    ///
    /// # Panics
    /// If the matrix was not created by this system.
    pub fn linearise(
        &mut self,
        u: &[f64],
        curvature: Curvature,
        matrix: &mut BorderedMatrix,
    ) -> Result<(MixedEnergy, Vec<f64>), MixedError> {
        assert!(Arc::ptr_eq(matrix.kinds.pattern(), &self.rows.pattern), "the matrix belongs to another system");
        matrix.clear();
        self.body.check(u)?;
        let add = |rows: &Rows, scatter: &mut Scatter, element: (usize, &[u32]), upper: &mut [f64]| {
            let projected = curvature != Curvature::Exact && scatter.project(upper, curvature);
            scatter.add_hessian(rows, element, upper, matrix);
            projected
        };
        self.second_derivatives(u, |_| true, add)
    }

    /// Writes the block of the shared unknowns to `matrix`, and returns U and ∂U/∂u of the terms with shared unknowns.
    pub(super) fn linearise_shared(
        &mut self,
        u: &[f64],
        matrix: &mut BorderedMatrix,
    ) -> Result<(MixedEnergy, Vec<f64>), MixedError> {
        matrix.corner.fill(0.0);
        let add = |rows: &Rows, scatter: &mut Scatter, (_, stencil): (usize, &[u32]), upper: &mut [f64]| {
            scatter.add_corner(rows, stencil, upper, matrix);
            false
        };
        self.second_derivatives(u, Scatter::has_shared, add)
    }

    /// Evaluates Hessians of the `wanted` terms, and calls `add` with each. It returns whether the Hessian was changed.
    fn second_derivatives(
        &mut self,
        u: &[f64],
        wanted: impl Fn(&Scatter) -> bool,
        mut add: impl FnMut(&Rows, &mut Scatter, (usize, &[u32]), &mut [f64]) -> bool,
    ) -> Result<(MixedEnergy, Vec<f64>), MixedError> {
        let points = self.points(u);
        let at = Configuration { u, points: &points };
        let mut sum = EnergySum::default();
        let mut gradient = vec![0.0; self.body.increments()];
        let mut energies = [0.0; CHUNK];
        for Summed { term, scatter, counts } in self.terms.iter_mut().filter(|summed| wanted(&summed.scatter)) {
            let (n, upper, mut flagged, mut projected) = (term.increments, triangle(term.increments), 0, 0);
            let (mut gradients, mut triangles) = (vec![0.0; n * CHUNK], vec![0.0; upper * CHUNK]);
            for range in chunks(term) {
                let (energies, gradients) = (&mut energies[..range.len()], &mut gradients[..n * range.len()]);
                let triangles = &mut triangles[..upper * range.len()];
                flagged += term.elements.hessians(range.clone(), at, energies, gradients, triangles);
                let derivatives = gradients.chunks_exact(n).zip(triangles.chunks_exact_mut(upper));
                for ((place, energy), (own, upper)) in range.zip(energies).zip(derivatives) {
                    sum.add(*energy);
                    check_finite(term, place, "gradient", own)?;
                    check_finite(term, place, "Hessian", upper)?;
                    let stencil = term.stencil(place);
                    scatter.add_gradient(place, own, &mut gradient);
                    projected += u64::from(add(&self.rows, scatter, (place, stencil), upper));
                }
            }
            counts.hessian += Tally { projected, ..tally(term, flagged) };
        }
        Ok((sum.energy(), gradient))
    }

    /// Replaces the state of each element by the one after a step that ends at u. Call it once after each accepted
    /// step. All new states are computed before any is replaced.
    ///
    /// # Errors
    /// If u is not a configuration of the body, or a new state is not finite. Then nothing has changed.
    pub fn advance(&mut self, u: &[f64]) -> Result<(), MixedError> {
        let next = self.next_states(u)?;
        self.restore(&next)
    }

    /// Returns the states after a step that ends at u.
    pub(super) fn next_states(&self, u: &[f64]) -> Result<ElementStates, MixedError> {
        self.body.check(u)?;
        let of_term = |Summed { term, .. }: &Summed| {
            let (states, _) = term.elements.next_states(u);
            match states.iter().position(|number| !number.is_finite()) {
                Some(number) => {
                    let element = number / term.elements.state_len().max(1);
                    Err(MixedError::NonFiniteElement { term: term.name.clone(), element, what: "next state" })
                }
                None => Ok(states),
            }
        };
        Ok(ElementStates { by_term: self.terms.iter().map(of_term).collect::<Result<_, _>>()? })
    }

    /// Sets the time step, in s, of elements whose declaration has `#[time_step(…)]`. An integrator does so itself.
    pub fn set_time_step(&mut self, h: f64) {
        self.terms.iter_mut().for_each(|summed| summed.term.elements.set_time_step(h));
    }

    /// Returns the states of all elements, for [`MixedSystem::restore`].
    #[must_use]
    pub fn states(&self) -> ElementStates {
        ElementStates { by_term: self.terms.iter().map(|summed| summed.term.elements.states()).collect() }
    }

    /// Replaces the states of all elements, bit by bit.
    ///
    /// # Errors
    /// If the states are those of other terms. Then nothing has changed.
    pub fn restore(&mut self, states: &ElementStates) -> Result<(), MixedError> {
        let found = |number: usize| states.by_term.get(number).map_or(0, Vec::len);
        for (number, Summed { term, .. }) in self.terms.iter().enumerate() {
            let expected = term.elements.state_len() * term.count;
            if found(number) != expected {
                return Err(MixedError::WrongStates { term: term.name.clone(), expected, found: found(number) });
            }
        }
        for (summed, states) in self.terms.iter_mut().zip(&states.by_term) {
            summed.term.elements.set_states(states);
        }
        Ok(())
    }

    /// Returns the vectors of 3, if some elements need them.
    fn points(&self, u: &[f64]) -> Vec<Vector3<f64>> {
        let vectors = self.body.all().iter().filter(|unknown| unknown.kind == UnknownKind::Vector3);
        let point = |number: usize| std::array::from_fn(|axis| u[number + axis]);
        if self.with_points { vectors.map(|unknown| point(unknown.number)).collect() } else { Vec::new() }
    }
}

/// Returns the ranges of packed elements that are evaluated together.
fn chunks(term: &Placed) -> impl Iterator<Item = Range<usize>> + use<> {
    let count = term.active.len();
    (0..count).step_by(CHUNK).map(move |first| first..(first + CHUNK).min(count))
}

fn tally(term: &Placed, flagged: usize) -> Tally {
    let evaluated = term.active.len();
    Tally {
        evaluated: evaluated as u64,
        skipped: (term.count - evaluated) as u64,
        flagged: flagged as u64,
        projected: 0,
    }
}

/// Returns the count of entries of an upper triangle.
fn triangle(n: usize) -> usize {
    n * (n + 1) / 2
}

fn check_finite(term: &Placed, place: usize, what: &'static str, numbers: &[f64]) -> Result<(), MixedError> {
    // Without an early end, compilers use vectors.
    if numbers.iter().fold(true, |all, number| all & number.is_finite()) {
        return Ok(());
    }
    Err(MixedError::NonFiniteElement { term: term.name.clone(), element: term.active[place] as usize, what })
}

/// Numbers the free unknowns.
fn rows(body: &MixedBody, terms: &[Placed]) -> Rows {
    let (mut of, mut sizes) = (Vec::with_capacity(body.all().len()), Vec::new());
    let (mut maximised, mut multipliers) = (Vec::new(), Vec::new());
    for (number, unknown) in body.all().iter().enumerate() {
        let is_shared = number >= body.len();
        let row = if is_shared { maximised.len() } else { sizes.len() };
        of.push((!unknown.fixed).then(|| index(row)));
        if unknown.fixed {
            continue;
        }
        if is_shared {
            let increments = 0..unknown.kind.increments();
            maximised.extend(increments.clone().map(|_| unknown.extremum != Extremum::Minimum));
            multipliers.extend(increments.map(|_| unknown.extremum == Extremum::Multiplier));
        } else {
            sizes.push(unknown.kind.increments());
        }
    }
    let own_rows = |unknown: u32| of[unknown as usize].filter(|_| (unknown as usize) < body.len());
    let (mut all, mut ends) = (Vec::new(), vec![0]);
    for term in terms {
        for place in 0..term.active.len() {
            all.extend(term.stencil(place).iter().copied().filter_map(own_rows));
            ends.push(all.len());
        }
    }
    let stencils = ends.windows(2).map(|window| &all[window[0]..window[1]]);
    let pattern = Arc::new(KindPattern::from_stencils(&sizes, stencils));
    Rows { pattern, of, maximised, multipliers }
}

/// Returns the position in gradients of each entry of the matrix's vectors.
fn increments(body: &MixedBody, rows: &Rows) -> Vec<u32> {
    let own = rows.pattern.increments();
    let mut increments = vec![0; own + rows.maximised.len()];
    for (number, (unknown, row)) in body.all().iter().zip(&rows.of).enumerate() {
        let Some(row) = row.map(|row| row as usize) else { continue };
        let first = if number < body.len() { rows.pattern.first(row) } else { own + row };
        for increment in 0..unknown.kind.increments() {
            increments[first + increment] = index(unknown.increment + increment);
        }
    }
    increments
}
