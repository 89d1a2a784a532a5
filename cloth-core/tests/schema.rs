//! The JSON schema of scenes says the same as the program, except for a few checks that the documentation lists.

use cloth_core::scene::{Scene, schema};
use serde_json::{Value, json};

/// Fragments of the messages of checks that a schema cannot express. `docs/scenes.md` lists them.
const BEYOND_SCHEMA: [&str; 9] = [
    "exceeds `duration`",
    "steps of `dt`",
    "the box is empty",
    "the ends of a capsule must differ",
    "cannot be rounded",
    "times of keys must increase",
    "unknown fabric",
    "expected one weight per vertex",
    "at most the static one",
];

const SCENE: &str = include_str!("../../fuzz/seeds/scene/every-key.toml");

/// A JSON schema with the keywords that the schema of scenes uses.
struct Checker {
    root: Value,
}

impl Checker {
    fn accepts(&self, schema: &Value, value: &Value) -> bool {
        let Value::Object(schema) = schema else { return schema != &Value::Bool(false) };
        schema.iter().all(|(keyword, rule)| self.passes(schema, keyword, rule, value))
    }

    fn passes(&self, schema: &serde_json::Map<String, Value>, keyword: &str, rule: &Value, value: &Value) -> bool {
        let each = |rule: &Value| -> Vec<bool> {
            rule.as_array().unwrap().iter().map(|one| self.accepts(one, value)).collect()
        };
        let (number, limit) = (value.as_f64(), rule.as_f64());
        let below = |strict: bool| match (number, limit) {
            (Some(number), Some(limit)) => number < limit || !strict && number == limit,
            _ => true,
        };
        let above = |strict: bool| match (number, limit) {
            (Some(number), Some(limit)) => number > limit || !strict && number == limit,
            _ => true,
        };
        let count = value.as_array().map(Vec::len);
        let object = value.as_object();
        match keyword {
            "$ref" => self.accepts(self.root.pointer(&rule.as_str().unwrap()[1..]).unwrap(), value),
            "type" => match rule {
                Value::Array(types) => types.iter().any(|one| is_of_type(one.as_str().unwrap(), value)),
                one => is_of_type(one.as_str().unwrap(), value),
            },
            "minimum" => above(false),
            "exclusiveMinimum" => above(true),
            "maximum" => below(false),
            "exclusiveMaximum" => below(true),
            "minItems" => count.is_none_or(|count| count as f64 >= limit.unwrap()),
            "maxItems" => count.is_none_or(|count| count as f64 <= limit.unwrap()),
            "items" => value.as_array().is_none_or(|items| items.iter().all(|item| self.accepts(rule, item))),
            "const" => same(rule, value),
            "enum" => rule.as_array().unwrap().contains(value),
            "not" => !self.accepts(rule, value),
            "anyOf" => each(rule).contains(&true),
            "oneOf" => each(rule).iter().filter(|&&one| one).count() == 1,
            "if" => !self.accepts(rule, value) || self.accepts(&schema["then"], value),
            "required" => object.is_none_or(|object| {
                rule.as_array().unwrap().iter().all(|key| object.contains_key(key.as_str().unwrap()))
            }),
            "dependentRequired" => object.is_none_or(|object| {
                let rules = rule.as_object().unwrap().iter().filter(|(key, _)| object.contains_key(*key));
                rules
                    .flat_map(|(_, keys)| keys.as_array().unwrap())
                    .all(|key| object.contains_key(key.as_str().unwrap()))
            }),
            "properties" => object.is_none_or(|object| {
                let known = rule.as_object().unwrap().iter().filter_map(|(key, rule)| Some((rule, object.get(key)?)));
                known.into_iter().all(|(rule, value)| self.accepts(rule, value))
            }),
            "additionalProperties" => object.is_none_or(|object| {
                let known = schema.get("properties").and_then(Value::as_object);
                let mut others = object.iter().filter(|(key, _)| known.is_none_or(|known| !known.contains_key(*key)));
                others.all(|(_, value)| self.accepts(rule, value))
            }),
            "description" | "title" | "default" | "format" | "$defs" | "$schema" | "then" => true,
            other => panic!("unknown keyword {other}"),
        }
    }
}

