//! Systems of a few vertices of another system.

use std::sync::Arc;

use super::{Counted, System};
use crate::matrix::dof_map::DofMap;
use crate::terms::counts::{Counts, Tally};
use crate::terms::restriction::Restriction;
use crate::threads::for_each;

impl System {
    /// Returns the system of the chosen free vertices; all others count as pinned. It evaluates only elements with a
    /// chosen vertex, so its energies differ from those of this system by constants. `None` if a term cannot be
    /// restricted; see [`PlacedTerm::restricted`](crate::PlacedTerm::restricted). It has no contact.
    ///
    /// # Panics
    /// If there is not one entry per vertex.
    pub fn restricted(&mut self, chosen: &[bool]) -> Option<Self> {
        assert_eq!(chosen.len(), self.dofs.vertex_count(), "expected one entry per vertex");
        let rows: Vec<usize> = (0..self.dofs.free().len()).filter(|&row| chosen[self.dofs.free()[row]]).collect();
        let mut pinned = vec![true; chosen.len()];
        rows.iter().for_each(|&row| pinned[self.dofs.free()[row]] = false);
        let dofs = DofMap::new(&pinned);
        let (pattern, slots) = self.pattern.restricted(&rows);
        let restriction = Restriction { dofs: &dofs, slots: &slots };
        let restricted = |Counted { term, .. }: &mut Counted| {
            Some(Counted { term: term.restricted(&restriction)?, counts: Counts::default() })
        };
        let terms = for_each(self.threads, self.terms.iter_mut().collect(), restricted);
        let terms = terms.into_iter().collect::<Option<_>>()?;
        Some(Self::with_placed(terms, dofs, Arc::new(pattern), self.threads))
    }

    /// Adds the evaluation counts of a restricted system.
    pub fn rejoin(&mut self, restricted: Self) {
        for (whole, Counted { counts, .. }) in self.terms.iter_mut().zip(restricted.terms) {
            // The other elements do not count as skipped: nothing asked for them.
            let asked = |tally: Tally| Tally { skipped: 0, ..tally };
            whole.counts.value += asked(counts.value);
            whole.counts.gradient += asked(counts.gradient);
            whole.counts.hessian += asked(counts.hessian);
            whole.counts.reused += counts.reused;
        }
    }
}
