//! Adds the derivatives of a term's elements to a gradient and a matrix.

use std::sync::Arc;

use super::body::MixedBody;
use super::term::Placed;
use crate::matrix::kinds::{KindPattern, KindSlot};
use crate::matrix::{BorderedMatrix, index};
use crate::terms::Curvature;
use crate::terms::curvature::{change_upper, is_semi_definite};

/// Marks a block of a fixed unknown.
const NOWHERE: u32 = u32::MAX;

/// The places of the free unknowns in matrices and vectors.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    pub(super) pattern: Arc<KindPattern>,
    /// The row of each own unknown in the pattern, and the first dense row of each shared one; `None` if it is fixed.
    pub(super) of: Vec<Option<u32>>,
    /// Whether each dense row belongs to a maximised unknown.
    pub(super) maximised: Vec<bool>,
    /// Whether each dense row belongs to a multiplier, which counts as maximised.
    pub(super) multipliers: Vec<bool>,
}

/// Scatter map: places of the derivatives of a term's elements in the body's gradient and matrix.
#[derive(Debug)]
pub(super) struct Scatter {
    /// The unknowns of an element: position of the first increment, and number of increments.
    spans: Vec<(usize, usize)>,
    /// The positions in the body's gradient of each packed element's increments.
    increments: Vec<u32>,
    /// Index of the first entry of each row in an upper triangle, less the row.
    starts: Vec<usize>,
    /// Pairs of own unknowns of an element, first ≤ second.
    pairs: Vec<(usize, usize)>,
    /// The place of each pair's block for each packed element.
    slots: Vec<KindSlot>,
    /// The unknowns that are shared.
    shared: Vec<usize>,
    projection: Projection,
}

/// The rows of an element's Hessian that are made positive semi-definite, and their scales.
#[derive(Debug)]
struct Projection {
    /// All but those of maximised unknowns, in which potentials are concave.
    rows: Vec<usize>,
    /// 1/scale of each row: projected matrices are by metres.
    weights: Vec<f64>,
    upper: Vec<f64>,
}

impl Scatter {
    pub(super) fn new(term: &Placed, body: &MixedBody, rows: &Rows) -> Self {
        let mut spans = Vec::with_capacity(term.kinds.len());
        let mut next = 0;
        for kind in &term.kinds {
            spans.push((next, kind.increments()));
            next += kind.increments();
        }
        // All elements have shared unknowns in the same positions.
        let first = &term.unknowns[..term.kinds.len().min(term.unknowns.len())];
        let is_shared = |&position: &usize| first[position] as usize >= body.len();
        let positions = || 0..first.len();
        let own: Vec<usize> = positions().filter(|position| !is_shared(position)).collect();
        let pairs: Vec<(usize, usize)> =
            own.iter().flat_map(|&i| own.iter().filter(move |&&j| i <= j).map(move |&j| (i, j))).collect();
        let slot = |stencil: &[u32], (i, j): (usize, usize)| {
            let row = |position: usize| rows.of[stencil[position] as usize].map(|row| row as usize);
            let both = row(i).zip(row(j));
            both.map_or(KindSlot { slot: NOWHERE, flipped: false }, |(i, j)| {
                rows.pattern.slot(i, j).expect("the pattern has the blocks of all elements")
            })
        };
        let of_element = |place: usize| {
            pairs.iter().map(move |&pair| (place, pair)).map(|(place, pair)| slot(term.stencil(place), pair))
        };
        let slots = (0..term.active.len()).flat_map(of_element).collect();
        let increments_of = |&unknown: &u32| {
            let unknown = &body.all()[unknown as usize];
            unknown.increment..unknown.increment + unknown.kind.increments()
        };
        let all = (0..term.active.len()).flat_map(|place| term.stencil(place).iter().flat_map(increments_of));
        let n = term.increments;
        Self {
            increments: all.map(index).collect(),
            starts: (0..n).map(|row| row * (2 * n - row + 1) / 2 - row).collect(),
            slots,
            shared: positions().filter(is_shared).collect(),
            projection: Projection::new(first, &spans, body),
            pairs,
            spans,
        }
    }

    /// Whether elements have shared unknowns.
    pub(super) fn has_shared(&self) -> bool {
        !self.shared.is_empty()
    }

    /// Adds the gradient of a packed element to that of the body.
    pub(super) fn add_gradient(&self, place: usize, own: &[f64], gradient: &mut [f64]) {
        let increments = &self.increments[place * own.len()..][..own.len()];
        increments.iter().zip(own).for_each(|(&increment, number)| gradient[increment as usize] += number);
    }

