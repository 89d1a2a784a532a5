use anyhow::Result;
use cloth_core::materials;

use super::print;

pub fn run() -> Result<()> {
    print(&materials::listing())
}
