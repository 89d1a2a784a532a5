//! Items whose boxes overlap a box.

use energy_dsl::{Kernel, Level, dispatch};

use super::{Hierarchy, RoundedMovingBounds, Volume};

impl<B: Volume> Hierarchy<B> {
    /// Calls `found` with each item whose box overlaps a box, in tree order. Boxes are rounded outwards to single
    /// precision.
    pub fn near(&self, bounds: &B, found: impl FnMut(usize)) {
        dispatch(Near { tree: self, bounds, found });
    }
}

/// Finds all items near a box.
struct Near<'a, B, F> {
    tree: &'a Hierarchy<B>,
    bounds: &'a B,
    found: F,
}

impl<B: Volume, F: FnMut(usize)> Kernel for Near<'_, B, F> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { tree, bounds, mut found } = self;
        let rounded = RoundedMovingBounds::around(bounds);
        // Halving the items at each level keeps the depth below the number of bits of their count.
        let (mut waiting, mut end) = ([0; 64], 1);
        while end > 0 {
            end -= 1;
            let number = waiting[end];
            let node = &tree.nodes[number];
            if !node.bounds.overlaps(bounds) {
                continue;
            }
            match node.second {
                None => {
                    for position in tree.rounded.overlapping::<L, B>(node.from, node.to, &rounded) {
                        found(tree.items[position]);
                    }
                }
                Some(second) => {
                    [waiting[end], waiting[end + 1]] = [second, number + 1];
                    end += 2;
                }
            }
        }
    }
}
