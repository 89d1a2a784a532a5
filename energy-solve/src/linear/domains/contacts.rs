use std::ops::Range;
use std::sync::RwLock;

use energy_dsl::{Block, Level, Vector3};

use super::{InverseFactor, Precision, Wide, scaled};
use crate::contact::{Contact, factors};
use crate::matrix::pattern::index;

/// Marks a vertex of a contact whose row is not in the domain.
const ELSEWHERE: u32 = u32::MAX;

/// The contacts that act on a domain, scaled to Σ g gᵀ without its diagonal blocks. Here g has the 3-vector cᵢ C⁻¹ r at
/// row i, and r rᵀ is a summand of the contact's block.
///
/// A contact between domains is computed by each of them. That costs a few dot products and needs no lock for writing.
#[derive(Clone, Debug)]
pub(crate) struct DomainContacts<T> {
    /// Rows that contacts act on, counted from the first row of the domain, ascending.
    rows: Vec<u32>,
    factors: Vec<ScaledFactor<T>>,
}

#[derive(Clone, Debug)]
struct ScaledFactor<T> {
    /// g of each vertex; zero for a pinned one.
    vectors: [Wide<T>; 4],
    /// The domain of each vertex, and its place among the rows that the domain publishes.
    sources: [[u32; 2]; 4],
    /// The row of each vertex in this domain, or [`ELSEWHERE`].
    targets: [u32; 4],
}

/// No contacts.
impl<T> Default for DomainContacts<T> {
    fn default() -> Self {
        Self { rows: Vec::new(), factors: Vec::new() }
    }
}

/// Returns the diagonal blocks of Σ (c cᵀ) ⊗ B by row; an empty list if there are no contacts.
pub(crate) fn contact_diagonals(contacts: &[Contact], rows: usize) -> Vec<Block<f64>> {
    if contacts.is_empty() {
        return Vec::new();
    }
    let mut diagonals = vec![[[0.0; 3]; 3]; rows];
    for contact in contacts {
        for (row, weight) in contact.free() {
            crate::matrix::vector::add_scaled_block(&mut diagonals[row], weight * weight, &contact.block);
        }
    }
    diagonals
}

/// Distributes contacts over the domains of these rows and scales them with C⁻¹ of each row.
pub(crate) fn distribute<T: Precision>(
    contacts: &[Contact],
    ranges: &[Range<usize>],
    inverses: &[InverseFactor<T>],
) -> Vec<DomainContacts<T>> {
    let mut all: Vec<_> = ranges.iter().map(|_| DomainContacts::default()).collect();
    let local = |row: usize| {
        let domain = ranges.partition_point(|range| range.end <= row);
        (domain, index(row - ranges[domain].start))
    };
    for (row, _) in contacts.iter().flat_map(Contact::free) {
        let (domain, row) = local(row);
        all[domain].rows.push(row);
    }
    for domain in &mut all {
        domain.rows.sort_unstable();
        domain.rows.dedup();
    }
    for contact in contacts {
        let homes: Vec<_> = contact.free().map(|(row, weight)| (row, weight, local(row))).collect();
        let place = |(domain, row): (usize, u32)| {
            let place = all[domain].rows.binary_search(&row).expect("the rows of all contacts were collected");
            [index(domain), index(place)]
        };
        let sources: Vec<_> = homes.iter().map(|&(_, _, home)| place(home)).collect();
        let mut domains: Vec<usize> = homes.iter().map(|(_, _, (domain, _))| *domain).collect();
        domains.sort_unstable();
        domains.dedup();
        for root in factors(contact) {
            for &own in &domains {
                let mut scaled_factor = ScaledFactor {
                    vectors: [[T::from_f64(0.0); 4]; 4],
                    sources: [sources[0]; 4],
                    targets: [ELSEWHERE; 4],
                };
                for (vertex, &(row, weight, (domain, local))) in homes.iter().enumerate() {
                    let root: Vector3<f64> = root.map(|component| weight * component);
                    let [u, v, w] = scaled(&inverses[row], &root).map(T::from_f64);
                    scaled_factor.vectors[vertex] = [u, v, w, T::from_f64(0.0)];
                    scaled_factor.sources[vertex] = sources[vertex];
                    if domain == own {
                        scaled_factor.targets[vertex] = local;
                    }
                }
                all[own].factors.push(scaled_factor);
            }
        }
    }
    all
}

impl<T: Precision> DomainContacts<T> {
    /// Creates the border of the domain: one entry per published row.
    pub(crate) fn border(&self) -> RwLock<Vec<Wide<T>>> {
        RwLock::new(vec![[T::from_f64(0.0); 4]; self.rows.len()])
    }

    /// Copies the rows in contact to where all domains read them.
    #[inline(always)]
    pub(crate) fn publish(&self, vector: &[Wide<T>], border: Option<&RwLock<Vec<Wide<T>>>>) {
        if let (Some(border), false) = (border, self.rows.is_empty()) {
            let mut published = border.write().expect("no other thread panicked");
            for (place, &row) in published.iter_mut().zip(&self.rows) {
                *place = vector[row as usize];
            }
        }
    }

    /// w ← w + K t without the diagonal blocks of K, where t is the vector that the domains published.
    #[inline(always)]
    pub(crate) fn add_product<L: Level>(&self, borders: &[RwLock<Vec<Wide<T>>>], w: &mut [Wide<T>]) {
        if self.factors.is_empty() {
            return;
        }
        let t: Vec<_> = borders.iter().map(|border| border.read().expect("no other thread panicked")).collect();
        for ScaledFactor { vectors, sources, targets } in &self.factors {
            let mut own = [T::from_f64(0.0); 4];
            let mut sum = T::from_f64(0.0);
            for vertex in 0..4 {
                let [domain, place] = sources[vertex];
                let (g, t) = (&vectors[vertex], &t[domain as usize][place as usize]);
                let product = g[0].mul_add::<L>(t[0], g[1].mul_add::<L>(t[1], g[2] * t[2]));
                own[vertex] = product;
                sum = sum + product;
            }
            for vertex in 0..4 {
                if targets[vertex] != ELSEWHERE {
                    let row = &mut w[targets[vertex] as usize];
                    let others = sum - own[vertex];
                    for lane in 0..4 {
                        row[lane] = vectors[vertex][lane].mul_add::<L>(others, row[lane]);
                    }
                }
            }
        }
    }
}
