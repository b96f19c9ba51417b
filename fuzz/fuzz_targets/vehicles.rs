//! Vehicle files: refused with a reason, or read as a vehicle that survives writing and reading unchanged and with which a plant can be stepped.
#![no_main]

use kisspoint::effects;
use kisspoint::plant::{Inputs, Plant, Start};
use kisspoint::vehicle::Vehicle;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    let Ok(document) = serde_json::from_str::<serde_json::Value>(text) else { return };
    let effects = effects::from_value(&document);
    let vehicle = match Vehicle::from_value(&document) {
        Ok(vehicle) => vehicle,
        Err(refused) => return assert!(!refused.to_string().is_empty()),
    };
    let again = Vehicle::from_value(&vehicle.to_value()).expect("what was written is read");
    assert_eq!(vehicle, again);
    let Ok(effects) = effects else { return };
    let inputs = Inputs { x_to: 5.5, t_e_ref: 60.0, theta_h: 25.0, t_load: 0.0 };
    let start = Start { omega_f: 100.0, omega_c: 0.0, theta_c: 25.0, theta_b: 25.0 };
    let mut plant = Plant::new(&vehicle, &effects, &start, &inputs);
    if plant.config().pace.check().is_ok() {
        for _ in 0..5 {
            plant.step(&inputs, 1e-3);
            assert!(plant.iterations() <= plant.most_iterations(1e-3));
        }
    }
});
