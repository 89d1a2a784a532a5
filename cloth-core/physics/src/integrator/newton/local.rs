//! Nonlinear elimination: Newton's method on the few vertices that hold up the others.
//!
//! E is far from quadratic where cloth buckles or touches an obstacle, but only at a few vertices. Every iteration on
//! them costs an iteration on all vertices. A local elimination splits the free vertices into the few V that the last
//! iteration moved far, and the others W. It minimises E over V alone before the next iteration on all vertices:
//!
//! x_V ← argmin E(x_V, x_W),  x_W fixed.
//!
//! This is nonlinear elimination (Cai and Keyes 2002, "Nonlinearly preconditioned inexact Newton algorithms", SIAM
//! J. Sci. Comput. 24). It changes the path to the minimum of E, not the minimum: a step converges by iterations on all
//! vertices only. E decreases, because each local iteration has the same line search.
//!
//! Contact is restricted to the pairs of V. Otherwise the certificates of local iterations would take longer than the
//! saved iterations.

use std::time::Instant;

use energy_dsl::Vector3;
use energy_solve::{
    BlockMatrix, Curvature, EvaluationError, OverRelaxation, SlidingStiffness, SolveOptions, SolveReport,
};

use super::forcing::Forcing;
use super::incremental_potential::IncrementalPotential;
use super::iterate::Direction;
use super::largest;
use super::line_search::Prefetch;

/// A vertex has moved far if it moved by more than this part of the largest move. Local iterations end when their moves
/// are shorter than that: the error that the fixed vertices cause is then as large.
const FAR: f64 = 0.1;
/// The largest part of the free vertices to eliminate. With more, a local iteration costs nearly as much as a global
/// one.
const FEW: f64 = 0.15;
/// Bounds the work on vertices that do not come to rest before the fixed ones move.
const ITERATIONS: usize = 4;
/// Residual of each linear system relative to its right-hand side. An exact local minimum is not worth more: the next
/// global iteration moves it.
const TOLERANCE: f64 = 0.1;

/// The vertices of a local elimination.
pub(super) struct Few {
    /// Whether each vertex of the body is among them.
    chosen: Vec<bool>,
    /// The smallest displacement along the direction that counts as far, in m.
    pub far: f64,
}

