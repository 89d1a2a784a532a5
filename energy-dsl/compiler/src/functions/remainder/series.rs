//! The functions, their coefficients and recurrences.

use super::super::exponential::{log1p, plain_expm1};
use super::super::power_series::{Interval, economised, polynomial};
use crate::graph::{Expansion, Graph, NodeId, Primitive, Rule};

/// The power series of the logarithm is used where |x/(2 + x)| is below this bound.
const LOGARITHM_BELOW: f64 = 0.5;

/// Power series are used where |x| is below these bounds. The higher the order, the farther recurrences cancel.
fn exponential_below(k: u32) -> f64 {
    f64::from(k.clamp(2, 4))
}

/// The median of the gamma distribution, beyond which 1 − e⁻ˣ Σ xʲ/j! does not cancel.
fn damped_below(k: u32) -> f64 {
    f64::from(k.max(2))
}

fn trigonometric_below(k: u32) -> f64 {
    f64::from((k + 1).clamp(3, 6))
}

/// Returns n!.
fn factorial(n: u32) -> f64 {
    (1..=n).map(f64::from).product()
}

/// The constant term of Φₖ: 1/k! or 1/k.
pub(super) fn constant_term(expansion: Expansion, k: u32) -> f64 {
    match expansion {
        Expansion::Logarithm => 1.0 / f64::from(k),
        Expansion::Exponential | Expansion::Trigonometric | Expansion::IncompleteGamma => 1.0 / factorial(k),
    }
}

/// Returns k′ and the sign s of xᵏ Φₖ = xᵏ Φₖ(0) + s xᵏ′ Φₖ′; `None` if that is of another family.
pub(super) fn successor(expansion: Expansion, k: u32) -> Option<(u32, f64)> {
    match expansion {
        Expansion::Exponential => Some((k + 1, 1.0)),
        Expansion::Logarithm => Some((k + 1, -1.0)),
        Expansion::Trigonometric => Some((k + 2, -1.0)),
        Expansion::IncompleteGamma => None,
    }
}

/// Creates Φₖ(x) with its derivatives.
pub(super) fn remainder(g: &mut Graph, expansion: Expansion, k: u32, x: NodeId) -> NodeId {
    let [value, first, second] = derivatives(g, expansion, k, x);
    let primitive = Primitive::Remainder(expansion, k as u8, 0);
    g.add_rule(Rule::smooth(primitive, vec![x], value, vec![first], vec![second]), &[])
}

/// Creates xᵏ Φₖ(x), k > 1, with its derivatives xᵏ⁻¹ Φₖ₋₁ and xᵏ⁻² Φₖ₋₂. For the logarithm they are xᵏ⁻¹/(1 + x) and
/// xᵏ⁻² (k − 1 + (k − 2) x)/(1 + x)². For the incomplete gamma function they are xᵏ⁻¹ e⁻ˣ/(k − 1)! and
/// xᵏ⁻² (k − 1 − x) e⁻ˣ/(k − 1)!.
pub(super) fn whole_remainder(g: &mut Graph, expansion: Expansion, k: u32, x: NodeId) -> NodeId {
    let powers = [k, k - 1, k - 2].map(|exponent| {
        let exponent = g.constant(f64::from(exponent));
        g.plain_pow(x, exponent)
    });
    let [value, below, lowest] = match expansion {
        Expansion::Logarithm => {
            let value = derivatives(g, expansion, k, x)[0];
            let [one, less, least] = [1.0, f64::from(k - 1), f64::from(k - 2)].map(|number| g.constant(number));
            let sum = g.add(one, x);
            let reciprocal = g.div(one, sum);
            let (scaled, square) = (g.mul(least, x), g.mul(reciprocal, reciprocal));
            let linear = g.add(less, scaled);
            [value, reciprocal, g.mul(linear, square)]
        }
        Expansion::IncompleteGamma => {
            let (value, decay) = (derivatives(g, expansion, k, x)[0], decay(g, x));
            let (number, less) = (g.constant(1.0 / factorial(k - 1)), g.constant(f64::from(k - 1)));
            let (first, linear) = (g.mul(number, decay), g.sub(less, x));
            [value, first, g.mul(linear, first)]
        }
        _ => [k, k - 1, k - 2].map(|k| value(g, expansion, k, x)),
    };
    let [value, first, second] = [(value, 0), (below, 1), (lowest, 2)].map(|(rest, i)| g.mul(powers[i], rest));
    let primitive = Primitive::Remainder(expansion, k as u8, k as u8);
    g.add_rule(Rule::smooth(primitive, vec![x], value, vec![first], vec![second]), &[])
}

