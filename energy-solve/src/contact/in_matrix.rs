use std::sync::Arc;

use super::Contact;
use crate::matrix::block_matrix::{BlockMatrix, Contents};
use crate::matrix::cross_blocks::{CrossBlocks, CrossEntry};
use crate::matrix::pattern::{Pattern, Storage, index};
use crate::matrix::precision::Precision;
use crate::matrix::vector::add_scaled_block;
use crate::threads::for_each;

/// Contacts added to a matrix. Blocks that its pattern has were added there.
#[derive(Debug)]
pub struct ContactsInMatrix<T> {
    /// The blocks before the contacts were added.
    replaced: Vec<Vec<Stored<T>>>,
    contents: Option<Arc<Contents>>,
    /// The blocks that the pattern lacks.
    pub cross: CrossBlocks,
}

/// A block and its slot in a matrix.
type Stored<T> = (u32, [[T; 3]; 3]);

/// The block of two corners of a contact.
struct Pair {
    corners: [usize; 2],
    rows: [u32; 2],
    /// Its slot, if the pattern has it.
    slot: Option<usize>,
}

/// Lists the pairs of corners of four rows whose blocks a matrix of this pattern stores, or would.
fn pairs(corners: [u32; 4], pattern: &Pattern, pairs: &mut Vec<Pair>) {
    pairs.clear();
    let free = || corners.into_iter().enumerate().filter(|(_, row)| *row != Contact::FIXED);
    for (i, row) in free() {
        // An upper triangle stores each pair of rows once, and so do blocks outside of the pattern.
        for (j, column) in free().filter(|(_, column)| row <= *column || pattern.storage() == Storage::Whole) {
            let slot = pattern.slot(row as usize, column as usize).map(|(slot, _)| slot);
            if row <= column || slot.is_some() {
                pairs.push(Pair { corners: [i, j], rows: [row, column], slot });
            }
        }
    }
}

/// Returns the blocks of the contacts that a pattern has, and the summands of the other ones, all times a scale.
/// Contacts of the same vertices that follow each other are summed.
fn located<'a, T: Precision>(
    contacts: &'a [Contact],
    scale: f64,
    pattern: &Pattern,
) -> (Vec<Stored<T>>, Vec<CrossEntry<'a>>) {
    let (mut stored, mut cross) = (Vec::with_capacity(2 * contacts.len()), Vec::new());
    let mut of_contact = Vec::new();
    for same in contacts.chunk_by(|one, other| one.rows == other.rows) {
        pairs(same[0].rows, pattern, &mut of_contact);
        for &Pair { corners: [i, j], rows: [row, column], slot } in &of_contact {
            let shares = same.iter().map(|contact| (scale * contact.weights[i] * contact.weights[j], &contact.block));
            let shares = shares.filter(|(share, _)| *share != 0.0);
            match slot {
                Some(slot) => {
                    let mut sum = [[0.0; 3]; 3];
                    shares.for_each(|(share, block)| add_scaled_block(&mut sum, share, block));
                    stored.push((index(slot), sum.map(|row| row.map(T::from_f64))));
                }
                None => cross.extend(shares.map(|(share, block)| CrossEntry { row, column, share, block })),
            }
        }
    }
    (stored, cross)
}

impl<T: Precision> BlockMatrix<T> {
    /// Adds lists of contacts, times a scale, wherever the pattern has their blocks, and returns the other blocks. At
    /// most `threads` threads look them up. No system may write to the matrix until [`BlockMatrix::remove_contacts`]
    /// restores it exactly.
    pub fn add_contacts(&mut self, contacts: &[Vec<Contact>], scale: f64, threads: usize) -> ContactsInMatrix<T> {
        let contents = self.take_contents();
        let pattern = &**self.pattern();
        let rows = pattern.rows();
        let parts = for_each(threads, contacts.iter().collect(), |part| located(part, scale, pattern));
        let (mut replaced, cross): (Vec<Vec<Stored<T>>>, Vec<_>) = parts.into_iter().unzip();
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
        ContactsInMatrix { replaced, contents, cross: CrossBlocks::summed(rows, &cross) }
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
            // The pattern lacks rows 0 and 3 together.
            let cross: Vec<_> = (0..4).flat_map(|row| added.cross.of_row(row).map(move |it| (row, it.1))).collect();
            assert_eq!(cross, [(0, 3)]);
            assert!((added.cross.blocks()[0][0][0] + 0.25 * 2.0).abs() < 1e-15);
            // c of each of the two contacts at the row and the column, multiplied and summed.
            let expected = [
                (2, 2, 0.0625 + 0.25),
                (2, 0, 0.125 - 0.5),
                (0, 1, 0.125 - 0.25),
                (1, 2, 0.0625 + 0.125),
                (3, 3, 0.0625),
            ];
            for (row, column, c) in expected {
                let change = matrix.block(row, column)[1][2] - before.block(row, column)[1][2];
                assert!((change - 0.25 * c).abs() < 1e-4, "{row} {column}: {change}");
            }
            matrix.remove_contacts(added);
            assert_eq!(matrix.values(), before.values());
        }
    }
}