impl IncrementalPotential<'_> {
    /// Returns the vertices that a direction moves far, and their neighbours on edges and triangles, which give way to
    /// them. `None` if they are too many, or the direction is zero.
    pub(super) fn few_that_move(&self, direction: &Direction) -> Option<Few> {
        let system = &self.body.system;
        let free = system.dofs().free();
        let far = FAR * direction.length;
        let moves_far = |vector: &Vector3<f64>| vector.iter().any(|component| component.abs() > far);
        let count = direction.vectors.iter().filter(|vector| moves_far(vector)).count();
        if count == 0 || count as f64 >= FEW * free.len() as f64 {
            return None;
        }
        let mut moving = vec![false; self.body.x.len()];
        free.iter().zip(&direction.vectors).for_each(|(&vertex, vector)| moving[vertex] = moves_far(vector));
        let mut chosen = moving.clone();
        let terms = system.terms().map(|(term, _)| term.stencils());
        for stencil in terms.filter(|stencils| matches!(stencils.arity(), 2 | 3)).flat_map(|stencils| stencils.iter()) {
            if stencil.clone().any(|vertex| moving[vertex as usize]) {
                stencil.for_each(|vertex| chosen[vertex as usize] = true);
            }
        }
        Some(Few { chosen, far })
    }

    /// Moves the chosen vertices towards the minimum of E, until a move is shorter than `shortest`, in m. Returns the
    /// change of E; `None` if a term cannot be restricted.
    pub(super) fn eliminate(
        &mut self,
        few: &Few,
        x: &mut [Vector3<f64>],
        shortest: f64,
    ) -> Result<Option<f64>, EvaluationError> {
        let started = Instant::now();
        let Some(restricted) = self.body.system.restricted(&few.chosen) else { return Ok(None) };
        self.report.phases.preparation += started.elapsed();
        let energies = self.report.energies;
        let whole = std::mem::replace(&mut self.body.system, restricted);
        let change = self.restricted_to(&few.chosen, |local| local.minimise(x, shortest));
        let restricted = std::mem::replace(&mut self.body.system, whole);
        self.body.system.rejoin(restricted);
        self.report.energies = energies;
        change.map(Some)
    }

    /// Lowers E by at most [`ITERATIONS`] iterations on the free vertices, until a move is shorter than `shortest`.
    /// Returns the change of E.
    fn minimise(&mut self, x: &mut [Vector3<f64>], shortest: f64) -> Result<f64, EvaluationError> {
        let started = Instant::now();
        let system = &self.body.system;
        let mut matrix = system.matrix_in();
        let mut solver = OverRelaxation::with_threads(matrix.pattern(), system.threads());
        self.report.phases.preparation += started.elapsed();
        let mut curvature = Curvature::Exact;
        let mut change = 0.0;
        for _ in 0..ITERATIONS {
            let direction = self.local_direction(x, curvature, &mut matrix, &mut solver)?;
            let before = self.energy(x)?;
            let step = match direction.length {
                0.0 => None,
                _ => self.line_search(x, before, &direction, Prefetch::Nothing)?,
            };
            let Some(step) = step else {
                if direction.is_projected {
                    break;
                }
                curvature = Curvature::Clamped;
                continue;
            };
            self.advance(x, step.scale, &direction.vectors);
            change += step.energy.value - before.value + self.update_active_set(x);
            if step.scale * direction.length < shortest {
                break;
            }
        }
        Ok(change)
    }

    /// Solves for the direction of a local iteration. It is truncated, or zero, if the Hessian is indefinite.
    fn local_direction(
        &mut self,
        x: &[Vector3<f64>],
        curvature: Curvature,
        matrix: &mut BlockMatrix<f32>,
        solver: &mut OverRelaxation<f32>,
    ) -> Result<Direction, EvaluationError> {
        let mut downhill = self.linearise(x, curvature, matrix)?;
        self.add_contact(x, &mut downhill);
        let contacts = self.contacts(x, SlidingStiffness::Exact);
        let (scale, threads) = (self.dt * self.dt, self.body.system.threads());
        let started = Instant::now();
        let contacts = matrix.add_contacts(&contacts, scale, threads);
        let mut vectors = vec![[0.0; 3]; downhill.len()];
        let mut solved = SolveReport::indefinite();
        if solver.scale_with(matrix, &contacts.cross).is_ok() {
            let options = SolveOptions::new(TOLERANCE);
            solved = solver.solve(&downhill, &mut vectors, &options);
        }
        matrix.remove_contacts(contacts);
        let report = &mut self.report;
        report.phases.solve += started.elapsed();
        report.local_solves += 1;
        report.local_vertices += downhill.len() as u64;
        report.projected |= curvature != Curvature::Exact;
        let forcing = Forcing { gradient: largest(&downhill), tolerance: TOLERANCE, is_first: false };
        Ok(Direction::new(&downhill, vectors, curvature, forcing, solved))
    }
}

#[cfg(test)]
mod tests {
    use energy_elements::StVK;
    use energy_solve::{ElementList, PotentialTerm, System};

    use super::*;
    use crate::body::Body;
    use crate::mesh::{Diagonals, Plane, Sheet, lumped_masses};

