//! Plausibility checks of a usable vehicle: contradictions that a simulation would not notice.

use crate::physics::cushion::{self, CushionSpring};
use crate::physics::driveline::Driveline;
use crate::physics::{friction, map};
use crate::vehicle::Vehicle;
use serde_json::{Value, json};

/// Temperatures that a clutch disc reaches, °C.
const TEMPERATURES: [f64; 10] = [-20.0, 0.0, 25.0, 60.0, 90.0, 120.0, 150.0, 180.0, 210.0, 240.0];

/// Slip speeds that occur in a launch, rad/s.
const SLIPS: [f64; 7] = [0.0, 1.0, 5.0, 20.0, 60.0, 120.0, 250.0];

/// One implausible number or group.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// The number or group that it concerns.
    pub number: String,
    /// The implausibility, with the values.
    pub what: String,
    /// Suggested remedy.
    pub remedy: String,
}

impl Finding {
    /// As JSON.
    pub fn to_json(&self) -> Value {
        json!({"severity": "warning", "number": self.number, "what": self.what, "remedy": self.remedy})
    }
}

/// A quantity derived from the vehicle's numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Fact {
    /// Name in JSON.
    pub name: &'static str,
    /// Meaning in words.
    pub meaning: &'static str,
    /// Value.
    pub value: f64,
    /// Unit.
    pub unit: &'static str,
}

/// All implausibilities of `vehicle`, which was read from `document`, with the gains ℓ_1, ℓ_2 of the observer (9).
pub fn findings(document: &Value, vehicle: &Vehicle, gains: (f64, f64)) -> Vec<Finding> {
    let mut all = Vec::new();
    spring(&mut all, &vehicle.cushion_spring);
    contact(&mut all, vehicle);
    rubbing(&mut all, vehicle);
    capacity(&mut all, vehicle);
    thermal(&mut all, vehicle);
    driveline(&mut all, &vehicle.driveline);
    observer(&mut all, &vehicle.driveline, gains);
    tolerances(&mut all, document);
    all
}

/// Derived quantities that an engineer can compare with what is known of the car.
pub fn facts(vehicle: &Vehicle, gains: (f64, f64)) -> Vec<Fact> {
    let spring = &vehicle.cushion_spring;
    let xi_0 = cushion::contact_point(spring);
    let at = map::contact(&vehicle.actuator, map::THETA_REFERENCE);
    let torque = |slip| map::torque_capacity(&vehicle.friction, cushion::force(spring, xi_0, 1.0), slip, map::THETA_REFERENCE);
    let t = &vehicle.thermal;
    let (slow, fast, _) = poles(&vehicle.driveline, gains);
    let fact = |name, meaning, value, unit| Fact { name, meaning, value, unit };
    vec![
        fact("contact_mm", "first force at 25 °C", at.x_cnt + xi_0 * (at.x_cls - at.x_cnt), "mm"),
        fact("force_closed_n", "cushion force when closed", cushion::force(spring, xi_0, 1.0), "N"),
        fact("capacity_static_nm", "torque capacity when closed, no slip, 25 °C", torque(0.0), "N·m"),
        fact("capacity_slipping_nm", "the same at 50 rad/s of slip", torque(50.0), "N·m"),
        fact("disc_time_constant_s", "time constant of the disc's temperature, engaged", t.C_1 / t.gamma_1.max(f64::MIN_POSITIVE), "s"),
        fact("observer_slow_1_s", "slow pole of the torque observer (9)", slow, "1/s"),
        fact("observer_fast_1_s", "fast pole of the torque observer (9)", fast, "1/s"),
    ]
}

fn add(all: &mut Vec<Finding>, number: &str, what: String, remedy: &str) {
    all.push(Finding { number: number.to_owned(), what, remedy: remedy.to_owned() });
}

/// Checks that the force increases from the contact point on, as the inverse of the torque map requires.
fn spring(all: &mut Vec<Finding>, p: &CushionSpring) {
    let xi_0 = cushion::contact_point(p);
    let places: Vec<f64> = (0..=1000).map(|k| xi_0 + (1.0 - xi_0) * f64::from(k) / 1000.0).collect();
    let force = |xi: f64| xi * (p.beta_1 + xi * (p.beta_2 + xi * p.beta_3));
    if let Some(pair) = places.windows(2).find(|w| force(w[1]) <= force(w[0])) {
        let what =
            format!("the force falls at ξ = {:.3}, above the contact point ξ_0 = {xi_0:.3}: the inverse map isn't monotone", pair[0]);
        add(all, "cushion_spring.beta", what, "Fit the polynomial anew: its slope must be positive from the contact point to 1");
    }
    if xi_0 > 0.5 {
        let what = format!("there is no force below ξ_0 = {xi_0:.3}: more than half of the travel from kiss to closed point is idle");
        add(all, "cushion_spring.beta", what, "Check signs and order: beta holds the terms of ξ, ξ² and ξ³ in N");
    }
}

