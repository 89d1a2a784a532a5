//! The budget of an audit: counts of operations, so that what an audit leaves out does not depend on the machine.

use std::cell::Cell;
use std::rc::Rc;

use energy_dsl::{Declaration, Kind, Routine};

/// Ordinary calls that a routine may take at a singular input, where it searches for limits.
const CALLS_AT_SINGULAR_INPUTS: u64 = 3000;

/// Counts the operations of an audit, in units of an operation of doubles. Clones share the count.
#[derive(Clone, Debug)]
pub(super) struct Meter {
    spent: Rc<Cell<u64>>,
    /// Operations of the value, and of all routines.
    value: u64,
    all: u64,
    /// Derivatives of the formula that the blocks need.
    derivatives: u64,
}

impl Meter {
    pub(super) fn new(declaration: &Declaration) -> Self {
        let count = |routine: &Routine| routine.full.total() as u64;
        let all = declaration.routines.iter().map(count).sum::<u64>().max(1);
        let value = declaration.routines.iter().map(count).min().unwrap_or(1).max(1);
        let n = declaration.increments() as u64;
        let derivatives = match declaration.kind {
            Kind::Energy | Kind::Constraint => n * (n + 1) / 2 + n,
            Kind::Force => 2 * n,
            Kind::Residual => n,
        };
        Self { spent: Rc::new(Cell::new(0)), value, all, derivatives }
    }

    /// Returns the operations so far.
    pub(super) fn spent(&self) -> u64 {
        self.spent.get()
    }

    fn charge(&self, operations: u64) {
        self.spent.set(self.spent.get().saturating_add(operations));
    }

    /// An evaluation of all blocks, of which some orders are flagged.
    pub(super) fn answer(&self, flagged: usize) {
        self.charge(self.all + flagged as u64 * CALLS_AT_SINGULAR_INPUTS * self.value);
    }

    /// An evaluation of the textbook form.
    pub(super) fn formula(&self) {
        self.charge(self.value);
    }

    /// All blocks by dual numbers.
    pub(super) fn duals(&self) {
        self.charge(8 * self.value * self.derivatives);
    }

    /// All blocks by multi-precision jets, of this number of bits together.
    pub(super) fn truth(&self, bits: usize) {
        self.charge(self.value * self.derivatives * bits as u64 / 4);
    }

    /// All routines in multi-precision, twice.
    pub(super) fn exact_routines(&self) {
        self.charge(100 * self.all);
    }

    /// The compilation of an element with a fault.
    pub(super) fn compilation(&self) {
        self.charge(20 * self.all);
    }
}
