//! Pins and obstacles on whose way contact lies move inside Newton's direction.
//!
//! Let p be the positions of pinned vertices and Δp the rest of their way. The free vertices x move by d with
//!
//! ∂²E/∂x² d = −∂E/∂x − ∂²E/∂x∂p Δp:
//!
//! cloth makes way while an obstacle comes, and is drawn along while it sticks to one. One length s scales d and Δp,
//! and one certificate covers both. Pins do work, so E may grow on the way, but not much faster than its expansion to
//! second order says.

use energy_dsl::Vector3;
use energy_solve::{EvaluationError, dot};

use super::super::projection::Progress;
use super::super::{StepError, if_finite};
use super::incremental_potential::IncrementalPotential;
use super::iterate::Iterate;
use super::largest;

/// Moves of pins and obstacles within a step, after which they count as blocked.
const PIN_MOVES: usize = 100;
/// The longest displacement for differences of gradients, in m: far below the gaps of contact.
const NUDGE: f64 = 1e-8;
/// Halvings of a move before pins wait for an iteration without them.
const HALVINGS: usize = 6;
/// The part of a certified way that pins and obstacles go if they cannot go all the way.
const SHARE: f64 = 0.9;
/// Pins wait for an iteration after a move that was shortened to less than this. A gap that is nearly closed stops
/// every move; an iteration without pins may double it.
const SHORT: f64 = 0.2;

/// The way of all vertices: of pins to their positions at the end of the step, and of the free vertices with them.
struct Way {
    vectors: Vec<Vector3<f64>>,
    /// dE/ds at the start.
    slope: f64,
    /// d²E/ds² at the start, or 0 if that is negative.
    curvature: f64,
}

impl Iterate<'_> {
    /// Moves pins that contact has stopped further on their way, and the free vertices with them. Returns whether that
    /// was possible.
    pub(super) fn follow_pins(&mut self) -> Result<bool, StepError> {
        self.count_pin_move()?;
        let Some(way) = self.way()? else { return Ok(false) };
        let end = self.potential.along(&self.x, 1.0, &way.vectors);
        let certified = self.potential.filter_step(&self.x, &end);
        let mut scale = shared(certified);
        for _ in 0..=HALVINGS {
            let moved = self.potential.along(&self.x, scale, &way.vectors);
            let energy = self.potential.energy(&moved)?;
            // Twice the second-order term: barriers are stiffer than their expansion.
            let most = self.energy.value + scale * way.slope.max(0.0) + scale * scale * way.curvature;
            if scale > 0.0 && energy.value <= most {
                self.x = moved;
                self.energy = energy;
                self.arrive(scale, &way);
                return Ok(true);
            }
            scale *= 0.5;
            self.potential.report.halvings += 1;
        }
        Ok(false)
    }

    /// Solves for the way of the free vertices; `None` if E is not finite near the iterate, or the solve fails.
    fn way(&mut self) -> Result<Option<Way>, StepError> {
        let mut vectors = self.potential.rest_of_way(&self.x);
        let here = self.potential.whole_gradient(&self.x)?;
        let Some(coupling) = self.potential.change(&self.x, &here, &vectors)? else { return Ok(None) };
        let mut downhill = self.linearise()?;
        for (downhill, &vertex) in downhill.iter_mut().zip(self.potential.body.system.dofs().free()) {
            for axis in 0..3 {
                downhill[axis] -= coupling[vertex][axis];
            }
        }
        let tolerance = self.options.forcing(largest(&downhill), None).tolerance;
        let (followed, solved) = self.solve(&downhill, self.projection.curvature, tolerance)?;
        let is_finite = followed.as_flattened().iter().all(|component| component.is_finite());
        if !is_finite || !solved.converged() {
            self.projection.demand();
            return Ok(None);
        }
        let free = self.potential.body.system.dofs().free();
        free.iter().zip(followed).for_each(|(&vertex, vector)| vectors[vertex] = vector);
        let Some(bend) = self.potential.change(&self.x, &here, &vectors)? else { return Ok(None) };
        let (slope, curvature) = (dot(&here, &vectors), dot(&bend, &vectors).max(0.0));
        Ok(Some(Way { vectors, slope, curvature }))
    }

    /// Proceeds after a part of a way.
    fn arrive(&mut self, scale: f64, way: &Way) {
        self.pass(scale);
        self.change = scale * largest(&way.vectors) / self.potential.dt;
        self.energy.value += self.potential.update_active_set(&self.x);
        (self.gradient, self.linearised) = (None, None);
        (self.took_full_step, self.pins_wait) = (scale == 1.0, scale < SHORT);
        self.count_secants(scale);
        self.projection.proceed(Progress { is_solution: true, is_whole: scale == 1.0, shrinks: false });
    }

    /// Records that pins went a part of the rest of their way.
    fn pass(&mut self, part: f64) {
        self.pins = if part == 1.0 { 1.0 } else { self.pins + (1.0 - self.pins) * part };
    }

    /// Lets pins that contact has stopped move on without the cloth, which has made way.
    pub(super) fn move_pins(&mut self) -> Result<(), StepError> {
        if self.pins == 1.0 {
            return Ok(());
        }
        self.count_pin_move()?;
        let vectors = self.potential.rest_of_way(&self.x);
        let end = self.potential.along(&self.x, 1.0, &vectors);
        let part = shared(self.potential.filter_step(&self.x, &end));
        self.x = self.potential.along(&self.x, part, &vectors);
        self.pass(part);
        self.potential.update_active_set(&self.x);
        self.energy = self.potential.energy(&self.x)?;
        (self.gradient, self.linearised) = (None, None);
        Ok(())
    }

    fn count_pin_move(&mut self) -> Result<(), StepError> {
        if self.pin_moves == PIN_MOVES {
            let pressed = self.potential.most_pressed(&self.x);
            return Err(StepError::PinsBlocked { moves: PIN_MOVES, part: self.pins, pressed });
        }
        self.pin_moves += 1;
        Ok(())
    }
}

