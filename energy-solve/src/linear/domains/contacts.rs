use std::ops::Range;
use std::sync::RwLock;

use energy_dsl::{Block, Level, Vector3};

use super::{InverseFactor, Precision, Wide, scaled};
use crate::contact::{Contact, factors};
use crate::matrix::pattern::index;
use crate::threads::for_each;

/// Marks a vertex of a contact whose row is not in the domain.
const ELSEWHERE: u32 = u32::MAX;
/// Contacts that a thread scales at a time.
const PART: usize = 1024;

/// The contacts that act on a domain, scaled to Σ g gᵀ without its diagonal blocks. Here g has the 3-vector cᵢ C⁻¹ r at
/// row i, and r rᵀ is a summand of the contact's block.
///
/// A contact between domains is computed by each of them. That costs a few dot products and needs no lock for writing.
#[derive(Clone, Debug)]
pub(crate) struct DomainContacts<T> {
    /// Rows that contacts act on, counted from the first row of the domain, ascending.
    rows: Vec<u32>,
    /// One list for each part of the contacts.
    factors: Vec<Vec<ScaledFactor<T>>>,
}

#[derive(Clone, Debug)]
struct ScaledFactor<T> {
    /// g of each vertex; zero for a pinned one.
    vectors: [Wide<T>; 4],
    /// The domain of each vertex, and its number among the rows that the domain publishes.
    sources: [[u32; 2]; 4],
    /// The row of each vertex in this domain, or [`ELSEWHERE`].
    targets: [u32; 4],
}

/// A set without contacts.
impl<T> Default for DomainContacts<T> {
    fn default() -> Self {
        Self { rows: Vec::new(), factors: Vec::new() }
    }
}

/// Returns the diagonal blocks of Σ (c cᵀ) ⊗ B by row; an empty list without contacts.
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
    threads: usize,
) -> Vec<DomainContacts<T>> {
    let (mut all, locations) = published(contacts, ranges);
    let parts = contacts.chunks(PART).collect();
    for part in for_each(threads, parts, |part| scaled_factors(part, ranges.len(), &locations, inverses)) {
        for (domain, factors) in all.iter_mut().zip(part) {
            domain.factors.push(factors);
        }
    }
    all
}

/// Returns the summands of some contacts for each domain.
fn scaled_factors<T: Precision>(
    contacts: &[Contact],
    domains: usize,
    locations: &[Location],
    inverses: &[InverseFactor<T>],
) -> Vec<Vec<ScaledFactor<T>>> {
    let mut all: Vec<_> = (0..domains).map(|_| Vec::new()).collect();
    for contact in contacts {
        let mut vertices = [Vertex::default(); 4];
        let mut count = 0;
        for (row, weight) in contact.free() {
            vertices[count] = Vertex { row, weight, location: locations[row] };
            count += 1;
        }
        let vertices = &vertices[..count];
        let Some(first) = vertices.first() else { continue };
        for root in factors(contact) {
            let mut scaled_factor = ScaledFactor {
                vectors: [[T::from_f64(0.0); 4]; 4],
                sources: [[first.location.domain, first.location.published]; 4],
                targets: [ELSEWHERE; 4],
            };
            for (number, &Vertex { row, weight, location }) in vertices.iter().enumerate() {
                let root: Vector3<f64> = root.map(|component| weight * component);
                let [u, v, w] = scaled(&inverses[row], &root).map(T::from_f64);
                scaled_factor.vectors[number] = [u, v, w, T::from_f64(0.0)];
                scaled_factor.sources[number] = [location.domain, location.published];
            }
            for (number, Vertex { location: Location { domain, .. }, .. }) in vertices.iter().enumerate() {
                let is_first = vertices[..number].iter().all(|before| before.location.domain != *domain);
                if is_first {
                    let target = |vertex: &Vertex| {
                        if vertex.location.domain == *domain { vertex.location.row } else { ELSEWHERE }
                    };
                    vertices.iter().zip(&mut scaled_factor.targets).for_each(|(vertex, t)| *t = target(vertex));
                    all[*domain as usize].push(scaled_factor.clone());
                }
            }
        }
    }
    all
}

/// A free vertex of a contact.
#[derive(Clone, Copy, Default)]
struct Vertex {
    row: usize,
    weight: f64,
    location: Location,
}

/// The location of a row.
#[derive(Clone, Copy, Default)]
struct Location {
    domain: u32,
    /// Its number within the domain.
    row: u32,
    /// Its number among the rows that the domain publishes.
    published: u32,
}

/// Returns the rows of each domain that contacts act on, and the location of each such row.
fn published<T>(contacts: &[Contact], ranges: &[Range<usize>]) -> (Vec<DomainContacts<T>>, Vec<Location>) {
    let mut is_touched = vec![false; ranges.last().map_or(0, |range| range.end)];
    contacts.iter().flat_map(Contact::free).for_each(|(row, _)| is_touched[row] = true);
    let mut locations = vec![Location::default(); is_touched.len()];
    let mut all = Vec::new();
    for (domain, range) in ranges.iter().enumerate() {
        let mut rows = Vec::new();
        for row in range.clone().filter(|&row| is_touched[row]) {
            let own = index(row - range.start);
            locations[row] = Location { domain: index(domain), row: own, published: index(rows.len()) };
            rows.push(own);
        }
        all.push(DomainContacts { rows, factors: Vec::new() });
    }
    (all, locations)
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
            for (target, &row) in published.iter_mut().zip(&self.rows) {
                *target = vector[row as usize];
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
        for ScaledFactor { vectors, sources, targets } in self.factors.iter().flatten() {
            let mut own = [T::from_f64(0.0); 4];
            let mut sum = T::from_f64(0.0);
            for vertex in 0..4 {
                let [domain, row] = sources[vertex];
                let (g, t) = (&vectors[vertex], &t[domain as usize][row as usize]);
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
