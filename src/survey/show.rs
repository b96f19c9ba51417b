//! A survey in words for a terminal, and as JSON.

use super::Survey;
use super::engagements::Engagement;
use super::latency::Lag;
use crate::campaign::{LogChannel, Quantity};
use serde_json::{Value, json};
use std::fmt::Write as _;

impl Survey {
    /// First and last stamp of the log, s.
    pub fn span(&self) -> (f64, f64) {
        let ends = self.log.channels.iter().filter_map(|c| Some((*c.time.first()?, *c.time.last()?)));
        ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), (from, to)| (a.min(from), b.max(to)))
    }

    /// The survey as text for people.
    pub fn to_text(&self) -> String {
        let (from, to) = self.span();
        let mut out = format!("{}: {:.1} s, nothing cut\n\n", self.log.file, to - from);
        out += &self.channels_text();
        self.gears_text(&mut out);
        self.engagements_text(&mut out);
        self.sensors_text(&mut out);
        for line in self.remarks.iter().chain(&self.log.notes) {
            // Writing to a String can't fail.
            let _ = writeln!(out, "note: {line}");
        }
        out
    }

    fn channels_text(&self) -> String {
        let name = self.log.channels.iter().map(|c| c.name.chars().count()).max().unwrap_or(0).max(7);
        let mut out = format!("{:<name$}  {:>8}  {:>9}  {:>8}  {:>5}  seen as\n", "channel", "rate/Hz", "jitter/ms", "quantum", "gaps");
        for (k, c) in self.log.channels.iter().enumerate() {
            let role = match k {
                _ if Some(k) == self.engine => "engine speed",
                _ if Some(k) == self.road => "speed behind the clutch",
                _ => c.quantity.map_or("", quantity),
            };
            let rate = if c.step > 0.0 { 1.0 / c.step } else { 0.0 };
            let (jitter, quantum, gaps) = (1e3 * c.jitter, number(c.quantum), c.gaps.len());
            let _ = writeln!(out, "{:<name$}  {rate:>8.1}  {jitter:>9.2}  {quantum:>8}  {gaps:>5}  {role}", c.name);
        }
        out
    }

    fn gears_text(&self, out: &mut String) {
        let (Some(engine), Some(road)) = (self.engine, self.road) else { return };
        let (engine, road) = (&self.log.channels[engine], &self.log.channels[road]);
        let unit = match road.quantity {
            Some(Quantity::Velocity) => "rad/m",
            Some(_) => "rad/rad",
            None => "rad/s per unit of it",
        };
        let kind = match (self.gears.given, self.gears.common) {
            (true, _) => "ratios as given",
            (false, Some(_)) => "none: the speed is the disc's own",
            (false, None) => "learned from locked stretches",
        };
        let _ = writeln!(out, "\ngears ({kind})");
        if let Some(common) = self.gears.common.filter(|_| unit == "rad/m") {
            let _ = writeln!(out, "  final drive over tyre radius: {common:.3} 1/m");
        }
        for gear in 0..self.gears.levels.len() {
            let (seconds, level) = (self.gears.seconds(gear), self.gears.factor(gear));
            let ratio = self.gears.locked_ratio(gear, engine.trace(), road.trace());
            let disc = if ratio.is_nan() { "never locked".to_string() } else { format!("disc over engine speed {ratio:.4} (median)") };
            let _ = writeln!(out, "  {}: engine over road {level:.3} {unit}, locked for {seconds:.1} s, {disc}", gear + 1);
        }
    }

    fn engagements_text(&self, out: &mut String) {
        let launches = self.engagements.iter().filter(|e| e.launch).count();
        let _ = writeln!(out, "\n{} and {}", count(launches, "launch", "es"), count(self.engagements.len() - launches, "shift", "s"));
        for e in &self.engagements {
            let heat =
                e.heat.map_or_else(String::new, |h| format!(", {:.2} kJ if {} is the clutch's", rounded(1e-3 * h), self.heat_channel()));
            let kind = if e.launch { "launch in" } else { "shift to" };
            let _ = writeln!(out, "  {kind} {}: speeds meet at {:.2} s after {:.2} s of slip{heat}", e.gear + 1, e.met, e.met - e.from);
            let _ = writeln!(out, "      {}", ringing(e));
        }
    }

    fn heat_channel(&self) -> &str {
        self.torques.first().map_or("", |t| &self.log.channels[t.channel].name)
    }

    fn sensors_text(&self, out: &mut String) {
        out.push('\n');
        for c in &self.log.channels {
            if let Some(text) = self.dead_band(c) {
                let _ = writeln!(out, "{}: {text}", c.name);
            }
        }
        if let Some(lag) = &self.latency {
            let _ = writeln!(out, "{}", latency(lag));
        }
        for t in &self.torques {
            let name = &self.log.channels[t.channel].name;
            let idle = t.idle.map_or_else(String::new, |(from, to, v)| format!("{v:.0} N·m from {from:.1} to {to:.1} s at standstill; "));
            let _ = writeln!(out, "{name}: {idle}{}", t.verdict);
        }
        for s in &self.switches {
            let levels: Vec<String> = s.levels.iter().map(|l| number(*l)).collect();
            let name = &self.log.channels[s.channel].name;
            let _ = writeln!(out, "{name}: rests at {} % alone: switches, no position", levels.join(", "));
        }
        if !self.has_position {
            out.push_str("no channel is a position of the clutch: actuator, clutch force and thermal parts are not assessable; record the position that is commanded\n");
        }
    }

    /// A text on what a dead band hides.
    fn dead_band(&self, c: &LogChannel) -> Option<String> {
        let threshold = c.dead_band?;
        let k = c.values.iter().position(|v| *v != 0.0).filter(|k| *k > 0)?;
        let road = c.quantity == Some(Quantity::Velocity);
        let radius = self.tyre_radius.filter(|_| road);
        let at_wheel = radius.map_or_else(String::new, |r| format!(" ({:.2} rad/s at a wheel of {r:.3} m)", threshold / r));
        let shown = if road { format!("{threshold:.3} m/s{at_wheel}") } else { format!("{threshold:.3} rad/s") };
        Some(format!("reads 0 below {shown}: what moves slower is not seen; it first reads something at {:.2} s", c.time[k]))
    }

    /// The survey as JSON for programs.
    pub fn to_json(&self) -> Value {
        let (from, to) = self.span();
        let name = |k: Option<usize>| k.map(|k| self.log.channels[k].name.clone());
        let traces = self.engine.zip(self.road).map(|(e, r)| (self.log.channels[e].trace(), self.log.channels[r].trace()));
        let gear = |g: usize| {
            let ratio = traces.map(|(e, r)| self.gears.locked_ratio(g, e, r)).filter(|r| !r.is_nan());
            json!({"gear": g + 1, "engine_over_road": self.gears.factor(g), "locked_s": self.gears.seconds(g), "disc_over_engine": ratio})
        };
        let channel = |c: &LogChannel| {
            let rate = (c.step > 0.0).then(|| 1.0 / c.step);
            json!({"name": c.name, "quantity": c.quantity.map(quantity), "rate_Hz": rate, "jitter_s": c.jitter, "quantum": c.quantum,
                   "gaps": c.gaps.len(), "dead_band": c.dead_band, "samples": c.values.len()})
        };
        let torque = |t: &super::torque::Reading| {
            json!({"channel": self.log.channels[t.channel].name, "at_standstill_Nm": t.idle.map(|i| i.2), "from_s": t.idle.map(|i| i.0),
                   "to_s": t.idle.map(|i| i.1), "inertia_kgm2": t.inertia, "verdict": t.verdict})
        };
        json!({
            "file": self.log.file,
            "from_s": from,
            "to_s": to,
            "channels": self.log.channels.iter().map(channel).collect::<Vec<_>>(),
            "engine_speed": name(self.engine),
            "speed_behind_clutch": name(self.road),
            "ratios_given": self.gears.given,
            "final_drive_over_tyre_radius_1_m": self.gears.common.filter(|_| self.is_road_speed()),
            "gears": (0..self.gears.levels.len()).map(gear).collect::<Vec<_>>(),
            "engagements": self.engagements.iter().map(engagement).collect::<Vec<_>>(),
            "latency_s": self.latency.map(|l| json!({"value": l.seconds, "low": l.interval.0, "high": l.interval.1})),
            "torques": self.torques.iter().map(torque).collect::<Vec<_>>(),
            "switches": self.switches.iter().map(|s| json!({"channel": self.log.channels[s.channel].name, "levels": s.levels})).collect::<Vec<_>>(),
            "not_assessable": if self.has_position { json!([]) } else { json!(["actuator", "clutch_force", "thermal"]) },
            "notes": self.remarks.iter().chain(&self.log.notes).collect::<Vec<_>>(),
        })
    }
}

