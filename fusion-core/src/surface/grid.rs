//! The grid around a model at rest.

use nalgebra::Vector3;

/// A regular grid of voxels; x varies fastest.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    /// Position of voxel (0, 0, 0), in m.
    pub(super) corner: Vector3<f64>,
    /// Distance between voxels, in m.
    pub(super) step: f64,
    /// Voxels along each axis.
    pub(super) size: [usize; 3],
}

impl Grid {
    /// Creates a grid that reaches `margin` m beyond points on every side.
    pub(super) fn enclosing(points: &[Vector3<f64>], margin: f64, step: f64) -> Self {
        let infinite = Vector3::repeat(f64::INFINITY);
        let low = points.iter().fold(infinite, |low, point| low.inf(point)).add_scalar(-margin);
        let high = points.iter().fold(-infinite, |high, point| high.sup(point)).add_scalar(margin);
        let size = (high - low).map(|length| (length / step).ceil() as usize + 1).into();
        Self { corner: low, step, size }
    }

    /// Number of voxels, also if it exceeds the memory.
    pub(super) fn count(&self) -> f64 {
        self.size.iter().map(|&n| n as f64).product()
    }

    /// Number of voxels.
    pub(super) fn len(&self) -> usize {
        self.size.iter().product()
    }

    /// Returns the voxels that share a corner, a side or a face with a voxel.
    pub(super) fn around(&self, index: usize) -> impl Iterator<Item = usize> {
        let [x, y, z] = self.voxel(index);
        let near = |at: usize, size: usize| at.saturating_sub(1)..(at + 2).min(size);
        let [xs, ys, zs] = [near(x, self.size[0]), near(y, self.size[1]), near(z, self.size[2])];
        let rows = zs.flat_map(move |z| ys.clone().map(move |y| (y, z)));
        rows.flat_map(move |(y, z)| xs.clone().map(move |x| self.index([x, y, z]))).filter(move |&at| at != index)
    }

    /// Returns the position of a voxel, in m.
    pub(super) fn place(&self, at: [usize; 3]) -> Vector3<f64> {
        self.corner + self.step * Vector3::from(at.map(|i| i as f64))
    }

    pub(super) fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.size[1] + y) * self.size[0] + x
    }

    pub(super) fn voxel(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.size;
        [index % nx, index / nx % ny, index / (nx * ny)]
    }

    /// Calls `each` with every voxel at most `reach` m from a point.
    pub(super) fn near(&self, point: &Vector3<f64>, reach: f64, mut each: impl FnMut(usize, f64)) {
        let bound = |axis: usize, by: f64| ((point[axis] + by - self.corner[axis]) / self.step).max(0.0);
        let range = |axis: usize| {
            let last = bound(axis, reach).floor() as usize;
            bound(axis, -reach).ceil() as usize..(last + 1).min(self.size[axis])
        };
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    let square = (self.place([x, y, z]) - point).norm_squared();
                    if square <= reach * reach {
                        each(self.index([x, y, z]), square);
                    }
                }
            }
        }
    }

    /// Returns which voxels are connected with the grid's boundary through voxels that are not `closed`, by steps along
    /// the axes.
    pub(super) fn outside(&self, closed: impl Fn(usize) -> bool) -> Vec<bool> {
        let total = self.len();
        let mut outside = vec![false; total];
        let on_boundary = |at: [usize; 3]| (0..3).any(|axis| at[axis] == 0 || at[axis] + 1 == self.size[axis]);
        let mut open: Vec<usize> = (0..total).filter(|&at| !closed(at) && on_boundary(self.voxel(at))).collect();
        open.iter().for_each(|&at| outside[at] = true);
        while let Some(index) = open.pop() {
            let at = self.voxel(index);
            for axis in 0..3 {
                for next in [at[axis].wrapping_sub(1), at[axis] + 1] {
                    if next >= self.size[axis] {
                        continue;
                    }
                    let mut to = at;
                    to[axis] = next;
                    let to = self.index(to);
                    if !outside[to] && !closed(to) {
                        outside[to] = true;
                        open.push(to);
                    }
                }
            }
        }
        outside
    }
}
