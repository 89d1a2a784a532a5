//! How numbers are spelled: in C or CUDA, in double or single precision.

/// The precision of all numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Precision {
    /// IEEE 754 binary64.
    Double,
    /// IEEE 754 binary32. No double occurs in the text.
    Single,
}

impl Precision {
    /// Returns the function that rounds a double to this precision.
    pub(super) const fn rounding(self) -> fn(f64) -> f64 {
        match self {
            Self::Double => |number| number,
            Self::Single => |number| f64::from(number as f32),
        }
    }

    /// Returns the suffix of names: `f64` or `f32`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Double => "f64",
            Self::Single => "f32",
        }
    }

    /// Returns the words for it.
    pub(super) const fn described(self) -> &'static str {
        match self {
            Self::Double => "double precision",
            Self::Single => "single precision",
        }
    }

    /// Returns the type in C.
    pub(super) const fn real(self) -> &'static str {
        match self {
            Self::Double => "double",
            Self::Single => "float",
        }
    }

    /// Returns a number as a literal that every compiler reads; `None` if no such literal exists: for subnormal
    /// numbers, infinities and NaN.
    pub(super) fn literal(self, value: f64) -> Option<String> {
        let single = value as f32;
        match self {
            Self::Double => (value == 0.0 || value.is_normal()).then(|| format!("{value:?}")),
            Self::Single => (single == 0.0 || single.is_normal()).then(|| format!("{single:?}f")),
        }
    }

    /// Returns the bits of a number as a literal.
    pub(super) fn bits(self, value: f64) -> String {
        match self {
            Self::Double => format!("0x{:016x}U", value.to_bits()),
            Self::Single => format!("0x{:08x}U", (value as f32).to_bits()),
        }
    }
}

/// The numbers that code is written for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Numbers {
    Plain,
    /// Numbers with an extended exponent.
    Wide,
    /// Vectors, one element a lane.
    Lanes,
}

/// How code is written.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dialect {
    pub(super) precision: Precision,
    pub(super) numbers: Numbers,
    /// Whether sums and products are operators. A compiler for CUDA contracts these, but not function calls.
    pub(super) operators: bool,
}

impl Dialect {
    pub(super) const fn of(self, numbers: Numbers) -> Self {
        Self { numbers, ..self }
    }

    /// Returns the beginning of all function names.
    pub(super) fn prefix(self) -> String {
        let precision = self.precision.name();
        match self.numbers {
            Numbers::Plain => format!("energy_{precision}_"),
            Numbers::Wide => format!("energy_{precision}_wide_"),
            Numbers::Lanes => format!("energy_{precision}_lanes_"),
        }
    }

    /// Returns the type of numbers or of masks.
    pub(super) fn of_type(self, is_mask: bool) -> String {
        match (self.numbers, is_mask) {
            (Numbers::Plain, false) => self.precision.real().to_owned(),
            (Numbers::Wide, false) => format!("energy_{}_wide", self.precision.name()),
            (Numbers::Lanes, false) => format!("energy_{}_lanes", self.precision.name()),
            (Numbers::Lanes, true) => format!("energy_{}_lane_mask", self.precision.name()),
            (_, true) => "int".to_owned(),
        }
    }

    /// Returns the operator that spells a function; `None` if it is called by name.
    pub(super) fn infix(self, name: &str) -> Option<&'static str> {
        let is_wide = self.numbers == Numbers::Wide;
        let of_masks = match name {
            "both" => Some("&"),
            "either" => Some("|"),
            "not" if matches!(self.numbers, Numbers::Lanes) => Some("~"),
            "not" => Some("!"),
            _ => None,
        };
        let of_numbers = match name {
            "neg" => Some("-"),
            "less" | "precedes" => Some("<"),
            "less_or_equal" => Some("<="),
            "equal" => Some("=="),
            "add" if self.operators => Some("+"),
            "sub" if self.operators => Some("-"),
            "mul" if self.operators => Some("*"),
            "div" if self.operators => Some("/"),
            _ => None,
        };
        of_masks.or(of_numbers.filter(|_| !is_wide))
    }

    pub(super) fn call(self, function: &str, arguments: &[&str]) -> String {
        format!("{}{function}({})", self.prefix(), arguments.join(", "))
    }

    pub(super) fn constant(self, value: f64) -> String {
        let plain = self
            .precision
            .literal(value)
            .unwrap_or_else(|| format!("energy_{}_from_bits({})", self.precision.name(), self.precision.bits(value)));
        match self.numbers {
            Numbers::Plain => plain,
            Numbers::Wide => self.call("of", &[&plain]),
            Numbers::Lanes => self.call("splat", &[&plain]),
        }
    }

    pub(super) fn truth(self, value: bool) -> String {
        match self.numbers {
            Numbers::Lanes => self.call("truth", &[if value { "1" } else { "0" }]),
            _ => u8::from(value).to_string(),
        }
    }
}
