//! Terms: elements of one type, with the unknowns that each acts on.

use std::fmt::Debug;
use std::marker::PhantomData;

use energy_dsl::{Declaration, Element, Field, FieldKind, PackedMixed, PackedPotential, Stateful};

use super::body::{MixedBody, UnknownKind};
use super::elements::{Elements, Kernels, Listed, OfMixed, OfPoints, StateRoutines, Unplaced};
use super::error::MixedError;
use crate::matrix::index;

/// The sum of the potentials of some elements, with the indices of the unknowns that each acts on.
///
/// The stencil of an element lists, in the order of the declaration, the body's unknowns that hold its declared ones. A
/// declared vector or array takes one unknown or several whose numbers add up to its size, a rotation takes one unknown
/// of that kind. Unknowns that are declared `shared` are indices among the body's shared unknowns.
#[derive(Debug)]
pub struct MixedTerm {
    name: String,
    declaration: &'static Declaration,
    elements: Box<dyn Unplaced>,
    /// Increments of an element.
    increments: usize,
    /// Whether the elements are evaluated at points: then each declared unknown takes one vector of 3.
    on_points: bool,
    /// Indices in declared order, `arity` for each element.
    stencils: Vec<usize>,
    arity: usize,
    count: usize,
}

impl MixedTerm {
    /// Creates the sum of potentials of mixed unknowns. The name tells people what the term is: "bending and twist".
    ///
    /// # Errors
    /// If the numbers of elements and stencils differ.
    pub fn new<E, const N: usize>(
        name: impl Into<String>,
        elements: Vec<E>,
        stencils: &[[usize; N]],
    ) -> Result<Self, MixedError>
    where
        E: PackedMixed<f64> + Debug + Send + Sync + 'static,
    {
        Self::of::<E, OfMixed, N>(name.into(), elements, stencils, None)
    }

    /// [`MixedTerm::new`] for elements with a state, which [`MixedSystem::advance`](super::MixedSystem::advance)
    /// replaces after each accepted step.
    ///
    /// # Errors
    /// If the numbers of elements and stencils differ.
    pub fn with_state<E, const N: usize>(
        name: impl Into<String>,
        elements: Vec<E>,
        stencils: &[[usize; N]],
    ) -> Result<Self, MixedError>
    where
        E: PackedMixed<f64> + Stateful<f64> + Debug + Send + Sync + 'static,
    {
        Self::of::<E, OfMixed, N>(name.into(), elements, stencils, Some(StateRoutines::new()))
    }

    /// Creates the sum of potentials of points: springs, weights, shells. Stencils list unknowns that are vectors of 3.
    ///
    /// # Errors
    /// If the numbers of elements and stencils differ.
    pub fn of_points<E, const N: usize>(
        name: impl Into<String>,
        elements: Vec<E>,
        stencils: &[[usize; N]],
    ) -> Result<Self, MixedError>
    where
        E: PackedPotential<f64> + Debug + Send + Sync + 'static,
    {
        Self::of::<E, OfPoints, N>(name.into(), elements, stencils, None)
    }

    /// [`MixedTerm::of_points`] for elements with a state.
    ///
    /// # Errors
    /// If the numbers of elements and stencils differ.
    pub fn of_points_with_state<E, const N: usize>(
        name: impl Into<String>,
        elements: Vec<E>,
        stencils: &[[usize; N]],
    ) -> Result<Self, MixedError>
    where
        E: PackedPotential<f64> + Stateful<f64> + Debug + Send + Sync + 'static,
    {
        Self::of::<E, OfPoints, N>(name.into(), elements, stencils, Some(StateRoutines::new()))
    }

    fn of<E, K, const N: usize>(
        term: String,
        elements: Vec<E>,
        stencils: &[[usize; N]],
        routines: Option<StateRoutines<E>>,
    ) -> Result<Self, MixedError>
    where
        E: energy_dsl::Stored<f64> + Debug + Send + Sync + 'static,
        K: Kernels<E>,
    {
        if elements.len() != stencils.len() {
            let (elements, stencils) = (elements.len(), stencils.len());
            return Err(MixedError::CountMismatch { term, elements, stencils });
        }
        Ok(Self {
            name: term,
            declaration: <E as Element>::DECLARATION,
            count: elements.len(),
            elements: Box::new(Listed { elements, routines, kernels: PhantomData::<K> }),
            increments: K::increments(),
            on_points: K::ON_POINTS,
            stencils: stencils.as_flattened().to_vec(),
            arity: N,
        })
    }

