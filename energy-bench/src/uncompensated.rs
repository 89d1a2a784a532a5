//! The kernels' elements declared `#[uncompensated]`. They show what compensation costs.

use std::marker::PhantomData;

use energy_dsl::energy;
use energy_dsl::{Array, Kernel, Lane, Level, LevelName, PackedPotential, Potential, Vector3, available, dispatch_at};

use crate::contender::Contender;
use crate::sample::{Answer, Sample, points, potential};
use crate::work::{Doubles, Work, call_each, each_block, lanes, packed};

energy! {
    /// K1 without compensation.
    #[uncompensated]
    pub energy UncompensatedSpring(p, q: Point; K: Scalar[N/m], L: Scalar[m]) = "K/2 (‖p − q‖ − L)²";

    /// K2 without compensation.
    #[uncompensated]
    pub energy UncompensatedHairBend(p0, p1, p2: Point; k: Scalar[J]) {
        let a = p1 - p0;
        let b = p2 - p1;
        "k/2 (1 − â·b̂)"
    }

    /// K3 without compensation.
    #[uncompensated]
    pub energy UncompensatedHinge(x1, x2, x3, x4: Point; k: Scalar[J], θ0: Scalar[rad]) {
        let θ = dihedral(x1, x2, x3, x4);
        "k (θ − θ₀)²"
    }
}

/// Results and contenders of an uncompensated element.
pub struct Uncompensated {
    /// Value, gradient and Hessian blocks, one list per element.
    pub answers: Vec<Vec<f64>>,
    /// The plain method, and lanes at every level.
    pub contenders: Vec<(Contender, Work)>,
}

pub(crate) fn uncompensated<E, const N: usize>(samples: &[Sample]) -> Uncompensated
where
    E: PackedPotential<f64, Wide<f64> = E> + Potential<f64, Points = [Vector3<f64>; N]> + 'static,
{
    let elements: Vec<E> = samples.iter().map(|sample| E::load::<f64>(&sample.generated, 1)).collect();
    let hessian = |element: &E, unknowns: &[f64]| element.hessian(points(unknowns));
    let answers = elements.iter().zip(samples).map(|(element, s)| hessian(element, &s.unknowns).numbers()).collect();
    let unknowns = packed::<f64>(samples, 1, |sample| &sample.unknowns);
    let plain = move || {
        call_each(&elements, &unknowns, hessian, |element, unknowns, result| {
            element.hessian_into(points(unknowns), result);
        });
    };
    let mut contenders: Vec<(Contender, Work)> = vec![(Contender::UncompensatedPlain, Box::new(plain))];
    contenders.extend(available().map(|level| (Contender::UncompensatedLanes(level), over_lanes::<E>(samples, level))));
    Uncompensated { answers, contenders }
}

fn over_lanes<E: PackedPotential<f64> + 'static>(samples: &[Sample], level: LevelName) -> Work {
    let width = lanes::<Doubles>(level).expect("the level is available");
    let numbers = packed::<f64>(samples, width, |sample| &sample.generated);
    Box::new(move || dispatch_at(level, Lanes::<E>(&numbers, PhantomData)).expect("the level is available"))
}

/// Kernel that evaluates the element's Hessian at a level, on numbers [`packed`] for its lanes.
struct Lanes<'a, E>(&'a [f64], PhantomData<E>);

impl<E: PackedPotential<f64>> Kernel for Lanes<'_, E> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let lanes = <L::F64 as Lane<f64>>::LANES;
        let size = (E::NUMBERS + 3 * <<E::Wide<f64> as Potential<f64>>::Points as Array<Vector3<f64>>>::LEN) * lanes;
        each_block!(self.0, size, lanes, |block| potential::<f64, E, L::F64, L>(block, lanes));
    }
}
