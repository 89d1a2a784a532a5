/// The effect of a function on units. Dual quaternions and twists have two parts, each with a unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Units {
    /// Takes numbers without units and returns one.
    Plain,
    /// Returns a number without a unit, whatever the arguments.
    Number,
    /// Takes arguments of one unit and returns a value of that unit.
    Same,
    /// Takes arguments of one unit and returns a number without a unit.
    Compared,
    /// Takes arguments of one unit and returns its square.
    SquareOfSame,
    /// Returns a value of the first argument's unit.
    First,
    /// Returns the first argument's unit to a power.
    Power(f64),
    /// Returns the first argument's unit to the power n + k; n is the size of that matrix, 1 for other values.
    PowerOfSize(i8),
    /// Returns the product of both arguments' units, part by part if one of them has two.
    Scaled,
    /// Like `Scaled`; the product of two dual quaternions is p q + ε (p q′ + p′ q), and that of two motions has the parts
    /// of each of them.
    Product,
    /// Returns the quotient of both arguments' units.
    Quotient,
    /// Returns the first argument's unit to the power of the second argument, a number without a unit.
    Raised,
    /// Returns the first argument over its length, a number without a unit; that of a dual quaternion has a dual part.
    Direction,
    /// Takes and returns numbers without units; that of a twist keeps its second part.
    Exponential,
    /// Returns the unit of the part that a component belongs to.
    Component,
    /// Makes a value of two parts from two arguments.
    Parts,
    /// Returns the first part.
    FirstPart,
    /// Returns the second part.
    SecondPart,
    /// Takes a rotation without a unit, and returns the second argument's unit.
    Rotated,
    /// Takes a motion whose dual part has the unit of the second argument, which is returned.
    Transformed,
    /// Takes a value whose first part has no unit, and returns a number without a unit.
    Orientation,
    /// Takes values of one unit, as many places and one more place of another; returns a value of the first unit.
    Interpolated,
}
