/// Numbers of a tester that no yarn law fits.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum YarnError {
    /// The end of the law lies below the line of its modulus.
    #[error(
        "{direction}.law: expected a tension of at least modulus × strain = {least:.4} N/m, got {tension}; a yarn law \
         cannot bend down, so give the smaller slope at rest"
    )]
    BendsDown { direction: &'static str, tension: f64, least: f64 },
    /// No convex curve of the law has this linearity.
    #[error(
        "{direction}.kes.lt: expected a linearity above 1/3 and at most 1, got {lt}; give points of the curve as \
         `{direction}.curve` instead"
    )]
    Linearity { direction: &'static str, lt: f64 },
    /// A curve without points.
    #[error("{direction}.{key}: expected at least one point [strain, tension]")]
    NoPoints { direction: &'static str, key: &'static str },
    /// The points are not those of a function that grows.
    #[error(
        "{direction}.{key}: point {number} {point:?} must exceed point {} {before:?} in strain and in tension; sort \
         the points, and leave out the way back of the tester", .number - 1
    )]
    NotAscending { direction: &'static str, key: &'static str, number: usize, point: [f64; 2], before: [f64; 2] },
    /// Strains that are probably percentages.
    #[error("{direction}.{key}: expected strains of at most 2, got {strain}; write 0.07 for 7 %")]
    Percent { direction: &'static str, key: &'static str, strain: f64 },
}
