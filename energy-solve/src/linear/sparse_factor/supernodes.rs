//! Supernodes: columns of the factor that are stored as one dense panel.

use std::ops::Range;

use super::elimination::Elimination;

/// Consecutive columns of the factor with one list of rows.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Supernode {
    /// Its columns, as positions of groups.
    pub columns: Range<usize>,
    /// Its rows in increasing order: first its own columns, then the rows below.
    pub rows: Vec<usize>,
}

/// Finds the supernodes of a factor whose groups have `size` unknowns.
///
/// A column joins the one before if their rows agree. Then a supernode joins its parent while the panel has few zeros;
/// narrow panels may have more (as in CHOLMOD: Chen, Davis, Hager and Rajamanickam, ACM TOMS 35, 2008).
pub(super) fn supernodes(size: usize, elimination: &Elimination) -> Vec<Supernode> {
    let mut found: Vec<Merged> = Vec::new();
    for supernode in fundamental(&elimination.structure) {
        let mut merged = Merged { supernode, zeros: 0 };
        while let Some(child) = found.pop_if(|child| merged.should_take(child, size)) {
            merged.take(child);
        }
        found.push(merged);
    }
    found.into_iter().map(|merged| merged.supernode).collect()
}

/// Groups columns whose rows agree exactly.
fn fundamental(structure: &[Vec<usize>]) -> Vec<Supernode> {
    let continues = |column: usize| {
        let before: &Vec<usize> = &structure[column - 1];
        before.first() == Some(&column) && before.len() == structure[column].len() + 1
    };
    let mut found = Vec::new();
    let mut start = 0;
    for end in 1..=structure.len() {
        if end == structure.len() || !continues(end) {
            let rows = (start..end).chain(structure[end - 1].iter().copied()).collect();
            found.push(Supernode { columns: start..end, rows });
            start = end;
        }
    }
    found
}

/// A supernode with the number of blocks that are stored although they are zero.
struct Merged {
    supernode: Supernode,
    zeros: usize,
}

impl Merged {
    /// Returns the stored blocks, without those above the diagonal.
    fn blocks(&self) -> usize {
        let (rows, columns) = (self.supernode.rows.len(), self.supernode.columns.len());
        rows * columns - columns * (columns - 1) / 2
    }

    /// Returns the zero blocks after a merge with a child.
    fn zeros_with(&self, child: &Self) -> usize {
        let columns = child.supernode.columns.len();
        let rows = columns + self.supernode.rows.len();
        self.zeros + child.zeros + columns * (rows - child.supernode.rows.len())
    }

    /// Whether the supernode before this one is its child, and a merge would store few zeros.
    fn should_take(&self, child: &Self, size: usize) -> bool {
        let parent = child.supernode.rows.get(child.supernode.columns.len());
        if parent.is_none_or(|parent| !self.supernode.columns.contains(parent)) {
            return false;
        }
        let rows = child.supernode.columns.len() + self.supernode.rows.len();
        let columns = child.supernode.columns.len() + self.supernode.columns.len();
        let blocks = rows * columns - columns * (columns - 1) / 2;
        let share = self.zeros_with(child) as f64 / blocks as f64;
        match size * columns {
            ..=4 => true,
            5..=16 => share < 0.8,
            17..=48 => share < 0.1,
            _ => share < 0.05,
        }
    }

    fn take(&mut self, child: Self) {
        self.zeros = self.zeros_with(&child);
        self.supernode.columns.start = child.supernode.columns.start;
        self.supernode.rows.splice(0..0, child.supernode.columns);
        debug_assert!(self.zeros < self.blocks());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dense_matrix_is_one_supernode() {
        let structure = vec![vec![1, 2], vec![2], vec![]];
        assert_eq!(fundamental(&structure), [Supernode { columns: 0..3, rows: vec![0, 1, 2] }]);
    }

    #[test]
    fn columns_of_other_subtrees_stay_apart() {
        // Two leaves below one parent: only the second is followed by its parent.
        let structure = vec![vec![2], vec![2], vec![]];
        let expected = [Supernode { columns: 0..1, rows: vec![0, 2] }, Supernode { columns: 1..3, rows: vec![1, 2] }];
        assert_eq!(fundamental(&structure), expected);
        // A wide group: nothing may be added that stores a zero.
        let elimination = Elimination { positions: vec![0, 1, 2], structure };
        assert_eq!(supernodes(100, &elimination), expected);
    }

    #[test]
    fn narrow_supernodes_merge_in_spite_of_a_zero() {
        let structure = vec![vec![2], vec![2], vec![]];
        let elimination = Elimination { positions: vec![0, 1, 2], structure };
        assert_eq!(supernodes(1, &elimination), [Supernode { columns: 0..3, rows: vec![0, 1, 2] }]);
    }
}
