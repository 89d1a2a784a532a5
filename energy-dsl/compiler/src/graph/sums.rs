//! Constructors of sums and products, and of vectors of them.

use super::{Graph, NodeId};

impl Graph {
    /// Creates Σ terms, from left to right.
    pub fn sum(&mut self, terms: impl IntoIterator<Item = NodeId>) -> NodeId {
        let mut terms = terms.into_iter();
        match terms.next() {
            None => self.constant(0.0),
            Some(first) => terms.fold(first, |sum, term| self.add(sum, term)),
        }
    }

    /// Creates Σ terms by halves: few additions wait for each other. Terms that are computed anyway do not fuse with it.
    pub(crate) fn pairwise_sum(&mut self, terms: &[NodeId], are_computed: bool) -> NodeId {
        match terms {
            [] => self.constant(0.0),
            [term] => *term,
            _ => {
                let (first, last) = terms.split_at(terms.len() / 2);
                let (first, last) = (self.pairwise_sum(first, are_computed), self.pairwise_sum(last, are_computed));
                if are_computed { self.unfused_sum(first, last) } else { self.add(first, last) }
            }
        }
    }

    /// Creates sum + term for derivatives. A difference of two products may fuse here; in the formula itself it may
    /// not, because it must vanish for equal products (see `fuse.rs`).
    pub fn accumulate(&mut self, sum: NodeId, term: NodeId) -> NodeId {
        match self.opposed_products(sum, term) {
            Some(opposed) => self.fused_difference(opposed),
            None => self.add(sum, term),
        }
    }

    /// Creates Σ aᵢ bᵢ.
    pub fn dot(&mut self, a: &[NodeId], b: &[NodeId]) -> NodeId {
        let products: Vec<_> = a.iter().zip(b).map(|(&x, &y)| self.mul(x, y)).collect();
        self.sum(products)
    }

    /// Creates Σ aᵢ².
    pub fn sum_of_squares(&mut self, a: &[NodeId]) -> NodeId {
        self.dot(a, a)
    }

    /// Creates a × b.
    pub fn cross(&mut self, a: &[NodeId], b: &[NodeId]) -> [NodeId; 3] {
        std::array::from_fn(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let (plus, minus) = (self.mul(a[j], b[k]), self.mul(a[k], b[j]));
            self.sub(plus, minus)
        })
    }

    /// Creates weight · the product of the factors, from left to right.
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

    /// Creates the difference of two products for use as a factor. A weight goes into the leading factor of both, once
    /// for all components that share it.
    pub fn weighable_difference(&mut self, plus: &[NodeId], minus: &[NodeId]) -> NodeId {
        let node = self.fused_product_difference(None, plus, minus);
        let (unsigned, negative) = self.magnitude(node);
        let (plus, minus) = if negative { (minus, plus) } else { (plus, minus) };
        // A difference that folds to one of its factors, such as 0, cannot be weighed through its factors.
        if plus.iter().chain(minus).all(|&factor| self.magnitude(factor).0 < unsigned) {
            self.weighable.entry(unsigned).or_insert_with(|| [plus.to_vec(), minus.to_vec()]);
        }
        node
    }

    fn weighed(&mut self, weight: NodeId, factor: NodeId) -> NodeId {
        let (unsigned, negative) = self.magnitude(factor);
        let Some([plus, minus]) = self.weighable.get(&unsigned).cloned() else { return self.mul(weight, factor) };
        let difference = self.fused_product_difference(Some(weight), &plus, &minus);
        self.signed(difference, negative)
    }

    /// Creates weight · (product of `plus` − product of `minus`), with the second product fused.
    fn fused_product_difference(&mut self, weight: Option<NodeId>, plus: &[NodeId], minus: &[NodeId]) -> NodeId {
        let (last, leading) = minus.split_last().expect("a product has factors");
        let (plus, leading) = (self.product(weight, plus), self.product(weight, leading));
        self.neg_mul_add(leading, *last, plus)
    }

    /// Creates weight · Σ products, with the weight inside each product. Consecutive products that end in the same
    /// factor are added before it multiplies them.
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

    /// Returns whether each product has a factor 0.
    #[must_use]
    pub fn vanishes(&self, products: &[Vec<NodeId>]) -> bool {
        products.iter().all(|factors| factors.iter().any(|&f| self.is(f, 0.0)))
    }

    /// Creates factor · a.
    pub fn scaled(&mut self, factor: NodeId, a: &[NodeId]) -> Vec<NodeId> {
        a.iter().map(|&x| self.mul(factor, x)).collect()
    }
}
