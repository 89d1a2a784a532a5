//! The hash-consed graph of scalar expressions. Equal expressions are one node, so common subexpressions are shared.
//! Nodes are numbered in topological order: operands come before their uses.

mod build;
mod contraction;
mod count;
mod derivative_forms;
mod differences;
mod fuse;
mod interpret;
mod mask;
mod node;
mod ordinary;
mod origin;
mod powers;
mod recognise;
mod rounding;
mod rule;
mod signs;
mod spectrum;
mod substitute;
mod sums;

pub(crate) use contraction::Contraction;
pub use count::{count, reachable};
pub use derivative_forms::DerivativeForms;
pub(crate) use derivative_forms::{BySquare, OfOneNumber};
pub use interpret::Interpreter;
pub(crate) use node::Spelling;
pub use node::{Input, NodeId, Op};
pub use ordinary::{Assumption, general, ordinary};
pub(crate) use origin::Origin;
pub use recognise::{Ending, Expansion, Recogniser};
pub(crate) use rule::{ComputedAs, upper};
pub use rule::{DihedralParts, Primitive, Product, Rule, symmetric_index};
pub use signs::with_signs_inside;
pub(crate) use spectrum::{Dependence, Spectrum};
pub(crate) use substitute::Substitution;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::budget::{Budget, Limits};

use rustc_hash::FxHashMap;

/// The form that functions are lowered to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Robust primitives with their own derivative rules. Naive spellings of them are recognised.
    Robust,
    /// The form a textbook prints, independent of all rewrites. The audit uses it.
    Textbook,
}

/// The expression graph. Only the constructors in `build.rs` add nodes, and they simplify.
#[derive(Clone, Debug)]
pub struct Graph {
    form: Form,
    /// Naive spellings that become robust forms; empty in the textbook form.
    recognisers: &'static [Recogniser],
    nodes: Vec<Op>,
    varies: Vec<bool>,
    /// Number of uses of each node as an operand.
    users: Vec<u32>,
    index: FxHashMap<Op, NodeId>,
    rules: Vec<Rule>,
    rule_index: FxHashMap<(Primitive, Vec<NodeId>), NodeId>,
    assumptions: Vec<Assumption>,
    /// Origins of vectors, by their components; see `origin.rs`.
    origins: FxHashMap<Vec<NodeId>, Origin>,
    /// Singular values, with the vectors that their derivatives need.
    spectra: Vec<Spectrum>,
    /// Weighted sums of second derivatives that have closed forms.
    contractions: Vec<Contraction>,
    /// Determinants of square matrices. That of a rest shape must be positive.
    determinants: Vec<NodeId>,
    /// Nodes that are rounded before every use; see `fuse.rs`.
    rounded: BTreeSet<NodeId>,
    /// Sums whose terms do not fuse with them.
    unfused: BTreeSet<NodeId>,
    /// Differences of products that absorb a weight; see `sums.rs`.
    weighable: BTreeMap<NodeId, [Product; 2]>,
    /// Whether powers of two move outwards, to meet and cancel.
    outward: bool,
    /// Whether rounding errors are computed and compensated.
    compensated: bool,
    /// Parameters that the formula differentiates by.
    varied: BTreeSet<Input>,
    /// Products and quotients that are powers: bases and exponents.
    powers: FxHashMap<NodeId, (NodeId, f64)>,
    /// Powers by base and positive whole exponent.
    whole_powers: FxHashMap<(NodeId, u32), NodeId>,
    /// The forms in which rules are differentiated.
    derivative_forms: DerivativeForms,
    /// Names that the formula gives to numbers.
    names: FxHashMap<NodeId, Arc<str>>,
    /// Pays for nodes and for passes over them.
    budget: Budget,
}

impl Graph {
    /// Creates an empty graph in the robust form.
    #[must_use]
    pub fn robust(recognisers: &'static [Recogniser]) -> Self {
        Self::new(Form::Robust, recognisers)
    }

    /// Creates an empty graph in the textbook form.
    #[must_use]
    pub fn textbook() -> Self {
        Self::new(Form::Textbook, &[])
    }

