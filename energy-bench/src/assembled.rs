//! Evaluation of elements on the vertices of a mesh: the cost of gathering, transposing and assembly.

use std::hint::black_box;

use energy_dsl::{
    Batch, BatchWork, Block, Kernel, Lane, Level, Packed, PackedPotential, Potential, Vector3, dispatch, for_each_batch,
};
use energy_solve::{BlockMatrix, Curvature, ElementList, LinearisationOptions, PotentialTerm, State, System, Weights};

use crate::sample::{Sample, points};
use crate::vector::{add, sub};
use crate::work::{TOGETHER, Work};

/// Work on all elements as part of a mesh.
pub struct Assembled {
    /// Batches at the best level: points gathered, results transposed to one element after the other.
    pub batches: Work,
    /// [`System::linearise`]: elements and vertices in, block matrix out.
    pub exact: Work,
    /// Assembly alone: clears matrix and forces, then adds precomputed blocks and gradients.
    pub scatter_only: Work,
    /// [`System::linearise`] with [`Curvature::Clamped`].
    pub clamped: Work,
}

/// Places the elements of `samples` on a shared set of vertices.
pub(crate) fn assembled<E, const N: usize>(samples: &[Sample]) -> Assembled
where
    E: PackedPotential<f64, Wide<f64> = E> + std::fmt::Debug + Send + Sync + 'static,
{
    let elements: Vec<E> = samples.iter().map(|sample| E::load::<f64>(&sample.generated, 1)).collect();
    // A strip: consecutive elements share all but one of their vertices. It has about as many vertices as elements,
    // more than a triangle mesh. It ends with the points it began with, and each element's points are distinct.
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
    let mut scatter = Scatter::new(&stencils, system(list.clone(), positions.len()).matrix(), positions.len());
    let scatter_only = Box::new(move || dispatch(&mut scatter));
    Assembled { batches, scatter_only, exact: linearise(Curvature::Exact), clamped: linearise(Curvature::Clamped) }
}

fn system<E>(list: ElementList<E>, vertices: usize) -> System
where
    E: PackedPotential<f64> + std::fmt::Debug + Send + Sync + 'static,
{
    System::new(vec![Box::new(PotentialTerm::new(list))], &vec![false; vertices]).expect("the vertices exist")
}

fn linearise<E>(list: ElementList<E>, positions: Vec<Vector3<f64>>, curvature: Curvature) -> Work
where
    E: PackedPotential<f64> + std::fmt::Debug + Send + Sync + 'static,
{
    let mut system = system(list, positions.len());
    let mut matrix: BlockMatrix = system.matrix();
    let velocities = vec![[0.0; 3]; positions.len()];
    let weights = Weights { position: 1.0, velocity: 0.0 };
    let options = LinearisationOptions::new(weights, curvature);
    Box::new(move || {
        let forces = system.linearise(State { x: &positions, v: &velocities }, options, &mut matrix);
        black_box((forces.expect("finite elements"), &mut matrix));
    })
}

/// Adds precomputed blocks and gradients to a matrix and to forces. The inputs stay in the cache: this measures
/// assembly without evaluation.
struct Scatter<const N: usize> {
    stencils: Vec<[usize; N]>,
    /// Indices of matrix blocks, by element and pair of its points.
    places: Vec<usize>,
    matrix: BlockMatrix,
    forces: Vec<Vector3<f64>>,
    gradient: [Vector3<f64>; N],
    triangle: Vec<Block<f64>>,
}

impl<const N: usize> Scatter<N> {
    fn new(stencils: &[[usize; N]], matrix: BlockMatrix, vertices: usize) -> Self {
        let pairs = stencils.iter().flat_map(|s| (0..N).flat_map(move |i| (i..N).map(move |j| (s[i], s[j]))));
        let places =
            pairs.map(|(row, column)| matrix.pattern().slot(row, column).expect("all are coupled").0).collect();
        let triangle = vec![[[1.0; 3]; 3]; N * (N + 1) / 2 * TOGETHER];
        let forces = vec![[0.0; 3]; vertices];
        Self { stencils: stencils.to_vec(), places, matrix, forces, gradient: [[1.0; 3]; N], triangle }
    }
}

impl<const N: usize> Kernel for &mut Scatter<N> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let pairs = N * (N + 1) / 2;
        let matrix = self.matrix.values_mut();
        matrix.fill([[0.0; 3]; 3]);
        self.forces.fill([0.0; 3]);
        let elements = self.stencils.iter().zip(self.places.chunks_exact(pairs)).enumerate();
        for (element, (stencil, places)) in elements {
            let triangle = &self.triangle[element % TOGETHER * pairs..][..pairs];
            for pair in 0..pairs {
                let block = &mut matrix[places[pair]];
                let rows = *block;
                // All rows are read before any is written, so that the sums stay in registers.
                *block = [0, 1, 2].map(|row| add(rows[row], triangle[pair][row]));
            }
            for point in 0..N {
                let force = &mut self.forces[stencil[point]];
                *force = sub(*force, self.gradient[point]);
            }
        }
        black_box((&mut self.matrix, &mut self.forces));
    }
}

/// Buffer for the results of [`TOGETHER`] elements, overwritten in turn.
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
