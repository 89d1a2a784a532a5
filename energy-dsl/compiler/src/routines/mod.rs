//! The routines of each kind of declaration, as nodes of one graph.

mod constraint;
mod domain;
mod hazards;
mod magnitude;
mod memory;
mod range;
mod sides;

use rustc_hash::FxHashMap;

use crate::budget::{Budget, Phase};
use crate::check::Program;
use crate::diff::{
    ATTEMPT, Coordinates, Moving, Routes, SecondOrder, Unknowns, first_order, hessian_vector, is_worth_taking,
    only_dihedral, second_order,
};
use crate::graph::{Graph, Input, NodeId, Op, general, ordinary, with_signs_inside};
use crate::lower::{Formula, LoweredProgram, Repetition, RestFormula};
use energy_runtime::{FieldKind, Flag, Kind, RoutineKind};
use hazards::{Hazards, hazards, operations, unless_moderate};
use range::Tests;

/// A routine to be generated.
#[derive(Clone, Debug)]
pub struct Routine {
    /// Kind of the routine.
    pub kind: RoutineKind,
    /// Results in reduced coordinates.
    pub reduced: Vec<NodeId>,
    /// Returned results by group: value, gradient, ….
    pub groups: Vec<Vec<NodeId>>,
    /// Masks of the flags of the ordinary path: degenerate, kink.
    pub flags: [Option<NodeId>; 2],
    /// The general path; `None` without precautions.
    pub general: Option<General>,
}

/// The general path of a routine, with all precautions.
#[derive(Clone, Debug)]
pub struct General {
    /// Mask where the ordinary path suffices.
    pub ordinary: NodeId,
    /// The part of that mask that does not depend on results.
    pub guards: NodeId,
    /// Results on the general path.
    pub groups: Vec<Vec<NodeId>>,
    /// Masks of inputs at which a result may be a convention: degenerate, kink. Rays through the input decide.
    pub flags: [Option<NodeId>; 2],
    /// Mask of inputs outside of the formula's domain; `None` if all inputs are inside.
    pub outside: Option<NodeId>,
    /// Mask of inputs at which a result is a convention without a limit; `None` if that is impossible.
    pub definite: Option<NodeId>,
}

impl Routine {
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

/// The largest error of a rotation's length.
const UNIT_TOLERANCE: f64 = 1e-6;

/// A routine before it is split into its ordinary and its general path.
struct Whole {
    kind: RoutineKind,
    reduced: Vec<NodeId>,
    groups: Vec<Vec<NodeId>>,
    hazards: Hazards,
}

impl Whole {
    fn new(kind: RoutineKind, reduced: Vec<NodeId>, groups: Vec<Vec<NodeId>>, hazards: Hazards) -> Self {
        Self { kind, reduced, groups, hazards }
    }

    fn nodes(&self) -> Vec<NodeId> {
        let Hazards { flags, sound, .. } = self.hazards;
        let masks = flags.into_iter().flatten().chain(sound);
        self.reduced.iter().copied().chain(self.groups.iter().flatten().copied()).chain(masks).collect()
    }

    /// Returns the masks where the general path needs no rays: outside of the domain, and where no limit exists.
    fn settled(&self, g: &mut Graph) -> [Option<NodeId>; 2] {
        let masks = [self.hazards.outside, self.hazards.definite];
        let known: Vec<NodeId> = masks.into_iter().flatten().collect();
        let mut rebuilt = general(g, &known).into_iter();
        masks.map(|mask| mask.and_then(|_| rebuilt.next()).filter(|&mask| g.op(mask) != Op::Truth(false)))
    }

    /// Replaces the nodes of the routine.
    fn with(&self, g: &Graph, nodes: &[NodeId]) -> Self {
        let mut nodes = nodes.iter().copied();
        let mut take = |n: usize| nodes.by_ref().take(n).collect::<Vec<_>>();
        let reduced = take(self.reduced.len());
        let groups = self.groups.iter().map(|group| take(group.len())).collect();
        let mut mask = |mask: Option<NodeId>| mask.map(|_| take(1)[0]);
        let flags = self.hazards.flags.map(|flag| mask(flag).filter(|&flag| g.op(flag) != Op::Truth(false)));
        let sound = mask(self.hazards.sound).filter(|&sound| g.op(sound) != Op::Truth(true));
        Self { kind: self.kind, reduced, groups, hazards: Hazards { flags, sound, ..Hazards::default() } }
    }

