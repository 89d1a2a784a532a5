//! Rules whose derivatives have several forms. Which one is shorter depends on the formula.

use super::{Graph, NodeId, Primitive, Product, Rule, symmetric_index};

/// The forms in which rules are differentiated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DerivativeForms {
    /// Whether rational primitives are differentiated through their values, as if they were spelled out.
    pub spelled_out: bool,
    /// Whether lengths and powers are differentiated as functions of one number: lengths by ½ d·d, not by the vector d,
    /// and powers by their base. With f′ and f″ by ½ d·d, the Hessian is f″ d dᵀ + f′ I, for all functions of one length
    /// together. Where d vanishes, only the derivatives by the vector are right.
    pub collapsed: bool,
}

/// The derivatives of a function of ‖d‖ by ½ d·d.
#[derive(Clone, Debug)]
pub(crate) struct BySquare {
    /// The node of ½ d·d. It precedes the function, as operands do.
    pub square: NodeId,
    /// Whether d = 0, where these derivatives are wrong.
    pub zero: NodeId,
    /// The first derivative.
    pub slope: Product,
    /// The second derivative, which is one product.
    pub curvature: Product,
}

/// The derivatives of a function of one number.
pub(crate) struct OfOneNumber {
    /// The number.
    pub operand: NodeId,
    /// The first derivative.
    pub slope: Product,
    /// The second derivative.
    pub curvature: Product,
}

impl Graph {
    /// Sets the forms.
    pub(crate) fn differentiate_by(&mut self, forms: DerivativeForms) {
        self.derivative_forms = forms;
    }

    /// Returns the forms.
    pub(crate) fn derivative_forms(&self) -> DerivativeForms {
        self.derivative_forms
    }

    /// Returns whether a rule is a rational primitive that is spelled out.
    pub(crate) fn is_spelled_out(&self, rule: &Rule) -> bool {
        self.derivative_forms.spelled_out && rule.primitive.is_rational()
    }

    /// Returns the value of a rational primitive; other nodes as they are.
    pub(crate) fn as_computed(&self, node: NodeId) -> NodeId {
        self.rule(node).filter(|rule| rule.primitive.is_rational()).map_or(node, |rule| rule.value)
    }

    /// Creates ½ d·d. Its derivatives, d and 1, need no factors.
    pub(crate) fn half_square(&mut self, d: &[NodeId]) -> NodeId {
        let (square, half, one) = (self.sum_of_squares(d), self.constant(0.5), self.constant(1.0));
        let value = self.mul(half, square);
        let first = d.iter().map(|&part| vec![part]).collect();
        let n = d.len();
        let mut second = vec![Vec::new(); n * (n + 1) / 2];
        (0..n).for_each(|i| second[symmetric_index(n, i, i)] = vec![vec![one]]);
        // The factor tells it from x·y, if d = (x, y).
        self.add_rule(Rule::factored(Primitive::InnerProduct, d.to_vec(), value, first, second), &[half])
    }

    /// Returns 1/‖d‖, or 0 where d vanishes, of a length ‖d‖.
    pub(crate) fn reciprocal_of_length(&self, node: NodeId) -> Option<NodeId> {
        let rule = self.rule(node).filter(|rule| rule.primitive == Primitive::Norm)?;
        Some(rule.by_square.as_ref()?.slope[0])
    }

    /// Creates the mask where a length among some nodes is 0.
    pub(crate) fn any_vanishes(&mut self, nodes: impl IntoIterator<Item = NodeId>) -> NodeId {
        let zeros: Vec<NodeId> =
            nodes.into_iter().filter_map(|node| Some(self.rule(node)?.by_square.as_ref()?.zero)).collect();
        let never = self.truth(false);
        zeros.into_iter().fold(never, |any, zero| self.or(any, zero))
    }

    /// Returns whether a node is a function of one number that can be collapsed.
    pub(crate) fn collapses(&self, node: NodeId) -> bool {
        self.powers.contains_key(&node) || self.rule(node).is_some_and(|rule| rule.by_square.is_some())
    }

    /// Returns the only operand of a node that is collapsed.
    pub(crate) fn collapsed_to(&self, node: NodeId) -> Option<NodeId> {
        if !self.derivative_forms.collapsed {
            return None;
        }
        let base = self.powers.get(&node).map(|&(base, _)| base);
        base.or_else(|| Some(self.rule(node)?.by_square.as_ref()?.square))
    }

    /// Returns the derivatives of a node that is collapsed by its operand.
    pub(crate) fn collapsed(&mut self, node: NodeId) -> Option<OfOneNumber> {
        let operand = self.collapsed_to(node)?;
        if let Some([slope, curvature]) = self.derivatives_of_power(node) {
            return Some(OfOneNumber { operand, slope, curvature });
        }
        let BySquare { slope, curvature, .. } = self.rule(node)?.by_square.clone()?;
        Some(OfOneNumber { operand, slope, curvature })
    }
}
