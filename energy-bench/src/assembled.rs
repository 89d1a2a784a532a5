//! Elements between the vertices of a mesh: what evaluating them costs with gathering, unpacking and assembly.

use std::hint::black_box;

use energy_dsl::{Batch, BatchWork, Lane, Level, Packed, PackedPotential, Potential, Vector3, for_each_batch};
use energy_solve::{BlockMatrix, Curvature, ElementList, LinearisationOptions, PotentialTerm, State, System, Weights};

use crate::run::{TOGETHER, Work};
use crate::subject::{Sample, points};

/// The work of all elements by way of vertices.
pub struct Assembled {
    /// Batches at the best level: points gathered, results turned to one element after the other.
    pub batches: Work,
    /// Elements and vertices in, matrix of blocks out, by [`System::linearise`].
    pub exact: Work,
    /// The same with [`Curvature::Clamped`].
    pub clamped: Work,
}

/// The elements of `samples` on vertices.
pub(crate) fn assembled<E, const N: usize>(samples: &[Sample]) -> Assembled
where
    E: PackedPotential<f64, Wide<f64> = E> + std::fmt::Debug + Sync + 'static,
{
    let elements: Vec<E> = samples.iter().map(|sample| E::load::<f64>(&sample.library, 1)).collect();
    // A strip: each element shares all but one of its vertices with the next, and there are as many vertices as elements, a few more than
    // in a mesh of triangles. It ends where it began, so that no element's vertices meet.
    let last_point = |sample: &Sample| points::<N>(&sample.unknowns)[N - 1];
    let positions: Vec<Vector3<f64>> = samples.iter().chain(&samples[..N - 1]).map(last_point).collect();
    let stencils: Vec<[usize; N]> = (0..samples.len()).map(|i| std::array::from_fn(|p| i + p)).collect();
    let short: Vec<[u32; N]> = stencils.iter().map(|s| s.map(|v| u32::try_from(v).expect("few vertices"))).collect();

    let packed = Packed::new(&elements, &short);
    let gathered = positions.clone();
    let mut results = Results { numbers: vec![0.0; TOGETHER * (1 + 3 * N + 9 * N * (N + 1) / 2)] };
    let batches = Box::new(move || for_each_batch(&packed, &gathered, &mut results));

    let list = ElementList::new("elements", elements, &stencils).expect("as many stencils as elements");
    let linearise = |curvature| linearise(list.clone(), positions.clone(), curvature);
    Assembled { batches, exact: linearise(Curvature::Exact), clamped: linearise(Curvature::Clamped) }
}

fn linearise<E>(list: ElementList<E>, positions: Vec<Vector3<f64>>, curvature: Curvature) -> Work
where
    E: PackedPotential<f64> + std::fmt::Debug + Sync + 'static,
{
    let pinned = vec![false; positions.len()];
    let mut system = System::new(vec![Box::new(PotentialTerm::new(list))], &pinned).expect("the vertices exist");
    let mut matrix: BlockMatrix = system.matrix();
    let velocities = vec![[0.0; 3]; positions.len()];
    let weights = Weights { position: 1.0, velocity: 0.0 };
    let options = LinearisationOptions { weights, curvature, stiffness_times_velocity: false };
    Box::new(move || {
        let forces = system.linearise(State { x: &positions, v: &velocities }, options, &mut matrix);
        black_box((forces.expect("finite elements"), &mut matrix));
    })
}

/// Results of a few elements, one after the other, soon written over.
struct Results {
    numbers: Vec<f64>,
}

impl<E: PackedPotential<f64>> BatchWork<E> for Results {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: Batch<'_, E, L::F64>) {
        let result = batch.element.hessian_at::<L>(batch.points);
        let gradient = result.gradient.as_ref().as_flattened();
        let triangle = result.hessian.as_ref().as_flattened().as_flattened();
        let stride = 1 + gradient.len() + triangle.len();
        let place = batch.first % TOGETHER * stride;
        L::F64::store_transposed(&[result.value], batch.count, &mut self.numbers[place..], stride);
        L::F64::store_transposed(gradient, batch.count, &mut self.numbers[place + 1..], stride);
        L::F64::store_transposed(triangle, batch.count, &mut self.numbers[place + 1 + gradient.len()..], stride);
        black_box(&mut self.numbers);
    }
}
