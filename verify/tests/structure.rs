//! The structure of the workspace: no import cycle between the top-level modules of a crate, no dependency cycle
//! between crates, no path in `ARCHITECTURE.md` that does not exist, no arrow between crates that its picture lacks,
//! and no file of tests that nothing runs.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use proc_macro2::{TokenStream, TokenTree};

/// The nodes that each node points to.
type Graph = BTreeMap<String, BTreeSet<String>>;

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace is one folder up").to_owned()
}

fn manifest(folder: &Path) -> toml::Table {
    let path = folder.join("Cargo.toml");
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    text.parse().unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Returns the name and the folder of each crate of the workspace.
fn crates() -> Vec<(String, PathBuf)> {
    let members = manifest(&workspace())["workspace"]["members"].as_array().expect("a list of members").clone();
    let crates = members.iter().map(|member| {
        let folder = workspace().join(member.as_str().expect("a path"));
        (manifest(&folder)["package"]["name"].as_str().expect("a name").to_owned(), folder)
    });
    crates.collect()
}

/// Returns a cycle of a graph, if there is one, as `a → b → a`.
fn cycle(graph: &Graph) -> Option<String> {
    fn visit<'a>(node: &'a str, graph: &'a Graph, path: &mut Vec<&'a str>, done: &mut BTreeSet<&'a str>) -> bool {
        if let Some(start) = path.iter().position(|&known| known == node) {
            path.drain(..start);
            path.push(node);
            return true;
        }
        if !done.contains(node) {
            path.push(node);
            for next in graph.get(node).into_iter().flatten() {
                if visit(next, graph, path, done) {
                    return true;
                }
            }
            path.pop();
            done.insert(node);
        }
        false
    }
    let mut done = BTreeSet::new();
    graph.keys().find_map(|node| {
        let mut path = Vec::new();
        visit(node, graph, &mut path, &mut done).then(|| path.join(" → "))
    })
}

