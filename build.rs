//! Turns the model descriptions into tables, so that no name, reference, unit, bound or start value stands twice.
//!
//! A variable that is renamed in `modelDescription/` breaks the build wherever the code still uses the old name; an
//! effect that is listed there without its file in `src/effects/`, too.

#[path = "src/fmi2/guid.rs"]
mod guid;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::{env, fs};

fn main() {
    let root = env::var("CARGO_MANIFEST_DIR").expect("cargo sets CARGO_MANIFEST_DIR");
    let out = env::var("OUT_DIR").expect("cargo sets OUT_DIR");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=src/fmi2/guid.rs");
    println!("cargo::rustc-env=KISSPOINT_PLACES={}", places(&root, &out).join("|"));
    println!("cargo::rustc-env=KISSPOINT_SOURCES={:032x}", sources(Path::new(&root)));
    for model in ["DrivelinePlant", "ClutchController"] {
        let path = Path::new(&root).join("modelDescription").join(model).with_extension("xml");
        println!("cargo::rerun-if-changed={}", path.display());
        let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let document = roxmltree::Document::parse(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let variables = variables(&document);
        let target = Path::new(&out).join(model).with_extension("rs");
        fs::write(target, variable_table(&variables) + &guid(&text, &variables) + &lookup_table(&variables))
            .expect("OUT_DIR can be written");
        if model == "DrivelinePlant" {
            fs::write(Path::new(&out).join("vehicle.rs"), vehicle_table(&variables)).expect("OUT_DIR can be written");
            fs::write(Path::new(&out).join("effects.rs"), effect_registry(&variables, &root)).expect("OUT_DIR can be written");
        } else {
            fs::write(Path::new(&out).join("settings.rs"), settings_table(&variables)).expect("OUT_DIR can be written");
        }
    }
}

/// What the plant is made of, by which a module for browsers is known to be of this version: a hash of all its sources.
fn sources(root: &Path) -> u128 {
    let mut all = Vec::new();
    for part in [
        "modelDescription",
        "src/effects",
        "src/effects/simulated",
        "src/faults.rs",
        "src/fmi2",
        "src/physics",
        "src/plant",
        "src/validated.rs",
        "src/vehicle.rs",
    ] {
        let path = root.join(part);
        println!("cargo::rerun-if-changed={}", path.display());
        let entries = fs::read_dir(&path).map(|entries| entries.map(|e| e.expect("a folder of sources can be read").path()).collect());
        all.extend(entries.unwrap_or_else(|_| vec![path]));
    }
    all.retain(|path| path.is_file());
    all.sort();
    let texts = all.iter().flat_map(|path| fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display())));
    // Line ends are left out, for a checkout may change them.
    guid::hash(texts.filter(|b| !matches!(b, b'\r' | b'\n')))
}

/// Folders of this machine whose names the compiler writes into what it builds: the longest first, for one may lie in another.
fn places(root: &str, out: &str) -> Vec<String> {
    // A build that remaps them says that there are none.
    println!("cargo::rerun-if-env-changed=KISSPOINT_PLACES");
    if let Ok(places) = env::var("KISSPOINT_PLACES") {
        return vec![places];
    }
    let home = || env::var("HOME").or_else(|_| env::var("USERPROFILE")).map(|home| Path::new(&home).join(".cargo").display().to_string());
    let target = Path::new(out).ancestors().nth(4).map(|folder| folder.display().to_string());
    let mut places: Vec<String> =
        [Some(root.to_owned()), env::var("CARGO_HOME").or_else(|_| home()).ok(), target].into_iter().flatten().collect();
    places.sort_by_key(|place| std::cmp::Reverse(place.len()));
    places
}

/// One ScalarVariable with its attributes and those of its type element, under their FMI names.
struct Variable {
    name: String,
    kind: String,
    attributes: BTreeMap<String, String>,
}

impl Variable {
    fn get(&self, key: &str) -> &str {
        self.attributes.get(key).map_or("", String::as_str)
    }
    fn start(&self) -> String {
        match self.kind.as_str() {
            "Boolean" => if self.get("start") == "true" { "1.0" } else { "0.0" }.to_owned(),
            _ => self.real("start", "0.0"),
        }
    }
    fn real(&self, key: &str, default: &str) -> String {
        let text = self.attributes.get(key).map_or(default, String::as_str);
        match text.parse::<f64>() {
            Ok(value) if value.is_infinite() => format!("f64::{}INFINITY", if value < 0.0 { "NEG_" } else { "" }),
            Ok(value) => format!("{value:?}"),
            Err(_) => panic!("variable {}: {key}=\"{text}\" is not a number", self.name),
        }
    }
}

