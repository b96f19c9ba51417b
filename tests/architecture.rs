//! The invariants of docs/architecture.md that can be checked on the source text.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::{fs, iter};

/// Modules that each module may import; the only list of import directions.
const IMPORTS: [(&str, &[&str]); 18] = [
    ("physics", &[]),
    ("json", &[]),
    ("validated", &[]),
    ("vehicle", &["physics", "json"]),
    ("effects", &["physics", "vehicle"]),
    ("faults", &["effects"]),
    ("plant", &["physics", "vehicle", "effects"]),
    ("control", &["physics", "vehicle"]),
    ("fmi2", &["physics", "json", "validated", "vehicle", "effects", "faults", "plant", "control"]),
    ("launch", &["physics", "vehicle", "effects", "faults", "plant", "control"]),
    ("plots", &["physics", "vehicle", "effects", "plant", "control", "launch"]),
    ("campaign", &["json"]),
    // Of `plots`, only the line chart.
    ("survey", &["campaign", "plots"]),
    ("gap", &["physics", "validated", "vehicle", "effects", "plant", "campaign"]),
    // Of `gap`, only the types in which curves are handed over.
    ("report", &["validated", "vehicle", "effects", "gap"]),
    ("fmu", &["physics", "validated", "vehicle", "effects", "faults", "control", "fmi2", "launch"]),
    (
        "cli",
        &[
            "physics",
            "json",
            "validated",
            "vehicle",
            "effects",
            "faults",
            "plant",
            "control",
            "launch",
            "plots",
            "campaign",
            "survey",
            "report",
            "gap",
            "fmu",
        ],
    ),
    ("main", &[]),
];

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Every file below `dir` with this extension.
fn files(dir: &Path, ending: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(dir).unwrap_or_else(|e| panic!("{}: {e}", dir.display()));
    let mut all: Vec<PathBuf> = entries
        .map(|entry| entry.unwrap().path())
        .flat_map(|path| if path.is_dir() { files(&path, ending) } else { vec![path] })
        .filter(|path| path.extension().is_some_and(|e| e == ending))
        .collect();
    all.sort();
    all
}

/// The text without comments, without string literals that do not span lines, and without the test module at its end.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    let text = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
    let mut code = String::new();
    for line in text.lines() {
        for (k, part) in line.split("//").next().unwrap_or_default().split('"').enumerate() {
            code.push_str(if k % 2 == 0 { part } else { "\"\"" });
        }
        code.push('\n');
    }
    code
}

/// The top-level module that a source file belongs to.
fn module(path: &Path) -> String {
    let inside = path.strip_prefix(root().join("src")).unwrap();
    inside.components().next().unwrap().as_os_str().to_string_lossy().trim_end_matches(".rs").to_owned()
}

/// Top-level modules that this code names as `crate::…`, also within a list in braces.
fn imports(code: &str) -> BTreeSet<String> {
    let name = |text: &str| text.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    code.split("crate::")
        .skip(1)
        .flat_map(|rest| match rest.strip_prefix('{') {
            Some(list) => list.split('}').next().unwrap_or_default().split(',').map(name).collect::<Vec<_>>(),
            None => vec![name(rest)],
        })
        .filter(|n| !n.is_empty())
        .collect()
}

#[test]
fn imports_flow_one_way() {
    let mut seen = BTreeSet::new();
    for path in files(&root().join("src"), "rs") {
        let own = module(&path);
        if own == "lib" {
            continue;
        }
        let (_, allowed) = IMPORTS.iter().find(|(name, _)| *name == own).unwrap_or_else(|| panic!("{own} has no line in IMPORTS"));
        for other in imports(&code(&path)) {
            assert!(other == own || allowed.contains(&other.as_str()), "{} imports {other}; {own} may import {allowed:?}", path.display());
        }
        seen.insert(own);
    }
    assert_eq!(seen.len(), IMPORTS.len(), "IMPORTS names a module that is not there");
}

#[test]
fn the_directions_have_no_circle() {
    for (name, allowed) in IMPORTS {
        let mut reached: BTreeSet<&str> = allowed.iter().copied().collect();
        for _ in 0..IMPORTS.len() {
            reached =
                reached.iter().flat_map(|m| iter::once(*m).chain(IMPORTS.iter().find(|i| i.0 == *m).unwrap().1.iter().copied())).collect();
        }
        assert!(!reached.contains(name), "{name} imports itself by a detour");
    }
}

#[test]
fn physics_and_control_never_name_fmi() {
    for folder in ["physics", "control"] {
        for path in files(&root().join("src").join(folder), "rs") {
            let named = code(&path).to_lowercase();
            assert!(!named.contains("fmi"), "{} names FMI", path.display());
        }
    }
}