/// Returns the files below a folder whose name ends with `extension`.
fn files(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut found = Vec::new();
    for path in entries.map(|entry| entry.expect("a readable entry").path()) {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if path.is_dir() && name != "target" && !name.starts_with('.') {
            found.extend(files(&path, extension));
        } else if name.ends_with(extension) {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// Returns the module path of a source file: `a/b.rs` and `a/b/mod.rs` are `[a, b]`, `lib.rs` and `main.rs` are `[]`.
fn module_path(file: &Path) -> Vec<String> {
    let mut path: Vec<String> =
        file.with_extension("").iter().map(|part| part.to_string_lossy().into_owned()).collect();
    if path.last().is_some_and(|last| ["mod", "lib", "main"].contains(&last.as_str())) {
        path.pop();
    }
    path
}

fn is_punct(token: Option<&TokenTree>, wanted: char) -> bool {
    matches!(token, Some(TokenTree::Punct(punct)) if punct.as_char() == wanted)
}

/// Returns the first names in a tree of imports: `a` and `b` of `a::x` or of `{a::{x, y}, b}`.
fn first_names(tokens: &[TokenTree]) -> Vec<String> {
    match tokens.first() {
        Some(TokenTree::Ident(name)) => vec![name.to_string()],
        Some(TokenTree::Group(group)) => {
            let inner: Vec<TokenTree> = group.stream().into_iter().collect();
            let parts = inner.split(|token| is_punct(Some(token), ','));
            parts.flat_map(first_names).collect()
        }
        _ => Vec::new(),
    }
}

/// Collects the names that a module imports from the root of its crate, by `crate::…` or `super::…`. Skips modules of
/// tests.
fn root_names(tokens: TokenStream, module: &[String], names: &mut BTreeSet<String>) {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let mut at = 0;
    while at < tokens.len() {
        match &tokens[at] {
            TokenTree::Ident(keyword) if keyword == "mod" => {
                if let (Some(TokenTree::Ident(name)), Some(TokenTree::Group(body))) =
                    (tokens.get(at + 1), tokens.get(at + 2))
                {
                    if name != "tests" {
                        let inner = [module, &[name.to_string()]].concat();
                        root_names(body.stream(), &inner, names);
                    }
                    at += 2;
                }
            }
            TokenTree::Ident(first) if first == "crate" || first == "super" => {
                let mut depth = if first == "crate" { 0 } else { module.len().saturating_sub(1) };
                let mut next = at + 1;
                while is_punct(tokens.get(next), ':') && is_punct(tokens.get(next + 1), ':') {
                    next += 2;
                    match tokens.get(next) {
                        Some(TokenTree::Ident(name)) if name == "super" => depth = depth.saturating_sub(1),
                        _ => break,
                    }
                    next += 1;
                }
                if depth == 0 {
                    names.extend(first_names(&tokens[next.min(tokens.len())..]));
                }
                at = next - 1;
            }
            TokenTree::Group(group) => root_names(group.stream(), module, names),
            _ => {}
        }
        at += 1;
    }
}

/// Maps the names that the root of a crate re-exports to the modules that they come from.
fn re_exports(tokens: TokenStream) -> BTreeMap<String, String> {
    fn leaves(tokens: &[TokenTree], found: &mut Vec<String>) {
        for token in tokens {
            match token {
                TokenTree::Ident(name) => found.push(name.to_string()),
                TokenTree::Group(group) => leaves(&group.stream().into_iter().collect::<Vec<_>>(), found),
                _ => {}
            }
        }
    }
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let mut exports = BTreeMap::new();
    for statement in tokens.split(|token| is_punct(Some(token), ';')) {
        let Some(start) = statement.iter().position(|token| matches!(token, TokenTree::Ident(i) if i == "use")) else {
            continue;
        };
        let mut path = Vec::new();
        leaves(&statement[start + 1..], &mut path);
        path.retain(|name| name != "self" && name != "crate");
        if let Some((module, names)) = path.split_first() {
            exports.extend(names.iter().map(|name| (name.clone(), module.clone())));
        }
    }
    exports
}

/// Returns which top-level modules of a crate import which. `sources` are paths within `src`, and their texts.
fn module_graph(sources: &[(PathBuf, String)]) -> Graph {
    let parse = |path: &Path, text: &str| -> TokenStream {
        text.parse().unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    };
    let mut exports = BTreeMap::new();
    let mut imports: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (path, text) in sources {
        let (module, tokens) = (module_path(path), parse(path, text));
        match module.first() {
            None => exports.extend(re_exports(tokens)),
            Some(top) => root_names(tokens, &module, imports.entry(top.clone()).or_default()),
        }
    }
    let modules: BTreeSet<String> = imports.keys().cloned().collect();
    let resolve = |name: &String| if modules.contains(name) { Some(name.clone()) } else { exports.get(name).cloned() };
    let graph = imports.iter().map(|(module, names)| {
        let targets = names.iter().filter_map(resolve).filter(|target| target != module && modules.contains(target));
        (module.clone(), targets.collect())
    });
    graph.collect()
}

#[test]
fn top_level_modules_do_not_import_each_other_in_a_cycle() {
    let mut problems = Vec::new();
    for (name, folder) in &crates() {
        let src = folder.join("src");
        let read = |path: PathBuf| {
            let text = std::fs::read_to_string(&path).expect("a readable source file");
            (path.strip_prefix(&src).expect("a path in src").to_owned(), text)
        };
        let sources: Vec<_> = files(&src, ".rs").into_iter().map(read).collect();
        assert!(!sources.is_empty(), "{name} has no sources");
        problems.extend(cycle(&module_graph(&sources)).map(|cycle| format!("{name}: {cycle}")));
    }
    assert!(problems.is_empty(), "{}", problems.join("\n"));
}

#[test]
fn crates_do_not_depend_on_each_other_in_a_cycle() {
    let crates = crates();
    let names: BTreeSet<&str> = crates.iter().map(|(name, _)| name.as_str()).collect();
    let mut graph = Graph::new();
    for (name, folder) in &crates {
        let manifest = manifest(folder);
        let kinds = ["dependencies", "dev-dependencies", "build-dependencies"];
        let tables = kinds.iter().filter_map(|kind| manifest.get(*kind)?.as_table());
        // Tests may ask for features of their own crate.
        let dependencies =
            tables.flat_map(|table| table.keys()).filter(|on| names.contains(on.as_str()) && *on != name);
        graph.insert(name.clone(), dependencies.cloned().collect());
    }
    assert_eq!(cycle(&graph), None, "dependencies, development dependencies included, form a cycle");
}

/// Returns the arrows of a picture in which lines read `crate → crate, crate`, and may go on in the next line.
fn drawn_arrows(document: &str) -> Graph {
    let picture = document.split("```").nth(1).expect("a picture in a block of text");
    let joined = picture.replace(",\n", ", ");
    let mut arrows = Graph::new();
    for line in joined.lines().skip(1).filter(|line| !line.trim().is_empty()) {
        let (from, to) = line.split_once('→').unwrap_or((line.split_whitespace().next().unwrap_or_default(), ""));
        let to = to.split(',').map(|name| name.trim().to_owned()).filter(|name| !name.is_empty());
        arrows.insert(from.trim().to_owned(), to.collect());
    }
    arrows
}

#[test]
fn the_picture_in_the_architecture_has_every_arrow_between_crates() {
    let crates = crates();
    let uses = |folder: &Path| -> BTreeSet<String> {
        let manifest = manifest(folder);
        let names =
            manifest.get("dependencies").and_then(toml::Value::as_table).into_iter().flat_map(toml::Table::keys);
        names.filter(|on| crates.iter().any(|(name, _)| name == *on)).cloned().collect()
    };
    let arrows: Graph = crates.iter().map(|(name, folder)| (name.clone(), uses(folder))).collect();
    let document = std::fs::read_to_string(workspace().join("ARCHITECTURE.md")).unwrap();
    assert_eq!(drawn_arrows(&document), arrows, "left: the picture in ARCHITECTURE.md; right: the manifests");
}

/// Returns all crates that a crate of the workspace builds, as far as manifests of the workspace name them.
/// Dependencies of tests do not count.
fn named_dependencies(of: &str) -> BTreeSet<String> {
    let crates: BTreeMap<String, PathBuf> = crates().into_iter().collect();
    let (mut found, mut open) = (BTreeSet::new(), vec![of.to_owned()]);
    while let Some(next) = open.pop() {
        let Some(folder) = crates.get(&next) else { continue };
        let manifest = manifest(folder);
        let table = manifest.get("dependencies").and_then(toml::Value::as_table);
        let names = table.into_iter().flat_map(|table| table.keys().cloned());
        open.extend(names.filter(|name| found.insert(name.clone())));
    }
    found
}

/// A crate with one element and `#[audit]` builds the library `verify`, which needs no crate of command lines.
#[test]
fn the_audit_needs_no_crate_of_the_command_line() {
    let built = named_dependencies("verify");
    assert!(built.contains("energy-compiler") && built.contains("dashu-float"), "{built:?}");
    let others = ["clap", "comfy-table", "console", "energy-cli", "indicatif", "plotters", "serde_json", "sigpipe"];
    let needless: Vec<&str> = others.into_iter().filter(|name| built.contains(*name)).collect();
    assert!(needless.is_empty(), "the library `verify` builds {needless:?}");
    assert!(named_dependencies("verify-command").contains("plotters"));
}

/// Returns the texts in backticks that look like paths: of several parts, or with the extension of a file.
fn named_paths(document: &str) -> BTreeSet<&str> {
    let is_part = |part: &str| part.len() > 1 && part.chars().all(|c| c.is_alphanumeric() || "._-".contains(c));
    let is_path = |text: &&str| {
        let extensions = [".rs", ".md", ".toml", ".energy", ".json", ".svg", ".png"];
        let has_extension = extensions.iter().any(|extension| text.ends_with(extension));
        (text.contains('/') || has_extension) && text.trim_end_matches('/').split('/').all(is_part)
    };
    document.split('`').skip(1).step_by(2).filter(is_path).collect()
}

/// Whether a path exists in the workspace, given from its root or from some folder in it.
fn exists(path: &str, all: &[PathBuf]) -> bool {
    let parts: Vec<&str> = path.trim_end_matches('/').split('/').collect();
    all.iter().any(|file| {
        let file: Vec<_> = file.iter().collect();
        file.windows(parts.len()).any(|window| window == parts)
    })
}

#[test]
fn every_path_in_the_architecture_exists() {
    let root = workspace();
    let relative = |path: PathBuf| path.strip_prefix(&root).expect("a path in the workspace").to_owned();
    let all: Vec<PathBuf> = files(&root, "").into_iter().map(relative).collect();
    let document = std::fs::read_to_string(root.join("ARCHITECTURE.md")).unwrap();
    let named = named_paths(&document);
    assert!(named.len() > 20, "{named:?}");
    let missing: Vec<_> = named.into_iter().filter(|path| !exists(path, &all)).collect();
    assert!(missing.is_empty(), "ARCHITECTURE.md names paths that do not exist: {missing:?}");
}

/// The names after `mod` in a file that declares one module a line.
fn declared_modules(text: &str) -> BTreeSet<String> {
    let names = text.lines().filter_map(|line| line.strip_prefix("mod ")?.strip_suffix(';'));
    names.map(str::to_owned).collect()
}

#[test]
fn every_test_file_belongs_to_a_test_program() {
    for (name, folder) in crates() {
        let tests = folder.join("tests");
        let Ok(listing) = std::fs::read_to_string(tests.join("all.rs")) else {
            assert!(!tests.exists(), "{name}: expected tests/all.rs, which lists the other files as modules");
            continue;
        };
        let mut listed = declared_modules(&listing);
        for program in manifest(&folder)["test"].as_array().expect("a list of test programs") {
            listed.insert(program["name"].as_str().expect("a name").to_owned());
        }
        for file in std::fs::read_dir(&tests).expect("the folder is readable") {
            let path = file.expect("the folder is readable").path();
            if path.extension().is_some_and(|extension| extension == "rs") {
                let module = path.file_stem().expect("a name").to_string_lossy();
                assert!(listed.contains(&*module), "{name}: add `mod {module};` to tests/all.rs");
            }
        }
    }
}

#[test]
fn an_import_cycle_is_found_however_it_is_written() {
    let source = |path: &str, text: &str| (PathBuf::from(path), text.to_owned());
    let root = source("lib.rs", "mod a; mod b; pub use a::{First, inner::Second as Other}; pub use b::Third;");
    let acyclic = [root.clone(), source("a.rs", "pub struct First;"), source("b/mod.rs", "use crate::a::First;")];
    assert_eq!(cycle(&module_graph(&acyclic)), None);
    for import in [
        "use crate::b::Third;",
        "use crate::{b::Third, a::First};",
        "use super::b;",
        "use crate::Third;",
        "fn f() -> crate::b::Third { todo!() }",
        "mod inner { use super::super::b::Third; }",
        "fn f() { println!(\"{}\", crate::b::NAME); }",
    ] {
        let mut sources = acyclic.to_vec();
        sources[1].1.push_str(import);
        assert_eq!(cycle(&module_graph(&sources)).as_deref(), Some("a → b → a"), "{import}");
    }
    // Neither imports within a module nor those of its tests count.
    for import in ["mod inner { use super::b::Third; }", "mod tests { use crate::b::Third; }", "// use crate::b;"] {
        let mut sources = acyclic.to_vec();
        sources[1].1.push_str(import);
        assert_eq!(cycle(&module_graph(&sources)), None, "{import}");
    }
}

#[test]
fn only_paths_are_looked_up_and_missing_ones_are_found() {
    let named = named_paths("`a-crate/src/lib.rs` has `Type`, `f(x)`, `a::b`, `N/m` and `tokens.rs` in `check/units`.");
    assert_eq!(named.into_iter().collect::<Vec<_>>(), ["a-crate/src/lib.rs", "check/units", "tokens.rs"]);
    let all = [PathBuf::from("a-crate/src/lib.rs"), PathBuf::from("a-crate/src/check/units/mod.rs")];
    assert!(exists("a-crate/src/lib.rs", &all) && exists("check/units", &all) && !exists("tokens.rs", &all));
}