/// Returns Φₖ; φ₀ is the exponential, c₀ the cosine.
fn value(g: &mut Graph, expansion: Expansion, k: u32, x: NodeId) -> NodeId {
    match (expansion, k) {
        (Expansion::Exponential, 0) => g.exp(x),
        (Expansion::Trigonometric, 0) => g.cos(x),
        _ => derivatives(g, expansion, k, x)[0],
    }
}

/// Returns Φₖ, Φₖ′ and Φₖ″, k > 0: by power series near 0, elsewhere by recurrences.
fn derivatives(g: &mut Graph, expansion: Expansion, k: u32, x: NodeId) -> [NodeId; 3] {
    match (expansion, k) {
        (Expansion::Exponential, _) => {
            let (near, far) = (exponential_near(g, k, x), exponential_far(g, k, x));
            near_or_far(g, x, exponential_below(k), near, far)
        }
        (Expansion::Logarithm, _) => {
            let (one, two) = (g.constant(1.0), g.constant(2.0));
            let sum = g.add(two, x);
            let z = g.div(x, sum);
            let rest = g.sub(one, z);
            let (near, far) = (logarithmic_near(g, k, z, rest), logarithmic_far(g, k, x));
            near_or_far(g, z, LOGARITHM_BELOW, near, far)
        }
        (Expansion::Trigonometric, _) => {
            let (mut near, far) = (trigonometric_near(g, k, x), trigonometric_far(g, k, x));
            if k == 1 {
                // The sine itself does not cancel.
                let (zero, one) = (g.constant(0.0), g.constant(1.0));
                let at_zero = g.equal(x, zero);
                near[0] = g.select(at_zero, one, far[0]);
            }
            near_or_far(g, x, trigonometric_below(k), near, far)
        }
        (Expansion::IncompleteGamma, _) => {
            let (near, far) = (damped_near(g, k, x), damped_far(g, k, x));
            near_or_far(g, x, damped_below(k), near, far)
        }
    }
}

/// Selects `near` where |x| is below a bound.
fn near_or_far(g: &mut Graph, x: NodeId, below: f64, near: [NodeId; 3], far: [NodeId; 3]) -> [NodeId; 3] {
    let (size, limit) = (g.abs(x), g.constant(below));
    let is_near = g.less(size, limit);
    [0, 1, 2].map(|order| g.select(is_near, near[order], far[order]))
}

/// Σ xʲ/(j + k)! and its derivatives.
fn exponential_near(g: &mut Graph, k: u32, x: NodeId) -> [NodeId; 3] {
    [0, 1, 2].map(|order| {
        let coefficient = |j: u32| falling(j + order, order) / factorial(j + order + k);
        polynomial(g, x, economised(coefficient, Interval::AroundZero(exponential_below(k))))
    })
}

/// Returns e⁻ˣ.
fn decay(g: &mut Graph, x: NodeId) -> NodeId {
    let opposite = g.neg(x);
    g.exp(opposite)
}

/// γₖ = e⁻ˣ φₖ, γₖ′ = −k γₖ₊₁ and γₖ″ = k (k + 1) γₖ₊₂. No terms of these series cancel if x > 0.
fn damped_near(g: &mut Graph, k: u32, x: NodeId) -> [NodeId; 3] {
    let decay = decay(g, x);
    let interval = || Interval::AroundZero(damped_below(k));
    [(0, 1.0), (1, -f64::from(k)), (2, f64::from(k * (k + 1)))].map(|(order, factor)| {
        let series = polynomial(g, x, economised(|j| factor / factorial(j + order + k), interval()));
        g.mul(decay, series)
    })
}

