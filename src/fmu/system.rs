//! The coupled launch for co-simulation masters: `launch.ssp` (SSP 1.0) and `OspSystemStructure.xml` (libcosim).
//!
//! Both describe column B of the paper's Table II: the mismatched plant and the controller with its torque feedback. Connected variables have the
//! same unit on both sides, because not every master converts units.

use super::ssv::{self, Parameter};
use super::{FmuError, Model, archive_of};
use crate::control::settings::SETTINGS;
use crate::effects::PARAMETERS;
use crate::fmi2::{controller, plant};
use crate::launch::{Setup, TABLE_II};
use crate::vehicle::Vehicle;
use std::fmt::Write;

/// Variables that the plant passes to the controller; their names are the same on both sides.
pub const TO_CONTROLLER: [&str; 3] = ["omega_f", "omega_c", "T_e"];

/// Variables that the controller passes to the plant.
pub const TO_PLANT: [&str; 3] = ["x_to", "T_e_ref", "T_brake"];

/// Communication step of the launch, s.
const STEP: f64 = 1e-3;

/// Names of the components. Neither is the beginning of a variable's name, as `controller` would be: OMSimulator would find `controller.kp_engine` in it ambiguous.
pub const COMPONENTS: [&str; 2] = ["plant", "clutch_controller"];

/// The two parameter sets of the launch.
pub struct Sets {
    /// Effects of the plant that differ from their null values.
    pub plant: Vec<Parameter<'static>>,
    /// Settings of the controller.
    pub controller: Vec<Parameter<'static>>,
}

/// The parameter sets of the launch of `vehicle`.
pub fn sets(vehicle: &Vehicle) -> Sets {
    let Setup { effects, settings, .. } = TABLE_II[TABLE_II.len() - 1].setup(vehicle);
    let changed = PARAMETERS.iter().zip(effects).filter(|(p, value)| *value != p.null);
    Sets {
        plant: changed.map(|(p, value)| Parameter { name: p.variable, value, unit: p.unit }).collect(),
        controller: SETTINGS.iter().map(|s| Parameter { name: s.name, value: (s.get)(&settings), unit: s.unit }).collect(),
    }
}

/// The bytes of `launch.ssp`, with these FMUs in it.
///
/// # Errors
/// The archive cannot be made.
pub fn ssp(fmus: &[(&Model, Vec<u8>)], vehicle: &Vehicle) -> Result<Vec<u8>, FmuError> {
    let sets = sets(vehicle);
    let mut files = vec![
        ("SystemStructure.ssd".to_owned(), ssd().into_bytes()),
        (format!("resources/{}.ssv", COMPONENTS[0]), ssv::write(COMPONENTS[0], &sets.plant).into_bytes()),
        (format!("resources/{}.ssv", COMPONENTS[1]), ssv::write(COMPONENTS[1], &sets.controller).into_bytes()),
    ];
    files.extend(fmus.iter().map(|(model, bytes)| (format!("resources/{}.fmu", model.description.name), bytes.clone())));
    archive_of(&files)
}

const HEAD: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<ssd:SystemStructureDescription \
xmlns:ssd=\"http://ssp-standard.org/SSP1/SystemStructureDescription\" \
xmlns:ssc=\"http://ssp-standard.org/SSP1/SystemStructureCommon\" \
xmlns:ssv=\"http://ssp-standard.org/SSP1/SystemStructureParameterValues\" \
xmlns:oms=\"https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd\" \
version=\"1.0\" name=\"launch\">\n  <ssd:System name=\"launch\">\n    <ssd:Elements>\n";

fn ssd() -> String {
    let mut text = HEAD.to_owned();
    component(&mut text, COMPONENTS[0], plant::DESCRIPTION.name, &TO_PLANT, &TO_CONTROLLER);
    component(&mut text, COMPONENTS[1], controller::DESCRIPTION.name, &TO_CONTROLLER, &TO_PLANT);
    text.push_str("    </ssd:Elements>\n    <ssd:Connections>\n");
    for (from, to, name) in connections() {
        let line = format!("startElement=\"{from}\" startConnector=\"{name}\" endElement=\"{to}\" endConnector=\"{name}\"");
        add(&mut text, &format!("      <ssd:Connection {line}/>"));
    }
    add(&mut text, &format!("    </ssd:Connections>\n{}  </ssd:System>", oms_master()));
    text.push_str("  <ssd:DefaultExperiment startTime=\"0.0\" stopTime=\"2.5\"/>\n");
    text + "</ssd:SystemStructureDescription>\n"
}

