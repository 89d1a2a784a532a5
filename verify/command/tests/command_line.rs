//! End-to-end tests of the binary.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn verify(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_verify")).args(arguments).output().expect("the binary runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn data(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/potentials").join(file)
}

#[test]
fn the_audit_of_named_elements_passes_and_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("audit.json");
    let output = verify(&["audit", "Spring", "HairBend", "--samples", "5", "--json", json.to_str().unwrap()]);
    let printed = text(&output.stdout);
    assert!(output.status.success(), "{printed}{}", text(&output.stderr));
    assert!(printed.contains("2 elements") && printed.contains("0 failed"), "{printed}");
    let report: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap();
    assert!(report["lines"].as_array().unwrap().iter().all(|line| line["passed"] == true));
}

#[test]
fn a_file_is_audited_reported_and_run_again_at_its_inputs() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (file, json, html, junit) = (path("s.energy"), path("a.json"), path("a.html"), path("a.xml"));
    std::fs::write(&file, "energy Mine(p, q: Point; k: Scalar[N/m], L: Scalar[m]) = \"k/2 (‖p − q‖ − L)²\";").unwrap();
    let options = ["--samples", "6", "--json", &json, "--html", &html, "--junit", &junit];
    let output = verify(&[&["audit", "--file", &file], &options[..]].concat());
    let printed = text(&output.stdout);
    assert!(output.status.success(), "{printed}{}", text(&output.stderr));
    assert!(printed.contains("24 of 24 planted faults noticed"), "{printed}");
    let page = std::fs::read_to_string(html).unwrap();
    for part in ["<math", "<svg", "Planted faults", "class=\"heat\""] {
        assert!(page.contains(part), "no {part}");
    }
    assert!(!page.contains("http-equiv") && !page.contains("src="), "the page needs nothing else");
    assert!(page.contains("Not looked at") && page.contains("`verify stress` goes closer"));
    let written: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
    assert_eq!(written["not_looked_at"].as_array().map(Vec::len), Some(2));
    assert_eq!(written["sections"][0]["inputs"], 6);
    assert!(std::fs::read_to_string(junit).unwrap().contains("<testsuite name=\"Mine\""));
    let again = verify(&["audit", "--file", &file, "--at", &json]);
    assert!(again.status.success(), "{}{}", text(&again.stdout), text(&again.stderr));
    std::fs::write(path("one.json"), "{\"positions\": [0, 0, 0, 1]}").unwrap();
    let refused = verify(&["audit", "--file", &file, "--at", &path("one.json")]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("`positions` holds 4 numbers, Mine takes 6"), "{}", text(&refused.stderr));
}

#[test]
fn a_declaration_says_how_many_samples_it_wants() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (file, json) = (path("s.energy"), path("a.json"));
    std::fs::write(&file, "#[audit(samples = 7)] energy Mine(p, q: Point; k: Scalar) = \"k ‖p − q‖²\";").unwrap();
    let inputs = |more: &[&str]| {
        let output = verify(&[&["audit", "--file", &file, "--json", &json], more].concat());
        assert!(output.status.success(), "{}", text(&output.stdout));
        let report: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
        report["sections"][0]["inputs"].clone()
    };
    assert_eq!(inputs(&[]), 7);
    assert_eq!(inputs(&["--samples", "9"]), 9);
}