    /// A strip that is one tenth too long for its pinned ends, with a wrinkle. Its membrane is a separate term: the
    /// terms of a fabric would compile the kernels of all materials.
    fn strip() -> Body {
        let (diagonals, plane) = (Diagonals::Alternating, Plane::Horizontal);
        let mesh = Sheet { cells: [20, 5], size: [0.4, 0.1], diagonals, plane, pleats: None }.mesh().unwrap();
        let flat = |corner: usize| [mesh.vertices()[corner][0], mesh.vertices()[corner][1]];
        let triangle = |corners: &[usize; 3]| {
            let [a, b, c] = corners.map(flat);
            StVK::new(a, b, c, 30.0, 40.0).unwrap()
        };
        let membrane = mesh.triangles().iter().map(triangle).collect();
        let membrane = ElementList::new("membrane", membrane, mesh.triangles()).unwrap();
        let pinned: Vec<bool> = mesh.vertices().iter().map(|x| x[0].abs() > 0.199).collect();
        let x: Vec<Vector3<f64>> =
            mesh.vertices().iter().map(|x| [0.9 * x[0], x[1], 1e-3 * (40.0 * x[0]).sin()]).collect();
        let system = System::new(vec![Box::new(PotentialTerm::new(membrane))], &pinned).unwrap();
        Body { v: vec![[0.0; 3]; x.len()], x, masses: lumped_masses(&mesh, 0.2), system }
    }

    #[test]
    fn an_elimination_lowers_the_energy_and_moves_the_chosen_vertices_only() {
        let mut body = strip();
        let (count, free) = (body.x.len(), body.system.dofs().clone());
        let mut potential = IncrementalPotential::new(&mut body, None, 0.01);
        for seed in (0..count).filter(|seed| seed % 11 > 0) {
            let chosen: Vec<bool> = (0..count).map(|vertex| (seed * vertex + seed / 7) % 11 < 3).collect();
            let start = potential.body.x.clone();
            let mut x = start.clone();
            let before = potential.energy(&x).unwrap();
            let few = Few { chosen: chosen.clone(), far: 0.0 };
            let change = potential.eliminate(&few, &mut x, 0.0).unwrap().unwrap();
            let after = potential.energy(&x).unwrap();
            assert!(change < 0.0 && after.value < before.value, "{seed}: {change:e}");
            let error = after.value - before.value - change;
            assert!(error.abs() < 1e-13 * before.magnitude, "{seed}: {error:e} of {change:e}");
            for (vertex, (x, start)) in x.iter().zip(&start).enumerate() {
                assert_eq!(x != start, chosen[vertex] && free.row(vertex).is_some(), "{seed}: vertex {vertex}");
            }
        }
        assert!(potential.report.local_solves > count as u64 && potential.report.solves == 0);
    }

    #[test]
    fn vertices_are_few_if_the_others_move_less_than_a_tenth() {
        let mut body = strip();
        let potential = IncrementalPotential::new(&mut body, None, 0.01);
        let free = potential.body.system.dofs().free().to_vec();
        let few = |moving: usize, rest: f64| {
            let vectors: Vec<Vector3<f64>> =
                (0..free.len()).map(|row| [0.0, if row < moving { -1.0 } else { rest }, 0.0]).collect();
            let forcing = Forcing { gradient: 1.0, tolerance: TOLERANCE, is_first: false };
            let solved = SolveReport::indefinite();
            potential.few_that_move(&Direction::new(&vectors, vectors.clone(), Curvature::Exact, forcing, solved))
        };
        // 114 vertices are free.
        assert_eq!(free.len(), 114);
        assert!(few(18, 0.0).is_none() && few(1, 0.11).is_none() && few(0, 0.0).is_none());
        let chosen = few(17, 0.09).unwrap().chosen;
        // The first 17 vertices are in the first row; their neighbours are in it or the second.
        let rows = |range: std::ops::Range<usize>| chosen[range].iter().filter(|&&chosen| chosen).count();
        assert!(free[..17].iter().all(|&vertex| chosen[vertex]));
        assert!(rows(0..21) <= 19 && rows(21..42) >= 17 && rows(42..126) == 0, "{chosen:?}");
    }
}