#[test]
fn every_file_of_an_effect_is_registered() {
    let found: BTreeSet<String> = files(&root().join("src/effects"), "rs")
        .iter()
        .map(|p| p.file_stem().unwrap().to_string_lossy().into_owned())
        .filter(|stem| stem != "mod")
        .collect();
    // A learned law is not an effect of the library.
    let all = kisspoint::effects::all().map(|e| e.id).chain(["empirical"]);
    let registered: BTreeSet<String> = all.map(str::to_owned).collect();
    assert_eq!(found, registered);
    for entry in &kisspoint::effects::SIMULATED {
        let file = root().join("src/effects/simulated").join(entry.id).with_extension("rs");
        assert!(file.exists(), "{} is simulated only, and its file stands elsewhere", entry.id);
    }
}

#[test]
fn unsafe_code_stands_in_fmi2_alone() {
    for path in files(&root().join("src"), "rs").into_iter().filter(|p| module(p) != "fmi2") {
        let words = code(&path);
        let found = words.split(|c: char| !(c.is_alphanumeric() || c == '_')).any(|word| word == "unsafe");
        assert!(!found, "{} is unsafe", path.display());
    }
    let tour = fs::read_to_string(root().join("src/lib.rs")).unwrap();
    assert!(tour.contains("#![deny(unsafe_code)]"));
    assert_eq!(tour.matches("#[allow(unsafe_code)]").count(), 1);
}

#[test]
fn no_file_names_a_path_of_one_machine() {
    let homes: Vec<String> = ["home", "Users", "root", "work"].iter().map(|name| format!("/{name}/")).collect();
    for folder in ["src", "docs", "tests", "packaging", "benches", "realcar", "modelDescription"] {
        for ending in ["rs", "md", "sh", "py", "xml", "toml", "c", "js", "json"] {
            for path in files(&root().join(folder), ending) {
                let text = fs::read_to_string(&path).unwrap();
                for line in text.lines() {
                    let named = homes.iter().find(|home| line.match_indices(home.as_str()).any(|(at, _)| begins_a_path(line, at)));
                    assert!(named.is_none(), "{}: {line}", path.display());
                }
            }
        }
    }
}

#[test]
fn every_effect_is_documented() {
    let page = fs::read_to_string(root().join("docs/effects.md")).unwrap();
    for c in &kisspoint::effects::empirical::CURVES {
        assert!(page.contains(&format!("`{}_1`", c.name)), "docs/effects.md has no row for {}", c.name);
    }
    for p in kisspoint::effects::PARAMETERS.iter().filter(|p| p.effect != "empirical") {
        let row = page.lines().find(|line| line.starts_with('|') && line.contains(&format!("| `{}` |", p.effect)));
        let row = row.unwrap_or_else(|| panic!("docs/effects.md has no row for {}", p.effect));
        assert!(row.contains(&format!("`{}`", p.name)), "docs/effects.md: {} has a parameter `{}`", p.effect, p.name);
    }
}

#[test]
fn the_table_of_invariants_names_tests_that_are_there() {
    let page = fs::read_to_string(root().join("docs/architecture.md")).unwrap();
    let table = page.split("## Invariants").nth(1).unwrap();
    let mut named = 0;
    for row in table.lines().filter(|line| line.starts_with("| ") && !line.contains("| test |")) {
        let quoted: Vec<&str> = row.rsplit_once(" | ").unwrap().1.split('`').skip(1).step_by(2).collect();
        let mut text = String::new();
        for file in quoted.iter().filter(|name| name.ends_with(".rs") || name.ends_with(".py")) {
            let path = if file.starts_with("src/") { root().join(file) } else { root().join("tests").join(file) };
            text += &fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            named += 1;
        }
        for function in quoted.iter().filter(|name| !name.contains(['.', '!'])) {
            assert!(text.contains(&format!("fn {function}()")), "{function} is in none of the files that stand beside it");
        }
    }
    assert!(named > 20, "{named} files");
}

/// Whether `at` is the beginning of a path and not its middle.
fn begins_a_path(line: &str, at: usize) -> bool {
    !line[..at].ends_with(|c: char| c.is_alphanumeric() || matches!(c, '.' | '_' | '-' | '/' | '}' | ')' | '~'))
}

#[test]
fn every_link_of_the_documentation_leads_somewhere() {
    let mut pages = files(&root().join("docs"), "md");
    pages.extend(["README.md", "CHANGELOG.md"].map(|name| root().join(name)));
    for page in pages {
        let text = fs::read_to_string(&page).unwrap();
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let file = link.split('#').next().unwrap_or_default();
            if !link.contains("://") && !file.is_empty() {
                assert!(page.parent().unwrap().join(file).exists(), "{}: {link}", page.display());
            }
        }
    }
}