fn engagement(e: &Engagement) -> Value {
    let ringing = e.ringing.as_ref().map(|r| json!({"frequency_Hz": r.frequency, "share": r.share, "set_95_Hz": r.set}));
    json!({"kind": if e.launch { "launch" } else { "shift" }, "gear": e.gear + 1, "from_s": e.from, "meet_s": e.met, "until_s": e.until,
           "slip_s": e.met - e.from, "heat_J": e.heat, "ringing": ringing})
}

fn latency(lag: &Lag) -> String {
    let (low, high) = (1e3 * lag.interval.0, 1e3 * lag.interval.1);
    let speed = "the speed behind the clutch";
    if low > 0.0 {
        format!("{speed} comes {:.0} ms later than the engine's (95 %: {low:.0} to {high:.0} ms)", 1e3 * lag.seconds)
    } else if high < 0.0 {
        format!("{speed} comes {:.0} ms earlier than the engine's (95 %: {:.0} to {:.0} ms)", -1e3 * lag.seconds, -high, -low)
    } else {
        format!(
            "{speed} and the engine's come at the same time, as far as can be seen (95 %: up to {:.0} ms earlier or {high:.0} ms later)",
            low.abs()
        )
    }
}

fn ringing(e: &Engagement) -> String {
    let Some(r) = &e.ringing else { return "no oscillation that stands out after it".to_string() };
    let parts: Vec<String> =
        r.set.iter().map(|(a, b)| if b - a < 0.05 { format!("{a:.1}") } else { format!("{a:.1} to {b:.1}") }).collect();
    let settled = if r.set.len() == 1 { "" } else { "; the data do not settle which" };
    let percent = 100.0 * r.share;
    format!("rings at {:.2} Hz, {percent:.0} % of the variance (95 %: {} Hz{settled})", r.frequency, parts.join(" or "))
}