fn is_of_type(name: &str, value: &Value) -> bool {
    match name {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "number" => value.is_number(),
        "integer" => value.as_f64().is_some_and(|number| number.fract() == 0.0),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        other => panic!("unknown type {other}"),
    }
}

fn same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Array(a), Value::Array(b)) => a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b)),
        (a, b) if a.is_number() && b.is_number() => a.as_f64() == b.as_f64(),
        (a, b) => a == b,
    }
}

fn scene() -> Value {
    serde_json::to_value(SCENE.parse::<toml::Table>().unwrap()).unwrap()
}

/// Returns the JSON pointers of all values below the root.
fn pointers(value: &Value, at: &str, found: &mut Vec<String>) {
    let inner: Vec<(String, &Value)> = match value {
        Value::Object(object) => object.iter().map(|(key, value)| (format!("{at}/{key}"), value)).collect(),
        Value::Array(items) => items.iter().enumerate().map(|(key, value)| (format!("{at}/{key}"), value)).collect(),
        _ => Vec::new(),
    };
    for (at, value) in inner {
        pointers(value, &at, found);
        found.push(at);
    }
}

/// Returns whether the program accepts the scene; `None` if it refuses it by a check that a schema cannot express.
fn program_accepts(scene: &Value) -> (Option<bool>, String) {
    let text = toml::to_string(scene).unwrap();
    match Scene::parse(&text, "scene.toml".as_ref()) {
        Ok(_) => (Some(true), String::new()),
        Err(error) => {
            let message = error.to_string();
            (if BEYOND_SCHEMA.iter().any(|part| message.contains(part)) { None } else { Some(false) }, message)
        }
    }
}

#[test]
fn program_and_schema_agree_on_edited_scenes() {
    let checker = Checker { root: schema() };
    let good = scene();
    assert_eq!(program_accepts(&good), (Some(true), String::new()));
    assert!(checker.accepts(&checker.root, &good));
    let numbers = [-1e20, -2e9, -1.0, -0.5, 0.0, 1e-9, 0.5, 1.0, 1.5, 2.0, 5000.0, 2e9, 1e12, 1e13, 1e20];
    let others =
        [json!("zebra"), json!(true), json!({}), json!([1.0, 2.0, 3.0, 4.0]), json!([]), json!([0.0, 0.0, 0.0])];
    let values: Vec<Value> = numbers.iter().map(|number| json!(number)).chain(others).collect();
    let mut all = Vec::new();
    pointers(&good, "", &mut all);
    let mut differences = Vec::new();
    let mut compare = |what: String, edited: &Value| {
        let (accepted, message) = program_accepts(edited);
        if accepted.is_some_and(|accepted| accepted != checker.accepts(&checker.root, edited)) {
            differences
                .push(format!("{what}: {}", if message.is_empty() { "only the schema refuses" } else { &message }));
        }
    };
    for pointer in &all {
        for value in &values {
            let mut edited = good.clone();
            *edited.pointer_mut(pointer).unwrap() = value.clone();
            compare(format!("{pointer} = {value}"), &edited);
        }
        let mut edited = good.clone();
        let (parent, key) = pointer.rsplit_once('/').unwrap();
        match edited.pointer_mut(parent).unwrap() {
            Value::Object(object) => drop(object.remove(key)),
            Value::Array(items) => drop(items.remove(key.parse().unwrap())),
            _ => unreachable!("the parent of a pointer has entries"),
        }
        compare(format!("without {pointer}"), &edited);
        if let Some(Value::Object(object)) = edited.pointer_mut(parent) {
            object.insert("zebra".to_owned(), json!(1.0));
            compare(format!("{parent}/zebra without {pointer}"), &edited);
        }
    }
    assert!(all.len() > 200, "{}", all.len());
    assert!(differences.is_empty(), "{} differences:\n{}", differences.len(), differences.join("\n"));
}

/// Calls a function with every schema within a schema, and its JSON pointer.
fn visit(schema: &Value, at: &str, found: &mut impl FnMut(&str, &Value)) {
    found(at, schema);
    match schema {
        Value::Object(object) => object.iter().for_each(|(key, inner)| visit(inner, &format!("{at}/{key}"), found)),
        Value::Array(items) => {
            items.iter().enumerate().for_each(|(at_, inner)| visit(inner, &format!("{at}/{at_}"), found))
        }
        _ => {}
    }
}