impl IncrementalPotential<'_> {
    /// Returns the rest of the way of pinned vertices, and 0 for free ones.
    fn rest_of_way(&self, x: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let of_vertex = |(vertex, x): (usize, &Vector3<f64>)| -> Vector3<f64> {
            if self.body.system.dofs().row(vertex).is_some() {
                return [0.0; 3];
            }
            let end = self.inertial(vertex);
            std::array::from_fn(|axis| end[axis] - x[axis])
        };
        x.iter().enumerate().map(of_vertex).collect()
    }

    /// Returns x + s w. At the end of their way, pinned vertices are exactly at their positions.
    fn along(&self, x: &[Vector3<f64>], scale: f64, way: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let of_vertex = |(vertex, (x, way)): (usize, (&Vector3<f64>, &Vector3<f64>))| -> Vector3<f64> {
            if scale == 1.0 && self.body.system.dofs().row(vertex).is_none() {
                return self.inertial(vertex);
            }
            std::array::from_fn(|axis| x[axis] + scale * way[axis])
        };
        x.iter().zip(way).enumerate().map(of_vertex).collect()
    }

    /// Returns the product of ∂²E/∂x² of all vertices with a way, as a difference of gradients; `None` if E is not
    /// finite there.
    fn change(
        &mut self,
        x: &[Vector3<f64>],
        here: &[Vector3<f64>],
        way: &[Vector3<f64>],
    ) -> Result<Option<Vec<Vector3<f64>>>, EvaluationError> {
        let scale = NUDGE / largest(way).max(NUDGE);
        let nudged = self.along(x, scale, way);
        let Some(there) = if_finite(self.whole_gradient(&nudged))? else { return Ok(None) };
        let difference = |(there, here): (Vector3<f64>, &Vector3<f64>)| -> Vector3<f64> {
            std::array::from_fn(|axis| (there[axis] - here[axis]) / scale)
        };
        let change: Vec<Vector3<f64>> = there.into_iter().zip(here).map(difference).collect();
        Ok(change.as_flattened().iter().all(|component| component.is_finite()).then_some(change))
    }
}

/// The part of the way that pins and obstacles go, of the certified part.
pub(super) fn shared(certified: f64) -> f64 {
    if certified == 1.0 { 1.0 } else { SHARE * certified }
}

#[cfg(test)]
mod tests {
    use energy_elements::HookeSpring;
    use energy_solve::{ElementList, PotentialTerm, System};

    use super::*;
    use crate::body::Body;

    /// A chain of two springs, whose first end moves.
    fn chain() -> Body {
        let springs = vec![HookeSpring::new(3.0, 0.0), HookeSpring::new(5.0, 0.0)];
        let springs = PotentialTerm::new(ElementList::new("springs", springs, &[[0, 1], [1, 2]]).unwrap());
        let system = System::new(vec![Box::new(springs)], &[true, false, false]).unwrap();
        let x = vec![[0.0; 3], [1.0, 0.0, 0.0], [1.5, 0.5, 0.0]];
        Body { x, v: vec![[2.0, 0.0, 0.0], [0.0; 3], [0.0; 3]], masses: vec![1.0, 2.0, 0.5], system }
    }

    #[test]
    fn the_way_of_pins_pulls_on_their_neighbours() {
        let dt = 0.1;
        let mut body = chain();
        let x = body.x.clone();
        let mut potential = IncrementalPotential::new(&mut body, None, dt);
        let way = potential.rest_of_way(&x);
        assert_eq!(way, [[0.2, 0.0, 0.0], [0.0; 3], [0.0; 3]]);
        let here = potential.whole_gradient(&x).unwrap();
        let change = potential.change(&x, &here, &way).unwrap().unwrap();
        // h² k Δp of the first spring, whose rest length is 0.
        let expected = [[0.006, 0.0, 0.0], [-0.006, 0.0, 0.0], [0.0; 3]];
        for (found, expected) in change.iter().zip(expected) {
            assert!((0..3).all(|axis| (found[axis] - expected[axis]).abs() < 1e-8), "{change:?}");
        }
        // Inertia and both springs at the free vertices.
        let way = [[0.0; 3], [0.0, 0.1, 0.0], [0.0; 3]];
        let change = potential.change(&x, &here, &way).unwrap().unwrap();
        assert!((change[1][1] - 0.1 * (2.0 + dt * dt * 8.0)).abs() < 1e-7, "{change:?}");
        // At the end of their way, pins are where they should be, to the bit.
        let end = potential.along(&x, 1.0, &potential.rest_of_way(&x));
        assert_eq!(end[0], potential.inertial(0));
    }
}
