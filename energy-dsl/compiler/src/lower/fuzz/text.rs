//! Random texts whose energies are sums of like terms behind a `rest` block.

/// Small random number generator (xorshift).
pub(super) struct Random(u64);

impl Random {
    /// Creates the generator of a seed. Neighbouring seeds give unrelated numbers.
    pub(super) fn new(seed: u64) -> Self {
        let mut random = Self((seed + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
        (0..8).for_each(|_| {
            random.below(2);
        });
        random
    }

    /// Returns a number from 0 to n − 1.
    pub(super) fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % n
    }

    /// Returns a number between −1 and 1.
    pub(super) fn number(&mut self) -> f64 {
        self.below(2_000_001) as f64 / 1e6 - 1.0
    }

    fn pick(&mut self, list: &[&str]) -> String {
        list[self.below(list.len())].to_owned()
    }
}

/// A term whose holes are filled with other numbers in each repetition.
enum Piece {
    Text(String),
    /// Texts of which each term takes one.
    Choice(&'static [&'static str]),
}

/// Numbers, stored numbers and constants that look like either.
const NUMBERS: &[&str] = &["0", "1", "(-1)", "2", "0.5", "3", "(1/3)", "π", "C"];
const STORED: &[&str] = &["w[0]", "w[1]", "w[2]", "V", "B[0][1]", "u[1].y"];
const MIXED: &[&str] = &["2", "w[0]", "w[1]", "k", "0.25", "a[1]"];
const INDICES: &[&str] = &["0", "1", "2", "C - 2"];
const EXPONENTS: &[&str] = &["2", "2", "3", "0.5", "1.5", "1", "-1", "a[0]", "w[1]", "C"];
const COMPARISONS: &[&str] = &["c0", "c1", "c0 && c1", "w[0] < w[2]", "k < a[0]"];
const SQUARES: &[&str] = &["B", "N", "w[0] * B", "identity(3)", "columns(u[0], u[1], v)"];
const VECTORS: &[&str] = &["u[0]", "u[1]", "u[2]", "v", "vector(1, 2, 3)", "vector(2, 0, 1)"];

/// Builds one term.
struct Grammar<'a> {
    random: &'a mut Random,
    pieces: Vec<Piece>,
}

impl Grammar<'_> {
    fn text(&mut self, text: &str) {
        self.pieces.push(Piece::Text(text.to_owned()));
    }

    /// Adds a choice: one for all terms, or one for each.
    fn choice(&mut self, list: &'static [&'static str]) {
        let piece = match self.random.below(2) {
            0 => Piece::Text(self.random.pick(list)),
            _ => Piece::Choice(list),
        };
        self.pieces.push(piece);
    }

    /// Adds `parts` in order: `@s` is a scalar, `@v` a vector, `@m` a 3×3 matrix, and other letters are choices.
    fn form(&mut self, form: &str, depth: usize) {
        let mut parts = form.split('@');
        self.text(parts.next().unwrap_or_default());
        for part in parts {
            let (hole, rest) = part.split_at(1);
            match hole {
                "s" => self.scalar(depth),
                "v" => self.vector(depth),
                "m" => self.matrix(depth),
                "c" => self.choice(NUMBERS),
                "w" => self.choice(STORED),
                "x" => self.choice(MIXED),
                "i" => self.choice(INDICES),
                "e" => self.choice(EXPONENTS),
                "b" => self.choice(COMPARISONS),
                "M" => self.choice(SQUARES),
                _ => self.choice(VECTORS),
            }
            self.text(rest);
        }
    }

    /// Adds a leaf, or a form with parts of less depth.
    fn grow(&mut self, leaves: &[&str], forms: &[&str], depth: usize) {
        let is_leaf = depth == 0 || self.random.below(3) == 0;
        let form = self.random.pick(if is_leaf { leaves } else { forms });
        // The index of a sum is a constant, as long as the matrix has rows.
        let form = form.replace("@n", ["1", "2", "3"][self.random.below(3)]);
        self.form(&form, depth.saturating_sub(1));
    }

    fn scalar(&mut self, depth: usize) {
        const LEAVES: &[&str] = &["s[@i]", "F[@i][@i]", "@c", "@w", "@x", "E[@i][@i]", "(q - p)[@i]", "p.x", "J"];
        const FORMS: &[&str] = &[
            "(@s + @s)",
            "(@s - @s)",
            "(@s * @s)",
            "(@s * @x)",
            "(@s / (1 + @s^2))",
            "(@s)^2",
            "abs(1 + @s^2)^(@e)",
            "exp(@s / 8)",
            "(exp(@s) - @c)",
            "(@c - cos(@s))",
            "sin(@s)",
            "sqrt(1 + (@s)^2)",
            "log(1 + (@c)^2 + (@s)^2)",
            "min(@s, @x)",
            "clamp(@s, @c, 5)",
            "huber(@s, 1.5)",
            "f(@s, @x)",
            "g(@v, @i)",
            "h(@m, @w)",
            "sum(i in 0..3, s[i] * @x)",
            "sum(i in 0..@n, w[i]^2 * F[i][0])",
            "dot(@v, @v)",
            "norm(@v)",
            "(norm(@v) - @x)^2",
            "(@v)[@i]",
            "det(@m)",
            "trace(@m)",
            "ddot(@m, @m)",
            "(@m)[@i][@i]",
            "(if @s < @x { @s } else { @s * 2 })",
            "(if @b { @s } else { @s - @x })",
            "(if w[0] < w[1] { @s } else { @s + 1 })",
            "[@s, @x, @c][@i]",
            "vector(@s, @x, @c)[@i]",
            "gradient(@s * p.y, p)[@i]",
            "gradient(b * @s + b^2, b)",
            "singular_values(F)[@i]",
            "singular_values(F * @M)[@i]^(@e)",
            "trace(stretch_of(F))",
            "stretch_of(F)[@i][@i]",
            "rotation_of(F)[@i][@i]",
            "angle(@v, v)",
            "dot(rotate(rotation(@v / 9), v), @V)",
            "real(quat(@s, @x, @c, 1) * quat(@c, 1, 2, @s))",
            "imaginary(quat(@s, @x, @c, 1))[@i]",
            "{ let t = @s; t * t + @x }",
            "{ let c = @c; dot(vector(1, 2, 3, c), vector(@s, 1, 2, c)) + norm(quat(1, 2, 3, c) * quat(@s, 1, 2, c)) }",
            "columns(q - p, r - p)[@i][1]",
        ];
        self.grow(LEAVES, FORMS, depth);
    }

    fn vector(&mut self, depth: usize) {
        const LEAVES: &[&str] = &["(q - p)", "(r - p)", "(r - q)", "@V", "F[@i]", "s"];
        const FORMS: &[&str] = &[
            "(@v + @v)",
            "(@v - @V)",
            "(@x * @v)",
            "(@m * @v)",
            "cross(@v, @v)",
            "unit(@v + vector(0, 0, 3))",
            "vector(@s, @x, @c)",
            "gradient(dot(@v, p), p)",
        ];
        self.grow(LEAVES, FORMS, depth);
    }

    fn matrix(&mut self, depth: usize) {
        const LEAVES: &[&str] = &["F", "E", "@M", "F * @M"];
        const FORMS: &[&str] = &[
            "(@m * @m)",
            "(@m + @c * @m)",
            "transpose(@m)",
            "inverse(identity(3) * 9 + @m)",
            "adjugate(@m)",
            "outer(@v, @V)",
            "columns(@v, @V, @v)",
            "(@x * @m)",
        ];
        self.grow(LEAVES, FORMS, depth);
    }
}

