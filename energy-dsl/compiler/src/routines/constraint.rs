//! The routines of a constraint: those of its energy U = ½ k_s CᵀC, C with J and ∂²C, and its force f = −∇U − k_d Jᵀ Ċ.

use super::{Hazards, Whole, hazards, potential};
use crate::check::Program;
use crate::diff::{Coordinates, Routes, SecondOrder, Unknowns, first_order, second_order};
use crate::graph::{Graph, Input, NodeId};
use energy_runtime::RoutineKind;

/// The shared parts of all routines, in reduced coordinates.
struct Compliant<'a> {
    c: &'a [NodeId],
    /// J, by row and coordinate.
    jacobian: Vec<Vec<NodeId>>,
    /// ∂²C, the upper triangle of each row.
    hessians: Vec<Vec<NodeId>>,
    energy: SecondOrder,
    /// ∇U by forward derivatives, for routines without ∇²U.
    gradient: Vec<NodeId>,
    stiffness: NodeId,
    damping: NodeId,
    coordinates: &'a Coordinates,
    unknowns: &'a Unknowns,
    is_mixed: bool,
}

/// Returns the stiffness (2 from the end) or the damping (1) of a constraint.
fn implied(g: &mut Graph, program: &Program, from_end: usize) -> NodeId {
    let number = program.parameters_size() - program.state_size() - from_end;
    g.input(Input::Parameter(u16::try_from(number).expect("few parameters")))
}

/// Returns ½ k_s CᵀC.
pub(super) fn energy(g: &mut Graph, program: &Program, c: &[NodeId]) -> NodeId {
    let stiffness = implied(g, program, 2);
    let square = g.sum_of_squares(c);
    let half = g.constant(0.5);
    let scaled = g.mul(half, square);
    g.mul(stiffness, scaled)
}

pub(super) fn routines(
    g: &mut Graph,
    program: &Program,
    c: &[NodeId],
    (unknowns, coordinates): (&Unknowns, &Coordinates),
    routes: &mut Vec<Routes>,
) -> (Vec<Whole>, SecondOrder) {
    let (stiffness, damping) = (implied(g, program, 2), implied(g, program, 1));
    let value = energy(g, program, c);
    let (energy, taken) = second_order(g, RoutineKind::Hessian.name(), value, coordinates);
    routes.push(taken);
    let (jacobian, taken) = first_order(g, RoutineKind::ConstraintJacobian.name(), c, coordinates, None);
    routes.push(taken);
    let mut hessians = Vec::with_capacity(c.len());
    for &row in c {
        let (second, taken) = second_order(g, RoutineKind::ConstraintHessian.name(), row, coordinates);
        hessians.push(second.hessian);
        routes.push(taken);
    }
    let (mut gradient, taken) = first_order(g, RoutineKind::GaussNewton.name(), &[value], coordinates, None);
    routes.push(taken);
    let compliant = Compliant {
        c,
        jacobian,
        hessians,
        gradient: gradient.remove(0),
        energy,
        stiffness,
        damping,
        coordinates,
        unknowns,
        is_mixed: program.is_mixed(),
    };
    let mut list = potential(g, &compliant.energy, coordinates, compliant.is_mixed, routes);
    list.extend(compliant.geometry(g));
    list.push(compliant.gauss_newton(g));
    list.extend(compliant.force(g));
    (list, compliant.energy)
}

