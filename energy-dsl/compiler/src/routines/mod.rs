//! The routines of each kind of declaration, as nodes of one graph.

mod constraint;

use std::collections::BTreeSet;

use crate::check::Program;
use crate::diff::{Coordinates, Moving, Plan, SecondOrder, first_order, hessian_vector, second_order};
use crate::graph::{Graph, Input, NodeId, Op, Primitive, general, ordinary, with_signs_inside};
use crate::lower::{Formula, RestFormula};
use energy_runtime::{Flag, Kind};

/// A routine to be generated.
#[derive(Clone, Debug)]
pub struct Routine {
    /// Name of the routine.
    pub name: &'static str,
    /// Results in reduced coordinates.
    pub reduced: Vec<NodeId>,
    /// Returned results by group: value, gradient, ….
    pub groups: Vec<Vec<NodeId>>,
    /// Masks of the flags: degenerate, kink.
    pub flags: [Option<NodeId>; 2],
    /// The general path; `None` if there are no precautions.
    pub general: Option<General>,
}

/// The general path of a routine, with all precautions.
#[derive(Clone, Debug)]
pub struct General {
    /// Mask where the ordinary path suffices.
    pub ordinary: NodeId,
    /// Results on the general path.
    pub groups: Vec<Vec<NodeId>>,
    /// Masks of the flags on the general path.
    pub flags: [Option<NodeId>; 2],
}

impl Routine {
    fn new(name: &'static str, reduced: Vec<NodeId>, groups: Vec<Vec<NodeId>>, flags: [Option<NodeId>; 2]) -> Self {
        Self { name, reduced, groups, flags, general: None }
    }

    /// Splits the routine into its ordinary and its general path.
    fn split(self, g: &mut Graph) -> Self {
        let all: Vec<NodeId> = self.reduced.iter().copied().chain(self.outputs()).collect();
        let cautious = general(g, &all);
        let Some((nodes, ordinary)) = ordinary(g, &all) else {
            let nodes = with_signs_inside(g, &cautious);
            return self.with(g, &nodes);
        };
        let cautious = self.with(g, &cautious);
        let general = General { ordinary, groups: cautious.groups, flags: cautious.flags };
        let nodes = with_signs_inside(g, &nodes);
        Self { general: Some(general), ..self.with(g, &nodes) }
    }

    /// Replaces the nodes of the routine: reduced, groups, flags.
    fn with(&self, g: &Graph, nodes: &[NodeId]) -> Self {
        let mut nodes = nodes.iter().copied();
        let mut take = |n: usize| nodes.by_ref().take(n).collect::<Vec<_>>();
        let reduced = take(self.reduced.len());
        let groups = self.groups.iter().map(|group| take(group.len())).collect();
        let flags = self.flags.map(|flag| flag.map(|_| take(1)[0]).filter(|&mask| g.op(mask) != Op::Truth(false)));
        Self { name: self.name, reduced, groups, flags, general: None }
    }

    /// Returns all outputs.
    #[must_use]
    pub fn outputs(&self) -> Vec<NodeId> {
        let guard = self.general.as_ref().map(|general| general.ordinary);
        self.groups.iter().flatten().copied().chain(self.flags.into_iter().flatten()).chain(guard).collect()
    }

    /// Returns all outputs before the expansion to points.
    #[must_use]
    pub fn reduced_outputs(&self) -> Vec<NodeId> {
        let guard = self.general.as_ref().map(|general| general.ordinary);
        self.reduced.iter().copied().chain(self.flags.into_iter().flatten()).chain(guard).collect()
    }
}

/// The routines of a declaration.
#[derive(Clone, Debug)]
pub struct Routines {
    /// The part that the rest shape determines.
    pub rest: RestFormula,
    /// Masks under which the rest shape is degenerate.
    pub rest_flags: [Option<NodeId>; 2],
    /// Graph of the moving part.
    pub graph: Graph,
    /// Routines in the order of the trait methods.
    pub list: Vec<Routine>,
    /// Number of reduced coordinates.
    pub coordinates: usize,
    /// Points of each coordinate vector, with signs; empty for residuals.
    pub vectors: Vec<Vec<(usize, bool)>>,
    /// Expansion of the derivatives of an energy to points.
    pub expansion: Option<Expansion>,
    /// Whether points enter only as differences.
    pub translation_invariant: bool,
    /// Robust primitives that the formula uses.
    pub primitives: Vec<&'static str>,
    /// Routes to the derivatives of each routine.
    pub plans: Vec<Plan>,
}

/// Derivatives with respect to points, as functions of the numbers of a reduced routine: [`Input::Precomputed`] 0 to n
/// − 1 are the gradient, the triangle follows.
#[derive(Clone, Debug)]
pub struct Expansion {
    /// The graph.
    pub graph: Graph,
    /// The gradient ∇U.
    pub gradient: Vec<NodeId>,
    /// The triangle of ∇²U.
    pub triangle: Vec<NodeId>,
}

impl Expansion {
    /// Creates the expansion. Numbers that are zero or equal in the reduced routine are so here.
    fn new(g: &Graph, energy: &SecondOrder, coordinates: &Coordinates, points: usize) -> Self {
        let mut graph = Graph::textbook();
        let all: Vec<NodeId> = energy.gradient.iter().chain(&energy.hessian).map(|&node| g.resolve(node)).collect();
        let numbers: Vec<NodeId> = all
            .iter()
            .map(|&node| match g.as_constant(node) {
                Some(value) => graph.constant(value),
                None => {
                    let first = all.iter().position(|&other| other == node).expect("it is one of them");
                    graph.input(Input::Precomputed(u16::try_from(first).expect("few numbers")))
                }
            })
            .collect();
        let (gradient, triangle) = numbers.split_at(energy.gradient.len());
        let gradient = coordinates.expand_all(&mut graph, gradient, points);
        let triangle = coordinates.expand_triangle(&mut graph, triangle, points);
        Self { graph, gradient, triangle }
    }
}

