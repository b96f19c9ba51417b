//! A survey's engagements as recordings of a campaign.
//!
//! Each engagement becomes a recording from half a second before its slip until the gear is left, at the samples' own stamps: engine speed, the speed
//! behind the clutch times the ratio, the torque that the user names as the engine's, and housing air, position and brake if the log has them. Start
//! temperatures are unknown and marked as such.

use super::Survey;
use super::engagements::Engagement;
use crate::campaign::{Channel, LogChannel, Quantity, Recording};

/// Time in front of the slip that is included, s.
const LEAD_S: f64 = 0.5;
/// Temperature that is written where none is known, °C, and its standard deviation, K.
const UNKNOWN: (f64, f64) = (20.0, 40.0);

/// One recording per engagement, or only those in `gear`, counted from 0; `torque` names the channel of the engine torque.
///
/// # Errors
/// The log has no such channel, or no engagement.
pub fn recordings(s: &Survey, torque: &str, gear: Option<usize>) -> Result<Vec<Recording>, String> {
    let Some(t_e) = s.log.channels.iter().find(|c| c.name == torque) else {
        let there: Vec<&str> = s.torques.iter().map(|t| s.log.channels[t.channel].name.as_str()).collect();
        return Err(format!("no channel is called `{torque}`; of torques there are {}", there.join(", ")));
    };
    let (Some(engine), Some(road)) = (s.engine, s.road) else { return Err(s.remarks.join("; ")) };
    let engagements: Vec<&Engagement> = s.engagements.iter().filter(|e| gear.is_none_or(|g| g == e.gear)).collect();
    if engagements.is_empty() {
        let which = gear.map_or_else(String::new, |g| format!(" in gear {}", g + 1));
        return Err(format!("no engagement{which} was found: there is nothing for a campaign"));
    }
    let [engine, road] = [engine, road].map(|k| &s.log.channels[k]);
    let is = |channel: Channel| s.log.channels.iter().find(|c| c.guess == Some(channel));
    let one = |(k, e): (usize, &Engagement)| {
        let (from, to) = (e.from - LEAD_S, e.until);
        let mut time: Vec<f64> = [Some(engine), Some(road), Some(t_e), is(Channel::XToCmd)]
            .into_iter()
            .flatten()
            .flat_map(|c| c.trace().within(from, to).map(|i| c.time[i]))
            .collect();
        time.sort_by(f64::total_cmp);
        time.dedup_by(|b, a| *b - *a < 1e-6);
        let start = time.first().copied().unwrap_or(from);
        let factor = s.gears.factor(e.gear);
        let step = |c: &LogChannel| {
            let own = c.trace().within(from, to);
            super::median(c.time[own].windows(2).map(|w| w[1] - w[0]).collect::<Vec<f64>>())
        };
        let own = |c: &LogChannel| {
            let there = sampled(c, &time, 1.0);
            (0..time.len()).filter(|row| there[*row].is_finite()).collect::<Vec<usize>>()
        };
        Recording {
            name: format!("r{:02}", k + 1),
            manoeuvre: if e.launch { "launch".into() } else { "shift".into() },
            // Digits that only reflect the rounding of the stamps are removed.
            sample_rate_hz: (1e6 / step(engine).min(step(road))).round() / 1e6,
            theta_c0: UNKNOWN.0,
            theta_b0: UNKNOWN.0,
            theta_0_sigma: [UNKNOWN.1; 2],
            omega_f: sampled(engine, &time, 1.0),
            omega_c: sampled(road, &time, factor),
            t_e: held(t_e, &time),
            x_to_cmd: is(Channel::XToCmd).map(|c| held(c, &time)).unwrap_or_default(),
            theta_h: is(Channel::ThetaH).map_or_else(|| vec![UNKNOWN.0; time.len()], |c| held(c, &time)),
            brake: is(Channel::Brake).map(|c| held(c, &time).into_iter().map(|v| v > 0.5).collect()),
            input_rows: [Some(own(t_e)), is(Channel::XToCmd).map(own)],
            time: time.iter().map(|t| t - start).collect(),
            ..Recording::default()
        }
    };
    Ok(engagements.into_iter().enumerate().map(one).collect())
}

/// Inertia of a car of `mass` kg at the disc in a gear, counted from 0, kg·m²: m (r/i)² with the ratio i of engine to wheel speed and the tyre radius r, without the driveline's own inertia.
///
/// # Errors
/// There is no such gear, or the speed is that of a shaft and r or i is unknown.
pub fn inertia(s: &Survey, mass: f64, gear: usize) -> Result<f64, String> {
    let road = s.road.map(|k| &s.log.channels[k]).filter(|_| gear < s.gears.levels.len());
    let Some(road) = road else { return Err(format!("there is no gear {}: {} were found", gear + 1, s.gears.levels.len())) };
    let level = s.gears.factor(gear);
    if s.is_road_speed() {
        return Ok(mass / level.powi(2));
    }
    let radius = s.tyre_radius.ok_or("the mass needs --tyre-radius where the speed is that of a shaft")?;
    let of_wheel = ["wheel", "whl"].iter().any(|w| road.name.to_lowercase().contains(w)) && road.quantity == Some(Quantity::Speed);
    let ratio = match s.gears.common.filter(|_| s.gears.given).zip(s.final_drive) {
        Some((common, final_drive)) => level / common * final_drive,
        None if of_wheel => level,
        None => {
            return Err(format!(
                "the mass needs --ratios and --final-drive: {} is a shaft's speed, and nothing says what lies between that shaft and the wheels",
                road.name
            ));
        }
    };
    Ok(mass * (radius / ratio).powi(2))
}

/// A channel's samples times `factor`, in the rows at their stamps; NaN elsewhere.
fn sampled(c: &LogChannel, rows: &[f64], factor: f64) -> Vec<f64> {
    let sample = |t: &f64| {
        let k = c.time.partition_point(|s| *s < t - 1e-6);
        c.time.get(k).filter(|s| **s <= t + 1e-6).map_or(f64::NAN, |_| factor * c.values[k])
    };
    rows.iter().map(sample).collect()
}

fn held(c: &LogChannel, rows: &[f64]) -> Vec<f64> {
    rows.iter().map(|t| c.values[c.time.partition_point(|s| *s <= t + 1e-6).saturating_sub(1)]).collect()
}