impl Compliant<'_> {
    /// Returns the hazards of U's derivatives of one order and of C's of another.
    fn hazards(&self, g: &mut Graph, energy_order: u8, row_order: u8) -> Hazards {
        let mut roots = vec![(self.energy.value, energy_order)];
        roots.extend(self.c.iter().map(|&row| (row, row_order)));
        hazards(g, &roots)
    }

    /// Creates the routines of C with J, and with ∂²C too.
    fn geometry(&self, g: &mut Graph) -> [Whole; 2] {
        let rows = |order: u8| self.c.iter().map(|&row| (row, order)).collect::<Vec<_>>();
        let (first, second) = (hazards(g, &rows(1)), hazards(g, &rows(2)));
        let (c, jacobian, hessians) = (self.c.to_vec(), self.jacobian.concat(), self.hessians.concat());
        let full_jacobian: Vec<NodeId> =
            self.jacobian.iter().flat_map(|row| self.coordinates.expand_all(g, row)).collect();
        let full_hessians: Vec<NodeId> =
            self.hessians.iter().flat_map(|row| self.coordinates.expand_symmetric(g, row, self.is_mixed)).collect();
        [
            Whole::new(
                RoutineKind::ConstraintJacobian,
                [&c[..], &jacobian].concat(),
                vec![c.clone(), full_jacobian.clone()],
                first,
            ),
            Whole::new(
                RoutineKind::ConstraintHessian,
                [&c[..], &jacobian, &hessians].concat(),
                vec![c, full_jacobian, full_hessians],
                second,
            ),
        ]
    }

    /// Returns an entry of factor · JᵀJ.
    fn outer(&self, g: &mut Graph, factor: NodeId, i: usize, j: usize) -> NodeId {
        let terms: Vec<_> = self.jacobian.iter().map(|row| g.mul(row[i], row[j])).collect();
        let sum = g.sum(terms);
        g.mul(factor, sum)
    }

    /// Creates the routine of U, ∇U and k_s JᵀJ.
    fn gauss_newton(&self, g: &mut Graph) -> Whole {
        let n = self.coordinates.len();
        let upper = (0..n).flat_map(|i| (i..n).map(move |j| (i, j)));
        let curvature: Vec<NodeId> = upper.map(|(i, j)| self.outer(g, self.stiffness, i, j)).collect();
        let value = self.energy.value;
        let full_gradient = self.coordinates.expand_all(g, &self.gradient);
        let full_curvature = self.coordinates.expand_symmetric(g, &curvature, self.is_mixed);
        let hazards = self.hazards(g, 1, 1);
        Whole::new(
            RoutineKind::GaussNewton,
            [&[value], &self.gradient[..], &curvature].concat(),
            vec![vec![value], full_gradient, full_curvature],
            hazards,
        )
    }

    /// Creates the routines of the force f = −∇U − k_d Jᵀ Ċ with Ċ = J q̇, where q̇ are the differences of velocities,
    /// and of its Jacobians ∂f/∂x = −∇²U − k_d Σ (Ċ ∂²C + ∇C (∂²C q̇)ᵀ) and ∂f/∂v = −k_d JᵀJ.
    fn force(&self, g: &mut Graph) -> [Whole; 2] {
        let n = self.coordinates.len();
        let speeds = self.coordinates.rates(g);
        let rates: Vec<NodeId> = self.jacobian.iter().map(|row| g.dot(row, &speeds)).collect();
        let damped_rates = g.scaled(self.damping, &rates);
        let force: Vec<NodeId> = (0..n)
            .map(|i| {
                let column: Vec<NodeId> = self.jacobian.iter().map(|row| row[i]).collect();
                let resisting = g.dot(&damped_rates, &column);
                let sum = g.add(self.gradient[i], resisting);
                g.neg(sum)
            })
            .collect();

        let energy = self.coordinates.plain(g, self.unknowns, &self.energy.hessian, &self.energy.gradient);
        let rows: Vec<Vec<NodeId>> = self
            .hessians
            .iter()
            .zip(&self.jacobian)
            .map(|(hessian, slopes)| self.coordinates.plain(g, self.unknowns, hessian, slopes))
            .collect();
        // k_d (∂J/∂x)ᵀ q̇ for each row.
        let turning: Vec<Vec<NodeId>> = rows
            .iter()
            .map(|h| {
                let column = |j: usize| (0..n).map(|i| h[i * n + j]).collect::<Vec<_>>();
                let rates: Vec<NodeId> = (0..n).map(|j| g.dot(&column(j), &speeds)).collect();
                g.scaled(self.damping, &rates)
            })
            .collect();
        let mut by_position = Vec::with_capacity(n * n);
        let mut by_velocity = Vec::with_capacity(n * n);
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let mut sum = energy[i * n + j];
            for (row, h) in rows.iter().enumerate() {
                let bending = g.mul(damped_rates[row], h[i * n + j]);
                let swinging = g.mul(self.jacobian[row][i], turning[row][j]);
                sum = g.add(sum, bending);
                sum = g.add(sum, swinging);
            }
            by_position.push(g.neg(sum));
            let resisting = self.outer(g, self.damping, i.min(j), i.max(j));
            by_velocity.push(g.neg(resisting));
        }

        let full_force = self.coordinates.expand_all(g, &force);
        let full_position = self.coordinates.expand_matrix(g, &by_position, self.is_mixed);
        let full_velocity = self.coordinates.expand_matrix(g, &by_velocity, self.is_mixed);
        let hazards = [(1, 1), (2, 2)].map(|(energy, rows)| self.hazards(g, energy, rows));
        [
            Whole::new(RoutineKind::Force, force.clone(), vec![full_force.clone()], hazards[0]),
            Whole::new(
                RoutineKind::Jacobians,
                [force, by_position, by_velocity].concat(),
                vec![full_force, full_position, full_velocity],
                hazards[1],
            ),
        ]
    }
}
