//! Sums of products whose common factors are taken out. Derivatives of matrices are outer products, and sums of their
//! products are products of sums: Σ_pq (a_p b_q)(c_p d_q) = (Σ_p a_p c_p)(Σ_q b_q d_q).

use std::collections::BTreeMap;

use super::forward::Sparse;
use super::outer_products::Summation;
use crate::graph::{Graph, NodeId, Op, Product};

/// Where a factor of an entry of a xᵀ w y comes from. A number in both x and y is two factors: if it were taken out as
/// one, what remains would be no product of sums.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Side {
    Weight,
    Left,
    Right,
}

type Factor = (NodeId, Side);

/// A product: a constant, and other factors in ascending order.
#[derive(Clone, Debug, PartialEq)]
struct Term {
    constant: f64,
    factors: Vec<Factor>,
}

/// The most products of a sum that is factored.
const MOST: usize = 64;
/// The most factors into which a product is taken apart. Powers by squaring would have very many.
const MOST_FACTORS: usize = 16;

impl Term {
    /// Takes apart the product of some nodes, but not those up to the last one `of_formula`.
    fn of(g: &Graph, of_formula: NodeId, factors: &[Factor]) -> Self {
        let mut term = Self { constant: 1.0, factors: Vec::new() };
        let mut stack = factors.to_vec();
        while let Some((node, side)) = stack.pop() {
            if let Some(constant) = g.as_constant(node) {
                term.constant *= constant;
                continue;
            }
            match g.op(node) {
                Op::Neg(a) => {
                    term.constant = -term.constant;
                    stack.push((a, side));
                }
                Op::Mul(a, b)
                    if node > of_formula
                        && !g.is_scale(a)
                        && !g.is_scale(b)
                        && term.factors.len() + stack.len() < MOST_FACTORS =>
                {
                    stack.extend([(a, side), (b, side)]);
                }
                _ => term.factors.push((g.as_computed(node), side)),
            }
        }
        term.factors.sort_unstable();
        term
    }

    fn has(&self, factors: &[Factor]) -> bool {
        match factors {
            [a, b] if a == b => self.factors.windows(2).any(|pair| pair == factors),
            _ => factors.iter().all(|factor| self.factors.binary_search(factor).is_ok()),
        }
    }

    fn without(mut self, factor: Factor) -> Self {
        if let Ok(place) = self.factors.binary_search(&factor) {
            self.factors.remove(place);
        }
        self
    }

    fn times(mut self, factor: Factor) -> Self {
        let place = self.factors.partition_point(|&other| other < factor);
        self.factors.insert(place, factor);
        self
    }

    fn node(self, g: &mut Graph) -> NodeId {
        let sign = g.constant(self.constant.signum());
        let scale = (self.constant.abs() != 1.0).then(|| g.constant(self.constant.abs()));
        // Factors of the formula come first: several sums share them.
        let mut factors: Vec<NodeId> =
            scale.into_iter().chain(self.factors.into_iter().map(|(node, _)| node)).collect();
        // Other sums may have formed a part of the product.
        while let Some((i, j)) = known_product(g, &factors) {
            factors[i] = g.mul(factors[i], factors[j]);
            factors.remove(j);
        }
        factors.into_iter().fold(sign, |product, factor| g.mul(product, factor))
    }
}

/// Returns two of three or more factors whose product is a node already.
fn known_product(g: &Graph, factors: &[NodeId]) -> Option<(usize, usize)> {
    let mut pairs = (0..factors.len()).flat_map(|i| (i + 1..factors.len()).map(move |j| (i, j)));
    pairs.find(|&(i, j)| factors.len() > 2 && g.has_product(factors[i], factors[j]))
}

/// Returns Σ terms as one product.
fn factored(g: &mut Graph, of_formula: NodeId, terms: Vec<Term>) -> Term {
    let mut merged: Vec<Term> = Vec::with_capacity(terms.len());
    for term in terms {
        match merged.iter_mut().find(|known| known.factors == term.factors) {
            Some(known) => known.constant += term.constant,
            None => merged.push(term),
        }
    }
    let mut terms = merged;
    terms.retain(|term| term.constant != 0.0);
    let mut taken = Term { constant: 1.0, factors: Vec::new() };
    if let Some(first) = terms.first().map(|term| term.constant)
        && terms.iter().all(|term| term.constant.abs() == first.abs())
    {
        taken.constant = first;
        terms.iter_mut().for_each(|term| term.constant /= first);
    }
    loop {
        match &terms[..] {
            [] => return Term { constant: 0.0, factors: Vec::new() },
            [one] => {
                let one = Term { constant: one.constant * taken.constant, ..one.clone() };
                return taken.factors.into_iter().fold(one, Term::times);
            }
            _ => {}
        }
        g.budget().spend(terms.len() as u64, 0);
        let Some(common) = most_shared(&terms) else { break };
        let (with, others): (Vec<_>, Vec<_>) = terms.into_iter().partition(|term| term.has(&common));
        let with: Vec<Term> =
            with.into_iter().map(|term| common.iter().fold(term, |term, &factor| term.without(factor))).collect();
        if others.is_empty() {
            taken = common.into_iter().fold(taken, Term::times);
            terms = with;
            continue;
        }
        let inner = factored(g, of_formula, with);
        terms = others;
        terms.push(common.into_iter().fold(inner, Term::times));
    }
    let sum = added(g, &terms);
    let sum = Term::of(g, of_formula, &[(sum, Side::Weight)]);
    let sum = Term { constant: sum.constant * taken.constant, ..sum };
    taken.factors.into_iter().fold(sum, Term::times)
}