/// The series in y = x²: Σ cⱼ yʲ, x Σ 2j cⱼ yʲ⁻¹ and Σ 2j (2j − 1) cⱼ yʲ⁻¹ with cⱼ = (−1)ʲ/(2j + k)!.
fn trigonometric_near(g: &mut Graph, k: u32, x: NodeId) -> [NodeId; 3] {
    let y = g.mul(x, x);
    let [value, slope, curvature] = [0, 1, 2].map(|order: u32| {
        let coefficient = |j: u32| {
            let j = j + u32::from(order > 0);
            let sign = if j.is_multiple_of(2) { 1.0 } else { -1.0 };
            sign * falling(2 * j, order) / factorial(2 * j + k)
        };
        polynomial(g, y, economised(coefficient, Interval::FromZero(trigonometric_below(k).powi(2))))
    });
    [value, g.mul(x, slope), curvature]
}

/// With z = x/(2 + x): Lₖ = ∫₀¹ tᵏ⁻¹/(1 + x t) dt = (1 − z) Σ zⁿ mₙ(k), where mₙ(k) = ∫₀¹ tᵏ⁻¹ (1 − 2t)ⁿ dt. So Lₖ′ =
/// −(1 − z)² Σ (n + 1) mₙ(k + 1) zⁿ and Lₖ″ = (1 − z)³ Σ (n + 1)(n + 2) mₙ(k + 2) zⁿ. `rest` is 1 − z.
fn logarithmic_near(g: &mut Graph, k: u32, z: NodeId, rest: NodeId) -> [NodeId; 3] {
    let mut factor = g.constant(1.0);
    [0, 1, 2].map(|order: u32| {
        let sign = if order == 1 { -1.0 } else { 1.0 };
        let coefficient = |n: u32| sign * falling(n + order, order) * moment(n, k + order);
        let series = polynomial(g, z, economised(coefficient, Interval::AroundZero(LOGARITHM_BELOW)));
        factor = g.mul(factor, rest);
        g.mul(factor, series)
    })
}

/// ∫₀¹ tᵏ⁻¹ (1 − 2t)ⁿ dt. With s = 1 − 2t it is 2⁻ᵏ ∫ (1 − s)ᵏ⁻¹ sⁿ ds from −1 to 1, where odd powers of s vanish.
fn moment(n: u32, k: u32) -> f64 {
    let binomial = |i: u32| (0..i).map(|j| f64::from(k - 1 - j) / f64::from(j + 1)).product::<f64>();
    let even = (0..k).filter(|i| (n + i).is_multiple_of(2));
    let sum: f64 = even.map(|i| 2.0 * binomial(i) / f64::from(n + i + 1)).sum();
    let sign = if n.is_multiple_of(2) { 1.0 } else { -1.0 };
    sign * sum * 0.5_f64.powi(k as i32)
}

/// Returns n (n − 1) … with this number of factors.
fn falling(n: u32, factors: u32) -> f64 {
    (0..factors).map(|i| f64::from(n) - f64::from(i)).product()
}

/// φₖ and its derivatives by φⱼ₊₁ = (φⱼ − 1/j!)/x.
fn exponential_far(g: &mut Graph, k: u32, x: NodeId) -> [NodeId; 3] {
    let power = g.exp(x);
    let minus_one = plain_expm1(g, power);
    let first = g.div(minus_one, x);
    recurrent(g, x, [power, first], power, k, |g, last, j| {
        let constant = g.constant(1.0 / factorial(j));
        let rest = g.plain_difference(last[1], constant);
        g.div(rest, x)
    })
}

