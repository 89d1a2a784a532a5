use std::sync::Arc;

use energy_dsl::Block;

use super::Contact;
use crate::matrix::block_matrix::{BlockMatrix, Contents};
use crate::matrix::pattern::{Pattern, Storage, index};
use crate::matrix::precision::Precision;
use crate::matrix::vector::add_scaled_block;
use crate::threads::for_each;

/// Contacts in a matrix whose pattern has all their blocks, such as those of a fixed obstacle with one triangle.
#[derive(Debug)]
pub struct ContactsInMatrix<T> {
    /// The blocks before the contacts were added.
    replaced: Vec<Vec<Stored<T>>>,
    contents: Option<Arc<Contents>>,
    /// The contacts that do not fit into the pattern, times the scale.
    pub others: Vec<Contact>,
}

/// A block and its slot in a matrix.
type Stored<T> = (u32, [[T; 3]; 3]);

/// The pairs of corners of a stencil that a matrix stores, with the slots of their blocks.
#[derive(Default)]
struct Slots(Vec<(usize, usize, usize)>);

impl Slots {
    /// Looks up the blocks of four rows. Returns whether the pattern has all of them.
    fn find(&mut self, rows: [u32; 4], pattern: &Pattern) -> bool {
        self.0.clear();
        let free = || rows.into_iter().enumerate().filter(|(_, row)| *row != Contact::FIXED);
        // An upper triangle stores each pair of rows once.
        let is_stored = |row: u32, column: u32| pattern.storage() == Storage::Whole || row <= column;
        let pairs = free().flat_map(|one| free().map(move |other| (one, other)));
        pairs.filter(|((_, row), (_, column))| is_stored(*row, *column)).all(|((i, row), (j, column))| {
            let found = pattern.slot(row as usize, column as usize);
            self.0.extend(found.map(|(slot, _)| (i, j, slot)));
            found.is_some()
        })
    }
}

/// Returns the blocks of the contacts that fit into a pattern, and the other contacts, all times a scale. Contacts of
/// the same vertices that follow each other are summed.
fn in_pattern<T: Precision>(contacts: &[Contact], scale: f64, pattern: &Pattern) -> (Vec<Stored<T>>, Vec<Contact>) {
    let (mut stored, mut others) = (Vec::with_capacity(2 * contacts.len()), Vec::new());
    let mut slots = Slots::default();
    for same in contacts.chunk_by(|one, other| one.rows == other.rows) {
        if !slots.find(same[0].rows, pattern) {
            let scaled = |block: Block<f64>| block.map(|row| row.map(|entry| scale * entry));
            others.extend(same.iter().map(|contact| Contact { block: scaled(contact.block), ..*contact }));
            continue;
        }
        for &(i, j, slot) in &slots.0 {
            let mut sum = [[0.0; 3]; 3];
            for Contact { weights, block, .. } in same {
                add_scaled_block(&mut sum, scale * weights[i] * weights[j], block);
            }
            stored.push((index(slot), sum.map(|row| row.map(T::from_f64))));
        }
    }
    (stored, others)
}

impl<T: Precision> BlockMatrix<T> {
    /// Adds lists of contacts, times a scale, if their blocks are all in the pattern. At most `threads` threads look
    /// them up. Solvers then treat them like every other stiffness. No system may write to the matrix until
    /// [`BlockMatrix::remove_contacts`] restores it exactly.
    pub fn add_contacts(&mut self, contacts: &[Vec<Contact>], scale: f64, threads: usize) -> ContactsInMatrix<T> {
        let contents = self.take_contents();
        let pattern = &**self.pattern();
        let parts = for_each(threads, contacts.iter().collect(), |part| in_pattern(part, scale, pattern));
        let (mut replaced, others): (Vec<Vec<Stored<T>>>, Vec<_>) = parts.into_iter().unzip();
        let values = self.values_and_nowhere();
        for (slot, block) in replaced.iter_mut().flatten() {
            let value = &mut values[*slot as usize];
            let added = std::mem::replace(block, *value);
            for row in 0..3 {
                for column in 0..3 {
                    value[row][column] = value[row][column] + added[row][column];
                }
            }
        }
        ContactsInMatrix { replaced, contents, others: others.concat() }
    }

    /// Restores the blocks that contacts were added to.
    pub fn remove_contacts(&mut self, contacts: ContactsInMatrix<T>) {
        let values = self.values_and_nowhere();
        // Several contacts may share a block.
        for (slot, block) in contacts.replaced.into_iter().rev().flat_map(|part| part.into_iter().rev()) {
            values[slot as usize] = block;
        }
        self.set_contents(contacts.contents);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contacts_in_the_pattern_are_added_and_removed_without_a_trace() {
        let stencils = [[0_u32, 1, 2], [1, 2, 3]];
        let block = [[2.0, 0.5, 0.0], [0.5, 1.0, 0.25], [0.0, 0.25, 3.0]];
        let with = |rows: [u32; 4]| Contact { rows, weights: [1.0, -0.25, -0.5, -0.25], block };
        for storage in [Storage::Upper, Storage::Whole] {
            let pattern = Pattern::from_stencils(storage, 4, stencils.iter().map(|stencil| &stencil[..]));
            let mut matrix = BlockMatrix::<f32>::zeros(Arc::new(pattern));
            for (number, value) in matrix.values_mut().as_flattened_mut().as_flattened_mut().iter_mut().enumerate() {
                *value = 0.1 + number as f32;
            }
            let before = matrix.clone();
            let half = |contact: Contact| Contact { block: contact.block.map(|row| row.map(|e| 0.5 * e)), ..contact };
            let (fits, crosses) = (with([Contact::FIXED, 2, 0, 1]), with([0, 1, 2, 3]));
            let added = matrix.add_contacts(&[vec![half(fits)], vec![half(crosses)]], 2.0, 1);
            assert_eq!(added.others, [crosses]);
            for (row, column, c) in [(2, 2, 0.0625), (2, 0, 0.125), (0, 1, 0.125), (1, 2, 0.0625), (3, 3, 0.0)] {
                let change = matrix.block(row, column)[1][2] - before.block(row, column)[1][2];
                assert!((change - 0.25 * c).abs() < 1e-4, "{row} {column}: {change}");
            }
            matrix.remove_contacts(added);
            assert_eq!(matrix.values(), before.values());
        }
    }
}
