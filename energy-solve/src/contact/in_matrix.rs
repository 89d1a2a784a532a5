use std::sync::Arc;

use super::Contact;
use crate::matrix::block_matrix::{BlockMatrix, Contents};
use crate::matrix::precision::Precision;

/// Contacts in a matrix whose pattern has all their blocks, such as those of a fixed obstacle with one triangle.
#[derive(Debug)]
pub struct ContactsInMatrix<T> {
    /// The blocks before the contacts were added, by place in the matrix.
    replaced: Vec<(usize, [[T; 3]; 3])>,
    contents: Option<Arc<Contents>>,
    /// The contacts that do not fit into the pattern.
    pub others: Vec<Contact>,
}

impl<T: Precision> BlockMatrix<T> {
    /// Adds the contacts whose blocks are all in the pattern. Solvers then treat them like every other stiffness.
    /// [`BlockMatrix::remove_contacts`] restores the matrix exactly; until then no system may write to it.
    pub fn add_contacts(&mut self, contacts: Vec<Contact>) -> ContactsInMatrix<T> {
        let pattern = Arc::clone(self.pattern());
        let fits = |contact: &Contact| {
            contact.free().all(|(row, _)| contact.free().all(|(column, _)| pattern.place(row, column).is_some()))
        };
        let (fitting, others): (Vec<_>, Vec<_>) = contacts.into_iter().partition(fits);
        let contents = self.take_contents();
        let mut replaced = Vec::new();
        for contact in &fitting {
            for ((row, c), (column, d)) in contact.free().flat_map(|one| contact.free().map(move |other| (one, other)))
            {
                let Some((place, flipped)) = pattern.place(row, column) else { continue };
                // An upper triangle stores each pair of rows once.
                if flipped {
                    continue;
                }
                let values = self.values_and_nowhere();
                replaced.push((place, values[place]));
                for i in 0..3 {
                    for j in 0..3 {
                        values[place][i][j] = values[place][i][j] + T::from_f64(c * d * contact.block[i][j]);
                    }
                }
            }
        }
        ContactsInMatrix { replaced, contents, others }
    }

    /// Restores the blocks that contacts were added to.
    pub fn remove_contacts(&mut self, contacts: ContactsInMatrix<T>) {
        let values = self.values_and_nowhere();
        for (place, block) in contacts.replaced.into_iter().rev() {
            values[place] = block;
        }
        self.set_contents(contacts.contents);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::pattern::{Pattern, Storage};

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
            let (fits, crosses) = (with([Contact::FIXED, 2, 0, 1]), with([0, 1, 2, 3]));
            let added = matrix.add_contacts(vec![fits, crosses]);
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
