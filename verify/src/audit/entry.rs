use energy_dsl::Declaration;

use crate::blocks::{Block, BlockName};

/// Formats the position of an entry by points and axes, as in `(x1.y, x3.z)`.
pub(super) fn entry_name(declaration: &Declaration, block: &Block, entry: usize) -> String {
    let coordinate = |number: usize| {
        let mut number = number;
        for point in &*declaration.points {
            let size = point.increments();
            if number < size {
                let axis = if size == 1 { String::new() } else { format!(".{}", ["x", "y", "z", "w"][number.min(3)]) };
                return format!("{}{axis}", point.name);
            }
            number -= size;
        }
        format!("component {number}")
    };
    let (row, column) = (entry / block.columns.max(1), entry % block.columns.max(1));
    match block.name {
        BlockName::Energy => "U".into(),
        BlockName::Constraint | BlockName::Residual => format!("row {column}"),
        BlockName::Gradient | BlockName::Force => coordinate(column),
        BlockName::Jacobian | BlockName::NextByUnknowns => format!("(row {row}, {})", coordinate(column)),
        BlockName::Next => format!("state number {column}"),
        BlockName::NextByState => format!("(row {row}, state number {column})"),
        BlockName::SlopesByState => format!("({}, state number {column})", coordinate(row)),
        _ => format!("({}, {})", coordinate(row), coordinate(column)),
    }
}
