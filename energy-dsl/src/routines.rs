//! What a declaration of each kind computes: the routines, as nodes of one graph.

use std::collections::BTreeSet;

use crate::check::Program;
use crate::diff::{Coordinates, Moving, first_derivatives, second_order};
use crate::graph::{Graph, Input, NodeId, Op, Primitive, symmetric_index};
use crate::lower::{Formula, RestFormula, lower};
use crate::runtime::{Flag, Kind};

/// One routine to be generated.
#[derive(Clone, Debug)]
pub struct Routine {
    /// Its name.
    pub name: &'static str,
    /// What it computes in reduced coordinates.
    pub reduced: Vec<NodeId>,
    /// What it returns, group by group: value, gradient, ….
    pub groups: Vec<Vec<NodeId>>,
    /// Masks: degenerate, kink.
    pub flags: [Option<NodeId>; 2],
}

impl Routine {
    /// All that it returns.
    #[must_use]
    pub fn outputs(&self) -> Vec<NodeId> {
        self.groups.iter().flatten().copied().chain(self.flags.into_iter().flatten()).collect()
    }

    /// All that it computes before the expansion to points.
    #[must_use]
    pub fn reduced_outputs(&self) -> Vec<NodeId> {
        self.reduced.iter().copied().chain(self.flags.into_iter().flatten()).collect()
    }
}

/// A declaration's routines.
#[derive(Clone, Debug)]
pub struct Routines {
    /// What the rest shape decides.
    pub rest: RestFormula,
    /// Masks under which the rest shape is degenerate.
    pub rest_flags: [Option<NodeId>; 2],
    /// The graph of the rest.
    pub graph: Graph,
    /// The routines, in the order of their traits' methods.
    pub list: Vec<Routine>,
    /// The coordinates the derivatives were taken by.
    pub coordinates: usize,
    /// Whether points enter only through differences.
    pub translation_invariant: bool,
    /// The robust primitives used.
    pub primitives: Vec<&'static str>,
}

/// Differentiates a program as its kind demands.
#[must_use]
pub fn differentiate(program: &Program) -> Routines {
    let (mut rest, Formula { mut graph, outputs }) = lower(program);
    let rest_flags = flags(&mut rest.graph, &rest.outputs.iter().map(|&o| (o, 0)).collect::<Vec<_>>());
    let g = &mut graph;
    let coordinates = match program.kind {
        Kind::Residual => Coordinates::of_unknowns(g, program.moving_size()),
        _ => Coordinates::of_points(g, &outputs, Moving::Positions),
    };
    let list = match program.kind {
        Kind::Energy => potential(g, outputs[0], &[(outputs[0], 0)], &coordinates, program.points()),
        Kind::Constraint => constraint(g, program, &outputs, &coordinates),
        Kind::Force => force(g, &outputs, &coordinates, program.points()),
        Kind::Residual => residual(g, &outputs, &coordinates),
    };
    let primitives = primitives(g, &outputs, &list);
    Routines {
        rest,
        rest_flags,
        list,
        coordinates: coordinates.len(),
        translation_invariant: coordinates.translation_invariant,
        primitives,
        graph,
    }
}

/// Value, gradient, Hessian of U. `roots` are the outputs whose conditions count, with the order of derivative that U adds.
fn potential(
    g: &mut Graph,
    value: NodeId,
    roots: &[(NodeId, u8)],
    coordinates: &Coordinates,
    points: usize,
) -> Vec<Routine> {
    let plan = second_order(g, value, coordinates);
    let forward = first_derivatives(g, &[value], coordinates).remove(0);
    let gradient = cheaper(g, &[value], [forward, plan.gradient.clone()]);
    let at_order = |g: &mut Graph, order: u8| {
        let roots: Vec<_> = roots.iter().map(|&(node, added)| (node, order + added)).collect();
        flags(g, &roots)
    };
    let flags = [0, 1, 2].map(|order| at_order(g, order));
    let full_gradient = coordinates.expand_all(g, &gradient, points);
    let hessian_gradient = coordinates.expand_all(g, &plan.gradient, points);
    let triangle = coordinates.expand_triangle(g, &plan.hessian, points);
    let with = |lists: &[&[NodeId]]| lists.iter().flat_map(|l| l.iter().copied()).collect::<Vec<_>>();
    vec![
        Routine { name: "value", reduced: vec![value], groups: vec![vec![value]], flags: flags[0] },
        Routine {
            name: "gradient",
            reduced: with(&[&[value], &gradient]),
            groups: vec![vec![value], full_gradient],
            flags: flags[1],
        },
        Routine {
            name: "hessian",
            reduced: with(&[&[value], &plan.gradient, &plan.hessian]),
            groups: vec![vec![value], hessian_gradient, triangle],
            flags: flags[2],
        },
    ]
}