/// Returns a declaration whose energy is a sum of 2 to 6 like terms.
pub(super) fn declaration(random: &mut Random) -> String {
    let count = 2 + random.below(5);
    let depth = 1 + random.below(3);
    let mut grammar = Grammar { random, pieces: Vec::new() };
    let leading = ["@s", "@w * @s", "@x * (@s)^2", "f(@s, @c)", "(@s)^(@e)"][grammar.random.below(5)];
    grammar.form(leading, depth);
    let pieces = grammar.pieces;
    let term = |random: &mut Random| -> String {
        let fill = |piece: &Piece| match piece {
            Piece::Text(text) => text.clone(),
            Piece::Choice(list) => random.pick(list),
        };
        pieces.iter().map(fill).collect()
    };
    let terms: Vec<String> = (0..count).map(|_| term(random)).collect();
    let sum = match random.below(6) {
        // The same term for each number of a stored array.
        0 => format!("sum(j in 0..3, {})", terms[0].replace("w[0]", "w[j]").replace("u[1]", "u[j]")),
        _ => terms.join(" + "),
    };
    let result = ["{}", "k * ({})", "V * k * ({})", "({}) / 3", "k / 2 * ({}) * V", "{ let t = {}; t }"];
    with_result(&result[random.below(result.len())].replace("{}", &sum))
}

/// Returns the declaration with this result.
pub(super) fn with_result(result: &str) -> String {
    format!(
        "const _C: Scalar = 2;
        energy Fuzz(_p, _q, _r: Point; rest _X: [Vec3; 3], _L: [Scalar; 3]; _k, _b: Scalar, _a: [Scalar; 2], _v: Vec3) {{
            rest {{
                let _w = [L[0], L[1], L[0] * L[1]];
                let _u = X;
                let _N = columns(X[0], X[1], X[2]) + 3 * identity(3);
                let _B = inverse(N);
                let _V = det(N) / 6;
                let _c0 = L[0] < L[1];
                let _c1 = L[1] < 0 || V < 1;
            }}
            fn f(x, c) {{ c * x^2 + x / (2 + c^2) }}
            fn g(d, i) {{ norm_squared(d) * (1 + i) + d[1] }}
            fn h(M, c) {{ c * ddot(M, M) - det(M) }}
            let _F = columns(q - p, r - p, cross(q - p, r - p)) * B;
            let _E = (transpose(F) * F - identity(3)) / 2;
            let _J = det(F);
            let _s = singular_values(F);
            let _every_function = f(J, 1) + g(F[0], 1) + h(F, 1);
            {result}
        }}"
    )
}
