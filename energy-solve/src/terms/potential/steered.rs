//! Tapes whose parameters a caller changes between evaluations.

use std::sync::{Arc, Mutex, PoisonError};

use energy_dsl::Declaration;
use energy_dsl::tape::TapeElements;

use super::TapeTerm;
use super::changing::{Changing, PlacedChangingTerm};
use super::placed::PlacedPotentialTerm;
use super::tapes::TapePacks;
use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::Pattern;
use crate::terms::active::Active;
use crate::terms::scatter_map::ScatterMaps;
use crate::terms::stencils::Stencils;
use crate::terms::term::{Character, PlacedTerm, Term, TermDescription};

/// The parameters of a [`SteeredTapeTerm`], shared between the term and its caller.
///
/// New elements take effect with the next start of a step; see [`System::begin_step`](crate::System::begin_step).
#[derive(Clone, Debug)]
pub struct SteeredTapes {
    shared: Arc<Mutex<(u64, TapeElements)>>,
}

impl SteeredTapes {
    /// Shares some elements.
    #[must_use]
    pub fn new(elements: TapeElements) -> Self {
        Self { shared: Arc::new(Mutex::new((0, elements))) }
    }

    /// Replaces the elements by others of the same declaration.
    ///
    /// # Panics
    /// If their number differs.
    pub fn replace(&self, elements: TapeElements) {
        let mut shared = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
        assert_eq!(shared.1.len(), elements.len(), "parameters of another number of elements");
        *shared = (shared.0 + 1, elements);
    }

    /// Whether a term, or another copy of this, still shares the elements.
    #[must_use]
    pub fn is_shared(&self) -> bool {
        Arc::strong_count(&self.shared) > 1
    }

    /// Returns the number of replacements, and the elements.
    fn now(&self) -> (u64, TapeElements) {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn version(&self) -> u64 {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner).0
    }
}

/// A [`TapeTerm`] whose parameters change when its caller wants.
///
/// ```no_run
/// # use std::sync::Arc;
/// # use energy_dsl::{Declaration, tape::TapeElements};
/// # fn example(declaration: &Arc<Declaration>, soft: TapeElements, stiff: TapeElements) {
/// use energy_solve::{SteeredTapeTerm, SteeredTapes};
///
/// let springs = SteeredTapes::new(soft);
/// let term = SteeredTapeTerm::new("springs".to_owned(), declaration, springs.clone(), [0, 1, 1, 2]);
/// springs.replace(stiff); // from the next step on
/// # drop(term);
/// # }
/// ```
#[derive(Debug)]
pub struct SteeredTapeTerm {
    term: TapeTerm,
    tapes: SteeredTapes,
    /// The number of replacements when the elements were packed.
    packed: u64,
}

impl SteeredTapeTerm {
    /// Creates the sum of the energies of some elements, as [`TapeTerm::new`] does.
    ///
    /// # Panics
    /// When the declaration is not an energy or constraint, or there are not as many stencils as elements.
    #[must_use]
    pub fn new(
        name: String,
        declaration: &Arc<Declaration>,
        tapes: SteeredTapes,
        vertices: impl IntoIterator<Item = usize>,
    ) -> Self {
        let (packed, elements) = tapes.now();
        Self { term: TapeTerm::new(name, declaration, elements, vertices), tapes, packed }
    }
}

impl TermDescription for SteeredTapeTerm {
    fn name(&self) -> &str {
        self.term.name()
    }

    fn declaration(&self) -> &Declaration {
        self.term.declaration()
    }

    fn character(&self) -> Character {
        Character { quadratic: false, ..self.term.character() }
    }

    fn stencils(&self) -> Stencils<'_> {
        self.term.stencils()
    }
}

impl Changing for SteeredTapeTerm {
    type Packs = TapePacks;

    fn pack(&mut self, _: f64, active: &Active, maps: &ScatterMaps) -> PlacedPotentialTerm<TapePacks> {
        (self.packed, self.term.elements) = self.tapes.now();
        self.term.packed(active, maps)
    }

    fn varies(&self, _: f64, _: f64) -> bool {
        self.tapes.version() != self.packed
    }
}

impl Term for SteeredTapeTerm {
    fn place(self: Box<Self>, dofs: &DofMap, pattern: &Pattern) -> Box<dyn PlacedTerm> {
        Box::new(PlacedChangingTerm::new(*self, dofs, pattern))
    }
}