/// The alternative that, computed together with `common`, needs fewer operations.
fn cheaper(g: &Graph, common: &[NodeId], alternatives: [Vec<NodeId>; 2]) -> Vec<NodeId> {
    let cost =
        |nodes: &Vec<NodeId>| crate::graph::count(g, &common.iter().chain(nodes).copied().collect::<Vec<_>>()).total();
    alternatives.into_iter().min_by_key(cost).expect("two alternatives")
}

fn constraint(g: &mut Graph, program: &Program, c: &[NodeId], coordinates: &Coordinates) -> Vec<Routine> {
    let points = program.points();
    let n = coordinates.len();
    let parameters = program.parameters_size();
    let input = |i: usize| u16::try_from(i).expect("few parameters");
    let stiffness = g.input(Input::Parameter(input(parameters - 2)));
    let damping = g.input(Input::Parameter(input(parameters - 1)));
    let square = g.sum_of_squares(c);
    let half = g.constant(0.5);
    let scaled = g.mul(half, square);
    let energy = g.mul(stiffness, scaled);
    let roots: Vec<_> = vec![(energy, 0)];
    let mut list = potential(g, energy, &roots, coordinates, points);

    let jacobian = first_derivatives(g, c, coordinates);
    let hessians: Vec<Vec<NodeId>> = c.iter().map(|&row| second_order(g, row, coordinates).hessian).collect();
    let order = |order: u8| c.iter().map(|&row| (row, order)).collect::<Vec<_>>();
    let full_jacobian: Vec<NodeId> = jacobian.iter().flat_map(|row| coordinates.expand_all(g, row, points)).collect();
    let full_hessians: Vec<NodeId> =
        hessians.iter().flat_map(|row| coordinates.expand_triangle(g, row, points)).collect();
    let first_flags = flags(g, &order(1));
    let second_flags = flags(g, &order(2));
    let flat = |rows: &[Vec<NodeId>]| rows.iter().flatten().copied().collect::<Vec<_>>();
    let with = |lists: &[&[NodeId]]| lists.iter().flat_map(|l| l.iter().copied()).collect::<Vec<_>>();
    list.push(Routine {
        name: "constraint_jacobian",
        reduced: with(&[c, &flat(&jacobian)]),
        groups: vec![c.to_vec(), full_jacobian.clone()],
        flags: first_flags,
    });
    list.push(Routine {
        name: "constraint_hessian",
        reduced: with(&[c, &flat(&jacobian), &flat(&hessians)]),
        groups: vec![c.to_vec(), full_jacobian, full_hessians],
        flags: second_flags,
    });

    let gradient = first_derivatives(g, &[energy], coordinates).remove(0);
    let outer = |g: &mut Graph, factor: NodeId, i: usize, j: usize| {
        let terms: Vec<_> = jacobian.iter().map(|row| g.mul(row[i], row[j])).collect();
        let sum = g.sum(terms);
        g.mul(factor, sum)
    };
    let upper: Vec<(usize, usize)> = (0..n).flat_map(|i| (i..n).map(move |j| (i, j))).collect();
    let gauss_newton: Vec<NodeId> = upper.iter().map(|&(i, j)| outer(g, stiffness, i, j)).collect();
    let energy_flags = flags(g, &[&[(energy, 1)], &order(1)[..]].concat());
    let triangle = coordinates.expand_triangle(g, &gauss_newton, points);
    let full_gradient = coordinates.expand_all(g, &gradient, points);
    list.push(Routine {
        name: "gauss_newton",
        reduced: with(&[&[energy], &gradient, &gauss_newton]),
        groups: vec![vec![energy], full_gradient, triangle],
        flags: energy_flags,
    });

    // f = −∇U − k_d Jᵀ Ċ, Ċ = J q̇ with q̇ the differences of velocity.
    let speeds = speeds(g, coordinates);
    let rates: Vec<NodeId> = jacobian.iter().map(|row| g.dot(row, &speeds)).collect();
    let damped_rates = g.scaled(damping, &rates);
    let force: Vec<NodeId> = (0..n)
        .map(|i| {
            let terms: Vec<_> = jacobian.iter().zip(&damped_rates).map(|(row, &rate)| g.mul(rate, row[i])).collect();
            let resisting = g.sum(terms);
            let sum = g.add(gradient[i], resisting);
            g.neg(sum)
        })
        .collect();
    let full_force = coordinates.expand_all(g, &force, points);
    list.push(Routine {
        name: "force",
        reduced: force.clone(),
        groups: vec![full_force.clone()],
        flags: flags(g, &[&[(energy, 1)], &order(1)[..]].concat()),
    });

    // ∂f/∂x = −∇²U − k_d Σ (Ċ ∇²C + ∇C (∇²C q̇)ᵀ); ∂f/∂v = −k_d JᵀJ.
    let energy_hessian = second_order(g, energy, coordinates).hessian;
    let turning: Vec<Vec<NodeId>> = hessians
        .iter()
        .map(|h| {
            let rows: Vec<Vec<NodeId>> =
                (0..n).map(|i| (0..n).map(|j| h[symmetric_index(n, i, j)]).collect()).collect();
            let rates: Vec<_> = rows.iter().map(|row| g.dot(row, &speeds)).collect();
            g.scaled(damping, &rates)
        })
        .collect();
    let mut by_position = Vec::with_capacity(n * n);
    let mut by_velocity = Vec::with_capacity(n * n);
    for i in 0..n {
        for j in 0..n {
            let mut sum = energy_hessian[symmetric_index(n, i, j)];
            for (row, h) in hessians.iter().enumerate() {
                let bending = g.mul(damped_rates[row], h[symmetric_index(n, i, j)]);
                let swinging = g.mul(jacobian[row][i], turning[row][j]);
                sum = g.add(sum, bending);
                sum = g.add(sum, swinging);
            }
            by_position.push(g.neg(sum));
            let resisting = outer(g, damping, i.min(j), i.max(j));
            by_velocity.push(g.neg(resisting));
        }
    }
    let full_position = coordinates.expand_square(g, &by_position, points);
    let full_velocity = coordinates.expand_square(g, &by_velocity, points);
    list.push(Routine {
        name: "jacobians",
        reduced: with(&[&force, &by_position, &by_velocity]),
        groups: vec![full_force, full_position, full_velocity],
        flags: flags(g, &[&[(energy, 2)], &order(2)[..]].concat()),
    });
    list
}