    /// Adds an element's Hessian, an upper triangle, to the matrix.
    pub(super) fn add_hessian(
        &self,
        rows: &Rows,
        (place, stencil): (usize, &[u32]),
        upper: &[f64],
        matrix: &mut BorderedMatrix,
    ) {
        let slots = &self.slots[place * self.pairs.len()..][..self.pairs.len()];
        for (&(i, j), &slot) in self.pairs.iter().zip(slots) {
            if slot.slot == NOWHERE {
                continue;
            }
            let ((row, height), (column, width)) = (self.spans[i], self.spans[j]);
            if i == j {
                let entry = |a: usize, b: usize| upper[self.starts[row + a.min(b)] + column + a.max(b)];
                matrix.kinds.add_at(slot, (height, width), entry);
            } else {
                matrix.kinds.add_at(slot, (height, width), |a, b| upper[self.starts[row + a] + column + b]);
            }
        }
        if self.has_shared() {
            self.add_border(rows, stencil, upper, matrix);
        }
    }

    /// Adds the rows of an element's shared unknowns.
    fn add_border(&self, rows: &Rows, stencil: &[u32], upper: &[f64], matrix: &mut BorderedMatrix) {
        let row_of = |position: usize| rows.of[stencil[position] as usize].map(|row| row as usize);
        for position in 0..self.spans.len() {
            let Some(row) = row_of(position).filter(|_| !self.shared.contains(&position)) else { continue };
            let first = rows.pattern.first(row);
            for &shared in &self.shared {
                let Some(column) = row_of(shared) else { continue };
                self.for_each_entry(position, shared, upper, |a, b, entry| {
                    matrix.border_mut(column + b)[first + a] += entry;
                });
            }
        }
        self.add_corner(rows, stencil, upper, matrix);
    }

    /// Adds the block between an element's shared unknowns.
    pub(super) fn add_corner(&self, rows: &Rows, stencil: &[u32], upper: &[f64], matrix: &mut BorderedMatrix) {
        let row_of = |position: usize| rows.of[stencil[position] as usize].map(|row| row as usize);
        let size = matrix.shared();
        for &i in &self.shared {
            for &j in &self.shared {
                let Some((row, column)) = row_of(i).zip(row_of(j)) else { continue };
                self.for_each_entry(i, j, upper, |a, b, entry| {
                    matrix.corner[(row + a) * size + column + b] += entry;
                });
            }
        }
    }

    /// Calls `visit` with the entries of the block of two unknowns.
    fn for_each_entry(&self, i: usize, j: usize, upper: &[f64], mut visit: impl FnMut(usize, usize, f64)) {
        let ((row, height), (column, width)) = (self.spans[i], self.spans[j]);
        for a in 0..height {
            for b in 0..width {
                let (r, c) = ((row + a).min(column + b), (row + a).max(column + b));
                visit(a, b, upper[self.starts[r] + c]);
            }
        }
    }

    /// Makes an element's Hessian positive semi-definite. Returns whether it was not.
    pub(super) fn project(&mut self, upper: &mut [f64], curvature: Curvature) -> bool {
        let Self { starts, projection: Projection { rows, weights, upper: projected }, .. } = self;
        let places = |visit: &mut dyn FnMut(usize, f64)| {
            for (i, &row) in rows.iter().enumerate() {
                for (j, &column) in rows.iter().enumerate().skip(i) {
                    visit(starts[row] + column, weights[i] * weights[j]);
                }
            }
        };
        projected.clear();
        places(&mut |entry, weight| projected.push(upper[entry] * weight));
        if is_semi_definite::<f64>(projected, rows.len()) || !change_upper(projected, rows.len(), curvature) {
            return false;
        }
        let mut changed = projected.iter();
        places(&mut |entry, weight| upper[entry] = changed.next().expect("an entry per pair of rows") / weight);
        true
    }
}

impl Projection {
    /// Takes the unknowns of an element.
    fn new(unknowns: &[u32], spans: &[(usize, usize)], body: &MixedBody) -> Self {
        let (mut rows, mut weights) = (Vec::new(), Vec::new());
        for (&unknown, &(from, size)) in unknowns.iter().zip(spans) {
            let unknown = &body.all()[unknown as usize];
            if unknown.is_minimised() {
                rows.extend(from..from + size);
                weights.extend((0..size).map(|_| 1.0 / unknown.metric()));
            }
        }
        Self { rows, weights, upper: Vec::new() }
    }
}