fn variables(document: &roxmltree::Document) -> Vec<Variable> {
    let unit_of_type: BTreeMap<&str, &str> = document
        .descendants()
        .filter(|n| n.has_tag_name("SimpleType"))
        .filter_map(|n| Some((n.attribute("name")?, n.first_element_child()?.attribute("unit")?)))
        .collect();
    document.descendants().filter(|n| n.has_tag_name("ScalarVariable")).map(|node| variable(node, &unit_of_type)).collect()
}

fn variable(node: roxmltree::Node, unit_of_type: &BTreeMap<&str, &str>) -> Variable {
    let typed = node.first_element_child().expect("a ScalarVariable holds its type");
    let mut attributes: BTreeMap<String, String> =
        node.attributes().chain(typed.attributes()).map(|a| (a.name().to_owned(), a.value().to_owned())).collect();
    if let Some(unit) = attributes.get("declaredType").and_then(|t| unit_of_type.get(t.as_str())) {
        attributes.insert("unit".to_owned(), (*unit).to_owned());
    }
    let name = attributes.remove("name").expect("a ScalarVariable has a name");
    Variable { name, kind: typed.tag_name().name().to_owned(), attributes }
}

fn camel(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |first| first.to_uppercase().collect::<String>() + chars.as_str())
}

fn variable_table(variables: &[Variable]) -> String {
    let mut text = String::from(
        "/// Value references, named as the variables are, with `_` for `.`.\n#[allow(non_upper_case_globals, missing_docs)]\npub mod vr {\n",
    );
    for v in variables {
        writeln!(text, "    pub const {}: u32 = {};", v.name.replace('.', "_"), v.get("valueReference")).unwrap();
    }
    text.push_str(
        "}\n/// Places in [`VARIABLES`], named as the variables are.\n#[allow(non_upper_case_globals, missing_docs)]\npub mod at {\n",
    );
    for (index, v) in variables.iter().enumerate() {
        writeln!(text, "    pub const {}: usize = {index};", v.name.replace('.', "_")).unwrap();
    }
    writeln!(
        text,
        "}}\n/// All variables, in the order of the model description.\npub static VARIABLES: [Variable; {}] = [",
        variables.len()
    )
    .unwrap();
    for v in variables {
        let variability = if v.get("variability").is_empty() { "Continuous".to_owned() } else { camel(v.get("variability")) };
        writeln!(
            text,
            "    Variable {{ name: {:?}, value_reference: {}, kind: Kind::{}, causality: Causality::{}, variability: Variability::{}, unit: {:?}, start: {}, min: {}, max: {} }},",
            v.name,
            v.get("valueReference"),
            v.kind,
            camel(v.get("causality")),
            variability,
            v.get("unit"),
            v.start(),
            v.real("min", "-inf"),
            v.real("max", "inf"),
        )
        .unwrap();
    }
    text.push_str("];\n");
    text
}

/// The GUID: a hash of the XML in the form of a UUID of version 8, so that it changes with the interface and is each model's own; its tail is that of
/// the start values in the XML.
fn guid(xml: &str, variables: &[Variable]) -> String {
    // Line ends are left out, for a checkout may change them.
    let hash = guid::hash(xml.bytes().filter(|b| !matches!(b, b'\r' | b'\n')));
    let uuid = hash & !(0xf << 76 | 0x3 << 62) | 0x8 << 76 | 0x2 << 62;
    let d = format!("{uuid:032x}");
    let starts = variables.iter().map(|v| v.start().parse().expect("a start value is a number"));
    let tail = String::from_utf8(guid::tail(starts).to_vec()).expect("digits are text");
    let interface = format!("{}-{}-{}-{}-", &d[..8], &d[8..12], &d[12..16], &d[16..20]);
    assert_eq!((interface.len(), interface.len() + tail.len()), (guid::OF_INTERFACE, guid::LENGTH));
    format!("/// GUID of the model with the start values of its source.\npub const GUID: &str = \"{interface}{tail}\";\n")
}

/// Index of the variable by value reference, so that access takes no search.
fn lookup_table(variables: &[Variable]) -> String {
    let references: Vec<usize> =
        variables.iter().map(|v| v.get("valueReference").parse().expect("a value reference is a number")).collect();
    let mut table = vec![u16::MAX; references.iter().max().map_or(0, |most| most + 1)];
    for (index, &reference) in references.iter().enumerate() {
        assert_eq!(table[reference], u16::MAX, "value reference {reference} stands twice");
        table[reference] = index as u16;
    }
    format!("/// Index in [`VARIABLES`] by value reference.\npub static LOOKUP: [u16; {}] = {table:?};\n", table.len())
}

/// The vehicle's numbers are the fixed parameters with a dot; the field has the variable's name.
fn vehicle_table(variables: &[Variable]) -> String {
    let numbers = variables.iter().filter(|v| v.name.contains('.') && !v.name.starts_with("effect."));
    number_table("The numbers of a vehicle", "NUMBERS", "Vehicle", &numbers.map(|v| (v.name.as_str(), v)).collect::<Vec<_>>())
}

