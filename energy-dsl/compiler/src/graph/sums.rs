//! Constructors made of others: sums, products, and those of vectors.

use super::{Graph, NodeId};

impl Graph {
    /// Σ terms, left to right.
    pub fn sum(&mut self, terms: impl IntoIterator<Item = NodeId>) -> NodeId {
        let mut terms = terms.into_iter();
        match terms.next() {
            None => self.constant(0.0),
            Some(first) => terms.fold(first, |sum, term| self.add(sum, term)),
        }
    }

    /// sum + term, as derivatives are added up: of a difference of two products one is fused. Those that a formula itself forms
    /// are not, for they must vanish where the products are equal; see `fuse.rs`.
    pub fn accumulate(&mut self, sum: NodeId, term: NodeId) -> NodeId {
        match self.opposed_products(sum, term) {
            Some(opposed) => self.fused_difference(opposed),
            None => self.add(sum, term),
        }
    }

    /// Σ aᵢ bᵢ.
    pub fn dot(&mut self, a: &[NodeId], b: &[NodeId]) -> NodeId {
        let products: Vec<_> = a.iter().zip(b).map(|(&x, &y)| self.mul(x, y)).collect();
        self.sum(products)
    }

    /// Σ aᵢ².
    pub fn sum_of_squares(&mut self, a: &[NodeId]) -> NodeId {
        self.dot(a, a)
    }

    /// a × b.
    pub fn cross(&mut self, a: &[NodeId], b: &[NodeId]) -> [NodeId; 3] {
        std::array::from_fn(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let (plus, minus) = (self.mul(a[j], b[k]), self.mul(a[k], b[j]));
            self.sub(plus, minus)
        })
    }

    /// weight · the factors, from left to right.
    pub fn product(&mut self, weight: Option<NodeId>, factors: &[NodeId]) -> NodeId {
        match (weight, factors) {
            (Some(weight), [first, rest @ ..]) => {
                let weighed = self.weighed(weight, *first);
                rest.iter().fold(weighed, |product, &factor| self.mul(product, factor))
            }
            _ => {
                let one = self.constant(1.0);
                factors.iter().fold(weight.unwrap_or(one), |product, &factor| self.mul(product, factor))
            }
        }
    }

    /// The difference of two products, as a factor of others: what weighs that weighs what leads the two, once for all
    /// components that share it.
    pub fn weighable_difference(&mut self, plus: &[NodeId], minus: &[NodeId]) -> NodeId {
        let node = self.fused_product_difference(None, plus, minus);
        let (unsigned, negative) = self.magnitude(node);
        let (plus, minus) = if negative { (minus, plus) } else { (plus, minus) };
        self.weighable.entry(unsigned).or_insert_with(|| [plus.to_vec(), minus.to_vec()]);
        node
    }

    fn weighed(&mut self, weight: NodeId, factor: NodeId) -> NodeId {
        let (unsigned, negative) = self.magnitude(factor);
        let Some([plus, minus]) = self.weighable.get(&unsigned).cloned() else { return self.mul(weight, factor) };
        let difference = self.fused_product_difference(Some(weight), &plus, &minus);
        self.signed(difference, negative)
    }

    /// weight · (the product of `plus` − that of `minus`), the second fused.
    fn fused_product_difference(&mut self, weight: Option<NodeId>, plus: &[NodeId], minus: &[NodeId]) -> NodeId {
        let (last, leading) = minus.split_last().expect("a product has factors");
        let (plus, leading) = (self.product(weight, plus), self.product(weight, leading));
        self.neg_mul_add(leading, *last, plus)
    }

    /// weight · Σ products, the weight going into each. Products that follow each other and end in the same factor are added
    /// before it multiplies them.
    pub fn sum_of_products(&mut self, weight: Option<NodeId>, products: &[Vec<NodeId>]) -> NodeId {
        let mut terms = Vec::with_capacity(products.len());
        for group in products.chunk_by(|a, b| a.len() > 1 && b.len() > 1 && a.last() == b.last()) {
            let term = match group {
                [factors] => self.product(weight, factors),
                _ => {
                    let common = *group[0].last().expect("more than one factor");
                    let kept: Vec<_> = group.iter().map(|factors| factors[..factors.len() - 1].to_vec()).collect();
                    let sum = self.sum_of_products(weight, &kept);
                    self.mul(sum, common)
                }
            };
            terms.push(term);
        }
        let zero = self.constant(0.0);
        terms.into_iter().fold(zero, |sum, term| self.accumulate(sum, term))
    }

    /// Whether each product has a factor 0.
    #[must_use]
    pub fn vanishes(&self, products: &[Vec<NodeId>]) -> bool {
        products.iter().all(|factors| factors.iter().any(|&f| self.is(f, 0.0)))
    }

    /// factor · a.
    pub fn scaled(&mut self, factor: NodeId, a: &[NodeId]) -> Vec<NodeId> {
        a.iter().map(|&x| self.mul(factor, x)).collect()
    }
}