#[test]
fn every_key_has_a_description_and_every_number_a_range() {
    let root = schema();
    let mut problems = Vec::new();
    visit(&root, "", &mut |at, schema| {
        let is_number = ["number", "integer"].iter().any(|name| schema["type"] == *name);
        let has = |names: [&str; 2]| names.iter().any(|name| schema.get(name).is_some());
        if is_number && !(has(["minimum", "exclusiveMinimum"]) && has(["maximum", "exclusiveMaximum"])) {
            problems.push(format!("{at} has no range"));
        }
        // The alternatives of a choice are described as such.
        let is_choice = at.contains("/oneOf/") || at.contains("/anyOf/") || ["/if", "/then"].contains(&at);
        if let (false, Some(properties)) = (is_choice, schema["properties"].as_object()) {
            let bare = properties.iter().filter(|(_, property)| property.get("description").is_none());
            problems.extend(bare.map(|(key, _)| format!("{at}/properties/{key} has no description")));
        }
    });
    assert!(problems.is_empty(), "{}", problems.join("\n"));
}

#[test]
fn impossible_values_are_refused_with_the_reason() {
    let message = |pointer: &str, value: Value| {
        let mut edited = scene();
        *edited.pointer_mut(pointer).unwrap() = value;
        program_accepts(&edited).1
    };
    let expect = |pointer: &str, value: Value, part: &str| {
        let message = message(pointer, value);
        assert!(message.contains(part), "{pointer}: {message}");
    };
    expect("/gravity", json!([0.0, 0.0, -9.81, 1.0]), "expected 3 entries, got 4");
    expect("/mesh/sheet/cells", json!([4, 4, 4]), "expected 2 entries, got 3");
    expect("/seams/0/pairs/0", json!([0, 1, 2]), "expected 2 entries, got 3");
    expect("/dt", json!(2.0), "`dt` = 2 s exceeds `duration` = 1 s; give a `dt` of at most the duration");
    expect("/dt", json!(1e-300), "more than 1e9; give a larger `dt`");
    expect("/tolerances/iterations", json!(0), "expected a whole number from 1 to 1000000, got 0");
    expect("/tolerances/linear", json!(2.0), "expected a number strictly between 0 and 1, got 2");
    expect("/garment/0/velocity", json!([0.0, 0.0, 1e300]), "nothing is faster than light");
    expect("/fabric/material/stvk/stretch_stiffness", json!(1e20), "up to 1e12, got 1");
}

#[test]
fn messages_say_what_was_expected_and_what_to_write() {
    let expect = |from: &str, to: &str, parts: &[&str]| {
        assert!(SCENE.contains(from), "{from}");
        let message = Scene::parse(&SCENE.replacen(from, to, 1), "scene.toml".as_ref()).unwrap_err().to_string();
        assert!(parts.iter().all(|part| message.contains(part)), "{message}");
    };
    let listed = ["expected one of `implicit-euler`", "`newton`", "invalid type: integer `5`"];
    expect("integrator = \"newton\"", "integrator = 5", &listed);
    let kinds = "expected exactly one of `sheet`, `disc`, `strip`, `obj`, got";
    expect(
        "[mesh.sheet]",
        "[mesh.disc]\nradius = 1.0\nrings = 2\n[mesh.sheet]",
        &["scene.toml:", kinds, "`disc`", "`sheet`"],
    );
    expect("[mesh.sheet]", "[mesh.sheeet]", &["unknown variant `sheeet`", "did you mean `sheet`?"]);
    expect("mesh.disc = { radius = 1.0, rings = 3 }", "mesh = 5", &["expected one of `sheet`, `disc`"]);
    expect("min = [-1.0", "min = [2.0", &["its `min` exceeds its `max` along x, 2 > 1; exchange the two"]);
    expect("cells = [4, 4]", "cells = [4.5, 4]", &["floating point `4.5`, expected a whole number"]);
    expect("cells = [4, 4]", "cells = [-4, 4]", &["expected a whole number from 1 to 4096, got -4"]);
    expect("vertex = 3", "vertex = \"a\"", &["expected a whole number"]);
    let fabric = ["unknown fabric `demin`, expected a table or one of the fabrics", "did you mean `denim`?"];
    expect("fabric = \"denim\"", "fabric = \"demin\"", &fabric);
}
