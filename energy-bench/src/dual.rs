//! Textbook formulas over the numbers of the crate `num-dual`.

use nalgebra::SVector;
use num_dual::{Dual2Vec, DualNum, hessian};

use crate::sample::Derivatives;

/// A number type of `num-dual` over `f64`.
pub trait Dual: DualNum<Primitive = f64> + Copy {}

impl<D: DualNum<Primitive = f64> + Copy> Dual for D {}

/// Second-order dual numbers: they carry a gradient and a Hessian for `N` variables.
pub type Second<const N: usize> = Dual2Vec<f64, nalgebra::Const<N>>;

/// Returns value, gradient and the upper triangle of Hessian blocks of a function of `POINTS` points. `N` = 3 `POINTS`.
pub fn derivatives<const N: usize, const POINTS: usize, const BLOCKS: usize>(
    coordinates: &[f64],
    function: impl Fn(&[[Second<N>; 3]; POINTS]) -> Second<N>,
) -> Derivatives<f64, POINTS, BLOCKS> {
    let x = SVector::<f64, N>::from_column_slice(coordinates);
    let of_points = |x: SVector<Second<N>, N>| {
        function(&std::array::from_fn(|point| std::array::from_fn(|axis| x[3 * point + axis])))
    };
    let (value, gradient, full) = hessian(of_points, &x);
    let gradient = std::array::from_fn(|point| std::array::from_fn(|axis| gradient[3 * point + axis]));
    let mut blocks = [[[0.0; 3]; 3]; BLOCKS];
    let mut place = 0;
    for i in 0..POINTS {
        for j in i..POINTS {
            for (row, entries) in blocks[place].iter_mut().enumerate() {
                for (column, entry) in entries.iter_mut().enumerate() {
                    *entry = full[(3 * i + row, 3 * j + column)];
                }
            }
            place += 1;
        }
    }
    Derivatives { value, gradient, hessian: blocks }
}

/// a − b.
pub fn sub<D: Dual>(a: &[D; 3], b: &[D; 3]) -> [D; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a·b.
pub fn dot<D: Dual>(a: &[D; 3], b: &[D; 3]) -> D {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a × b.
pub fn cross<D: Dual>(a: &[D; 3], b: &[D; 3]) -> [D; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// ‖a‖.
pub fn norm<D: Dual>(a: &[D; 3]) -> D {
    dot(a, a).sqrt()
}