/// Returns the one or two factors that, taken out of all terms that have them, save the most products; the first of
/// equals, two rather than one. `None` if no terms share any.
fn most_shared(terms: &[Term]) -> Option<Vec<Factor>> {
    let mut counts: BTreeMap<Vec<Factor>, usize> = BTreeMap::new();
    for term in terms {
        let mut own: Vec<Vec<Factor>> = Vec::new();
        for (i, &a) in term.factors.iter().enumerate() {
            own.push(vec![a]);
            own.extend(term.factors[i + 1..].iter().map(|&b| vec![a, b]));
        }
        own.sort_unstable();
        own.dedup();
        own.into_iter().for_each(|factors| *counts.entry(factors).or_insert(0) += 1);
    }
    let saved = |factors: &[Factor], count: usize| (factors.len() * (count - 1), factors.len());
    let shared = counts.into_iter().filter(|&(_, count)| count > 1);
    let best = shared.rev().max_by_key(|(factors, count)| saved(factors, *count))?;
    Some(best.0)
}

/// Terms are collected, and common factors are taken out in the end.
pub(super) struct Factored {
    n: usize,
    /// The last node of the formula. Its products stay whole, because others use them.
    of_formula: NodeId,
    origin: usize,
    /// By entry, and by origin and part of the weight: terms of one origin share factors.
    terms: BTreeMap<usize, BTreeMap<(usize, usize), Vec<Term>>>,
}

impl Factored {
    pub(super) fn new(n: usize, of_formula: NodeId) -> Self {
        Self { n, of_formula, origin: 0, terms: BTreeMap::new() }
    }

    /// Returns the product of some weights, x and y.
    fn term(&self, g: &Graph, weights: &[NodeId], x: NodeId, y: NodeId) -> Term {
        let weights = weights.iter().map(|&weight| (weight, Side::Weight));
        let factors: Vec<Factor> = weights.chain([(x, Side::Left), (y, Side::Right)]).collect();
        Term::of(g, self.of_formula, &factors)
    }

    fn put(&mut self, (i, j): (usize, usize), part: usize, term: Term) {
        self.terms.entry(i * self.n + j).or_default().entry((self.origin, part)).or_default().push(term);
    }
}

/// Returns Σ terms, factored unless they are many.
fn sum(g: &mut Graph, of_formula: NodeId, terms: Vec<Term>) -> NodeId {
    if terms.len() <= MOST {
        return factored(g, of_formula, terms).node(g);
    }
    added(g, &terms)
}

fn added(g: &mut Graph, terms: &[Term]) -> NodeId {
    let zero = g.constant(0.0);
    terms.iter().fold(zero, |sum, term| {
        let term = term.clone().node(g);
        g.accumulate(sum, term)
    })
}

impl Summation for Factored {
    fn combine(&self, g: &mut Graph, terms: &[(NodeId, &Sparse)]) -> Sparse {
        let mut sums: BTreeMap<usize, Vec<Term>> = BTreeMap::new();
        for &(factor, parts) in terms {
            for &(coordinate, part) in parts {
                let term = Term::of(g, self.of_formula, &[factor, part].map(|node| (node, Side::Weight)));
                sums.entry(coordinate).or_default().push(term);
            }
        }
        let sums = sums.into_iter().map(|(coordinate, terms)| (coordinate, sum(g, self.of_formula, terms)));
        sums.collect::<Sparse>().into_iter().filter(|&(_, sum)| !g.is(sum, 0.0)).collect()
    }

    fn next(&mut self) {
        self.origin += 1;
    }

    fn add(&mut self, g: &mut Graph, weight: NodeId, (a, b): (&Sparse, &Sparse), same: bool) {
        for (&(i, x), &(j, y)) in a.iter().flat_map(|x| b.iter().map(move |y| (x, y))) {
            let term = self.term(g, &[weight], x, y);
            if i <= j {
                self.put((i, j), 0, term.clone());
            }
            if !same && j <= i {
                self.put((j, i), 0, term);
            }
        }
    }

    fn add_form(&mut self, g: &mut Graph, form: &[Vec<Product>], of: &[&Sparse]) {
        let places = (0..of.len()).flat_map(|k| (0..of.len()).map(move |l| (k, l)));
        for ((k, l), products) in places.zip(form) {
            let pairs = of[k].iter().flat_map(|x| of[l].iter().map(move |y| (x, y)));
            for (&(i, x), &(j, y)) in pairs.filter(|((i, _), (j, _))| i <= j) {
                for (part, weights) in products.iter().enumerate() {
                    let term = self.term(g, weights, x, y);
                    self.put((i, j), part, term);
                }
            }
        }
    }

    fn add_to_entry(&mut self, g: &mut Graph, place: (usize, usize), x: NodeId, y: NodeId) {
        let term = self.term(g, &[], x, y);
        self.put(place, 0, term);
    }

    fn entries(self, g: &mut Graph) -> BTreeMap<usize, NodeId> {
        let zero = g.constant(0.0);
        let mut entries = BTreeMap::new();
        for (place, of_origins) in self.terms {
            let sums: Vec<NodeId> = of_origins.into_values().map(|terms| sum(g, self.of_formula, terms)).collect();
            entries.insert(place, sums.into_iter().fold(zero, |sum, term| g.accumulate(sum, term)));
        }
        entries
    }
}
