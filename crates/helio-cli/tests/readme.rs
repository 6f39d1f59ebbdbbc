//! What README and manual tell people to type, typed.
//!
//! Every `helio-rs …` and `cargo run … -- …` line of their ```sh blocks runs, page by page, in a copy
//! of the examples and must be good; lines of a ```text block after it must stand in what it said.

// Test helpers fail loudly; the lint knows only functions that are tests themselves.
#![allow(clippy::unwrap_used)]

mod common;

use std::path::{Path, PathBuf};

use common::Folder;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The arguments of a line that runs the program, and the file that takes its standard output.
fn arguments(line: &str) -> Option<(Vec<&str>, Option<&str>)> {
    let line = line.split(" #").next().unwrap_or_default();
    let rest = match line.strip_prefix("helio-rs ") {
        Some(rest) => rest,
        None if line.starts_with("cargo run ") => line.split_once(" -- ")?.1,
        None => return None,
    };
    let (rest, file) = match rest.split_once(" > ") {
        Some((rest, file)) => (rest, Some(file.trim())),
        None => (rest, None),
    };
    Some((rest.split_whitespace().collect(), file))
}

/// Runs a page; the number of commands and of lines of output that were looked for.
fn run(page: &Path) -> (usize, usize) {
    let folder = Folder::empty();
    std::fs::create_dir_all(folder.path().join("examples/flux")).unwrap();
    for name in [
        "field.toml",
        "heliostats.csv",
        "observations.csv",
        "flux/strips.inp",
        "flux/strips.frd",
        "flux/strips.toml",
        "flux/tower.toml",
    ] {
        let from = root().join("examples").join(name);
        std::fs::copy(from, folder.path().join("examples").join(name)).unwrap();
    }
    common::copy_folder(
        &root().join("examples/paint"),
        &folder.path().join("examples/paint"),
    );
    let text = std::fs::read_to_string(page).unwrap().replace("\\\n", " ");
    let (mut commands, mut looked_for) = (0, 0);
    let mut block = None;
    let mut said = String::new();
    for (index, line) in text.lines().enumerate() {
        let place = || format!("{}, line {} or so: {line}", page.display(), index + 1);
        if let Some(kind) = line.trim_start().strip_prefix("```") {
            block = if block.is_some() { None } else { Some(kind) };
            if block == Some("sh") {
                said.clear();
            }
            continue;
        }
        match block {
            Some("sh") => {
                let Some((args, file)) = arguments(line) else {
                    continue;
                };
                let run = folder.run(&args);
                said += &run.stderr();
                let out = run.good();
                match file {
                    Some(file) => folder.write(file, out),
                    None => said += &out,
                }
                commands += 1;
            }
            Some("text") if !said.is_empty() && !line.trim().is_empty() && line != "..." => {
                assert!(said.lines().any(|l| l == line), "{}\n{said}", place());
                looked_for += 1;
            }
            _ => {}
        }
    }
    assert!(block.is_none(), "{}: a block stays open", page.display());
    (commands, looked_for)
}

#[test]
fn the_readme_runs() {
    let (commands, looked_for) = run(&root().join("README.md"));
    assert!(commands >= 6 && looked_for >= 4, "{commands} {looked_for}");
}

#[test]
fn the_manual_runs() {
    let mut commands = 0;
    for entry in std::fs::read_dir(root().join("docs")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "md") {
            commands += run(&path).0;
        }
    }
    assert!(commands >= 14, "{commands}");
}

/// Names of all keys in a JSON Schema.
fn keys(schema: &serde_json::Value, found: &mut Vec<String>) {
    if let Some(properties) = schema.get("properties").and_then(|p| p.as_object()) {
        for (name, value) in properties {
            found.push(name.clone());
            keys(value, found);
        }
    }
    if let Some(named) = schema.get("additionalProperties") {
        keys(named, found);
    }
}

#[test]
fn every_key_is_in_the_manual() {
    let mut found = Vec::new();
    for (file, least) in [("field", 60), ("target", 10), ("scene", 50)] {
        let before = found.len();
        let schema = Folder::empty().run(&["schema", file]).good();
        keys(&serde_json::from_str(&schema).unwrap(), &mut found);
        assert!(found.len() > before + least, "{file}");
    }
    let page = std::fs::read_to_string(root().join("docs/files.md")).unwrap();
    for name in found {
        let told = ["`NAME`", "`[NAME]`", "`[NAME.", "[heliostats.drive.NAME]"]
            .iter()
            .any(|form| page.contains(&form.replace("NAME", &name)));
        assert!(told, "docs/files.md does not tell of {name}");
    }
}

#[test]
fn messages_of_the_manual_are_recorded_ones() {
    let mut recorded = String::new();
    let snapshots = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/snapshots");
    for entry in std::fs::read_dir(snapshots).unwrap() {
        recorded += &std::fs::read_to_string(entry.unwrap().path()).unwrap();
    }
    let page = std::fs::read_to_string(root().join("docs/errors.md")).unwrap();
    let mut count = 0;
    for message in page.lines().filter(|line| line.starts_with("error: ")) {
        assert!(recorded.lines().any(|line| line == message), "{message}");
        count += 1;
    }
    assert!(count >= 25, "{count}");
}