    /// Returns the mask where all results are finite, if the guards hold. Adds those that this takes.
    fn is_finite(&self, g: &mut Graph, guards: &mut Vec<NodeId>) -> NodeId {
        // Before results are expanded to points, they are fewer. The values come first.
        let values = if self.kind.has_values() { self.groups[0].len().min(self.reduced.len()) } else { 0 };
        let (values, derivatives) = self.reduced.split_at(values);
        let tests = Tests::of(g, guards, values, derivatives);
        guards.extend(tests.guards(g));
        let outputs = self.groups.iter().flatten().map(|&output| g.resolve(output)).collect();
        tests.finite(g, &outputs)
    }

    /// Flags rotations whose quaternions are not of unit length. Nothing has a limit there.
    fn flagged_off_unit(mut self, g: &mut Graph, unknowns: &Unknowns) -> Self {
        for rotation in unknowns.list.iter().filter(|unknown| unknown.kind == FieldKind::Rotation) {
            let numbers = rotation.first_number..rotation.first_number + 4;
            let q: Vec<NodeId> = numbers.map(|number| g.input(Input::Position(Budget::input_number(number)))).collect();
            let (square, one) = (g.dot(&q, &q), g.constant(1.0));
            let excess = g.sub(square, one);
            let (excess, most) = (g.abs(excess), g.constant(2.0 * UNIT_TOLERANCE));
            let is_unit = g.less_or_equal(excess, most);
            // Also true of NaN.
            let off = g.not(is_unit);
            self.hazards.never(g, off);
        }
        self
    }

    fn split(self, g: &mut Graph) -> Routine {
        let all = self.nodes();
        let cautious = general(g, &all);
        let [outside, definite] = self.settled(g);
        let (nodes, moderate) = match ordinary(g, &all) {
            Some((nodes, moderate)) => (nodes, Some(moderate)),
            None => (cautious.clone(), None),
        };
        let nodes = with_signs_inside(g, &nodes);
        let ordinary = self.with(g, &nodes);
        let Hazards { flags, sound, .. } = ordinary.hazards;
        let bounds = sound.into_iter().chain(moderate).reduce(|a, b| g.and(a, b));
        let mut open: Vec<NodeId> = flags.into_iter().flatten().map(|flag| unless_moderate(g, flag, bounds)).collect();
        open.retain(|&flag| g.op(flag) != Op::Truth(false));
        let unflagged: Vec<NodeId> = open.into_iter().map(|flag| g.not(flag)).collect();
        // Outside of the domain, results are not numbers, and nothing else guards against that.
        let always = outside.map(|_| g.truth(true));
        let mut guards: Vec<NodeId> = moderate.into_iter().chain(sound).chain(unflagged).chain(always).collect();
        let finite = ordinary.is_finite(g, &mut guards);
        let Self { kind, reduced, groups, .. } = ordinary;
        let Some(guards) = guards.into_iter().reduce(|all, guard| g.and(all, guard)) else {
            // A polynomial: it overflows where its own terms do.
            let degenerate = Some(g.not(finite)).filter(|&mask| g.op(mask) != Op::Truth(false));
            return Routine { kind, reduced, groups, flags: [degenerate, None], general: None };
        };
        let ordinary = g.and(finite, guards);
        let Self { groups: with_care, hazards, .. } = self.with(g, &cautious);
        let general = General { ordinary, guards, groups: with_care, flags: hazards.flags, outside, definite };
        Routine { kind, reduced, groups, flags: [None, None], general: Some(general) }
    }
}

/// The routines of a declaration.
#[derive(Clone, Debug)]
pub struct Routines {
    /// The part that the rest shape determines.
    pub rest: RestFormula,
    /// Mask under which the rest shape is degenerate or inverted.
    pub refused: Option<NodeId>,
    /// The state at rest, from the rest shape and the parameters; `None` if it is given with each element.
    pub at_rest: Option<Formula>,
    /// Graph of the moving part, or of one term of it.
    pub graph: Graph,
    /// The numbers of each term, if the routines compute one term of a sum.
    pub repetition: Option<Repetition>,
    /// Routines in the order of the trait methods.
    pub list: Vec<Routine>,
    /// Number of reduced coordinates.
    pub coordinates: usize,
    /// Points of each coordinate vector, with weights; empty for residuals and mixed unknowns.
    pub vectors: Vec<Vec<(usize, f64)>>,
    /// Expansion of the derivatives of an energy to points.
    pub expansion: Option<Expansion>,
    /// Points of the dihedral angle that the energy is a function of; `None` for other formulas.
    pub dihedral: Option<[usize; 4]>,
    /// Whether points enter only as differences.
    pub translation_invariant: bool,
    /// Robust primitives that the formula uses.
    pub primitives: Vec<&'static str>,
    /// Routes to the derivatives of each routine.
    pub routes: Vec<Routes>,
    /// Routines that have graphs of their own: those of single vertices, and those of the state.
    pub apart: Vec<Apart>,
}

impl Routines {
    /// Returns a routine; `None` if declarations of this kind do not have it.
    #[must_use]
    pub fn find(&self, kind: RoutineKind) -> Option<&Routine> {
        self.list.iter().find(|routine| routine.kind == kind)
    }