#[test]
fn declarations_of_a_file_are_evaluated_and_timed() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (file, inputs, out) = (path("s.energy"), path("inputs.json"), path("out.json"));
    let spring = "energy Mine(p, q: Point; k: Scalar[N/m], L: Scalar[m]) = \"k/2 (‖p − q‖ − L)²\";";
    std::fs::write(&file, spring).unwrap();
    let at = |q: &str| format!("{{\"positions\": [0, 0, 0, {q}], \"parameters\": [2, 1], \"rest\": []}}");
    std::fs::write(&inputs, format!("[{}, {}, {}]", at("3, 0, 0"), at("0, 0, 0"), at("1, 1, 0"))).unwrap();
    let evaluated = |more: &[&str]| -> serde_json::Value {
        let output = verify(&[&["eval", &inputs, "--file", &file, "-o", &out], more].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        serde_json::from_str(&std::fs::read_to_string(&out).unwrap()).unwrap()
    };
    let records = evaluated(&[])["records"].clone();
    assert_eq!(records[0]["out"]["energy"], "4.0000000000000000e0");
    assert_eq!(records[0]["flags"]["hess"]["degenerate"], false);
    assert_eq!(records[1]["flags"]["grad"]["degenerate"], true);
    // (√2 − 1)².
    let digits = evaluated(&["--digits", "40"])["records"][2]["out"]["energy"].clone();
    assert!(digits.as_str().is_some_and(|digits| digits.contains("7157287525380990239662255158060384")), "{digits}");
    std::fs::write(&inputs, "{\"positions\": [0, 0, 0, 1]}").unwrap();
    let refused = verify(&["eval", &inputs, "--file", &file, "-o", &out]);
    assert!(text(&refused.stderr).contains("`positions` holds 4 numbers, Mine takes 6"), "{}", text(&refused.stderr));

    let timed = verify(&["bench", "--file", &file]);
    let table = text(&timed.stdout);
    assert!(timed.status.success(), "{}", text(&timed.stderr));
    for method in ["central differences", "dual numbers", "tape, f64 lanes", "multi-precision"] {
        assert!(table.contains(&format!("| Mine | {method}")), "{table}");
    }
    std::fs::write(&file, "residual Mine(a: Scalar; b: Scalar) { a - b }").unwrap();
    let without = verify(&["bench", "--file", &file]);
    assert!(text(&without.stderr).contains("energies and constraints do"), "{}", text(&without.stderr));
}

#[test]
fn sweeps_of_a_distance_keep_the_digits_that_the_textbook_form_loses() {
    let output = verify(&["stress", "Distance", "PowerLaw"]);
    let printed = text(&output.stdout);
    assert!(output.status.success(), "{printed}{}", text(&output.stderr));
    assert!(printed.contains("0 failed") && printed.contains("| Distance | scale | hess |"), "{printed}");
}

/// Lost digits near rest are warnings: the exit status is 0.
#[test]
fn lost_digits_are_warnings_with_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("solid.energy").to_str().unwrap().to_owned();
    std::fs::write(
        &file,
        "energy Solid(x0, x1, x2, x3: Point; rest X0, X1, X2, X3: Vec3; mu, la: Scalar) {
            rest { let D = columns(X1 - X0, X2 - X0, X3 - X0); let B = inverse(D); let V = det(D) / 6; }
            let F = columns(x1 - x0, x2 - x0, x3 - x0) * B;
            let J = det(F);
            V * (mu / 2 * (ddot(F, F) - 3) - mu * log(J) + la / 2 * log(J)^2)
        }",
    )
    .unwrap();
    let output = verify(&["audit", "--quick", "--file", &file]);
    let printed = text(&output.stdout);
    assert!(output.status.success(), "{printed}{}", text(&output.stderr));
    let warning = "warning: Solid: block `energy` loses digits near rest";
    for part in [warning, "- mu * log(J)", "`log1pmx(x)`", "random inputs were replaced", "0 failed"] {
        assert!(printed.contains(part), "no {part} in {printed}");
    }
}

#[test]
fn the_output_does_not_depend_on_the_number_of_threads() {
    for command in [&["audit", "--quick", "StVK", "Spring", "Distance"][..], &["stress", "Distance", "HairBend"]] {
        let [one, three] = ["1", "3"].map(|threads| verify(&[command, &["--threads", threads]].concat()));
        assert!(one.status.success() && one.stdout == three.stdout, "{command:?}");
        assert!(text(&one.stdout).contains("0 failed"), "{command:?}");
    }
    assert_eq!(verify(&["stress", "--threads", "0"]).status.code(), Some(2));
}