fn contact(all: &mut Vec<Finding>, vehicle: &Vehicle) {
    for theta in TEMPERATURES {
        let at = map::contact(&vehicle.actuator, theta);
        if at.x_cls - at.x_cnt < 0.2 {
            let what =
                format!("at {theta} °C the kiss point {:.3} mm leaves less than 0.2 mm to the closed point {:.3} mm", at.x_cnt, at.x_cls);
            add(all, "actuator.x_cnt", what, "Check the temperature terms: they are in mm/K and mm/K², from 25 °C on");
            return;
        }
    }
}

fn rubbing(all: &mut Vec<Finding>, vehicle: &Vehicle) {
    let f = &vehicle.friction;
    if let Some((theta, slip)) = at_worst(|theta, slip| friction::friction_coefficient(f, slip, theta) <= friction::MU_MIN) {
        let what = format!("friction is at its floor of {} at {theta} °C and {slip} rad/s of slip", friction::MU_MIN);
        add(all, "friction.mu_d", what, "Check the polynomial: constant, 1/K and 1/K² of °C (not of kelvin), and mu_0");
    }
    if let Some((theta, slip)) = at_worst(|theta, slip| friction::friction_coefficient(f, slip, theta) > 0.9) {
        let mu = friction::friction_coefficient(f, slip, theta);
        let what = format!("friction is {mu:.2} at {theta} °C and {slip} rad/s of slip: no dry facing has that");
        add(all, "friction.mu_d", what, "Check the polynomial's terms, alpha_1 and alpha_2");
    }
}

fn at_worst(wrong: impl Fn(f64, f64) -> bool) -> Option<(f64, f64)> {
    TEMPERATURES.iter().flat_map(|&theta| SLIPS.map(|slip| (theta, slip))).find(|&(theta, slip)| wrong(theta, slip))
}

fn capacity(all: &mut Vec<Finding>, vehicle: &Vehicle) {
    let spring = &vehicle.cushion_spring;
    let force = cushion::force(spring, cushion::contact_point(spring), 1.0);
    let torque = map::torque_capacity(&vehicle.friction, force, 0.0, map::THETA_REFERENCE);
    if !(20.0..5000.0).contains(&torque) {
        let what = format!("the closed clutch holds {torque:.1} N·m ({force:.0} N on two faces)");
        add(all, "cushion_spring.beta", what, "Check units: N for the spring (the paper prints kN), m for the radii");
    }
}

fn thermal(all: &mut Vec<Finding>, vehicle: &Vehicle) {
    let t = &vehicle.thermal;
    if t.C_1 >= t.C_b {
        let what = format!("the disc's capacity C_1 = {} J/K is not below the body's C_b = {} J/K", t.C_1, t.C_b);
        add(all, "thermal.C_1", what, "Check whether the two are swapped");
    }
    if t.gamma_3 == 0.0 || t.gamma_3 == 1.0 {
        let what = format!("gamma_3 = {}: all friction heat enters one side", t.gamma_3);
        add(all, "thermal.gamma_3", what, "It is the disc's share, about one half");
    }
    if t.gamma_1 == 0.0 {
        add(all, "thermal.gamma_1", "the disc cannot pass its heat on to the body".to_owned(), "Give the conductance in W/K");
    }
}

fn driveline(all: &mut Vec<Finding>, d: &Driveline) {
    if d.J_c <= d.J_f {
        let what = format!("the driveline's J_c = {} kg·m² is not above the engine's J_f = {} kg·m²", d.J_c, d.J_f);
        add(all, "driveline.J_c", what, "J_c is the vehicle's mass seen by the clutch, m (r/i)², with all behind the disc");
    }
    if d.T_L0 < 0.0 {
        add(all, "driveline.T_L0", format!("a rolling load of {} N·m drives the car", d.T_L0), "Give it as a resistance");
    }
    if d.mgR_over_i > 0.0 && d.T_L0.abs() > 0.3 * d.mgR_over_i {
        let what = format!("the rolling load of {} N·m is that of a grade of {:.0} %", d.T_L0, 100.0 * d.T_L0.abs() / d.mgR_over_i);
        add(all, "driveline.T_L0", what, "Give both torques at the clutch: wheel torque over ratio");
    }
}

