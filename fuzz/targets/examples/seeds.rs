//! Writes the seeds of all targets below a folder, and their words as dictionaries of libFuzzer:
//! `cargo run -p fuzz-targets --example seeds -- fuzz/corpus`.

use std::path::PathBuf;

fn main() -> std::io::Result<()> {
    let folder = PathBuf::from(std::env::args().nth(1).expect("the folder is an argument"));
    for target in &fuzz_targets::TARGETS {
        let escaped = |word: &&str| word.bytes().map(|byte| format!("\\x{byte:02x}")).collect::<String>();
        let words: String = target.words.iter().map(|word| format!("\"{}\"\n", escaped(word))).collect();
        std::fs::create_dir_all(&folder)?;
        std::fs::write(folder.join(target.name).with_extension("dict"), words)?;
        let folder = folder.join(target.name);
        std::fs::create_dir_all(&folder)?;
        let regressions = target.regressions().into_iter().map(|(_, input)| input);
        for (number, input) in target.seeds().into_iter().chain(regressions).enumerate() {
            std::fs::write(folder.join(format!("seed-{number}")), input)?;
        }
    }
    Ok(())
}