/// `SystemStructure.ssd` of one component, whose parameters are in `resources/<component>.ssv`.
pub fn single(system: &str, name: &str, model: &str) -> String {
    let mut text = HEAD.replace("launch", system);
    component(&mut text, name, model, &TO_PLANT, &TO_CONTROLLER);
    text + "    </ssd:Elements>\n  </ssd:System>\n</ssd:SystemStructureDescription>\n"
}

/// Annotation with the master algorithm and the step for OMSimulator, which imports no system without it.
fn oms_master() -> String {
    format!(
        "    <ssd:Annotations>\n      <ssc:Annotation type=\"org.openmodelica\">\n        <oms:Annotations>\n          <oms:SimulationInformation>\n            \
         <oms:FixedStepMaster description=\"oms-ma\" stepSize=\"{STEP:?}\" absoluteTolerance=\"1e-4\" relativeTolerance=\"1e-4\"/>\n          \
         </oms:SimulationInformation>\n        </oms:Annotations>\n      </ssc:Annotation>\n    </ssd:Annotations>\n"
    )
}

fn component(text: &mut String, name: &str, model: &str, inputs: &[&str], outputs: &[&str]) {
    add(text, &format!("      <ssd:Component name=\"{name}\" type=\"application/x-fmu-sharedlibrary\" source=\"resources/{model}.fmu\">"));
    text.push_str("        <ssd:Connectors>\n");
    for (kind, names) in [("input", inputs), ("output", outputs)] {
        for connector in names {
            add(text, &format!("          <ssd:Connector name=\"{connector}\" kind=\"{kind}\"><ssc:Real/></ssd:Connector>"));
        }
    }
    text.push_str("        </ssd:Connectors>\n        <ssd:ParameterBindings>\n");
    add(text, &format!("          <ssd:ParameterBinding source=\"resources/{name}.ssv\"/>"));
    text.push_str("        </ssd:ParameterBindings>\n      </ssd:Component>\n");
}

/// `OspSystemStructure.xml`, for both FMUs in the same folder.
pub fn osp(vehicle: &Vehicle) -> String {
    let sets = sets(vehicle);
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <OspSystemStructure xmlns=\"http://opensimulationplatform.com/MSMI/OSPSystemStructure\" version=\"0.1\">\n  \
         <StartTime>0.0</StartTime>\n  <BaseStepSize>{STEP:?}</BaseStepSize>\n  <Algorithm>fixedStep</Algorithm>\n  <Simulators>\n"
    );
    let simulators =
        [(COMPONENTS[0], plant::DESCRIPTION.name, &sets.plant), (COMPONENTS[1], controller::DESCRIPTION.name, &sets.controller)];
    for (name, model, parameters) in simulators {
        add(&mut text, &format!("    <Simulator name=\"{name}\" source=\"{model}.fmu\" stepSize=\"{STEP:?}\">\n      <InitialValues>"));
        for Parameter { name, value, .. } in parameters {
            add(&mut text, &format!("        <InitialValue variable=\"{name}\"><Real value=\"{value:?}\"/></InitialValue>"));
        }
        text.push_str("      </InitialValues>\n    </Simulator>\n");
    }
    text.push_str("  </Simulators>\n  <Connections>\n");
    for (from, to, name) in connections() {
        let ends = [from, to].map(|end| format!("<Variable simulator=\"{end}\" name=\"{name}\"/>")).concat();
        add(&mut text, &format!("    <VariableConnection>{ends}</VariableConnection>"));
    }
    text + "  </Connections>\n</OspSystemStructure>\n"
}

fn connections() -> impl Iterator<Item = (&'static str, &'static str, &'static str)> {
    let [plant, controller] = COMPONENTS;
    let there = TO_CONTROLLER.iter().map(move |name| (plant, controller, *name));
    there.chain(TO_PLANT.iter().map(move |name| (controller, plant, *name)))
}

fn add(text: &mut String, line: &str) {
    writeln!(text, "{line}").expect("a String takes all text");
}