    /// Returns all routines, each with its graph.
    pub fn all(&self) -> impl Iterator<Item = (&Graph, &Routine)> {
        let own = self.list.iter().map(|routine| (&self.graph, routine));
        let apart = self.apart.iter().flat_map(|all| all.list.iter().map(|routine| (&all.graph, routine)));
        own.chain(apart)
    }
}

/// Derivatives with respect to points, as functions of the numbers of a reduced routine: [`Input::Precomputed`] 0 to n
/// − 1 are the gradient, the triangle follows.
#[derive(Clone, Debug)]
pub struct Expansion {
    /// The graph of all routines.
    pub graph: Graph,
    /// The gradient ∇U.
    pub gradient: Vec<NodeId>,
    /// The triangle of ∇²U.
    pub triangle: Vec<NodeId>,
}

impl Expansion {
    /// Creates the expansion. Derivatives that are constant or equal in the reduced gradient are so here. Entries of
    /// the reduced Hessian are not, unless all are 0: a projection to a semi-definite matrix may change them in
    /// between.
    fn new(g: &Graph, energy: &SecondOrder, coordinates: &Coordinates) -> Self {
        let mut graph = Graph::textbook().paid_by(g.budget());
        let all: Vec<NodeId> = energy.gradient.iter().chain(&energy.hessian).map(|&node| g.resolve(node)).collect();
        let projected = match all[energy.gradient.len()..].iter().all(|&entry| g.is(entry, 0.0)) {
            true => all.len(),
            false => energy.gradient.len(),
        };
        let mut first = FxHashMap::default();
        let numbers: Vec<NodeId> = all
            .iter()
            .enumerate()
            .map(|(number, &node)| match g.as_constant(node) {
                Some(value) if number < projected => graph.constant(value),
                _ => {
                    let source = if number < projected { *first.entry(node).or_insert(number) } else { number };
                    graph.input(Input::Precomputed(Budget::input_number(source)))
                }
            })
            .collect();
        let (gradient, triangle) = numbers.split_at(energy.gradient.len());
        let gradient = coordinates.expand_all(&mut graph, gradient);
        let triangle = coordinates.expand_symmetric(&mut graph, triangle, false);
        Self { graph, gradient, triangle }
    }
}

/// Differentiates the formulas of a program as its kind requires.
#[must_use]
pub fn differentiate(
    program: &Program,
    LoweredProgram { mut rest, formula: Formula { mut graph, outputs, repetition }, memory, at_rest }: LoweredProgram,
) -> Routines {
    program.budget.enter(Phase::Differentiating);
    let refused = refused(&mut rest);
    let g = &mut graph;
    let (unknowns, is_mixed) = (Unknowns::of(&program.moving), program.is_mixed());
    let mut coordinates = match program.kind {
        Kind::Residual => Coordinates::of_unknowns(g, &unknowns),
        _ => Coordinates::reduced(g, &outputs, &unknowns, Moving::Unknowns),
    };
    let mut routes = Vec::new();
    let (mut expansion, mut dihedral) = (None, None);
    let list: Vec<Whole> = match program.kind {
        Kind::Energy => {
            let before = g.clone();
            let (mut energy, mut taken) = second_order(g, RoutineKind::Hessian.name(), outputs[0], &coordinates);
            if let Some(other) = by_linear_functions(before, outputs[0], &unknowns, taken.list[0].cost) {
                (*g, coordinates, energy, taken) = other;
            }
            routes.push(taken);
            (expansion, dihedral) = of_points(g, &energy, &coordinates, is_mixed);
            potential(g, &energy, &coordinates, is_mixed, &mut routes)
        }
        Kind::Constraint => {
            let (list, energy) = constraint::routines(g, program, &outputs, (&unknowns, &coordinates), &mut routes);
            (expansion, dihedral) = of_points(g, &energy, &coordinates, is_mixed);
            list
        }
        Kind::Force => force(g, &outputs, &coordinates, (&unknowns, is_mixed), &mut routes),
        Kind::Residual => residual(g, &outputs, &coordinates, &mut routes),
    };
    let primitives = primitives(g, &outputs, &list);
    let mut apart = Vec::new();
    if program.vertices && !is_mixed {
        apart.push(Apart::of_vertices(g, list[0].groups[0][0], &coordinates, &unknowns, &mut routes));
    }
    if let Some(memory) = memory {
        apart.extend(memory::routines(program, &unknowns, memory, &mut routes));
    }
    let list = list.into_iter().map(|whole| whole.flagged_off_unit(g, &unknowns).split(g)).collect();
    Routines {
        rest,
        refused,
        at_rest,
        list,
        coordinates: coordinates.len(),
        vectors: if program.kind == Kind::Residual || is_mixed { Vec::new() } else { coordinates.vectors.clone() },
        expansion,
        dihedral,
        translation_invariant: coordinates.translation_invariant,
        primitives,
        routes,
        apart,
        graph,
        repetition,
    }
}

/// Differentiates by linear functions of the unknowns, if these are as many as their differences. `None` if that is not
/// cheaper by a twentieth.
fn by_linear_functions(
    mut graph: Graph,
    output: NodeId,
    unknowns: &Unknowns,
    cost: usize,
) -> Option<(Graph, Coordinates, SecondOrder, Routes)> {
    let coordinates = Coordinates::of_as_many_functions(&mut graph, &[output], unknowns, Moving::Unknowns)?;
    let budget = graph.budget().clone();
    let attempt = || second_order(&mut graph, RoutineKind::Hessian.name(), output, &coordinates);
    let ((energy, taken), [steps, bytes]) = budget.attempt(ATTEMPT, attempt)?;
    is_worth_taking(taken.list[0].cost, cost).then(|| {
        budget.spend(steps, bytes);
        (graph, coordinates, energy, taken)
    })
}

/// Returns what only energies of points have: the expansion from reduced coordinates, and the points of a dihedral angle.
fn of_points(
    g: &Graph,
    energy: &SecondOrder,
    coordinates: &Coordinates,
    is_mixed: bool,
) -> (Option<Expansion>, Option<[usize; 4]>) {
    if is_mixed {
        return (None, None);
    }
    (Some(Expansion::new(g, energy, coordinates)), only_dihedral(g, energy.value, coordinates))
}

/// Creates value, gradient and Hessian of U.
fn potential(
    g: &mut Graph,
    energy: &SecondOrder,
    coordinates: &Coordinates,
    is_mixed: bool,
    routes: &mut Vec<Routes>,
) -> Vec<Whole> {
    let value = energy.value;
    let known = Some(energy.gradient.clone());
    let (mut gradient, taken) = first_order(g, RoutineKind::Gradient.name(), &[value], coordinates, known);
    routes.push(taken);
    let gradient = gradient.remove(0);
    let (product, taken) = hessian_vector(g, RoutineKind::HessianVector.name(), energy, coordinates);
    routes.push(taken);
    let full_product = coordinates.expand_all(g, &product);
    let hazards = [0, 1, 2].map(|order| hazards(g, &[(value, order)]));
    let full_gradient = coordinates.expand_all(g, &gradient);
    let hessian_gradient = coordinates.expand_all(g, &energy.gradient);
    let triangle = coordinates.expand_symmetric(g, &energy.hessian, is_mixed);
    let reduced = [&[value], &energy.gradient[..], &energy.hessian[..]].concat();
    let reduced_groups = vec![vec![value], energy.gradient.clone(), energy.hessian.clone()];
    let mut list = vec![
        Whole::new(RoutineKind::Value, vec![value], vec![vec![value]], hazards[0]),
        Whole::new(
            RoutineKind::Gradient,
            [&[value], &gradient[..]].concat(),
            vec![vec![value], full_gradient],
            hazards[1],
        ),
        Whole::new(RoutineKind::Hessian, reduced.clone(), vec![vec![value], hessian_gradient, triangle], hazards[2]),
    ];
    if !is_mixed {
        list.push(Whole::new(RoutineKind::ReducedHessian, reduced, reduced_groups, hazards[2]));
    }
    list.push(Whole::new(RoutineKind::HessianVector, product, vec![full_product], hazards[2]));
    list
}

/// Routines with a graph of their own: a number that they, too, would use might round otherwise in the other routines.
#[derive(Clone, Debug)]
pub struct Apart {
    /// The graph.
    pub graph: Graph,
    /// The routines.
    pub list: Vec<Routine>,
}

impl Apart {
    fn new(mut graph: Graph, list: Vec<Whole>, unknowns: &Unknowns) -> Self {
        let split = |whole: Whole| whole.flagged_off_unit(&mut graph, unknowns).split(&mut graph);
        let list = list.into_iter().map(split).collect();
        Self { graph, list }
    }