/// Differentiates the formulas of a program as its kind requires.
#[must_use]
pub fn differentiate(
    program: &Program,
    (mut rest, Formula { mut graph, outputs }): (RestFormula, Formula),
) -> Routines {
    let rest_flags = flags(&mut rest.graph, &rest.outputs.iter().map(|&o| (o, 0)).collect::<Vec<_>>());
    let g = &mut graph;
    let coordinates = match program.kind {
        Kind::Residual => Coordinates::of_unknowns(g, program.moving_size()),
        _ => Coordinates::of_points(g, &outputs, Moving::Positions),
    };
    let mut plans = Vec::new();
    let mut expansion = None;
    let list: Vec<Routine> = match program.kind {
        Kind::Energy => {
            let (energy, plan) = second_order(g, "hessian", outputs[0], &coordinates);
            plans.push(plan);
            expansion = Some(Expansion::new(g, &energy, &coordinates, program.points()));
            potential(g, &energy, &coordinates, program.points(), &mut plans)
        }
        Kind::Constraint => {
            let (list, energy) = constraint::routines(g, program, &outputs, &coordinates, &mut plans);
            expansion = Some(Expansion::new(g, &energy, &coordinates, program.points()));
            list
        }
        Kind::Force => force(g, &outputs, &coordinates, program.points(), &mut plans),
        Kind::Residual => residual(g, &outputs, &coordinates, &mut plans),
    };
    let primitives = primitives(g, &outputs, &list);
    let list: Vec<Routine> = list.into_iter().map(|routine| routine.split(g)).collect();
    Routines {
        rest,
        rest_flags,
        list,
        coordinates: coordinates.len(),
        vectors: if program.kind == Kind::Residual { Vec::new() } else { coordinates.vectors.clone() },
        expansion,
        translation_invariant: coordinates.translation_invariant,
        primitives,
        plans,
        graph,
    }
}

/// Creates value, gradient and Hessian of U.
fn potential(
    g: &mut Graph,
    energy: &SecondOrder,
    coordinates: &Coordinates,
    points: usize,
    plans: &mut Vec<Plan>,
) -> Vec<Routine> {
    let value = energy.value;
    let known = Some(energy.gradient.clone());
    let (mut gradient, plan) = first_order(g, "gradient", &[value], coordinates, known);
    plans.push(plan);
    let gradient = gradient.remove(0);
    let (product, plan) = hessian_vector(g, "hessian_vector", energy, coordinates);
    plans.push(plan);
    let full_product = coordinates.expand_all(g, &product, points);
    let flags = [0, 1, 2].map(|order| flags(g, &[(value, order)]));
    let full_gradient = coordinates.expand_all(g, &gradient, points);
    let hessian_gradient = coordinates.expand_all(g, &energy.gradient, points);
    let triangle = coordinates.expand_triangle(g, &energy.hessian, points);
    let reduced = [&[value], &energy.gradient[..], &energy.hessian[..]].concat();
    let reduced_groups = vec![vec![value], energy.gradient.clone(), energy.hessian.clone()];
    vec![
        Routine::new("value", vec![value], vec![vec![value]], flags[0]),
        Routine::new("gradient", [&[value], &gradient[..]].concat(), vec![vec![value], full_gradient], flags[1]),
        Routine::new("hessian", reduced.clone(), vec![vec![value], hessian_gradient, triangle], flags[2]),
        Routine::new("reduced_hessian", reduced, reduced_groups, flags[2]),
        Routine::new("hessian_vector", product, vec![full_product], flags[2]),
    ]
}

fn force(g: &mut Graph, f: &[NodeId], coordinates: &Coordinates, points: usize, plans: &mut Vec<Plan>) -> Vec<Routine> {
    let (by_position, plan) = first_order(g, "jacobians", f, coordinates, None);
    plans.push(plan);
    let velocities = Coordinates::of_points(g, f, Moving::Velocities);
    let (by_velocity, plan) = first_order(g, "jacobians, by velocity", f, &velocities, None);
    plans.push(plan);
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
        Routine::new("force", f.to_vec(), vec![f.to_vec()], flags(g, &order(0))),
        Routine::new("jacobians", reduced, vec![f.to_vec(), full_position, full_velocity], flags(g, &order(1))),
    ]
}

fn residual(g: &mut Graph, r: &[NodeId], coordinates: &Coordinates, plans: &mut Vec<Plan>) -> Vec<Routine> {
    let (jacobian, plan) = first_order(g, "jacobian", r, coordinates, None);
    plans.push(plan);
    let jacobian = jacobian.concat();
    let order = |order: u8| r.iter().map(|&node| (node, order)).collect::<Vec<_>>();
    vec![
        Routine::new("residual", r.to_vec(), vec![r.to_vec()], flags(g, &order(0))),
        Routine::new(
            "jacobian",
            r.iter().chain(&jacobian).copied().collect(),
            vec![r.to_vec(), jacobian],
            flags(g, &order(1)),
        ),
    ]
}

/// Returns the rules that `roots` depend on.
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

/// Returns the masks (degenerate, kink) under which derivatives of `roots` up to the given orders are conventions.
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

/// Lists the primitives for the documentation of the generated type.
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
