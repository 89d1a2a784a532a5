use energy_compiler::Interpreted;
use energy_dsl::{Block, Declaration, Flags, Inputs, Mask, RestError, Vector3, triangle_index};
use energy_solve::{
    Character, Curvature, DofMap, Linearisation, Pattern, PlacedTerm, Quantity, State, Stencils, Tally, Term,
    TermDescription, TrianglePlaces, change_dense, index,
};

/// A term of a declaration that was read at run time. Interprets its compiled routines operation by operation: 10 to
/// 100 times slower than generated code, with the same results up to rounding.
#[derive(Debug)]
pub(crate) struct InterpretedTerm {
    name: String,
    element: Interpreted,
    stencils: Vec<u32>,
    arity: usize,
    bound: Vec<Bound>,
    /// Indices of the elements with a free vertex.
    active: Vec<usize>,
    places: TrianglePlaces,
}

/// The constants of one element.
#[derive(Debug)]
struct Bound {
    parameters: Vec<f64>,
    rest: Vec<f64>,
}

/// The results of a routine, by group, and whether an element was flagged.
type Results = (Vec<Vec<f64>>, bool);

impl InterpretedTerm {
    /// Creates a term. Each stencil has as many vertices as the declaration has points; `inputs` holds the flattened
    /// parameters and rest shape of each element.
    ///
    /// # Errors
    /// Returns the index of the first element that rejects its rest shape, and why.
    pub(crate) fn new(
        name: String,
        element: Interpreted,
        stencils: Vec<usize>,
        inputs: Vec<(Vec<f64>, Vec<f64>)>,
    ) -> Result<Self, (usize, RestError)> {
        let bind = |(number, (parameters, rest)): (usize, (Vec<f64>, Vec<f64>))| {
            let at = Inputs { parameters: &parameters, rest: &rest, positions: &[], velocities: &[] };
            element.check_rest(&at).map_err(|error| (number, error))?;
            Ok(Bound { parameters, rest })
        };
        let bound = inputs.into_iter().enumerate().map(bind).collect::<Result<Vec<_>, _>>()?;
        let arity = element.declaration().points.len();
        let stencils = stencils.into_iter().map(index).collect();
        Ok(Self { name, element, stencils, arity, bound, active: Vec::new(), places: TrianglePlaces::default() })
    }

    fn stencil(&self, number: usize) -> &[u32] {
        &self.stencils[number * self.arity..][..self.arity]
    }

    fn run(&self, routine: &str, number: usize, x: &[Vector3<f64>]) -> Results {
        let positions: Vec<f64> = self.stencil(number).iter().flat_map(|&vertex| x[vertex as usize]).collect();
        let Bound { parameters, rest } = &self.bound[number];
        let inputs = Inputs { parameters, rest, positions: &positions, velocities: &[] };
        let (groups, Flags { degenerate, kink }) =
            self.element.routine(routine, &inputs).expect("checked").expect("energies have this routine");
        (groups, degenerate.any() || kink.any())
    }

    fn tally(&self, flagged: u64, projected: u64) -> Tally {
        let evaluated = self.active.len() as u64;
        Tally { evaluated, skipped: self.bound.len() as u64 - evaluated, flagged, projected }
    }

    /// Subtracts an element's gradient from the forces.
    fn subtract_gradient(&self, number: usize, gradient: &[f64], force: &mut [Vector3<f64>]) {
        for (point, &vertex) in self.stencil(number).iter().enumerate() {
            (0..3).for_each(|axis| force[vertex as usize][axis] -= gradient[3 * point + axis]);
        }
    }

    /// Subtracts an element's ∇²U v from the product.
    fn subtract_product(
        &self,
        number: usize,
        triangle: &[Block<f64>],
        v: &[Vector3<f64>],
        product: &mut [Vector3<f64>],
    ) {
        let stencil = self.stencil(number);
        for (i, &p) in stencil.iter().enumerate() {
            for (j, &q) in stencil.iter().enumerate() {
                let block = &triangle[triangle_index(self.arity, i.min(j), i.max(j))];
                for row in 0..3 {
                    let entry = |column: usize| if i <= j { block[row][column] } else { block[column][row] };
                    product[p as usize][row] -= (0..3).map(|column| entry(column) * v[q as usize][column]).sum::<f64>();
                }
            }
        }
    }
}

impl TermDescription for InterpretedTerm {
    fn name(&self) -> &str {
        &self.name
    }

    fn declaration(&self) -> &'static Declaration {
        self.element.declaration()
    }

    fn character(&self) -> Character {
        let Declaration { quadratic, curved, .. } = *self.element.declaration();
        Character { symmetric: true, velocity_dependent: false, quadratic, curved }
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils::new(self.arity, &self.stencils)
    }
}

impl Term for InterpretedTerm {
    fn place(mut self: Box<Self>, dofs: &DofMap, pattern: &Pattern) -> Box<dyn PlacedTerm> {
        let is_free = |stencil: &[u32]| stencil.iter().any(|&vertex| dofs.place(vertex as usize).is_some());
        self.active = (0..self.bound.len()).filter(|&number| is_free(self.stencil(number))).collect();
        if self.character().curved {
            self.places = TrianglePlaces::new(self.stencils(), dofs, pattern);
        }
        self
    }
}

impl PlacedTerm for InterpretedTerm {
    fn has_energy(&self) -> bool {
        true
    }

    fn energy(&self, x: &[Vector3<f64>]) -> Option<(f64, Tally)> {
        let (mut sum, mut flagged) = (0.0, 0);
        for &number in &self.active {
            let (groups, flag) = self.run("value", number, x);
            sum += groups[0][0];
            flagged += u64::from(flag);
        }
        Some((sum, self.tally(flagged, 0)))
    }

    fn element_energies(&self, x: &[Vector3<f64>]) -> Option<Vec<(usize, f64)>> {
        Some(self.active.iter().map(|&number| (number, self.run("value", number, x).0[0][0])).collect())
    }

    fn add_force(&self, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        let mut flagged = 0;
        for &number in &self.active {
            let (groups, flag) = self.run("gradient", number, state.x);
            self.subtract_gradient(number, &groups[1], force);
            flagged += u64::from(flag);
        }
        self.tally(flagged, 0)
    }

    fn add_linearisation(&self, State { x, v }: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        let (mut flagged, mut projected) = (0, 0);
        for &number in &self.active {
            let (groups, flag) = self.run("hessian", number, x);
            self.subtract_gradient(number, &groups[1], sum.force);
            let mut triangle: Vec<Block<f64>> = groups[2]
                .chunks_exact(9)
                .map(|block| std::array::from_fn(|i| std::array::from_fn(|j| block[3 * i + j])))
                .collect();
            if sum.curvature != Curvature::Exact {
                projected += u64::from(change_dense(&mut triangle, self.arity, sum.curvature));
            }
            self.places.add(number, -sum.weights.position, &triangle, &mut sum.matrix);
            if let Some(product) = &mut sum.stiffness_times_velocity {
                self.subtract_product(number, &triangle, v, product);
            }
            flagged += u64::from(flag);
        }
        self.tally(flagged, projected)
    }

    fn find_non_finite(&self, quantity: Quantity, state: State<'_>) -> Option<usize> {
        let is_finite = |number: &&usize| {
            let (groups, _) = self.run("gradient", **number, state.x);
            let group = if quantity == Quantity::Energy { &groups[0] } else { &groups[1] };
            group.iter().all(|number| number.is_finite())
        };
        self.active.iter().find(|number| !is_finite(number)).copied()
    }
}
