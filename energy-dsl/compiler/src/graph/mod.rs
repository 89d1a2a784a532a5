//! The hash-consed scalar expression graph. Equal expressions are one node, so sharing is found by construction, and
//! nodes are numbered in topological order: operands before their uses.

mod build;
mod count;
mod fuse;
mod mask;
mod node;
mod ordinary;
mod origin;
mod recognise;
mod rounding;
mod rule;
mod signs;
mod sums;

pub use count::{count, reachable};
pub use node::{Input, NodeId, Op};
pub use ordinary::{Assumption, general, ordinary};
pub(crate) use origin::Origin;
pub use recognise::{Ending, Recogniser};
pub use rule::{DihedralParts, Primitive, Product, Rule, symmetric_index};
pub use signs::with_signs_inside;

use std::collections::{BTreeMap, BTreeSet, HashMap};

/// How language functions are lowered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// To robust primitives with their own derivative rules; naive spellings of them are recognised.
    Robust,
    /// As a textbook prints them: the audit's independent form.
    Textbook,
}

/// The graph. Only its constructors in `build.rs` add nodes, and they simplify.
#[derive(Clone, Debug)]
pub struct Graph {
    form: Form,
    /// Naive spellings that become robust forms; empty in the textbook form.
    recognisers: &'static [Recogniser],
    nodes: Vec<Op>,
    varies: Vec<bool>,
    /// How many nodes each is an operand of.
    users: Vec<u32>,
    index: HashMap<Op, NodeId>,
    rules: Vec<Rule>,
    rule_index: HashMap<(Primitive, Vec<NodeId>), NodeId>,
    assumptions: Vec<Assumption>,
    /// What was made of what, by components; see `origin.rs`.
    origins: HashMap<Vec<NodeId>, Origin>,
    /// Nodes that no sum takes along unrounded; see `fuse.rs`.
    rounded: BTreeSet<NodeId>,
    /// Differences of products that a weight goes into; see `sums.rs`.
    weighable: BTreeMap<NodeId, [Product; 2]>,
    /// Whether powers of two move out of products and sums, to meet and cancel.
    outward: bool,
    /// Whether rounding errors are computed, to be added where they matter.
    compensated: bool,
}

impl Graph {
    /// An empty graph in the robust form.
    #[must_use]
    pub fn robust(recognisers: &'static [Recogniser]) -> Self {
        Self::new(Form::Robust, recognisers)
    }

    /// An empty graph in the textbook form.
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
            index: HashMap::new(),
            rules: Vec::new(),
            rule_index: HashMap::new(),
            assumptions: Vec::new(),
            origins: HashMap::new(),
            rounded: BTreeSet::new(),
            weighable: BTreeMap::new(),
            outward: false,
            compensated: true,
        }
    }

    /// Whether rounding errors are computed; otherwise each is taken as 0, and vanishes with what is made of it.
    pub fn compensate(&mut self, compensated: bool) {
        self.compensated = compensated;
    }

    /// Whether powers of two move out of products and sums.
    pub fn move_outward(&mut self, outward: bool) {
        self.outward = outward;
    }

    /// How functions are lowered into it.
    #[must_use]
    pub fn form(&self) -> Form {
        self.form
    }

    /// The number of nodes ever made.
    #[must_use]
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Whether it has no nodes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// What a node computes.
    #[must_use]
    pub fn op(&self, node: NodeId) -> Op {
        self.nodes[node.0 as usize]
    }

    /// Whether the node depends on positions, velocities or unknowns (and not on parameters and rest shape alone).
    #[must_use]
    pub fn varies(&self, node: NodeId) -> bool {
        self.varies[node.0 as usize]
    }

    /// The rule behind a node, if it is a robust primitive.
    #[must_use]
    pub fn rule(&self, node: NodeId) -> Option<&Rule> {
        match self.op(node) {
            Op::Rule(id) => Some(&self.rules[id as usize]),
            _ => None,
        }
    }

    /// The node that computes the value: a rule's own expression, or the node itself.
    #[must_use]
    pub fn resolve(&self, mut node: NodeId) -> NodeId {
        while let Some(rule) = self.rule(node) {
            node = rule.value;
        }
        node
    }
}
