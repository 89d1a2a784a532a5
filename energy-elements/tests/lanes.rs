//! Elements in SIMD lanes are bit-identical to scalars, also if one lane is degenerate and another far out of range.

use energy_dsl::{
    BLOCK, Hessians, Kernel, Lane, Level, Packed, PackedPotential, PackedResidual, Potential, Residual, Vector3,
    dispatch, for_each_batch,
};
use energy_elements::{
    AsRigidAsPossible, BaraffWitkinShear, BaraffWitkinStretch, Binding, BlendedMotion4, DistanceBarrier, FlatBending,
    GraphEdge, HairBend, NeoHookean, QuadraticHinge, SquaredDistanceBarrier, StableNeoHookean, StableNeoHookeanLog,
};

/// One full batch and a partial one.
const COUNT: usize = 21;

fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut random = fastrand::Rng::with_seed(seed);
    move || 2.0 * random.f64() - 1.0
}

/// Ordinary points. Every fifth element has coincident points, every seventh tiny ones.
fn points<const N: usize>() -> Vec<Vector3<f64>> {
    let mut draw = numbers(7);
    let element = |number: usize| -> [Vector3<f64>; N] {
        let size = if number % 7 == 6 { 1e-160 } else { 1.0 };
        let mut own = std::array::from_fn(|_| std::array::from_fn(|_| size * draw()));
        if number % 5 == 4 {
            own[1] = own[0];
        }
        own
    };
    (0..COUNT).flat_map(element).collect()
}

fn potential<E, const N: usize>(element: E)
where
    E: PackedPotential<f64> + Potential<f64, Points = [Vector3<f64>; N]>,
{
    let x = points::<N>();
    let stencils: Vec<[u32; N]> = (0..COUNT).map(|e| std::array::from_fn(|p| (N * e + p) as u32)).collect();
    let (mut energies, mut gradients) = (vec![0.0; COUNT], vec![0.0; COUNT * 3 * N]);
    let triangle = 9 * N * (N + 1) / 2;
    let mut triangles = vec![0.0; COUNT * triangle];
    let mut wide =
        Hessians { energies: &mut energies, gradients: &mut gradients, triangles: &mut triangles, flagged: Vec::new() };
    for_each_batch(&Packed::new(&[element; COUNT], &stencils), &x, &mut wide);
    let flagged = wide.flagged;
    let name = &E::DECLARATION.name;
    for (number, own) in x.chunks(N).enumerate() {
        let at = element.hessian(&std::array::from_fn(|p| own[p]));
        let same = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits());
        assert_eq!(at.value.to_bits(), energies[number].to_bits(), "{name} {number}: value");
        let gradient = at.gradient.as_ref().as_flattened();
        assert!(same(gradient, &gradients[3 * N * number..]), "{name} {number}: gradient");
        let hessian = at.hessian.as_ref().as_flattened().as_flattened();
        assert!(same(hessian, &triangles[triangle * number..]), "{name} {number}: Hessian");
        assert!(hessian.iter().all(|x| !x.is_nan()), "{name} {number}: {hessian:?}");
        assert_eq!(at.flags.any(), flagged.iter().any(|(e, _)| *e == number), "{name} {number}: flags");
    }
}

#[test]
fn potentials_over_lanes_have_the_bits_of_scalars() {
    let (u0, u1, u2) = ([0.0, 0.0], [0.75, 0.25], [-0.25, 1.0]);
    potential(AsRigidAsPossible::new(u0, u1, u2, 1.5).unwrap());
    potential(StableNeoHookean::new(u0, u1, u2, 1.5, 2.0).unwrap());
    potential(StableNeoHookeanLog::new(u0, u1, u2, 1.5, 2.0).unwrap());
    potential(NeoHookean::new(u0, u1, u2, 1.5, 2.0).unwrap());
    potential(BaraffWitkinStretch::new(u0, u1, u2, 1.5, 1.0, 1.25).unwrap());
    potential(BaraffWitkinShear::new(u0, u1, u2, 1.5).unwrap());
    potential(FlatBending::new([0.5, 1.0, 0.0], [0.4, -0.9, 0.0], [0.0; 3], [1.0, 0.0, 0.0], 2.0).unwrap());
    potential(DistanceBarrier::new(1.5, 1.25));
    potential(SquaredDistanceBarrier::new(1.5, 1.25));
    potential(HairBend::new(1.5));
    potential(QuadraticHinge::new(1.5, 0.25));
}

/// Jacobians of all elements, evaluated in lanes.
struct Jacobians<'a, E>(&'a [E], &'a [Vec<f64>]);

impl<E: PackedResidual<f64>> Kernel for Jacobians<'_, E> {
    type Output = Vec<Vec<f64>>;

    fn run<L: Level>(self) -> Self::Output {
        let lanes = <L::F64 as Lane<f64>>::LANES;
        let mut results = Vec::new();
        for (elements, unknowns) in self.0.chunks(lanes).zip(self.1.chunks(lanes)) {
            let of = |lane: usize| lane.min(elements.len() - 1);
            let mut numbers = vec![0.0; E::NUMBERS * BLOCK];
            for lane in 0..lanes {
                elements[of(lane)].store(&mut numbers[lane..], BLOCK);
            }
            let wide = E::load::<L::F64>(&numbers, BLOCK);
            let read = |i: usize| L::F64::from_fn(|lane| unknowns[of(lane)][i]);
            let at = wide.jacobian_at::<L>(&energy_dsl::Array::from_fn(read));
            results.extend(
                (0..elements.len()).map(|lane| {
                    at.value.as_ref().iter().chain(at.jacobian.as_ref()).map(|x| x.extract(lane)).collect()
                }),
            );
        }
        results
    }
}

fn residual<E: PackedResidual<f64>>(elements: &[E]) {
    let declaration = E::DECLARATION;
    let unknowns: usize = declaration.points.iter().map(|field| field.size).sum();
    let mut draw = numbers(11);
    // Includes zero and tiny motions and a half turn.
    let size = |number: usize| [1.0, 0.0, 1e-160, 1e-9, 3.0][number % 5];
    let inputs: Vec<Vec<f64>> =
        (0..elements.len()).map(|number| (0..unknowns).map(|_| size(number) * draw()).collect()).collect();
    let wide = dispatch(Jacobians(elements, &inputs));
    for (number, (element, input)) in elements.iter().zip(&inputs).enumerate() {
        let at = element.jacobian(&energy_dsl::Array::from_fn(|i| input[i]));
        let scalar: Vec<f64> = at.value.as_ref().iter().chain(at.jacobian.as_ref()).copied().collect();
        let bits = |numbers: &[f64]| numbers.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&scalar), bits(&wide[number]), "{} {number}", declaration.name);
        assert!(scalar.iter().all(|x| x.is_finite()), "{} {number}: {scalar:?}", declaration.name);
    }
}

#[test]
fn residuals_over_lanes_have_the_bits_of_scalars() {
    residual(&[Binding::new(0.5, [0.1, 0.2, 0.3], [0.2, 0.1, 0.4]); COUNT]);
    residual(&[GraphEdge::new(0.5, [0.1, 0.2, 0.3]); COUNT]);
    residual(&[BlendedMotion4::new(0.5, [0.25, 0.5, 0.125, 0.125], [0.1, 0.2, 0.3], [0.0, 0.6, 0.8]); COUNT]);
}
