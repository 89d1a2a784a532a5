use energy_dsl::Declaration;

use crate::blocks::{Block, BlockName};

/// Formats the position of an entry by points and axes, as in `(x1.y, x3.z)`.
pub(super) fn entry_name(declaration: &Declaration, block: &Block, entry: usize) -> String {
    let coordinate = |number: usize| {
        let mut number = number;
        for point in &*declaration.points {
            if number < point.size {
                let axis =
                    if point.size == 1 { String::new() } else { format!(".{}", ["x", "y", "z", "w"][number.min(3)]) };
                return format!("{}{axis}", point.name);
            }
            number -= point.size;
        }
        format!("component {number}")
    };
    let (row, column) = (entry / block.columns.max(1), entry % block.columns.max(1));
    match block.name {
        BlockName::Energy => "U".into(),
        BlockName::Constraint | BlockName::Residual => format!("row {column}"),
        BlockName::Gradient | BlockName::Force => coordinate(column),
        BlockName::Jacobian => format!("(row {row}, {})", coordinate(column)),
        _ => format!("({}, {})", coordinate(row), coordinate(column)),
    }
}
