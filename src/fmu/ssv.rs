//! Parameter sets of SSP 1.0 (`.ssv`), for any tool that sets an FMU's parameters from a file.

use super::MODELS;
use super::description::attribute;
use std::collections::BTreeSet;
use std::fmt::Write;

/// A parameter and its value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter<'a> {
    /// Name of the FMU's variable.
    pub name: &'a str,
    /// Value.
    pub value: f64,
    /// Unit, as named in the model descriptions.
    pub unit: &'a str,
}

const NAMESPACES: &str = "xmlns:ssv=\"http://ssp-standard.org/SSP1/SystemStructureParameterValues\" \
xmlns:ssc=\"http://ssp-standard.org/SSP1/SystemStructureCommon\"";

/// The text of a parameter set.
pub fn write(set: &str, parameters: &[Parameter]) -> String {
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<ssv:ParameterSet {NAMESPACES} version=\"1.0\" name=\"{set}\" generationTool=\"kisspoint {}\">\n  <ssv:Parameters>\n",
        env!("CARGO_PKG_VERSION")
    );
    for p in parameters {
        let Parameter { name, value, unit } = p;
        writeln!(text, "    <ssv:Parameter name=\"{name}\"><ssv:Real value=\"{value:?}\" unit=\"{unit}\"/></ssv:Parameter>")
            .expect("a String takes all text");
    }
    text.push_str("  </ssv:Parameters>\n");
    let units: BTreeSet<&str> = parameters.iter().map(|p| p.unit).collect();
    if !units.is_empty() {
        text.push_str("  <ssv:Units>\n");
        for unit in units {
            writeln!(text, "    <ssc:Unit name=\"{unit}\">{}</ssc:Unit>", base_unit(unit)).expect("a String takes all text");
        }
        text.push_str("  </ssv:Units>\n");
    }
    text + "</ssv:ParameterSet>\n"
}

/// Definition of the unit, taken from the model descriptions.
fn base_unit(unit: &str) -> String {
    let lines = MODELS.iter().flat_map(|model| model.xml.lines().zip(model.xml.lines().skip(1)));
    let mut definitions = lines.filter(|(line, _)| line.contains("<Unit ") && attribute(line, "name") == Some(unit));
    definitions.next().map_or_else(|| "<ssc:BaseUnit/>".to_owned(), |(_, base)| base.trim().replace("<BaseUnit", "<ssc:BaseUnit"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_keep_every_bit_and_units_are_defined() {
        let value = 0.1 + 0.2;
        let text = write("plant", &[Parameter { name: "effect.kiss_point_offset.offset", value, unit: "mm" }]);
        let line = text.lines().find(|l| l.contains("kiss_point_offset")).unwrap();
        assert_eq!(attribute(line, "value").unwrap().parse::<f64>(), Ok(value));
        assert!(text.contains("<ssc:Unit name=\"mm\"><ssc:BaseUnit m=\"1\" factor=\"0.001\"/></ssc:Unit>"), "{text}");
    }
}