/// γₖ and its derivatives by γ₀ = 1 and γⱼ₊₁ = (γⱼ − e⁻ˣ/j!)/x, x γₖ′ = e⁻ˣ/(k − 1)! − k γₖ and
/// x γₖ″ = −e⁻ˣ/(k − 1)! − (k + 1) γₖ′.
fn damped_far(g: &mut Graph, k: u32, x: NodeId) -> [NodeId; 3] {
    let (decay, mut value) = (decay(g, x), g.constant(1.0));
    let mut term = decay;
    for j in 0..k {
        let number = g.constant(1.0 / factorial(j));
        term = g.mul(number, decay);
        let rest = g.plain_difference(value, term);
        value = g.div(rest, x);
    }
    let (factor, more) = (g.constant(f64::from(k)), g.constant(f64::from(k + 1)));
    let scaled = g.mul(factor, value);
    let difference = g.plain_difference(term, scaled);
    let slope = g.div(difference, x);
    let scaled = g.mul(more, slope);
    let sum = g.add(term, scaled);
    let curvature = g.div(sum, x);
    [value, slope, g.neg(curvature)]
}

/// cₖ and its derivatives by cⱼ₊₁ = (1/(j − 1)! − cⱼ₋₁)/x².
fn trigonometric_far(g: &mut Graph, k: u32, x: NodeId) -> [NodeId; 3] {
    let (sine, cosine) = (g.sin(x), g.cos(x));
    let sinc = g.div(sine, x);
    let (slope, square) = (g.neg(sine), g.mul(x, x));
    recurrent(g, x, [cosine, sinc], slope, k, |g, last, j| {
        let constant = g.constant(1.0 / factorial(j - 1));
        let rest = g.plain_difference(constant, last[0]);
        g.div(rest, square)
    })
}

/// Returns Φₖ and its derivatives from Φ₀, Φ₁ and Φ₀′ by x Φⱼ′ = Φⱼ₋₁ − j Φⱼ and x Φⱼ″ = Φⱼ₋₁′ − (j + 1) Φⱼ′. `next`
/// returns Φⱼ₊₁ from Φⱼ₋₁ and Φⱼ.
fn recurrent(
    g: &mut Graph,
    x: NodeId,
    first: [NodeId; 2],
    slope_of_zeroth: NodeId,
    k: u32,
    next: impl Fn(&mut Graph, [NodeId; 2], u32) -> NodeId,
) -> [NodeId; 3] {
    let mut all = first.to_vec();
    for j in 1..k {
        let last = [all[j as usize - 1], all[j as usize]];
        all.push(next(g, last, j));
    }
    let mut slope = |j: u32| {
        if j == 0 {
            return slope_of_zeroth;
        }
        let (factor, below) = (g.constant(f64::from(j)), all[j as usize - 1]);
        let scaled = g.mul(factor, all[j as usize]);
        let difference = g.plain_difference(below, scaled);
        g.div(difference, x)
    };
    let (own, below) = (slope(k), slope(k - 1));
    let factor = g.constant(f64::from(k + 1));
    let scaled = g.mul(factor, own);
    let difference = g.plain_difference(below, scaled);
    [all[k as usize], own, g.div(difference, x)]
}

/// Φₖ and its derivatives by x Φₖ′ = 1/(1 + x) − k Φₖ and x Φₖ″ = −1/(1 + x)² − (k + 1) Φₖ′.
fn logarithmic_far(g: &mut Graph, k: u32, x: NodeId) -> [NodeId; 3] {
    let (one, logarithm) = (g.constant(1.0), log1p(g, x));
    let mut value = g.div(logarithm, x);
    for j in 1..k {
        let constant = g.constant(1.0 / f64::from(j));
        let rest = g.plain_difference(constant, value);
        value = g.div(rest, x);
    }
    let sum = g.add(one, x);
    let reciprocal = g.div(one, sum);
    let (factor, more) = (g.constant(f64::from(k)), g.constant(f64::from(k + 1)));
    let scaled = g.mul(factor, value);
    let difference = g.plain_difference(reciprocal, scaled);
    let slope = g.div(difference, x);
    let (square, scaled) = (g.mul(reciprocal, reciprocal), g.mul(more, slope));
    let sum = g.add(square, scaled);
    let curvature = g.div(sum, x);
    [value, slope, g.neg(curvature)]
}
