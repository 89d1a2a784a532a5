use nalgebra::Vector3;

/// How much each node follows each bone, N × m: rows are zero or sum to one.
#[derive(Clone, Debug, PartialEq)]
pub struct Attachments {
    /// The rows.
    pub rows: Vec<Vec<f64>>,
    /// Whether a row is set at all.
    pub assigned: Vec<bool>,
}

/// What a fill did.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FillReport {
    /// Passes that assigned a node.
    pub passes: usize,
    /// Nodes that no assigned node can be reached from.
    pub left: Vec<usize>,
}

impl Attachments {
    /// Each place follows the bone (a segment) nearest to it wholly, if that is within `reach`; others are not assigned.
    #[must_use]
    pub fn nearest_bone(places: &[Vector3<f64>], bones: &[[Vector3<f64>; 2]], reach: f64) -> Self {
        let (mut rows, mut assigned) = (Vec::new(), Vec::new());
        for place in places {
            let nearest = bones
                .iter()
                .map(|bone| bone_distance(place, bone))
                .enumerate()
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .filter(|(_, distance)| *distance <= reach);
            let mut row = vec![0.0; bones.len()];
            if let Some((bone, _)) = nearest {
                row[bone] = 1.0;
            }
            rows.push(row);
            assigned.push(nearest.is_some());
        }
        Self { rows, assigned }
    }

    /// Rows that are all given.
    #[must_use]
    pub fn given(rows: Vec<Vec<f64>>) -> Self {
        let assigned = vec![true; rows.len()];
        Self { rows, assigned }
    }

    /// One pass, all nodes at once: a node that is not assigned, but has assigned neighbours, becomes their mean. Returns whether any did.
    pub fn fill_once(&mut self, neighbours: &[Vec<usize>]) -> bool {
        let before = self.clone();
        let mut changed = false;
        for (node, around) in neighbours.iter().enumerate() {
            if !before.assigned[node]
                && let Some(mean) = before.mean(around.iter().copied())
            {
                self.rows[node] = mean;
                self.assigned[node] = true;
                changed = true;
            }
        }
        changed
    }

    /// Passes until all nodes are assigned or nothing changes. On a graph whose edges lead both ways only parts without any assigned
    /// node are left.
    pub fn fill(&mut self, neighbours: &[Vec<usize>]) -> FillReport {
        let mut passes = 0;
        while self.assigned.contains(&false) && self.fill_once(neighbours) {
            passes += 1;
        }
        let left = (0..self.rows.len()).filter(|&node| !self.assigned[node]).collect();
        FillReport { passes, left }
    }

    /// One pass, all nodes at once: each becomes the mean of itself and its neighbours, as far as these are assigned.
    pub fn relax_once(&mut self, neighbours: &[Vec<usize>]) {
        let before = self.clone();
        for (node, around) in neighbours.iter().enumerate() {
            if let Some(mean) = before.mean(std::iter::once(node).chain(around.iter().copied())) {
                self.rows[node] = mean;
                self.assigned[node] = true;
            }
        }
    }

    /// |H_i − H_j|².
    #[must_use]
    pub fn square_distance(&self, i: usize, j: usize) -> f64 {
        self.rows[i].iter().zip(&self.rows[j]).map(|(a, b)| (a - b) * (a - b)).sum()
    }

    fn mean(&self, nodes: impl Iterator<Item = usize>) -> Option<Vec<f64>> {
        let known: Vec<&Vec<f64>> = nodes.filter(|&node| self.assigned[node]).map(|node| &self.rows[node]).collect();
        let first = known.first()?;
        let count = known.len() as f64;
        Some((0..first.len()).map(|bone| known.iter().map(|row| row[bone]).sum::<f64>() / count).collect())
    }
}

/// The distance of a place to a segment.
#[must_use]
pub fn bone_distance(place: &Vector3<f64>, [head, tail]: &[Vector3<f64>; 2]) -> f64 {
    let along = tail - head;
    let square = along.norm_squared();
    let part = if square > 0.0 { ((place - head).dot(&along) / square).clamp(0.0, 1.0) } else { 0.0 };
    (place - head - part * along).norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fill_reaches_what_is_connected() {
        let mut h = Attachments {
            rows: vec![vec![1.0, 0.0], vec![0.0; 2], vec![0.0; 2], vec![0.0, 1.0], vec![0.0; 2]],
            assigned: vec![true, false, false, true, false],
        };
        let graph = vec![vec![1], vec![0, 2], vec![1, 3], vec![2], vec![]];
        assert_eq!(h.fill(&graph), FillReport { passes: 1, left: vec![4] });
        assert_eq!(h.rows[1], [1.0, 0.0]);
        assert_eq!(h.rows[2], [0.0, 1.0]);
        h.relax_once(&graph);
        assert_eq!(h.rows[1], [2.0 / 3.0, 1.0 / 3.0]);
        assert!(!h.assigned[4]);
    }

    #[test]
    fn the_nearest_bone_counts_if_it_is_near() {
        let bones = [[Vector3::zeros(), Vector3::x()], [Vector3::y(), 2.0 * Vector3::y()]];
        let places = [Vector3::new(0.5, 0.1, 0.0), Vector3::new(0.0, 3.0, 0.0)];
        let h = Attachments::nearest_bone(&places, &bones, 0.5);
        assert_eq!((h.rows[0].clone(), h.assigned), (vec![1.0, 0.0], vec![true, false]));
        assert_eq!(bone_distance(&places[1], &bones[1]), 1.0);
    }
}
