//! The elimination order, and the rows of each column of the factor.

use crate::matrix::pattern::Pattern;

/// An elimination order of groups, and the pattern of the factor.
pub(super) struct Elimination {
    /// Position of each group.
    pub positions: Vec<usize>,
    /// Rows below the diagonal of each column of the factor, in increasing order.
    pub structure: Vec<Vec<usize>>,
}

impl Elimination {
    /// Orders the groups of a symmetric pattern by approximate minimum degree (Amestoy, Davis and Duff, SIAM J. Matrix
    /// Anal. Appl. 17, 1996), then so that subtrees of the elimination tree are consecutive.
    pub fn new(pattern: &Pattern) -> Self {
        let by_degree = minimum_degree(pattern);
        let parents = tree(&neighbours(pattern, &by_degree, Side::Before));
        let later = postorder(&parents);
        let positions: Vec<usize> = by_degree.into_iter().map(|position| later[position]).collect();
        let structure = structure(neighbours(pattern, &positions, Side::After));
        Self { positions, structure }
    }
}

/// Returns the position of each group in an approximate minimum degree order.
fn minimum_degree(pattern: &Pattern) -> Vec<usize> {
    let groups = pattern.rows();
    let starts: Vec<isize> = (0..=groups).map(|row| pattern.first_in(row) as isize).collect();
    let columns: Vec<isize> = pattern.columns().iter().map(|&column| column as isize).collect();
    match amd::order(groups as isize, &starts, &columns, &amd::Control::default()) {
        Ok((_, positions, _)) => positions.into_iter().map(|position| position as usize).collect(),
        // Only patterns with indices out of range are refused.
        Err(status) => unreachable!("the pattern of a matrix is valid: {status:?}"),
    }
}

/// Neighbours that are eliminated before or after a group.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    Before,
    After,
}

/// Returns the neighbours of each position on one side.
fn neighbours(pattern: &Pattern, positions: &[usize], side: Side) -> Vec<Vec<usize>> {
    let mut lists = vec![Vec::new(); positions.len()];
    for row in 0..positions.len() {
        for (_, column) in pattern.row(row) {
            let (a, b) = (positions[row], positions[column]);
            let (early, late) = (a.min(b), a.max(b));
            match side {
                _ if early == late => {}
                Side::Before => lists[late].push(early),
                Side::After => lists[early].push(late),
            }
        }
    }
    lists
}

/// Returns the elimination tree: the parent of a column is the first row below its diagonal (Liu, SIAM J. Matrix Anal.
/// Appl. 11, 1990). `before` has the neighbours before each column.
fn tree(before: &[Vec<usize>]) -> Vec<Option<usize>> {
    let mut parents = vec![None; before.len()];
    // Shortcuts to the root of each subtree so far.
    let mut roots: Vec<Option<usize>> = vec![None; before.len()];
    for (column, neighbours) in before.iter().enumerate() {
        for &neighbour in neighbours {
            let mut at = neighbour;
            while at != column {
                match roots[at].replace(column) {
                    Some(above) => at = above,
                    None => {
                        parents[at] = Some(column);
                        break;
                    }
                }
            }
        }
    }
    parents
}

/// Returns the position of each column in a postorder of the tree.
fn postorder(parents: &[Option<usize>]) -> Vec<usize> {
    let mut children = vec![Vec::new(); parents.len()];
    let mut stack = Vec::new();
    for (column, parent) in parents.iter().enumerate().rev() {
        match parent {
            Some(parent) => children[*parent].push(column),
            None => stack.push(column),
        }
    }
    let mut positions = vec![0; parents.len()];
    let mut visited = 0;
    while let Some(&column) = stack.last() {
        match children[column].pop() {
            Some(child) => stack.push(child),
            None => {
                stack.pop();
                positions[column] = visited;
                visited += 1;
            }
        }
    }
    positions
}

/// Returns the rows below the diagonal of each column of the factor: the neighbours after it, and the rows of the
/// columns whose first row it is.
fn structure(after: Vec<Vec<usize>>) -> Vec<Vec<usize>> {
    let mut structure = after;
    let mut children = vec![Vec::new(); structure.len()];
    let mut last_seen = vec![usize::MAX; structure.len()];
    for column in 0..structure.len() {
        let mut rows = std::mem::take(&mut structure[column]);
        rows.retain(|&row| std::mem::replace(&mut last_seen[row], column) != column);
        for &child in &children[column] {
            let inherited: &Vec<usize> = &structure[child];
            rows.extend(inherited[1..].iter().filter(|&&row| std::mem::replace(&mut last_seen[row], column) != column));
        }
        rows.sort_unstable();
        if let Some(&parent) = rows.first() {
            children[parent].push(column);
        }
        structure[column] = rows;
    }
    structure
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::pattern::Storage;

    /// Two paths that meet: 0 – 1 – 4 – 3 – 2, and an isolated group 5.
    const LINKS: [[u32; 2]; 4] = [[0, 1], [1, 4], [2, 3], [3, 4]];

    #[test]
    fn an_order_visits_each_group_once_and_makes_no_fill_on_a_path() {
        let pattern = Pattern::from_stencils(Storage::Upper, 6, LINKS.iter().map(<[u32; 2]>::as_slice));
        let Elimination { positions, structure } = Elimination::new(&pattern);
        let mut sorted = positions.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, [0, 1, 2, 3, 4, 5]);
        assert_eq!(structure.iter().map(Vec::len).sum::<usize>(), 4);
    }

    #[test]
    fn a_tree_and_its_postorder_follow_the_first_rows() {
        // An arrow: all groups are neighbours of the last one only.
        let parents = tree(&[vec![], vec![], vec![], vec![0, 1, 2]]);
        assert_eq!(parents, [Some(3), Some(3), Some(3), None]);
        // Two interleaved subtrees become consecutive.
        let parents = [Some(2), Some(3), Some(4), Some(4), None];
        let positions = postorder(&parents);
        assert_eq!(positions, [0, 2, 1, 3, 4]);
    }

    #[test]
    fn a_star_that_is_eliminated_from_its_centre_fills_in() {
        let lists = structure(vec![vec![1, 2, 3], vec![], vec![], vec![]]);
        assert_eq!(lists, [vec![1, 2, 3], vec![2, 3], vec![3], vec![]]);
    }
}