/// Slow and fast pole of the observer (9) in 1/s, and the imaginary part if they are a complex pair.
fn poles(d: &Driveline, (l_1, l_2): (f64, f64)) -> (f64, f64, f64) {
    let half = -0.5 * (d.b_f + l_1) / d.J_f;
    let discriminant = half * half + l_2 / d.J_f;
    if discriminant < 0.0 {
        return (half, half, (-discriminant).sqrt());
    }
    let fast = half + discriminant.sqrt().copysign(half);
    (if fast == 0.0 { 0.0 } else { -l_2 / d.J_f / fast }, fast, 0.0)
}

fn observer(all: &mut Vec<Finding>, d: &Driveline, gains: (f64, f64)) {
    let (slow, fast, turn) = poles(d, gains);
    let (l_1, l_2) = gains;
    if slow >= 0.0 || fast >= 0.0 {
        let what = format!("l_1 = {l_1}, l_2 = {l_2} make the torque observer unstable: its poles are {slow:+.1} and {fast:+.1} 1/s");
        add(all, "observer", what, "It needs l_1 > -b_f and l_2 < 0; the paper's Table I prints both with the opposite sign");
    } else if turn > -slow {
        let what = format!("the torque observer oscillates at {turn:.0} rad/s, damped with {:.0} 1/s", -slow);
        add(all, "observer", what, "Raise l_1 or lower the magnitude of l_2 for this J_f");
    }
}

fn tolerances(all: &mut Vec<Finding>, document: &Value) {
    let Some(entries) = document.get("tolerance").and_then(Value::as_object) else {
        let what = "there is none: a diagnosis takes every number of this file as exact".to_owned();
        return add(all, "tolerance", what, "Give one standard deviation each, as `kisspoint vehicle new` does");
    };
    for (name, size) in entries {
        // Entries that cannot be read were refused earlier.
        if let Some(rel) = size.get("rel").and_then(Value::as_f64).filter(|rel| *rel > 0.3) {
            let what = format!("one standard deviation of {:.0} % forgives almost everything", 100.0 * rel);
            add(all, &format!("tolerance of {name}"), what, "rel is a share: 0.02 is 2 %");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Findings after a change to the paper's vehicle.
    fn after(change: impl Fn(&mut Value), gains: (f64, f64)) -> Vec<String> {
        let mut document = Vehicle::paper().to_value();
        document["tolerance"] = json!({});
        change(&mut document);
        let vehicle = Vehicle::from_value(&document).expect("the change leaves a vehicle that can be used");
        findings(&document, &vehicle, gains).into_iter().map(|f| format!("{}: {}", f.number, f.what)).collect()
    }

    const SOUND: (f64, f64) = (300.0, -4252.0);

    #[test]
    fn the_papers_vehicle_is_plausible_but_not_its_printed_observer() {
        assert_eq!(after(|_| {}, SOUND), Vec::<String>::new());
        let found = after(|_| {}, (-300.0, 4252.0));
        assert!(found[0].contains("unstable") && found[0].contains("+1601"), "{found:?}");
    }

    #[test]
    fn every_implausible_number_is_named() {
        let cases: [(&str, &str, Value, &str); 10] = [
            ("cushion_spring", "beta", json!([9000.0, -9000.0, 200.0]), "isn't monotone"),
            ("cushion_spring", "beta", json!([100.0, -9000.0, 9500.0]), "more than half of the travel"),
            ("cushion_spring", "beta", json!([0.026, 1.3, 5.8]), "holds 0.2 N·m"),
            ("actuator", "x_cnt", json!([4.02, 0.02]), "less than 0.2 mm"),
            ("friction", "mu_d", json!([0.1834, -0.0024, 0.0]), "at its floor"),
            ("friction", "mu_d", json!([0.1834, 0.24, 0.0]), "no dry facing"),
            ("thermal", "C_1", json!(9000.0), "not below the body's"),
            ("thermal", "gamma_3", json!(1.0), "all friction heat"),
            ("driveline", "J_c", json!(0.05), "not above the engine's"),
            ("driveline", "T_L0", json!(-3.0), "drives the car"),
        ];
        for (group, key, value, expected) in cases {
            let found = after(|d| d[group][key] = value.clone(), SOUND);
            assert!(found.iter().any(|f| f.contains(expected)), "{group}.{key} = {value}: {found:?}");
        }
    }

    #[test]
    fn a_tolerance_that_forgives_everything_is_named() {
        let found = after(|d| d["tolerance"] = json!({"driveline.J_c": {"rel": 0.3}, "driveline.J_f": {"rel": 2.0}}), SOUND);
        assert!(!found.iter().any(|f| f.contains("J_c")), "{found:?}");
        assert!(found.iter().any(|f| f.contains("J_f") && f.contains("200 %")), "{found:?}");
    }
}