/// The velocity of each coordinate.
fn speeds(g: &mut Graph, coordinates: &Coordinates) -> Vec<NodeId> {
    let mut speeds = Vec::with_capacity(coordinates.len());
    for vector in &coordinates.vectors {
        for axis in 0..coordinates.components {
            let mut sum = g.constant(0.0);
            for &(point, positive) in vector {
                let number = u16::try_from(coordinates.components * point + axis).expect("few points");
                let velocity = g.input(Input::Velocity(number));
                sum = if positive { g.add(sum, velocity) } else { g.sub(sum, velocity) };
            }
            speeds.push(sum);
        }
    }
    speeds
}

fn force(g: &mut Graph, f: &[NodeId], coordinates: &Coordinates, points: usize) -> Vec<Routine> {
    let by_position = first_derivatives(g, f, coordinates);
    let velocities = Coordinates::of_points(g, f, Moving::Velocities);
    let by_velocity = first_derivatives(g, f, &velocities);
    let reduced = f.iter().copied().chain(by_position.iter().chain(&by_velocity).flatten().copied()).collect();
    let square = |g: &mut Graph, rows: &[Vec<NodeId>], coordinates: &Coordinates| {
        let expanded: Vec<Vec<NodeId>> = rows.iter().map(|row| coordinates.expand_all(g, row, points)).collect();
        let mut blocks = Vec::with_capacity(9 * points * points);
        for i in 0..points {
            for j in 0..points {
                for row in 0..3 {
                    blocks.extend_from_slice(&expanded[3 * i + row][3 * j..3 * j + 3]);
                }
            }
        }
        blocks
    };
    let full_position = square(g, &by_position, coordinates);
    let full_velocity = square(g, &by_velocity, &velocities);
    let order = |order: u8| f.iter().map(|&node| (node, order)).collect::<Vec<_>>();
    vec![
        Routine { name: "force", reduced: f.to_vec(), groups: vec![f.to_vec()], flags: flags(g, &order(0)) },
        Routine {
            name: "jacobians",
            reduced,
            groups: vec![f.to_vec(), full_position, full_velocity],
            flags: flags(g, &order(1)),
        },
    ]
}

