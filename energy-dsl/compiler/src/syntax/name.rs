use crate::diagnostic::Span;

/// A name as written. Names are compared in canonical form.
#[derive(Clone, Debug)]
pub struct Name {
    /// The name as written.
    pub text: String,
    /// Place of the name.
    pub span: Span,
}

impl Name {
    /// Returns the canonical form.
    #[must_use]
    pub fn canonical(&self) -> String {
        canonical(&self.text)
    }
}

/// Returns the canonical form of a name, in which all spellings of a symbol agree: `θ₀`, `θ_0` and `θ0`; `p_ℓ`, `p_l`,
/// `pₗ` and `pl`; `θ` and `theta`.
#[must_use]
pub fn canonical(name: &str) -> String {
    let mut plain = String::with_capacity(name.len());
    for c in name.chars() {
        match c {
            '_' => {}
            'A'..='Z' | 'a'..='z' | '0'..='9' => plain.push(c),
            'ℓ' => plain.push('l'),
            '₀'..='₉' => plain.push(char::from(b'0' + (c as u32 - '₀' as u32) as u8)),
            _ if subscript_letter(c).is_some() => plain.extend(subscript_letter(c)),
            '′' | '\'' => plain.push_str("prime"),
            other => match GREEK.iter().find(|(letter, _)| *letter == other) {
                Some((_, spelled)) => plain.push_str(spelled),
                None => plain.push(other),
            },
        }
    }
    plain
}

/// Returns the letter of a subscript letter.
pub(super) fn subscript_letter(c: char) -> Option<char> {
    const SUBSCRIPTS: &str = "ₐaₑeₕhᵢiⱼjₖkₗlₘmₙnₒoₚpᵣrₛsₜtᵤuᵥvₓx";
    let mut pairs = SUBSCRIPTS.chars();
    while let (Some(subscript), Some(letter)) = (pairs.next(), pairs.next()) {
        if subscript == c {
            return Some(letter);
        }
    }
    None
}

pub(super) const GREEK: &[(char, &str)] = &[
    ('α', "alpha"),
    ('β', "beta"),
    ('γ', "gamma"),
    ('δ', "delta"),
    ('ε', "epsilon"),
    ('ζ', "zeta"),
    ('η', "eta"),
    ('θ', "theta"),
    ('κ', "kappa"),
    ('λ', "lambda"),
    ('μ', "mu"),
    ('ν', "nu"),
    ('ξ', "xi"),
    ('ρ', "rho"),
    ('σ', "sigma"),
    ('τ', "tau"),
    ('φ', "phi"),
    ('χ', "chi"),
    ('ψ', "psi"),
    ('ω', "omega"),
    ('ϑ', "theta"),
    ('ϵ', "epsilon"),
    ('ϕ', "phi"),
    ('Γ', "Gamma"),
    ('Δ', "Delta"),
    ('Θ', "Theta"),
    ('Λ', "Lambda"),
    ('Ξ', "Xi"),
    ('Π', "Pi"),
    ('Σ', "Sigma"),
    ('Φ', "Phi"),
    ('Ψ', "Psi"),
    ('Ω', "Omega"),
];
