//! A survey's engagements as recordings of a campaign.
//!
//! Each engagement becomes a recording from half a second before its slip until the gear is left, at the samples' own stamps: engine speed,
//! the speed behind the clutch times the ratio, the torque that the user calls the engine's, housing air, position and brake where the log has
//! them. Start temperatures are unknown, and said to be.

use super::Survey;
use crate::campaign::{Channel, LogChannel, Recording};

/// What is taken in front of the slip, s.
const LEAD_S: f64 = 0.5;
/// Temperature that is written where none is known, °C, and how well, K.
const UNKNOWN: (f64, f64) = (20.0, 40.0);

/// One recording per engagement; `torque` names the channel of the engine's torque.
///
/// # Errors
/// The log has no such channel, or no engagement.
pub fn recordings(s: &Survey, torque: &str) -> Result<Vec<Recording>, String> {
    let Some(t_e) = s.log.channels.iter().find(|c| c.name == torque) else {
        let there: Vec<&str> = s.torques.iter().map(|t| s.log.channels[t.channel].name.as_str()).collect();
        return Err(format!("no channel is called `{torque}`; of torques there are {}", there.join(", ")));
    };
    let (Some(engine), Some(road)) = (s.engine, s.road) else { return Err(s.remarks.join("; ")) };
    if s.engagements.is_empty() {
        return Err("no engagement was found: there is nothing for a campaign".to_string());
    }
    let [engine, road] = [engine, road].map(|k| &s.log.channels[k]);
    let is = |channel: Channel| s.log.channels.iter().find(|c| c.guess == Some(channel));
    let one = |(k, e): (usize, &super::engagements::Engagement)| {
        let (from, to) = (e.from - LEAD_S, e.until);
        let mut time: Vec<f64> = [engine, road, t_e].iter().flat_map(|c| c.trace().within(from, to).map(|i| c.time[i])).collect();
        time.sort_by(f64::total_cmp);
        time.dedup_by(|b, a| *b - *a < 1e-6);
        let start = time.first().copied().unwrap_or(from);
        let factor = s.gears.factor(e.gear);
        let steps: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).collect();
        Recording {
            name: format!("r{:02}", k + 1),
            manoeuvre: if e.launch { "launch".into() } else { "shift".into() },
            sample_rate_hz: 1.0 / super::median(steps),
            theta_c0: UNKNOWN.0,
            theta_b0: UNKNOWN.0,
            theta_0_sigma: [UNKNOWN.1; 2],
            omega_f: sampled(engine, &time, 1.0),
            omega_c: sampled(road, &time, factor),
            t_e: held(t_e, &time),
            x_to_cmd: is(Channel::XToCmd).map(|c| held(c, &time)).unwrap_or_default(),
            theta_h: is(Channel::ThetaH).map_or_else(|| vec![UNKNOWN.0; time.len()], |c| held(c, &time)),
            brake: is(Channel::Brake).map(|c| held(c, &time).into_iter().map(|v| v > 0.5).collect()),
            time: time.iter().map(|t| t - start).collect(),
            ..Recording::default()
        }
    };
    Ok(s.engagements.iter().enumerate().map(one).collect())
}

/// The samples at their own stamps, NaN elsewhere.
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