fn residual(g: &mut Graph, r: &[NodeId], coordinates: &Coordinates) -> Vec<Routine> {
    let jacobian: Vec<NodeId> = first_derivatives(g, r, coordinates).into_iter().flatten().collect();
    let order = |order: u8| r.iter().map(|&node| (node, order)).collect::<Vec<_>>();
    vec![
        Routine { name: "residual", reduced: r.to_vec(), groups: vec![r.to_vec()], flags: flags(g, &order(0)) },
        Routine {
            name: "jacobian",
            reduced: r.iter().chain(&jacobian).copied().collect(),
            groups: vec![r.to_vec(), jacobian],
            flags: flags(g, &order(1)),
        },
    ]
}

/// The rules that `roots` are made of.
fn rules(g: &Graph, roots: &[NodeId]) -> BTreeSet<NodeId> {
    let mut seen = BTreeSet::new();
    let mut stack = roots.to_vec();
    while let Some(node) = stack.pop() {
        if seen.insert(node) {
            match g.rule(node) {
                Some(rule) => stack.extend(&rule.arguments),
                None => stack.extend(g.op(node).operands()),
            }
        }
    }
    seen.retain(|&node| matches!(g.op(node), Op::Rule(_)));
    seen
}

/// The conditions under which derivatives of the given orders of `roots` are conventions: degenerate, kink.
fn flags(g: &mut Graph, roots: &[(NodeId, u8)]) -> [Option<NodeId>; 2] {
    let mut masks = [None, None];
    for &(root, order) in roots {
        for node in rules(g, &[root]) {
            for flag in g.rule(node).expect("a rule").flags.clone() {
                if flag.order <= order {
                    let mask = &mut masks[usize::from(flag.flag == Flag::Kink)];
                    *mask = Some(mask.map_or(flag.mask, |other| g.or(other, flag.mask)));
                }
            }
        }
    }
    masks
}

/// What the documentation says the formula was compiled to.
fn primitives(g: &Graph, outputs: &[NodeId], list: &[Routine]) -> Vec<&'static str> {
    let values: Vec<NodeId> =
        outputs.iter().chain(list.first().into_iter().flat_map(|r| r.groups.iter().flatten())).copied().collect();
    let mut labels: Vec<&'static str> = Vec::new();
    for node in rules(g, &values) {
        let primitive: Primitive = g.rule(node).expect("a rule").primitive;
        if let Some(label) = primitive.label().filter(|l| !labels.contains(l)) {
            labels.push(label);
        }
    }
    labels
}