    /// Creates the value and its derivatives by each point alone.
    fn of_vertices(
        graph: &Graph,
        value: NodeId,
        coordinates: &Coordinates,
        unknowns: &Unknowns,
        routes: &mut Vec<Routes>,
    ) -> Self {
        let mut graph = graph.clone();
        let list = vertices(&mut graph, value, coordinates, unknowns.list.len(), routes);
        Self::new(graph, list, unknowns)
    }
}

fn vertices(
    g: &mut Graph,
    value: NodeId,
    coordinates: &Coordinates,
    points: usize,
    routes: &mut Vec<Routes>,
) -> Vec<Whole> {
    let hazards = hazards(g, &[(value, 2)]);
    let of_point = |point: usize| {
        let kind = RoutineKind::Vertex(u8::try_from(point).expect("few points"));
        let own = coordinates.of_point(g, point);
        let (energy, taken) = second_order(g, kind.name(), value, &own);
        routes.push(taken);
        let entry = |row: usize, column: usize| energy.hessian[[[0, 1, 2], [1, 3, 4], [2, 4, 5]][row][column]];
        let block: Vec<NodeId> = (0..9).map(|number| entry(number / 3, number % 3)).collect();
        let reduced = [&[energy.value], &energy.gradient[..], &energy.hessian[..]].concat();
        Whole::new(kind, reduced, vec![vec![energy.value], energy.gradient, block], hazards)
    };
    (0..points).map(of_point).collect()
}

fn force(
    g: &mut Graph,
    f: &[NodeId],
    coordinates: &Coordinates,
    (unknowns, is_mixed): (&Unknowns, bool),
    routes: &mut Vec<Routes>,
) -> Vec<Whole> {
    let (by_position, taken) = first_order(g, RoutineKind::Jacobians.name(), f, coordinates, None);
    routes.push(taken);
    let velocities = Coordinates::reduced(g, f, unknowns, Moving::Velocities);
    let (by_velocity, taken) = first_order(g, "jacobians, by velocity", f, &velocities, None);
    routes.push(taken);
    let reduced = f.iter().copied().chain(by_position.iter().chain(&by_velocity).flatten().copied()).collect();
    let square = |g: &mut Graph, rows: &[Vec<NodeId>], coordinates: &Coordinates| {
        let expanded: Vec<Vec<NodeId>> = rows.iter().map(|row| coordinates.expand_all(g, row)).collect();
        if is_mixed { expanded.concat() } else { in_blocks(&expanded) }
    };
    let full_position = square(g, &by_position, coordinates);
    let full_velocity = square(g, &by_velocity, &velocities);
    let order = |order: u8| f.iter().map(|&node| (node, order)).collect::<Vec<_>>();
    let hazards = [0, 1].map(|i| hazards(g, &order(i)));
    vec![
        Whole::new(RoutineKind::Force, f.to_vec(), vec![f.to_vec()], hazards[0]),
        Whole::new(RoutineKind::Jacobians, reduced, vec![f.to_vec(), full_position, full_velocity], hazards[1]),
    ]
}

/// Arranges the rows of a matrix of points in 3×3 blocks.
fn in_blocks(rows: &[Vec<NodeId>]) -> Vec<NodeId> {
    let points = rows.len() / 3;
    let mut blocks = Vec::with_capacity(9 * points * points);
    for (i, j) in (0..points).flat_map(|i| (0..points).map(move |j| (i, j))) {
        for row in &rows[3 * i..3 * i + 3] {
            blocks.extend_from_slice(&row[3 * j..3 * j + 3]);
        }
    }
    blocks
}

fn residual(g: &mut Graph, r: &[NodeId], coordinates: &Coordinates, routes: &mut Vec<Routes>) -> Vec<Whole> {
    let (jacobian, taken) = first_order(g, RoutineKind::Jacobian.name(), r, coordinates, None);
    routes.push(taken);
    let jacobian = jacobian.concat();
    let order = |order: u8| r.iter().map(|&node| (node, order)).collect::<Vec<_>>();
    let hazards = [0, 1].map(|i| hazards(g, &order(i)));
    vec![
        Whole::new(RoutineKind::Residual, r.to_vec(), vec![r.to_vec()], hazards[0]),
        Whole::new(
            RoutineKind::Jacobian,
            r.iter().chain(&jacobian).copied().collect(),
            vec![r.to_vec(), jacobian],
            hazards[1],
        ),
    ]
}

/// Returns the mask of rest shapes for which a robust primitive is a convention, or a determinant is not positive.
fn refused(rest: &mut RestFormula) -> Option<NodeId> {
    let g = &mut rest.graph;
    let rules = operations(g, &rest.outputs).into_iter().filter_map(|node| g.rule(node));
    let flags = rules.flat_map(|rule| rule.flags.clone());
    let conventions = flags.filter(|flag| flag.order == 0 && flag.flag == Flag::Degenerate).map(|flag| flag.mask);
    let mut masks: Vec<NodeId> = conventions.collect();
    let zero = g.constant(0.0);
    masks.extend(rest.determinants.iter().map(|&determinant| g.less_or_equal(determinant, zero)));
    masks.into_iter().reduce(|a, b| g.or(a, b))
}

/// Lists the primitives for the documentation of the generated type.
fn primitives(g: &Graph, outputs: &[NodeId], list: &[Whole]) -> Vec<&'static str> {
    let values: Vec<NodeId> =
        outputs.iter().chain(list.first().into_iter().flat_map(|r| r.groups.iter().flatten())).copied().collect();
    let mut labels: Vec<&'static str> = Vec::new();
    for rule in operations(g, &values).into_iter().filter_map(|node| g.rule(node)) {
        if let Some(label) = rule.primitive.label().filter(|l| !labels.contains(l)) {
            labels.push(label);
        }
    }
    labels
}