    fn new(form: Form, recognisers: &'static [Recogniser]) -> Self {
        Self {
            form,
            recognisers,
            nodes: Vec::new(),
            varies: Vec::new(),
            users: Vec::new(),
            index: FxHashMap::default(),
            rules: Vec::new(),
            rule_index: FxHashMap::default(),
            assumptions: Vec::new(),
            origins: FxHashMap::default(),
            spectra: Vec::new(),
            contractions: Vec::new(),
            determinants: Vec::new(),
            rounded: BTreeSet::new(),
            unfused: BTreeSet::new(),
            weighable: BTreeMap::new(),
            outward: false,
            compensated: true,
            varied: BTreeSet::new(),
            powers: FxHashMap::default(),
            whole_powers: FxHashMap::default(),
            derivative_forms: DerivativeForms::default(),
            names: FxHashMap::default(),
            budget: Budget::new(Limits::NONE),
        }
    }

    /// Sets the budget that pays for nodes. Otherwise nothing is limited.
    #[must_use]
    pub fn paid_by(self, budget: &Budget) -> Self {
        Self { budget: budget.clone(), ..self }
    }

    /// Returns the budget.
    pub(crate) fn budget(&self) -> &Budget {
        &self.budget
    }

    /// Makes an input vary, so that nodes can be differentiated by it. Call it before the input is used.
    pub fn vary(&mut self, input: Input) {
        self.varied.insert(input);
    }

    /// Sets whether rounding errors are computed. Otherwise they are 0, and whatever uses them folds.
    pub fn compensate(&mut self, compensated: bool) {
        self.compensated = compensated;
    }

    /// Sets whether powers of two move out of products and sums.
    pub fn move_outward(&mut self, outward: bool) {
        self.outward = outward;
    }

    /// Returns the last node that was created.
    pub(crate) fn last(&self) -> NodeId {
        NodeId(u32::try_from(self.len().saturating_sub(1)).expect("fewer than 2³² nodes"))
    }

    /// Returns the form that functions are lowered to.
    #[must_use]
    pub fn form(&self) -> Form {
        self.form
    }

    /// Returns the number of nodes.
    #[must_use]
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Returns whether the graph has no nodes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// Returns the operation of a node.
    #[must_use]
    pub fn op(&self, node: NodeId) -> Op {
        self.nodes[node.0 as usize]
    }

    /// Returns all operations, by index.
    pub(crate) fn ops(&self) -> impl Iterator<Item = Op> {
        self.nodes.iter().copied()
    }

    /// Returns whether the node depends on positions, velocities or unknowns, not only on parameters and rest shape.
    #[must_use]
    pub fn varies(&self, node: NodeId) -> bool {
        self.varies[node.0 as usize]
    }

    /// Returns whether the operation of a node is linear in those of its operands that vary.
    pub(crate) fn is_linear(&self, node: NodeId) -> bool {
        match self.op(node) {
            Op::Add(..) | Op::Sub(..) | Op::Neg(_) => true,
            Op::Mul(a, b) => !(self.varies(a) && self.varies(b)),
            Op::Div(_, divisor) => !self.varies(divisor),
            _ => false,
        }
    }

    /// Returns whether all nodes are linear functions of the inputs that vary.
    pub(crate) fn are_linear(&self, nodes: &[NodeId]) -> bool {
        let mut seen = BTreeSet::new();
        let mut stack = nodes.to_vec();
        while let Some(node) = stack.pop() {
            if !self.varies(node) || !seen.insert(node) || matches!(self.op(node), Op::Input(_)) {
                continue;
            }
            if !self.is_linear(node) {
                return false;
            }
            stack.extend(self.op(node).operands());
        }
        true
    }

    /// Returns the rule of a node; `None` if it is not a robust primitive.
    #[must_use]
    pub fn rule(&self, node: NodeId) -> Option<&Rule> {
        match self.op(node) {
            Op::Rule(id) => Some(&self.rules[id as usize]),
            _ => None,
        }
    }

    /// Names a number for readers of the code. A number that has a name keeps it.
    pub(crate) fn name(&mut self, node: NodeId, name: &str) {
        let node = self.resolve(node);
        self.names.entry(node).or_insert_with(|| name.into());
    }

    /// Names what a number has become.
    fn keep_name(&mut self, of: NodeId, copy: NodeId) {
        if let Some(name) = self.names.get(&of).map(Arc::clone) {
            self.names.entry(copy).or_insert(name);
        }
    }

    /// Returns the names of numbers that rules do not replace.
    pub(crate) fn names(&self) -> &FxHashMap<NodeId, Arc<str>> {
        &self.names
    }

    /// Returns the node that computes the value: the rule's expression, or the node itself.
    #[must_use]
    pub fn resolve(&self, mut node: NodeId) -> NodeId {
        while let Some(rule) = self.rule(node) {
            node = rule.value;
        }
        node
    }
}