#[test]
fn an_unknown_element_is_rejected_with_the_known_ones() {
    let output = verify(&["audit", "Sprin"]);
    assert_eq!(output.status.code(), Some(2));
    let message = text(&output.stderr);
    assert!(message.contains("Sprin") && message.contains("HairBend"), "{message}");
    let output = verify(&["audit", "own.energy"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("give it as `--file own.energy`"));
}

#[test]
fn the_reference_values_are_met() {
    let output = verify(&["reference"]);
    let printed = text(&output.stdout);
    assert!(output.status.success(), "{printed}{}", text(&output.stderr));
    // Every result is within tier A, and within tier B if it applies.
    assert!(printed.contains("beyond tier A: none\n"), "{printed}");
    assert!(printed.contains("beyond tier B: none\n"), "{printed}");
    assert!(printed.contains("132 of 132 blocks at degenerate inputs as documented"), "{printed}");
}

#[test]
fn evaluated_records_read_back_as_the_same_doubles() {
    let folder = tempfile::tempdir().unwrap();
    for file in ["hinge_theta.json", "witkin_spring_damped.json", "stvk_membrane.json"] {
        let out = folder.path().join(file);
        let output = verify(&["eval", data(file).to_str().unwrap(), "-o", out.to_str().unwrap()]);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let read = |path: &Path| -> serde_json::Value {
            serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
        };
        let (before, after) = (read(&data(file)), read(&out));
        let (before, after) = (before["records"].as_array().unwrap(), after["records"].as_array().unwrap());
        assert_eq!(before.len(), after.len());
        for (truth, found) in before.iter().zip(after) {
            assert_eq!(truth["x"], found["x"]);
            for (block, digits) in found["out"].as_object().unwrap() {
                assert!(truth["out"].get(block).is_some(), "{block} was not asked for");
                assert_eq!(found["flags"][block]["degenerate"], false);
                let list = digits.as_array().cloned().unwrap_or_else(|| vec![digits.clone()]);
                for number in list {
                    let text = number.as_str().unwrap();
                    assert_eq!(format!("{:.16e}", text.parse::<f64>().unwrap()), text);
                }
            }
        }
    }
}

#[test]
fn degenerate_records_are_evaluated_with_flags() {
    let folder = tempfile::tempdir().unwrap();
    let input = folder.path().join("in.json");
    std::fs::write(
        &input,
        r#"{"records": [{"id": "a", "potential": "distance", "x": ["1", "2", "3", "1", "2", "3"], "params": {}},
            {"id": "b", "potential": "stvk_membrane", "x": ["0","0","0","1","0","0","0","1","0"],
             "params": {"mu": "1", "lambda": "1", "rest_uv": ["0","0","1","0","2","0"]}}]}"#,
    )
    .unwrap();
    let out = folder.path().join("out.json");
    let output = verify(&["eval", input.to_str().unwrap(), "-o", out.to_str().unwrap()]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let written: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(out).unwrap()).unwrap();
    assert_eq!(written["records"][0]["flags"]["grad"]["degenerate"], true);
    assert_eq!(written["records"][0]["flags"]["energy"]["degenerate"], false);
    assert!(written["records"][1]["error"].as_str().unwrap().contains("degenerate"));
}

/// A file may mix potentials; only a degenerate rest shape has no result.
#[test]
fn the_degenerate_inputs_are_all_evaluated_but_for_a_degenerate_rest_shape() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("policy.json");
    let output = verify(&["eval", data("policy.json").to_str().unwrap(), "-o", out.to_str().unwrap()]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let written: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(out).unwrap()).unwrap();
    let without: Vec<&str> = written["records"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|record| record.get("error").is_some())
        .map(|record| record["potential"].as_str().unwrap())
        .collect();
    assert_eq!(without, ["stvk_membrane"]);
}

/// A decimal that is not the intended double means a damaged file.
#[test]
fn a_number_that_disagrees_with_its_bits_is_rejected() {
    let folder = tempfile::tempdir().unwrap();
    let (input, out) = (folder.path().join("in.json"), folder.path().join("out.json"));
    let original = std::fs::read_to_string(data("distance.json")).unwrap();
    let damaged = original.replacen("-1.7330773331989477e-01", "-1.7330773331989480e-01", 1);
    assert_ne!(original, damaged);
    std::fs::write(&input, damaged).unwrap();
    let output = verify(&["eval", input.to_str().unwrap(), "-o", out.to_str().unwrap()]);
    let message = text(&output.stderr);
    assert!(message.contains("distance/000") && message.contains("x_bits has 0xbfc62ef2a3605cfb"), "{message}");
    assert!(!out.exists());
}

