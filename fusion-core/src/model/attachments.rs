use nalgebra::Vector3;

/// Weights of the bones for each node, N × m. Rows are zero or sum to 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Attachments {
    /// Weights by node, then bone.
    pub rows: Vec<Vec<f64>>,
    /// Whether the row of each node is set.
    pub assigned: Vec<bool>,
}

/// Statistics of a fill.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct FillReport {
    /// Number of passes that assigned a node.
    pub passes: usize,
    /// Nodes without a path to an assigned node.
    pub left: Vec<usize>,
}

impl Attachments {
    /// Assigns each point to the nearest bone (a segment) within `reach`. Points without one are not assigned.
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

    /// Creates attachments from complete rows.
    #[must_use]
    pub fn given(rows: Vec<Vec<f64>>) -> Self {
        let assigned = vec![true; rows.len()];
        Self { rows, assigned }
    }

    /// Runs one simultaneous pass: an unassigned node with assigned neighbours becomes their mean. Returns whether any
    /// node was assigned.
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

    /// Repeats passes until all nodes are assigned or nothing changes. On a symmetric graph, only components without an
    /// assigned node remain.
    pub fn fill(&mut self, neighbours: &[Vec<usize>]) -> FillReport {
        let mut passes = 0;
        while self.assigned.contains(&false) && self.fill_once(neighbours) {
            passes += 1;
        }
        let left = (0..self.rows.len()).filter(|&node| !self.assigned[node]).collect();
        FillReport { passes, left }
    }

    /// Runs one simultaneous pass: each node becomes the mean of itself and its neighbours, of those that are assigned.
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

/// Returns the distance of a point from a segment.
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
    fn a_fill_reaches_connected_nodes() {
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
    fn points_attach_to_the_nearest_bone_within_reach() {
        let bones = [[Vector3::zeros(), Vector3::x()], [Vector3::y(), 2.0 * Vector3::y()]];
        let places = [Vector3::new(0.5, 0.1, 0.0), Vector3::new(0.0, 3.0, 0.0)];
        let h = Attachments::nearest_bone(&places, &bones, 0.5);
        assert_eq!((h.rows[0].clone(), h.assigned), (vec![1.0, 0.0], vec![true, false]));
        assert_eq!(bone_distance(&places[1], &bones[1]), 1.0);
    }
}
