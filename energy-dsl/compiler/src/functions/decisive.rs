//! Arguments that decide the operations of a function. They must be constants where the function is lowered: numbers
//! that are read at run time cannot replace them.

use super::Function;

/// Decisive arguments, by the function's name and the argument's index.
const DECISIVE_ARGUMENTS: &[(&str, usize)] = &[("[]", 1), ("^", 1)];

impl Function {
    /// Returns whether an argument decides the operations: the index of a component, or an exponent, which makes a
    /// power a product, a root or a general power.
    #[must_use]
    pub(crate) fn is_decided_by(&self, argument: usize) -> bool {
        DECISIVE_ARGUMENTS.contains(&(self.name, argument))
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Lowered, RECOGNISERS, Shape, all};
    use crate::graph::{Graph, Input};

    const SHAPES: &[Shape] = &[
        Shape::Scalar,
        Shape::Vector(2),
        Shape::Vector(3),
        Shape::Vector(4),
        Shape::Matrix(2, 2),
        Shape::Matrix(3, 2),
        Shape::Matrix(3, 3),
        Shape::Matrix(4, 4),
        Shape::Quat,
        Shape::Motion,
        Shape::DualQuat,
        Shape::Twist,
        Shape::Truth,
    ];

    /// Returns the lists of up to four shapes.
    fn lists() -> Vec<Vec<Shape>> {
        let mut lists = vec![Vec::new()];
        let mut last = lists.clone();
        for _ in 0..4 {
            last = last.iter().flat_map(|list| SHAPES.iter().map(|&shape| [&list[..], &[shape]].concat())).collect();
            lists.extend(last.iter().cloned());
        }
        lists
    }

    /// Returns inputs of a shape.
    fn read(g: &mut Graph, shape: Shape, first: u16) -> Lowered {
        let parts = (0..).take(shape.size()).map(|i| g.input(Input::Position(first + i))).collect::<Vec<_>>();
        match shape {
            Shape::Truth => {
                let zero = g.constant(0.0);
                Lowered::truth(g.less(parts[0], zero))
            }
            _ => Lowered { shape, parts },
        }
    }

    #[test]
    fn all_other_arguments_may_be_read_at_run_time() {
        let lists = lists();
        for function in all() {
            for shapes in lists.iter().filter(|list| (function.shape)(list).is_ok()) {
                let mut g = Graph::robust(RECOGNISERS);
                let mut arguments = Vec::new();
                for (place, &shape) in shapes.iter().enumerate() {
                    let number = place as u16 * 16;
                    arguments.push(match function.is_decided_by(place) {
                        true => Lowered::scalar(g.constant(0.0)),
                        false => read(&mut g, shape, number),
                    });
                }
                (function.lower)(&mut g, &arguments);
            }
        }
    }
}