/// The controller's settings are its start values and the parameters `controller.<field>`.
fn settings_table(variables: &[Variable]) -> String {
    let parameters = variables.iter().filter(|v| v.get("causality") == "parameter");
    let fields: Vec<(&str, &Variable)> = parameters
        .filter_map(|v| v.name.strip_prefix("controller.").or((!v.name.contains('.')).then_some(&v.name)).map(|field| (field, v)))
        .collect();
    number_table("The controller's settings", "SETTINGS", "Settings", &fields)
}

/// Numbers of the struct `of`, each with its field and variable.
fn number_table(what: &str, table: &str, of: &str, fields: &[(&str, &Variable)]) -> String {
    let count = fields.len();
    let mut text = format!("/// {what} under their flat names.\npub static {table}: [Number<{of}>; {count}] = [\n");
    for (field, v) in fields {
        writeln!(
            text,
            "    Number {{ name: {:?}, unit: {:?}, meaning: {:?}, default: {}, min: {}, max: {}, value_reference: {}, get: |s| s.{field}, get_mut: |s| &mut s.{field} }},",
            v.name, v.get("unit"), v.get("description"), v.real("start", "0.0"), v.real("min", "-inf"), v.real("max", "inf"),
            v.get("valueReference")
        )
        .unwrap();
    }
    text + "];\n"
}

/// Tables that were learned from recordings: parameters of the plant, but no effect of the library.
const EMPIRICAL: &str = "empirical";

fn effect_registry(variables: &[Variable], root: &str) -> String {
    let parameters: Vec<(&str, &str, &Variable)> = variables
        .iter()
        .filter_map(|v| v.name.strip_prefix("effect.").map(|rest| (rest, v)))
        .map(|(rest, v)| {
            rest.split_once('.')
                .map(|(id, name)| (id, name, v))
                .unwrap_or_else(|| panic!("{}: effect.<id>.<parameter> is expected", v.name))
        })
        .collect();
    let mut ids: Vec<&str> = parameters.iter().map(|p| p.0).collect();
    ids.dedup();
    let mut text = String::new();
    for id in &ids {
        let folder = if simulated(root, id) { "effects/simulated" } else { "effects" };
        writeln!(text, "#[path = \"{root}/src/{folder}/{id}.rs\"]\npub mod {id};").unwrap();
    }
    writeln!(text, "/// Number of parameters of all effects together.\npub const N_PARAMETERS: usize = {};", parameters.len()).unwrap();
    text.push_str(
        "/// Index of each parameter, as `param::<id>::<parameter>`.\n#[allow(non_upper_case_globals, missing_docs)]\npub mod param {\n",
    );
    for id in &ids {
        writeln!(text, "    pub mod {id} {{").unwrap();
        for (k, p) in parameters.iter().enumerate().filter(|(_, p)| p.0 == *id) {
            writeln!(text, "        pub const {}: usize = {k};", p.1).unwrap();
        }
        text.push_str("    }\n");
    }
    writeln!(text, "}}\n/// Every parameter of every effect.\npub static PARAMETERS: [Parameter; N_PARAMETERS] = [").unwrap();
    for (id, name, v) in &parameters {
        writeln!(
            text,
            "    Parameter {{ effect: {id:?}, name: {name:?}, variable: {:?}, unit: {:?}, meaning: {:?}, null: {}, min: {}, max: {}, nominal: {}, value_reference: {} }},",
            v.name, v.get("unit"), v.get("description"), v.real("start", "0.0"), v.real("min", "-inf"), v.real("max", "inf"), v.real("nominal", "1.0"), v.get("valueReference")
        )
        .unwrap();
    }
    text.push_str("];\n");
    let (beyond, library): (Vec<&str>, Vec<&str>) = ids.iter().filter(|id| **id != EMPIRICAL).partition(|id| simulated(root, id));
    for (name, meaning, ids) in [
        ("REGISTRY", "The library that a diagnosis searches: every effect, in the order of the model description.", library),
        ("SIMULATED", "Effects that are there to be simulated: the plant has them, and no diagnosis searches for them.", beyond),
    ] {
        writeln!(text, "/// {meaning}\npub static {name}: [Entry; {}] = [", ids.len()).unwrap();
        for id in ids {
            let first = parameters.iter().position(|p| p.0 == id).expect("an id comes from its parameters");
            let count = parameters.iter().filter(|p| p.0 == id).count();
            assert!(parameters[first..first + count].iter().all(|p| p.0 == id), "the parameters of effect {id} must stand together");
            writeln!(text, "    Entry {{ id: {id:?}, effect: &{id}::EFFECT, parameters: {first}..{} }},", first + count).unwrap();
        }
        text.push_str("];\n");
    }
    text
}

/// Whether an effect is there to be simulated only: its file says so by where it stands.
fn simulated(root: &str, id: &str) -> bool {
    Path::new(root).join("src/effects/simulated").join(id).with_extension("rs").exists()
}
