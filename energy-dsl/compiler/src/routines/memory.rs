//! The routines of an element's state: its value after a step, and the derivatives that gradients through time need.

use super::{Apart, Whole, hazards};
use crate::budget::Budget;
use crate::check::Program;
use crate::diff::{Coordinates, Moving, Order, Routes, Unknowns, first_derivatives, first_order};
use crate::graph::{Graph, Input, NodeId};
use crate::lower::{Formula, Memory};
use energy_runtime::{Kind, RoutineKind};

/// Creates the routines of the state, and those of the formula's derivatives by it.
pub(super) fn routines(
    program: &Program,
    unknowns: &Unknowns,
    Memory { formula, next }: Memory,
    routes: &mut Vec<Routes>,
) -> Vec<Apart> {
    let Formula { graph: mut of_next, outputs: next, .. } = next;
    let list = after_step(&mut of_next, program, unknowns, &next, routes);
    let mut apart = vec![Apart::new(of_next, list, unknowns)];
    // A force may depend on velocities, which these routines do not take.
    if program.kind != Kind::Force {
        let Formula { graph, outputs, .. } = formula;
        let (graph, by_state) = slopes_by_state(graph, program, unknowns, &outputs, routes);
        apart.push(Apart::new(graph, vec![by_state], unknowns));
    }
    apart
}

/// Creates one coordinate for each number of the state.
fn state(g: &mut Graph, program: &Program) -> Coordinates {
    let numbers = program.state().iter().flat_map(|state| state.first..state.first + state.input_type.size());
    let nodes: Vec<NodeId> = numbers.map(|number| g.input(Input::Parameter(Budget::input_number(number)))).collect();
    Coordinates::of_nodes(g, &nodes)
}

/// Creates the state after a step, alone and with its derivatives by the unknowns and by the state before.
fn after_step(
    g: &mut Graph,
    program: &Program,
    unknowns: &Unknowns,
    next: &[NodeId],
    routes: &mut Vec<Routes>,
) -> Vec<Whole> {
    let coordinates = Coordinates::reduced(g, next, unknowns, Moving::Unknowns);
    let (by_unknowns, taken) = first_order(g, RoutineKind::NextJacobians.name(), next, &coordinates, None);
    routes.push(taken);
    let state = state(g, program);
    let (by_state, taken) = first_order(g, "next_jacobians, by state", next, &state, None);
    routes.push(taken);
    let full: Vec<NodeId> = by_unknowns.iter().flat_map(|row| coordinates.expand_all(g, row)).collect();
    let (by_unknowns, by_state) = (by_unknowns.concat(), by_state.concat());
    let order = |order: u8| next.iter().map(|&node| (node, order)).collect::<Vec<_>>();
    let hazards = [0, 1].map(|i| hazards(g, &order(i)));
    vec![
        Whole::new(RoutineKind::Next, next.to_vec(), vec![next.to_vec()], hazards[0]),
        Whole::new(
            RoutineKind::NextJacobians,
            [next, &by_unknowns, &by_state].concat(),
            vec![next.to_vec(), full, by_state],
            hazards[1],
        ),
    ]
}

/// Creates the first derivatives of an energy by the unknowns, or the rows of a residual, with their derivatives by the
/// state.
fn slopes_by_state(
    mut graph: Graph,
    program: &Program,
    unknowns: &Unknowns,
    outputs: &[NodeId],
    routes: &mut Vec<Routes>,
) -> (Graph, Whole) {
    let g = &mut graph;
    let (slopes, roots): (Vec<NodeId>, Vec<(NodeId, u8)>) = match program.kind {
        Kind::Force | Kind::Residual => (outputs.to_vec(), outputs.iter().map(|&row| (row, 1)).collect()),
        Kind::Energy | Kind::Constraint => {
            let value = match program.kind {
                Kind::Constraint => super::constraint::energy(g, program, outputs),
                _ => outputs[0],
            };
            let coordinates = Coordinates::reduced(g, &[value], unknowns, Moving::Unknowns);
            let reduced = first_derivatives(g, &[value], &coordinates, Order::FirstToDifferentiate).remove(0);
            (coordinates.expand_all(g, &reduced), vec![(value, 2)])
        }
    };
    let state = state(g, program);
    let (by_state, taken) = first_order(g, RoutineKind::StateJacobian.name(), &slopes, &state, None);
    routes.push(taken);
    let by_state = by_state.concat();
    let hazards = hazards(g, &roots);
    let all = [&slopes[..], &by_state].concat();
    let whole = Whole::new(RoutineKind::StateJacobian, all, vec![slopes, by_state], hazards);
    (graph, whole)
}
