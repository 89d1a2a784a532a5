use std::sync::Arc;

use super::Contact;
use crate::matrix::block_matrix::{BlockMatrix, Contents};
use crate::matrix::pattern::{Pattern, Storage};
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

/// The stored blocks of four rows in a pattern.
struct Blocks {
    rows: [u32; 4],
    /// Whether the pattern has all blocks of the rows.
    fit: bool,
    /// Pairs of corners and the indices of their blocks.
    places: Vec<(usize, usize, usize)>,
}

impl Blocks {
    /// Looks up the blocks of other rows.
    fn find(&mut self, rows: [u32; 4], pattern: &Pattern) {
        self.rows = rows;
        self.places.clear();
        let free = || rows.into_iter().enumerate().filter(|(_, row)| *row != Contact::FIXED);
        // An upper triangle stores each pair of rows once.
        let is_stored = |row: u32, column: u32| pattern.storage() == Storage::Whole || row <= column;
        let pairs = free().flat_map(|one| free().map(move |other| (one, other)));
        self.fit = pairs.filter(|((_, row), (_, column))| is_stored(*row, *column)).all(|((i, row), (j, column))| {
            let place = pattern.place(row as usize, column as usize);
            self.places.extend(place.map(|(place, _)| (i, j, place)));
            place.is_some()
        });
    }
}

impl<T: Precision> BlockMatrix<T> {
    /// Adds the contacts whose blocks are all in the pattern. Solvers then treat them like every other stiffness.
    /// [`BlockMatrix::remove_contacts`] restores the matrix exactly; until then no system may write to it.
    pub fn add_contacts(&mut self, contacts: Vec<Contact>) -> ContactsInMatrix<T> {
        let pattern = Arc::clone(self.pattern());
        let contents = self.take_contents();
        let (mut replaced, mut others) = (Vec::new(), Vec::new());
        // Several contacts of the same vertices follow each other.
        let mut known = Blocks { rows: [Contact::FIXED; 4], fit: true, places: Vec::new() };
        let values = self.values_and_nowhere();
        for contact in contacts {
            if known.rows != contact.rows {
                known.find(contact.rows, &pattern);
            }
            if !known.fit {
                others.push(contact);
                continue;
            }
            for &(i, j, place) in &known.places {
                let scale = contact.weights[i] * contact.weights[j];
                replaced.push((place, values[place]));
                for row in 0..3 {
                    for column in 0..3 {
                        values[place][row][column] =
                            values[place][row][column] + T::from_f64(scale * contact.block[row][column]);
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
