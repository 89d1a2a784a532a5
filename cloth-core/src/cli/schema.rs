use anyhow::Result;
use cloth_core::scene;

use super::print;

pub fn run() -> Result<()> {
    print(&format!("{:#}\n", scene::schema()))
}
