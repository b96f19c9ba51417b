//! The law of every effect: the behaviour of the plant compared with a value computed independently.
//!
//! Each row sets effects on a bench that is simple enough for a closed form – one inertia, constant friction, speeds or temperatures that do not move – and reads one number
//! from the plant after some time. Signs, sizes, units and limits are those of docs/effects.md. The number must be far from that of the plant without the effects, or equal to
//! it if the row is a limit at which the effect does nothing.

mod actuator;
#[allow(dead_code)]
mod bench;
mod clutch_force;
mod driveline;
mod engine;
mod friction;
mod sensors;
mod thermal;

use bench::Law;
use kisspoint::effects::{PARAMETERS, all, null};

fn laws() -> Vec<Law> {
    let subsystems =
        [engine::laws(), actuator::laws(), clutch_force::laws(), friction::laws(), thermal::laws(), driveline::laws(), sensors::laws()];
    subsystems.into_iter().flatten().collect()
}

#[test]
fn every_law_gives_its_number() {
    let mut broken = Vec::new();
    for law in laws() {
        let found = law.measure(&law.parameters());
        let (off, away) = ((found - law.expected).abs(), (law.measure(&null()) - law.expected).abs());
        if !(off <= law.tolerance) {
            broken.push(format!("{}: {found} against {}, {off:.1e} apart", law.what, law.expected));
        }
        if !(if law.limit { away <= law.tolerance } else { away > 20.0 * law.tolerance }) {
            broken.push(format!("{}: without effects it is {away:.1e} away", law.what));
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn every_parameter_of_every_effect_has_a_law_that_depends_on_it() {
    let laws = laws();
    for entry in all() {
        for k in entry.parameters.clone() {
            let shows = |law: &&Law| {
                let mut without = law.parameters();
                let set = without[k] != PARAMETERS[k].null;
                without[k] = PARAMETERS[k].null;
                set && (law.measure(&without) - law.expected).abs() > 20.0 * law.tolerance
            };
            assert!(laws.iter().any(|law| shows(&law)), "no law shows {}", PARAMETERS[k].variable);
        }
    }
}