#[test]
fn bad_records_are_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let (input, out) = (folder.path().join("in.json"), folder.path().join("out.json"));
    for (content, expected) in [
        ("{", "in.json:1:1"),
        ("{}", "records"),
        (r#"{"records": [{"id": "r7", "x": []}]}"#, "record r7: `potential` is missing"),
        (r#"{"potential": "dist", "records": [{"id": "r7", "x": []}]}"#, "record r7: no declared element"),
        (r#"{"potential": "distance", "records": [{"id": "r7"}]}"#, "missing field `x`"),
        (r#"{"potential": "distance", "records": [{"id": "r7", "x": ["1", "2"]}]}"#, "2 numbers, expected 6"),
        (
            r#"{"potential": "distance", "records": [{"id": "r7", "x": ["1", "2", "3", "a", "5", "6"]}]}"#,
            "`a` is not a number",
        ),
        (
            r#"{"potential": "distance", "records": [{"id": "r7", "x": ["1", "2", "3", "NaN", "5", "6"]}]}"#,
            "not finite",
        ),
        (
            r#"{"potential": "witkin_vector_damped", "records": [{"id": "r7", "x": ["1","2","3","4","5","6"],
                "params": {"k_s": "1", "k_d": "1"}}]}"#,
            "record r7: the velocities `v` are missing",
        ),
        (
            r#"{"potential": "distance", "records": [{"id": "r7", "x": ["1","2","3","4","5","6"],
                "x_bits": ["0x3ff0000000000000"]}]}"#,
            "x_bits holds 1 numbers, x holds 6",
        ),
        (
            r#"{"potential": "hair_bend", "records": [{"id": "r7", "x": ["1","2","3","4","5","6","7","8","0"]}]}"#,
            "parameter `k` is missing",
        ),
    ] {
        std::fs::write(&input, content).unwrap();
        let output = verify(&["eval", input.to_str().unwrap(), "-o", out.to_str().unwrap()]);
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{content}");
        assert!(message.contains(expected), "{content}: {message}");
        assert!(!out.exists(), "{content}");
    }
    let output = verify(&["reference", folder.path().join("nowhere").to_str().unwrap()]);
    assert!(text(&output.stderr).contains("nowhere"));
    std::fs::write(&input, r#"{"records": []}"#).unwrap();
    let output =
        verify(&["eval", input.to_str().unwrap(), "-o", folder.path().join("no/folder.json").to_str().unwrap()]);
    assert!(text(&output.stderr).contains("folder.json"), "{}", text(&output.stderr));
}

#[test]
fn generated_code_is_shown() {
    let output = verify(&["show", "HookeSpring", "--routine", "value"]);
    let printed = text(&output.stdout);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(printed.contains("fn value_at<L: ::energy_dsl::Level>") && printed.contains("self.K *"), "{printed}");
    assert!(!printed.contains("fn gradient"), "one routine only: {printed}");
    // The output is deterministic.
    assert_eq!(verify(&["show", "BridsonForce"]).stdout, verify(&["show", "BridsonForce"]).stdout);
}

#[test]
fn code_in_other_languages_is_shown() {
    let show = |language: &[&str]| {
        let output = verify(&[&["show", "HookeSpring", "--lang"], language].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stdout)
    };
    let c = show(&["c"]);
    assert!(c.contains("unsigned hooke_spring_f64_gradient(") && c.contains("const energy_f64_element"), "{c}");
    assert!(!c.contains("double energy_f64_sum_error(") && !c.contains("cmake"), "what all elements share: {c}");
    assert!(show(&["cpp"]).contains("hooke_spring_f64.cpp: generated"));
    let cuda = show(&["cuda", "--precision", "f32"]);
    assert!(cuda.contains("__global__ void hooke_spring_f32_vertex_kernel(") && !cuda.contains("double"), "{cuda}");
    assert!(show(&["warp"]).contains("def hooke_spring_f64_gradient("));
    let refused = verify(&["show", "HookeSpring", "--lang", "c", "--plan"]);
    assert!(text(&refused.stderr).contains("cannot be used with"), "{}", text(&refused.stderr));
}

#[test]
fn plans_name_each_route_and_the_one_taken() {
    let printed = text(&verify(&["show", "StVK", "--plan"]).stdout);
    for route in ["forward over forward", "adjoint-weighted", "gathered at primitives", "reverse"] {
        assert!(printed.contains(route), "{route} is missing: {printed}");
    }
    let first = printed.lines().nth(1).unwrap();
    assert!(first.contains("gathered at primitives") && first.contains("taken"), "{first}");
    let last = printed.lines().last().unwrap();
    assert!(last.starts_with("StVK took ") && last.ends_with(" of 400 MB"), "{last}");
    assert!(last.contains(" of 10,000,000 steps to compile, and "), "{last}");
}

#[test]
fn pinned_points_save_operations() {
    let printed = text(&verify(&["show", "QuadraticHinge", "--counts"]).stdout);
    let operations = |row: &str| -> usize {
        let line = printed.lines().find(|line| line.trim_start().starts_with(row)).expect(row);
        line[row.len() + 2..].split_whitespace().next().unwrap().parse().unwrap()
    };
    let all = operations("hessian ");
    assert!(operations("value ") < operations("gradient ") && operations("gradient ") < all);
    for point in 0..4 {
        let pinned = operations(&format!("hessian, point {point} pinned"));
        assert!(pinned + 20 < all, "point {point}: {pinned} of {all}");
    }
}