    /// Returns the name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Finds the unknowns of the elements in a body.
    ///
    /// # Errors
    /// If a stencil does not fit the declaration or the body.
    pub(super) fn place(self, body: &MixedBody) -> Result<Placed, MixedError> {
        let mut unknowns = Vec::with_capacity(self.stencils.len());
        let mut kinds: Vec<UnknownKind> = Vec::new();
        for element in 0..self.count {
            let stencil = &self.stencils[element * self.arity..][..self.arity];
            let first = unknowns.len();
            self.resolve(element, stencil, body, &mut unknowns)?;
            let own = unknowns[first..].iter().map(|&unknown| body.all()[unknown as usize].kind);
            if element == 0 {
                kinds = own.collect();
            } else if let Some((place, (found, expected))) =
                own.zip(&kinds).enumerate().find(|(_, (found, expected))| found != *expected)
            {
                let expected = format!("a {expected}, as element 0 has");
                return Err(self.wrong_kind(element, "this unknown", expected, stencil[place], found));
            }
        }
        let is_active = |stencil: &[u32]| stencil.iter().any(|&unknown| !body.all()[unknown as usize].fixed);
        let stencils = unknowns.chunks_exact(self.arity.max(1)).enumerate();
        let active: Vec<u32> =
            stencils.filter(|(_, stencil)| is_active(stencil)).map(|(element, _)| index(element)).collect();
        let numbers: Vec<u32> = unknowns.iter().flat_map(|&unknown| numbers_of(body, unknown)).collect();
        let points = self.on_points.then(|| points_of(body, &unknowns));
        let elements = self.elements.place(&active, points.as_ref().unwrap_or(&numbers), numbers.clone());
        Ok(Placed {
            name: self.name,
            on_points: self.on_points,
            elements,
            increments: self.increments,
            kinds,
            unknowns,
            active,
            count: self.count,
        })
    }

    /// Appends the body's unknowns of an element: the shared ones are counted on from the own ones.
    fn resolve(
        &self,
        element: usize,
        stencil: &[usize],
        body: &MixedBody,
        unknowns: &mut Vec<u32>,
    ) -> Result<(), MixedError> {
        let (fields, first) = (&*self.declaration.points, unknowns.len());
        let term = || self.name.clone();
        let wrong_count = || MixedError::WrongCount {
            term: term(),
            element,
            declared: fields.len(),
            numbers: self.declaration.unknowns(),
            found: stencil.len(),
        };
        let mut given = stencil.iter().copied();
        for field in fields {
            let (which, count, start) = if field.shared {
                ("shared unknown", body.shared_len(), body.len())
            } else {
                ("unknown", body.len(), 0)
            };
            let mut left = field.size;
            while left > 0 {
                let unknown = given.next().ok_or_else(wrong_count)?;
                if unknown >= count {
                    return Err(MixedError::Missing { term: term(), element, which, unknown, count });
                }
                let kind = body.all()[start + unknown].kind;
                if !self.takes(field, kind, left) {
                    let expected = match field.kind {
                        FieldKind::Rotation => "a rotation".to_owned(),
                        _ if left < field.size => format!("{} numbers, of which {left} are left", field.size),
                        _ => format!("{left} numbers"),
                    };
                    return Err(self.wrong_kind(element, &field.name, expected, unknown, kind));
                }
                let unknown_of_body = index(start + unknown);
                if unknowns[first..].contains(&unknown_of_body) {
                    return Err(MixedError::Repeated { term: term(), element, unknown });
                }
                unknowns.push(unknown_of_body);
                left -= kind.numbers();
            }
        }
        if given.next().is_some() { Err(wrong_count()) } else { Ok(()) }
    }

    /// Whether a declared unknown, of which `left` numbers are left, takes an unknown of this kind.
    fn takes(&self, field: &Field, kind: UnknownKind, left: usize) -> bool {
        let same_motion = (field.kind == FieldKind::Rotation) == (kind == UnknownKind::Rotation);
        same_motion && kind.numbers() <= left && (!self.on_points || kind == UnknownKind::Vector3)
    }

    fn wrong_kind(
        &self,
        element: usize,
        field: &str,
        expected: String,
        unknown: usize,
        found: UnknownKind,
    ) -> MixedError {
        let (term, field, found) = (self.name.clone(), field.to_owned(), found.to_string());
        MixedError::WrongKind { term, element, field, expected, unknown, found }
    }
}

/// Returns the positions of an unknown's numbers in configurations.
fn numbers_of(body: &MixedBody, unknown: u32) -> impl Iterator<Item = u32> {
    let unknown = body.all()[unknown as usize];
    (unknown.number..unknown.number + unknown.kind.numbers()).map(index)
}

/// Returns the number of each of these unknowns among the body's vectors of 3.
fn points_of(body: &MixedBody, unknowns: &[u32]) -> Vec<u32> {
    let mut next = 0;
    let point = |unknown: &super::body::Unknown| {
        let number = next;
        next += u32::from(unknown.kind == UnknownKind::Vector3);
        number
    };
    let points: Vec<u32> = body.all().iter().map(point).collect();
    unknowns.iter().map(|&unknown| points[unknown as usize]).collect()
}

/// A term whose unknowns are known.
#[derive(Debug)]
pub(super) struct Placed {
    pub(super) name: String,
    /// Whether the elements are evaluated at points.
    pub(super) on_points: bool,
    pub(super) elements: Box<dyn Elements>,
    /// Increments of an element.
    pub(super) increments: usize,
    /// Kinds of an element's unknowns.
    pub(super) kinds: Vec<UnknownKind>,
    /// Indices among all unknowns of the body, as many for each element as there are kinds.
    pub(super) unknowns: Vec<u32>,
    /// The elements with a free unknown, which are the packed ones.
    pub(super) active: Vec<u32>,
    /// Number of elements.
    pub(super) count: usize,
}

impl Placed {
    /// Returns the unknowns of a packed element.
    pub(super) fn stencil(&self, place: usize) -> &[u32] {
        &self.unknowns[self.active[place] as usize * self.kinds.len()..][..self.kinds.len()]
    }
}
