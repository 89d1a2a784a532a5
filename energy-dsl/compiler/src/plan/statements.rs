//! The statements of a routine in the order of execution.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use crate::graph::{Graph, Input, NodeId, Op};

/// Straight-line code. Each statement is one operation; its operands are the numbers of earlier statements.
#[derive(Clone, Debug, Default)]
pub(crate) struct Statements {
    list: Vec<Op>,
    /// Names that the formula gives to results of statements.
    names: FxHashMap<NodeId, Arc<str>>,
}

impl Statements {
    pub(super) fn of(list: Vec<Op>) -> Self {
        Self { list, names: FxHashMap::default() }
    }

    /// Takes the names of other statements, of which `place` tells the places here.
    pub(super) fn with_names(mut self, of: &Self, place: impl Fn(NodeId) -> Option<NodeId>) -> Self {
        self.names = of.names.iter().filter_map(|(&at, name)| Some((place(at)?, Arc::clone(name)))).collect();
        self
    }

    /// Returns the name that the formula gives to the result of a statement.
    pub(crate) fn name(&self, place: usize) -> Option<&str> {
        let place = NodeId(u32::try_from(place).ok()?);
        self.names.get(&place).map(|name| &**name)
    }

    /// Returns all statements. Those that read an input come just before their first use.
    pub(crate) fn list(&self) -> &[Op] {
        &self.list
    }

    /// Returns the statements with another operation at one place.
    pub(crate) fn with(&self, place: usize, op: Op) -> Self {
        let mut statements = self.clone();
        statements.list[place] = op;
        statements
    }

    /// Returns the last statement that reads the result of each statement; [`RETURNED`] for those in `returned`, and 0
    /// for those that no other reads.
    pub(crate) fn last_uses(&self, returned: impl IntoIterator<Item = NodeId>) -> Vec<usize> {
        let mut last_uses = vec![0; self.list.len()];
        for (place, op) in self.list.iter().enumerate() {
            op.operands().for_each(|operand| last_uses[operand.0 as usize] = place);
        }
        returned.into_iter().for_each(|result| last_uses[result.0 as usize] = RETURNED);
        last_uses
    }
}

/// The last use of a result that is returned.
pub(crate) const RETURNED: usize = usize::MAX;

/// Puts the nodes of a graph in order: each is computed just before its first use.
struct Sequence<'a> {
    graph: &'a Graph,
    places: FxHashMap<NodeId, NodeId>,
    statements: Statements,
}

impl<'a> Sequence<'a> {
    fn new(graph: &'a Graph) -> Self {
        Self { graph, places: FxHashMap::default(), statements: Statements::default() }
    }

    /// Returns the statement that computes a node, after adding those that it needs.
    fn value(&mut self, node: NodeId) -> NodeId {
        let node = self.graph.resolve(node);
        // Uses an explicit stack, because expressions may be deep.
        let mut stack = vec![node];
        while let Some(&next) = stack.last() {
            if self.places.contains_key(&next) {
                stack.pop();
                continue;
            }
            let missing: Vec<NodeId> = self
                .graph
                .fused(next)
                .operands()
                .map(|o| self.graph.resolve(o))
                .filter(|o| !self.places.contains_key(o))
                .collect();
            if missing.is_empty() {
                self.compute(next);
                stack.pop();
            } else {
                stack.extend(missing.into_iter().rev());
            }
        }
        self.places[&node]
    }

    /// Returns the statements that compute some nodes.
    fn values(&mut self, nodes: &[NodeId]) -> Vec<NodeId> {
        nodes.iter().map(|&node| self.value(node)).collect()
    }

    fn compute(&mut self, node: NodeId) {
        self.graph.budget().spend(1, 0);
        let op = self.graph.fused(node).with_operands(|operand| self.places[&self.graph.resolve(operand)]);
        let place = NodeId(u32::try_from(self.statements.list.len()).expect("fewer than 2³² statements"));
        self.places.insert(node, place);
        self.statements.list.push(op);
        self.statements.names.extend(self.graph.names().get(&node).map(|name| (place, Arc::clone(name))));
    }
}