fn count(n: usize, word: &str, more: &str) -> String {
    format!("{n} {word}{}", if n == 1 { "" } else { more })
}

fn quantity(q: Quantity) -> &'static str {
    match q {
        Quantity::Time => "time",
        Quantity::Speed => "rotational speed",
        Quantity::Torque => "torque",
        Quantity::Length => "length",
        Quantity::Temperature => "temperature",
        Quantity::Flag => "flag",
        Quantity::Velocity => "road speed",
        Quantity::Acceleration => "acceleration",
        Quantity::Share => "percentage",
    }
}

/// Formats a number with four digits, without trailing zeros.
fn number(v: f64) -> String {
    let decimals = if v == 0.0 { 0 } else { (3 - v.abs().log10().floor() as i32).clamp(0, 6) as usize };
    let text = format!("{v:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_string() } else { text }
}
/// Rounds to two decimals; a small negative value becomes 0 without a sign.
fn rounded(value: f64) -> f64 {
    (100.0 * value).round() / 100.0 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delay_is_named_by_its_sign() {
        let said = |seconds: f64, low: f64, high: f64| latency(&Lag { seconds, interval: (low, high) });
        assert!(said(0.018, 0.004, 0.032).ends_with("comes 18 ms later than the engine's (95 %: 4 to 32 ms)"));
        assert!(said(-0.02, -0.03, -0.01).ends_with("comes 20 ms earlier than the engine's (95 %: 10 to 30 ms)"));
        assert!(
            said(-0.002, -0.016, 0.012).contains("at the same time")
                && said(-0.002, -0.016, 0.012).contains("16 ms earlier or 12 ms later")
        );
    }
}
