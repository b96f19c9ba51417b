//! Declared tolerances as nuisance parameters: what the engineer knows of each number, as a Gaussian prior.
//!
//! `tolerance` of `vehicle.json` gives one standard deviation of each number, absolute or relative. A real car differs by
//! that much in everything, so every fit moves these numbers too, and pays for it.

use crate::effects::{self, PARAMETERS, Parameters, param};
use crate::vehicle::{NUMBERS, Vehicle};
use serde_json::Value;

/// One number that may differ within its tolerance, in units of its standard deviation.
#[derive(Clone, Debug, PartialEq)]
pub struct Nuisance {
    /// Name in `tolerance`.
    pub name: String,
    /// One standard deviation, in the number's unit, or relative.
    pub sigma: f64,
    /// Whether `sigma` is relative.
    pub relative: bool,
    target: Target,
}

#[derive(Clone, Debug, PartialEq)]
enum Target {
    /// Numbers of the vehicle that move together.
    Numbers(Vec<usize>),
    /// An effect parameter stands for it: the plant has no number of that name.
    Effect(usize),
}

impl Nuisance {
    /// The effect parameter that does to the car exactly what this number does.
    fn parameter(&self) -> Option<usize> {
        Some(match self.name.as_str() {
            "engine.T_e_bias" => param::engine_torque_bias::torque,
            "engine.T_e_gain" => param::engine_torque_gain::gain,
            "friction.mu" => param::friction_level::factor,
            "actuator.x_cnt" => param::kiss_point_offset::offset,
            "actuator.x_cls" => param::kiss_point_offset::closed_offset,
            "driveline.T_L0" => param::road_load::rolling_torque,
            "driveline.J_c" => param::vehicle_mass::factor,
            "thermal.gamma_1" => param::clutch_cooling::body_factor,
            "thermal.gamma_2" => param::clutch_cooling::air_factor,
            _ => return None,
        })
    }

    /// The effect that does to the car what this number does: beyond the tolerance it is the effect's turn.
    pub fn twin(&self) -> Option<usize> {
        // Force and friction make the torque as a product.
        let force = (self.name == "cushion_spring.beta").then_some(param::friction_level::factor);
        self.parameter().or(force).and_then(|k| effects::find(PARAMETERS[k].effect))
    }

    /// The effect parameter that does to the car exactly what this number does, and how far it moves there for one standard deviation, at a
    /// point with this vehicle, tolerances applied, and these effects.
    pub fn same_as(&self, vehicle: &Vehicle, effects: &Parameters) -> Option<(usize, f64)> {
        let k = self.parameter()?;
        let rate = match &self.target {
            Target::Numbers(_) if PARAMETERS[k].null == 1.0 && !self.relative => return None,
            _ if !self.relative => self.sigma,
            Target::Numbers(numbers) if PARAMETERS[k].null != 1.0 => self.sigma * (NUMBERS[numbers[0]].get)(vehicle),
            _ => self.sigma * effects[k],
        };
        Some((k, rate))
    }

    /// Puts a move of `z` standard deviations into the effect parameter that does the same to `vehicle`, tolerances not applied; that parameter's
    /// place, if there is one.
    pub fn hand_over(&self, z: f64, vehicle: &Vehicle, effects: &mut Parameters) -> Option<usize> {
        let (k, rate) = self.same_as(vehicle, effects)?;
        let grown = if self.relative { ((self.sigma * z).exp() - 1.0) / self.sigma } else { z };
        effects[k] += rate * grown;
        Some(k)
    }
}

/// Why a tolerance cannot be used.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum ToleranceError {
    /// No such number.
    #[error("vehicle.json: tolerance \"{0}\" names no number of the vehicle; correct its name or remove it")]
    Unknown(String),
    /// Neither `abs` nor `rel`, or not positive.
    #[error("vehicle.json: tolerance \"{0}\" needs one positive number, \"abs\" or \"rel\"")]
    Malformed(String),
}

/// Reads the tolerances of a vehicle document, in the order of their names.
///
/// # Errors
/// A tolerance that names no number, or has no positive size.
pub fn read(vehicle: &Value) -> Result<Vec<Nuisance>, ToleranceError> {
    let Some(entries) = vehicle.get("tolerance").and_then(Value::as_object) else {
        return Ok(Vec::new());
    };
    let mut all: Vec<Nuisance> = entries.iter().map(|(name, size)| nuisance(name, size)).collect::<Result<_, _>>()?;
    all.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(all)
}

fn nuisance(name: &str, size: &Value) -> Result<Nuisance, ToleranceError> {
    let get = |key: &str| size.get(key).and_then(Value::as_f64);
    let (sigma, relative) = match (get("abs"), get("rel")) {
        (Some(sigma), None) => (sigma, false),
        (None, Some(sigma)) => (sigma, true),
        _ => return Err(ToleranceError::Malformed(name.to_owned())),
    };
    if !(sigma > 0.0 && sigma.is_finite()) {
        return Err(ToleranceError::Malformed(name.to_owned()));
    }
    let target = target(name).ok_or_else(|| ToleranceError::Unknown(name.to_owned()))?;
    Ok(Nuisance { name: name.to_owned(), sigma, relative, target })
}

fn target(name: &str) -> Option<Target> {
    let group =
        |names: &[&str]| names.iter().map(|n| NUMBERS.iter().position(|m| m.name == *n)).collect::<Option<Vec<_>>>().map(Target::Numbers);
    match name {
        "engine.T_e_bias" => Some(Target::Effect(param::engine_torque_bias::torque)),
        "engine.T_e_gain" => Some(Target::Effect(param::engine_torque_gain::gain)),
        // μ of eq. (4) is linear in these, so that one factor on all is a factor on μ.
        "friction.mu" => group(&["friction.mu_0", "friction.alpha_1", "friction.m_0", "friction.m_1", "friction.m_2"]),
        "cushion_spring.beta" => group(&["cushion_spring.beta_1", "cushion_spring.beta_2", "cushion_spring.beta_3"]),
        "actuator.x_cnt" => group(&["actuator.x_cnt_0"]),
        "actuator.x_cls" => group(&["actuator.x_cls_0"]),
        _ => group(&[name]),
    }
}

/// Vehicle and effects with every nuisance moved by `z` standard deviations; relative ones by their logarithm.
pub fn apply(nuisances: &[Nuisance], z: &[f64], vehicle: &mut Vehicle, effects: &mut Parameters) {
    for (n, z) in nuisances.iter().zip(z) {
        let moved = |value: f64| if n.relative { value * (n.sigma * z).exp() } else { value + n.sigma * z };
        match &n.target {
            Target::Effect(k) => effects[*k] = moved(effects[*k]),
            Target::Numbers(numbers) => {
                for &k in numbers {
                    let slot = (NUMBERS[k].get_mut)(vehicle);
                    *slot = moved(*slot);
                }
            }
        }
    }
}