/// The statements of a path of a routine, with its results.
#[derive(Clone, Debug, Default)]
pub(crate) struct Code {
    pub(crate) statements: Statements,
    /// Results by group: value, gradient, ….
    pub(crate) groups: Vec<Vec<NodeId>>,
    /// Masks of the flags: degenerate, kink.
    pub(crate) flags: [Option<NodeId>; 2],
    /// Masks of a general path: outside of the domain, conventions without a limit.
    pub(crate) settled: [Option<NodeId>; 2],
    /// Mask where the ordinary path suffices.
    pub(crate) guard: Option<NodeId>,
}

impl Code {
    /// Puts the statements that compute groups of numbers and flags in order.
    pub(crate) fn new(graph: &Graph, groups: &[Vec<NodeId>], flags: [Option<NodeId>; 2]) -> Self {
        Self::settling(graph, groups, flags, [None, None])
    }

    /// Puts the statements of a general path in order.
    pub(crate) fn settling(
        graph: &Graph,
        groups: &[Vec<NodeId>],
        flags: [Option<NodeId>; 2],
        settled: [Option<NodeId>; 2],
    ) -> Self {
        let mut sequence = Sequence::new(graph);
        let groups = groups.iter().map(|group| sequence.values(group)).collect();
        let [flags, settled] = [flags, settled].map(|masks| masks.map(|mask| mask.map(|node| sequence.value(node))));
        Self { statements: sequence.statements, groups, flags, settled, guard: None }
    }

    /// Puts the statements that compute a guard in order.
    pub(crate) fn guard(graph: &Graph, node: NodeId) -> Self {
        let mut sequence = Sequence::new(graph);
        let guard = Some(sequence.value(node));
        Self { statements: sequence.statements, guard, ..Self::default() }
    }

    /// Adds the statements of a guard. If `shared`, those that the code already has are not repeated.
    pub(crate) fn with_guard(&self, guard: &Self, shared: bool) -> Self {
        let mut code = self.clone();
        let list = &mut code.statements.list;
        let mut known = FxHashMap::default();
        if shared {
            known.extend(list.iter().zip(0..).map(|(&op, place)| (op, NodeId(place))));
        }
        let mut places: Vec<NodeId> = Vec::with_capacity(guard.statements.list.len());
        for op in &guard.statements.list {
            let op = op.with_operands(|operand| places[operand.0 as usize]);
            let place = *known.entry(op).or_insert_with(|| {
                list.push(op);
                NodeId(u32::try_from(list.len() - 1).expect("fewer than 2³² statements"))
            });
            places.push(place);
        }
        code.guard = guard.guard.map(|place| places[place.0 as usize]);
        code
    }

    /// Returns other statements with the same results at other places.
    pub(super) fn on(&self, statements: Statements, place: impl Fn(NodeId) -> NodeId) -> Self {
        let masks = |masks: [Option<NodeId>; 2]| masks.map(|mask| mask.map(&place));
        Self {
            statements,
            groups: self.groups.iter().map(|group| group.iter().map(|&at| place(at)).collect()).collect(),
            flags: masks(self.flags),
            settled: masks(self.settled),
            guard: self.guard.map(&place),
        }
    }

    /// Returns the inputs that the statements read, in order.
    pub(crate) fn inputs(&self) -> Vec<Input> {
        let input = |op: &Op| if let Op::Input(input) = *op { Some(input) } else { None };
        let mut inputs = Vec::new();
        for input in self.statements.list.iter().filter_map(input) {
            if !inputs.contains(&input) {
                inputs.push(input);
            }
        }
        inputs
    }

    /// Returns whether each statement's result is a number of the results, other than through a comparison.
    pub(crate) fn are_numbers_of_results(&self) -> Vec<bool> {
        let list = &self.statements.list;
        let mut reach = vec![false; list.len()];
        self.groups.iter().flatten().for_each(|&at| reach[at.0 as usize] = true);
        for place in (0..list.len()).rev().filter(|&place| !list[place].is_mask()) {
            if reach[place] {
                list[place].operands().for_each(|at| reach[at.0 as usize] = true);
            }
        }
        reach
    }

    /// Returns all results and masks.
    pub(crate) fn returned(&self) -> impl Iterator<Item = NodeId> {
        let masks = self.flags.into_iter().chain(self.settled).chain([self.guard]).flatten();
        self.groups.iter().flatten().copied().chain(masks)
    }
}
