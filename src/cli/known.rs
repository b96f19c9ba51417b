//! Data for the report on how well the retuned plant knows its clutch torque: a free replay of the held-out recording.

use super::laws::{SLOPE_S, source};
use crate::campaign::Campaign;
use crate::gap::diagnosis::Diagnosis;
use crate::gap::model::replay;
use crate::gap::model::tolerance::Car;
use crate::gap::model::track::Track;
use crate::physics::driveline::clutch_torque;
use crate::plant::config::Config;
use crate::report::known::Known;
use crate::validated::Place;

/// The retuned plant along the held-out recording (or the first held-out engagement of a drive); `None` if the plant was validated nowhere.
pub fn known(campaign: &Campaign, found: &Diagnosis) -> Option<Known> {
    let validated = &found.validated;
    let o = found.overlays.iter().find(|o| o.held_out).filter(|_| !validated.places().is_empty())?;
    let (r, begin) = source(campaign, o).filter(|(r, _)| !r.x_to_cmd.is_empty())?;
    let channel = |column: &str| o.channels.iter().find(|c| c.column == column).map(|c| c.real.as_slice());
    let omega_f = channel("omega_f_rad_s")?;
    let track = Track::new(r);
    let car = Car { effects: found.effects, ..Car::nominal(&found.vehicle) };
    let start = replay::start(&track, &car, begin, o.theta, 0.0);
    let mut known = Known { recording: o.recording.clone(), ..Known::default() };
    let mut near = 0;
    replay::replay(&track, &car, (&start, o.slip_angle), begin..(begin + omega_f.len()).min(track.rows()), None, |row, now, plant, _| {
        let place = Place { slip: plant.slip(), theta: now.theta_c, closing: plant.closing(), torque: now.t_fc };
        known.time.push(track.time[row] - track.time[begin]);
        known.torque.push(now.t_fc);
        known.sigma.push(validated.sigma(&place));
        known.validity.push(validated.validity(&place, &mut near));
    });
    let n = known.time.len();
    known.real = match channel("T_fc_Nm") {
        Some(measured) => measured[..n].to_vec(),
        None => {
            // Gain and bias of the reported engine torque are among the retuned parameters.
            let constants = Config::new(&found.vehicle, &found.effects).constants;
            let reach = ((0.5 * SLOPE_S / o.dt).round() as usize).max(1);
            let balance = |i: usize| {
                let slope = (omega_f[i + reach] - omega_f[i - reach]) / (2.0 * reach as f64 * o.dt);
                let engine = constants.engine_gain * r.t_e[begin + i] + constants.engine_bias;
                clutch_torque(&constants.driveline, engine, omega_f[i], slope)
            };
            (0..n).map(|i| if i >= reach && i + reach < n { balance(i) } else { f64::NAN }).collect()
        }
    };
    known.from = if channel("T_fc_Nm").is_some() {
        "the car’s torque by the transducer"
    } else {
        "the car’s torque from the flywheel’s balance"
    };
    Some(known)
}