#[test]
fn unknown_routines_and_files_are_rejected() {
    let output = verify(&["show", "Spring", "--routine", "hesian"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("it has hessian, value, gradient"), "{}", text(&output.stderr));
    let output = verify(&["show", "nowhere.energy"]);
    assert!(text(&output.stderr).contains("cannot read nowhere.energy"), "{}", text(&output.stderr));
}

#[test]
fn declarations_of_a_file_are_shown_and_their_errors_placed() {
    let folder = tempfile::tempdir().unwrap();
    let good = folder.path().join("good.energy");
    std::fs::write(&good, "energy Pull(p, q: Point; k: Scalar) = \"k/2 ‖p − q‖²\";\n").unwrap();
    let printed = text(&verify(&["show", good.to_str().unwrap()]).stdout);
    assert!(printed.contains("struct Pull"), "{printed}");
    let bad = folder.path().join("bad.energy");
    std::fs::write(&bad, "energy Pull(p, q: Point; k: Scalar) {\n    k * nrm(p - q)\n}\n").unwrap();
    let output = verify(&["show", bad.to_str().unwrap()]);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        message.contains("bad.energy:2:9: unknown function") && message.contains("did you mean `norm`"),
        "{message}"
    );
}

#[cfg(target_os = "linux")]
#[test]
fn output_that_cannot_be_printed_is_an_error() {
    for arguments in [&["show", "Spring"][..], &["audit", "Spring", "--samples", "2"]] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_verify")).args(arguments).stdout(full).output().unwrap();
        let message = text(&output.stderr);
        assert!(output.status.code() == Some(2) && message.starts_with("error: cannot print: No space"), "{message}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn files_without_declarations_and_files_without_end_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("open.energy");
    std::fs::write(&file, "/* energy Mine(p: Point) = \"p·p\";").unwrap();
    let pipe = folder.path().join("pipe.energy");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for (path, reason) in [(&file, ""), (&pipe, "expected a regular file, got a pipe")] {
        let path = path.to_str().unwrap();
        for arguments in [&["show", path][..], &["audit", "--file", path], &["audit", "Spring", "--at", path]] {
            let output = verify(arguments);
            let message = text(&output.stderr);
            assert!(output.status.code() == Some(2) && message.contains(reason), "{arguments:?}: {message}");
        }
    }
}

/// Folders for other languages are the same byte for byte, and spare files that are not theirs.
#[test]
fn folders_are_written_again_but_never_over_foreign_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(path("s.energy"), "energy Mine(p, q: Point; k: Scalar[N/m]) { k * norm_squared(p - q) }").unwrap();
    let out = path("out");
    let emit = |extra: &[&str]| verify(&[&["emit", &path("s.energy"), "Spring", "-o", &out], extra].concat());
    let first = emit(&["--precision", "both"]);
    assert!(first.status.success(), "{}", text(&first.stderr));
    assert!(text(&first.stdout).contains("2 elements in 20 files"), "{}", text(&first.stdout));
    let header = folder.path().join("out/mine_f32.h");
    let before = std::fs::read_to_string(&header).unwrap();
    assert!(before.contains("energy Mine: k * norm_squared(p - q)") && !before.contains("double"), "{before}");
    assert!(text(&emit(&["--precision", "both"]).stdout).contains(" 0 of them new or changed"));
    assert_eq!(std::fs::read_to_string(&header).unwrap(), before);
    // A file that was edited, and one that was never generated.
    std::fs::write(&header, before.replace("return", "return 1 +")).unwrap();
    let refused = emit(&["--precision", "f32"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(
        text(&refused.stderr).contains("mine_f32.h was changed since it was generated"),
        "{}",
        text(&refused.stderr)
    );
    assert!(emit(&["--precision", "f32", "--force"]).status.success());
    assert_eq!(std::fs::read_to_string(&header).unwrap(), before);
    std::fs::write(&header, "int mine;\n").unwrap();
    let refused = emit(&["--precision", "f32", "--force"]);
    assert!(text(&refused.stderr).contains("mine_f32.h was not generated"), "{}", text(&refused.stderr));
    assert_eq!(std::fs::read_to_string(&header).unwrap(), "int mine;\n");
    let unknown = verify(&["emit", "Spingr", "-o", &out]);
    assert_eq!(unknown.status.code(), Some(2));
}
