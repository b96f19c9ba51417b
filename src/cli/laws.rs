//! Data that the report shows beside the answer: the clutch's laws, nominal and identified, and the inputs of each recording.

use crate::campaign::{Campaign, Recording};
use crate::effects::Subsystem;
use crate::effects::empirical::{Curve, curves};
use crate::gap::diagnosis::Diagnosis;
use crate::gap::empirical::{BAND, Tried};
use crate::gap::measure::Overlay;
use crate::gap::model::replay;
use crate::gap::model::tolerance::Car;
use crate::gap::model::track::Track;
use crate::physics::cushion;
use crate::physics::driveline::{clutch_torque, load_torque};
use crate::physics::map::torque_of;
use crate::plant::clutch::{self, Branch, FaceCache};
use crate::plant::config::Config;
use crate::plant::motion::{self, Motion, index};
use crate::report::laws::{Law, Line};
use crate::report::names;
use crate::report::series::{Signal, Trace};
use crate::vehicle::Vehicle;

/// Slip below which a clutch counts as locked, rad/s.
const LOCKED: f64 = 1.5;
/// Slip at which torque over position and friction over temperature are drawn, rad/s.
const SLIP: f64 = 50.0;
/// Torque per unit of friction coefficient below which a measured friction coefficient is mostly noise, N·m.
const PRESSED: f64 = 60.0;
/// Number of points of a curve.
const POINTS: usize = 121;
/// Time span over which the acceleration is computed as a difference quotient, s.
pub const SLOPE_S: f64 = 0.1;

/// One sample of a recording in which the clutch slips.
struct Sample {
    torque: f64,
    x: f64,
    slip: f64,
    theta: Option<f64>,
    modelled: Option<f64>,
}

/// The recording of an overlay, and the row at which the overlay begins.
pub fn source<'a>(campaign: &'a Campaign, o: &Overlay) -> Option<(&'a Recording, usize)> {
    if let Some(r) = campaign.recordings.iter().find(|r| r.name == o.recording) {
        return Some((r, 0));
    }
    let (name, at) = o.recording.rsplit_once(" at ")?;
    let begin: f64 = at.strip_suffix(" s")?.parse().ok()?;
    let r = campaign.recordings.iter().find(|r| r.name == name)?;
    let real = o.channels.iter().find(|c| c.column == "omega_f_rad_s")?;
    // The overlay's name states its time with one decimal only; the row is found by comparing samples.
    let near = (0..r.time.len()).filter(|&k| (r.time[k] - begin).abs() < 0.06);
    let off = |k: usize| real.real.iter().zip(&r.omega_f[k..]).take(20).map(|(a, b)| (a - b).abs()).filter(|d| d.is_finite()).sum::<f64>();
    near.min_by(|&a, &b| off(a).total_cmp(&off(b))).map(|k| (r, k))
}

/// Reported torque, commanded position and state of the clutch along each overlay.
pub fn traces(campaign: &Campaign, found: &Diagnosis) -> Vec<Trace> {
    let car = Config::new(&found.vehicle, &found.effects);
    let one = |o| {
        source(campaign, o)
            .map_or_else(Trace::default, |(r, begin)| trace(&car, r, begin, o, modelled_disc_temperature(found, r, begin, o)))
    };
    found.overlays.iter().map(one).collect()
}

/// Disc temperature of the retuned model along an overlay, from a free replay.
fn modelled_disc_temperature(found: &Diagnosis, r: &Recording, begin: usize, o: &Overlay) -> Vec<f64> {
    let track = Track::new(r);
    let car = Car { effects: found.effects, ..Car::nominal(&found.vehicle) };
    let start = replay::start(&track, &car, begin, o.theta, 0.0);
    let rows = o.channels.iter().map(|c| c.real.len()).max().unwrap_or(0);
    let mut theta = Vec::with_capacity(rows);
    replay::replay(&track, &car, (&start, o.slip_angle), begin..(begin + rows).min(track.rows()), None, |_, now, _, _| {
        theta.push(now.theta_c)
    });
    theta
}

fn trace(car: &Config, r: &Recording, begin: usize, o: &Overlay, modelled_disc_temperature: Vec<f64>) -> Trace {
    let n = o.channels.iter().map(|c| c.real.len()).max().unwrap_or(0);
    let mut row = begin;
    let rows: Vec<usize> = (0..n)
        .map(|i| {
            let t = r.time[begin] + i as f64 * o.dt + 1e-9;
            while row + 1 < r.time.len() && r.time[row + 1] <= t {
                row += 1;
            }
            row
        })
        .collect();
    let held = |v: &[f64]| rows.iter().map(|&k| v.get(k).copied().unwrap_or(f64::NAN)).collect::<Vec<f64>>();
    let (t_e, x) = (held(&r.t_e), held(&r.x_to_cmd));
    let position_free = r.x_to_cmd.is_empty();
    let theta = o.channels.iter().find(|c| c.column == "theta_c_degC");
    let speeds = ["omega_f_rad_s", "omega_c_rad_s"].map(|column| o.channels.iter().find(|c| c.column == column));
    let phases = match speeds {
        [Some(f), Some(c)] => (0..n.min(f.real.len()).min(c.real.len()))
            .map(|i| {
                let theta =
                    theta.map(|t| t.after[i]).or(modelled_disc_temperature.get(i).copied()).filter(|t| t.is_finite()).unwrap_or(r.theta_c0);
                if !position_free && !clutch::engaged(car, x[i], theta) {
                    0
                } else if (f.real[i] - c.real[i]).abs() < LOCKED {
                    2
                } else {
                    1
                }
            })
            .collect(),
        _ => Vec::new(),
    };
    let command = (!position_free).then_some(Signal { column: "x_to_cmd_mm", unit: "mm", values: x });
    let signals = [Signal { column: "T_e_Nm", unit: "N.m", values: t_e }].into_iter().chain(command).collect();
    Trace { signals, phases, theta: modelled_disc_temperature }
}

/// Torque over position, friction over slip and over temperature, and the learned laws of effects outside the library.
pub fn laws(campaign: &Campaign, found: &Diagnosis, traces: &[Trace]) -> Vec<Law> {
    let cars = [Config::new(&found.nominal, &crate::effects::null()), Config::new(&found.vehicle, &found.effects)];
    let measured = found.overlays.iter().any(|o| o.channels.iter().any(|c| c.column == "T_fc_Nm"));
    let all: Vec<Sample> = found.overlays.iter().zip(traces).flat_map(|(o, t)| samples(o, t, &found.nominal)).collect();
    let mut thetas: Vec<f64> = all.iter().filter_map(|s| s.theta).collect();
    thetas.sort_by(f64::total_cmp);
    let at = |share: f64| thetas.get((share * (thetas.len().max(1) - 1) as f64) as usize).copied();
    let (cold, hot) = match (at(0.05), at(0.95)) {
        (Some(a), Some(b)) if b - a > 10.0 => ((a / 5.0).round() * 5.0, (b / 5.0).round() * 5.0),
        _ => (40.0, 120.0),
    };
    let torque_from =
        if measured { "torque by the transducer" } else { "torque from the flywheel’s balance, T_e − b_f ω_f − J_f ω̇_f" };
    let actuator = &found.nominal.actuator;
    let mut xs: Vec<f64> = all.iter().map(|s| s.x).collect();
    xs.sort_by(f64::total_cmp);
    // Up to the positions at which the recordings slip, and slightly beyond.
    let reached = xs.get(xs.len().saturating_sub(1) * 98 / 100).map_or(actuator.x_cls_0, |x| x + 0.4);
    let (first, last) = (actuator.x_cnt_0 - 0.3, reached.min(actuator.x_cls_0).max(actuator.x_cnt_0 + 0.5));
    let x = |k: usize| first + (last - first) * k as f64 / (POINTS - 1) as f64;
    let lines = |of: &dyn Fn(&Config, f64) -> Vec<(f64, f64)>| -> Vec<Line> {
        let both = cars.iter().enumerate();
        both.flat_map(|(k, car)| [(false, cold), (true, hot)].map(|(hot, theta)| Line { identified: k == 1, hot, points: of(car, theta) }))
            .collect()
    };
    let mut laws = vec![Law {
        title: "Clutch torque over position".to_owned(),
        over: "bearing position, mm".to_owned(),
        unit: "N·m",
        lines: lines(&|car, theta| (0..POINTS).map(|k| (x(k), capacity(car, x(k), SLIP, theta))).collect()),
        cloud: all.iter().map(|s| (s.x, s.torque)).collect(),
        note: format!("{cold:.0} and {hot:.0} °C, {SLIP:.0} rad/s; {torque_from}"),
        band: Vec::new(),
        learned: false,
    }];
    // Computing friction from the data requires the temperature, since the force depends on it; without a thermocouple the retuned model's temperature is used.
    let warm = |s: &Sample| if thetas.is_empty() { s.modelled } else { s.theta };
    let friction = |s: &Sample| {
        let force = clutch::force(&cars[1], &FaceCache::EMPTY, s.x, Branch { x: s.x, z: 0.0 }, &motion::warm(warm(s)?));
        let per_mu = torque_of(&cars[1].vehicle.friction, force, 1.0);
        (per_mu > PRESSED).then(|| s.torque / per_mu)
    };
    let cloud = |over: &dyn Fn(&Sample) -> Option<f64>| all.iter().filter_map(|s| Some((over(s)?, friction(s)?))).collect::<Vec<_>>();
    let from = match (measured, thetas.is_empty()) {
        (true, false) => "dots: measured torque over the model’s force",
        (true, true) => "dots: measured torque over the model’s force, at its temperature",
        (false, false) => "dots: torque from the flywheel’s balance over the model’s force",
        (false, true) => "dots: torque from the flywheel’s balance over the model’s force, at its temperature",
    };
    laws.push(Law {
        title: "Friction coefficient over slip".to_owned(),
        over: "slip, rad/s".to_owned(),
        unit: "",
        lines: lines(&|car, theta| {
            (0..POINTS).map(|k| 200.0 * k as f64 / (POINTS - 1) as f64).map(|slip| (slip, mu(car, slip, theta))).collect()
        }),
        cloud: cloud(&|s| Some(s.slip)),
        note: format!("{cold:.0} and {hot:.0} °C; {from}"),
        band: Vec::new(),
        learned: false,
    });
    laws.push(Law {
        title: "Friction coefficient over disc temperature".to_owned(),
        over: "disc temperature, °C".to_owned(),
        unit: "",
        lines: cars
            .iter()
            .enumerate()
            .map(|(k, car)| {
                let most = hot.max(120.0) + 40.0;
                let theta = |i: usize| 20.0 + (most - 20.0) * i as f64 / (POINTS - 1) as f64;
                Line { identified: k == 1, hot: false, points: (0..POINTS).map(|i| (theta(i), mu(car, SLIP, theta(i)))).collect() }
            })
            .collect(),
        cloud: cloud(&warm),
        note: format!("at {SLIP:.0} rad/s; {from}"),
        band: Vec::new(),
        learned: false,
    });
    // A learned friction law may depend on the friction work, which these curves leave at zero.
    if found.learned.as_ref().is_some_and(|l| l.refused.is_none() && l.laws.contains(&Subsystem::Friction)) {
        laws.iter_mut().for_each(|l| l.note += "; identified: before any friction work");
    }
    laws.extend(learned(campaign, found, traces));
    laws
}

/// Modelled torque below which a relative change is mostly noise, N·m.
const LOADED: f64 = 15.0;

/// Sum of a law's curves as the recordings show it at one sample, and the abscissa of each of the curves.
struct LawSample {
    sum: f64,
    at: Vec<f64>,
}

/// Curves of a learned law that was adopted, each with its band and with what the recordings show of it after subtracting the other curves.
fn learned(campaign: &Campaign, found: &Diagnosis, traces: &[Trace]) -> Vec<Law> {
    let Some(l) = found.learned.as_ref().filter(|l| l.refused.is_none()) else { return Vec::new() };
    l.laws.iter().flat_map(|&law| learned_in(law, l, campaign, found, traces)).collect()
}

/// The curves of one law.
fn learned_in(law: Subsystem, l: &Tried, campaign: &Campaign, found: &Diagnosis, traces: &[Trace]) -> Vec<Law> {
    let all: Vec<&'static Curve> = curves(law).collect();
    let mut without = found.effects;
    all.iter().flat_map(|c| c.parameters()).for_each(|k| without[k] = 0.0);
    let car = Config::new(&found.vehicle, &without);
    let with_data = found.overlays.iter().zip(traces);
    let shown: Vec<LawSample> =
        with_data.flat_map(|(o, t)| source(campaign, o).map_or_else(Vec::new, |(r, _)| law_samples(&car, law, o, t, r.theta_c0))).collect();
    // Curves that multiply another curve, and time constants, are hardly visible in the recordings by themselves.
    let apart = |c: &Curve| ["force_direction", "engine_time", "engine_slowing"].contains(&c.name);
    l.learned
        .curves
        .iter()
        .filter(|c| c.subsystem == law)
        .map(|c| {
            let place = all.iter().position(|other| other.name == c.name).expect("a learned curve is one of its law's");
            let others = |s: &LawSample| {
                all.iter()
                    .zip(&s.at)
                    .enumerate()
                    .filter(|(k, (c, _))| *k != place && !apart(c))
                    .map(|(_, (c, x))| c.value(&found.effects, *x))
                    .sum::<f64>()
            };
            let values = c.parameters().map(|k| found.effects[k]);
            let points: Vec<(f64, f64)> = c.breakpoints.iter().copied().zip(values).collect();
            let band = points.iter().zip(l.learned.sigma(c)).map(|((x, y), s)| (*x, y - BAND * s, y + BAND * s)).collect();
            let (first, last) = (c.breakpoints[0], c.breakpoints[c.breakpoints.len() - 1]);
            let cloud = match law {
                Subsystem::Actuator | Subsystem::Sensors => {
                    found.overlays.iter().zip(traces).flat_map(|(o, t)| curve_samples(c, &found.effects, &found.vehicle, o, t)).collect()
                }
                _ if apart(c) => Vec::new(),
                _ => shown.iter().map(|s| (s.at[place], s.sum - others(s))).collect(),
            };
            Law {
                title: names::curve(c.name),
                over: c.over.to_owned(),
                unit: match c.unit() {
                    "1" => "relative",
                    "N.m" => "N·m",
                    other => other,
                },
                lines: vec![
                    Line { identified: false, hot: false, points: vec![(first, 0.0), (last, 0.0)] },
                    Line { identified: true, hot: false, points },
                ],
                cloud,
                note: String::new(),
                band,
                learned: true,
            }
        })
        .collect()
}

/// Speed of the bearing below which its distance to the command yields no time constant, mm/s.
const MOVING: f64 = 2.0;
/// Speed below which a ratio of speeds is mostly noise, rad/s.
const TURNING: f64 = 5.0;

/// Samples of one curve of the actuator or the sensors, as an overlay shows them with all other effects at their identified sizes: a time constant from the speed of the
/// measured bearing position, an offset, or a scale. The remaining curves cannot be seen by themselves, and give no samples.
fn curve_samples(c: &Curve, effects: &crate::effects::Parameters, vehicle: &Vehicle, o: &Overlay, t: &Trace) -> Vec<(f64, f64)> {
    let channel = |column: &str| o.channels.iter().find(|c| c.column == column);
    let seen =
        |column: &str| channel(column).map(|c| c.real.iter().copied().zip(c.after.iter().copied()).collect::<Vec<_>>()).unwrap_or_default();
    let command = t.signals.iter().find(|s| s.column == "x_to_cmd_mm").map_or(&[][..], |s| s.values.as_slice());
    let all: Vec<(f64, f64)> = match c.name {
        "actuator_time" => {
            let x = seen("x_to_mm");
            let reach = ((0.5 * SLOPE_S / o.dt).round() as usize).max(1);
            let pace = |i: usize| (x[i + reach].0 - x[i - reach].0) / (2.0 * reach as f64 * o.dt);
            let range = reach..x.len().min(command.len()).saturating_sub(reach);
            range.filter(|&i| pace(i).abs() > MOVING).map(|i| (command[i] - x[i].0, (command[i] - x[i].0) / pace(i))).collect()
        }
        "actuator_offset" => {
            let at = |x: f64| x / vehicle.actuator.x_cls_0;
            seen("x_to_mm").iter().zip(command).map(|((real, after), x)| (at(*x), real - after + c.value(effects, at(*x)))).collect()
        }
        "disc_scale" | "flywheel_scale" => {
            let column = if c.name == "disc_scale" { "omega_c_rad_s" } else { "omega_f_rad_s" };
            let scaled =
                |(real, after): &(f64, f64)| (*after, (real / after - 1.0) * (1.0 + c.value(effects, *after)) + c.value(effects, *after));
            seen(column).iter().filter(|(_, after)| after.abs() > TURNING).map(scaled).collect()
        }
        _ => Vec::new(),
    };
    all.into_iter().filter(|(x, y)| x.is_finite() && y.is_finite()).collect()
}

/// Samples of a law from the torque balances: relative deviation of the torque from that of the car without the law, or residual torque.
fn law_samples(car: &Config, law: Subsystem, o: &Overlay, t: &Trace, theta_0: f64) -> Vec<LawSample> {
    let of = |column: &str| o.channels.iter().find(|c| c.column == column).map(|c| c.real.as_slice());
    let (Some(f), Some(c)) = (of("omega_f_rad_s"), of("omega_c_rad_s")) else { return Vec::new() };
    let signal = |column: &str| t.signals.iter().find(|s| s.column == column).map_or(&[][..], |s| s.values.as_slice());
    let (t_e, x_cmd) = (signal("T_e_Nm"), signal("x_to_cmd_mm"));
    let d = &car.constants.driveline;
    let reach = ((0.5 * SLOPE_S / o.dt).round() as usize).max(1);
    let n = t.phases.len().min(f.len()).min(c.len()).min(t_e.len()).min(x_cmd.len());
    let mut work = 0.0;
    let mut all = Vec::new();
    for i in reach..n.saturating_sub(reach) {
        let slope = |v: &[f64]| (v[i + reach] - v[i - reach]) / (2.0 * reach as f64 * o.dt);
        // Without a thermocouple, the retuned model's disc temperature is used.
        let theta = of("theta_c_degC").or((!t.theta.is_empty()).then_some(&t.theta)).and_then(|v| v.get(i)).copied().unwrap_or(theta_0);
        let slip = f[i] - c[i];
        let engine = car.constants.engine_gain * t_e[i] + car.constants.engine_bias;
        let balance = clutch_torque(&car.constants.driveline, engine, f[i], slope(f));
        let measured = of("T_fc_Nm").map(|v| v[i]);
        let torque = measured.unwrap_or(balance);
        let slipping = t.phases[i] == 1 && slip > 3.0 * LOCKED;
        if slipping && torque.is_finite() {
            work += (torque * slip).max(0.0) * o.dt;
        }
        let shown = match law {
            Subsystem::Friction | Subsystem::ClutchForce if slipping => {
                let x = of("x_to_mm").map_or(x_cmd[i], |v| v[i]);
                let modelled = capacity(car, x, slip, theta);
                let force = clutch::force(car, &FaceCache::EMPTY, x, Branch { x, z: 0.0 }, &motion::warm(theta));
                let closed = cushion::force(&car.vehicle.cushion_spring, car.xi_0, 1.0);
                let xi = clutch::normalised_position(car, x, theta);
                let at = if law == Subsystem::Friction { vec![slip, theta, force / closed, 1e-3 * work] } else { vec![xi, xi, theta] };
                (modelled > LOADED).then(|| LawSample { sum: torque / modelled - 1.0, at })
            }
            // The clutch torque must be known: the clutch is open, or its torque is measured.
            Subsystem::Engine if t.phases[i] == 0 || measured.is_some() => {
                Some(LawSample { sum: measured.filter(|_| t.phases[i] != 0).unwrap_or(0.0) - balance, at: vec![f[i], t_e[i]] })
            }
            Subsystem::Driveline if slipping || t.phases[i] == 2 => {
                let resisted = if slipping { torque } else { engine - (d.J_f) * slope(f) };
                let known = d.b_c * c[i] + load_torque(d, c[i]) + d.J_c * slope(c);
                (c[i] > 2.0 * d.omega_L).then(|| LawSample { sum: resisted - known, at: vec![c[i]] })
            }
            _ => None,
        };
        all.extend(shown.filter(|s| s.sum.is_finite() && s.at.iter().all(|x| x.is_finite())));
    }
    all
}

fn motion(theta: f64) -> Motion {
    let mut y = Motion::default();
    y[index::THETA_C] = theta;
    y
}

fn capacity(car: &Config, x: f64, slip: f64, theta: f64) -> f64 {
    clutch::capacity(car, x, Branch { x, z: 0.0 }, slip, &motion(theta))
}

/// Effective friction coefficient: torque divided by the torque that the same force gives with a friction coefficient of 1.
fn mu(car: &Config, slip: f64, theta: f64) -> f64 {
    let force = 1000.0;
    clutch::capacity_under(car, &FaceCache::EMPTY, force, slip, &motion(theta)) / torque_of(&car.vehicle.friction, force, 1.0)
}

fn samples(o: &Overlay, t: &Trace, vehicle: &Vehicle) -> Vec<Sample> {
    let of = |column: &str| o.channels.iter().find(|c| c.column == column).map(|c| c.real.as_slice());
    let (Some(f), Some(c)) = (of("omega_f_rad_s"), of("omega_c_rad_s")) else { return Vec::new() };
    let signal = |column: &str| t.signals.iter().find(|s| s.column == column).map(|s| s.values.as_slice());
    let Some(x) = of("x_to_mm").or_else(|| signal("x_to_cmd_mm")) else { return Vec::new() };
    let reach = ((0.5 * SLOPE_S / o.dt).round() as usize).max(1);
    let balance = |i: usize| {
        let (a, b) = (i.checked_sub(reach)?, i + reach);
        let slope = (f.get(b)? - f[a]) / ((b - a) as f64 * o.dt);
        Some(clutch_torque(&vehicle.driveline, *signal("T_e_Nm")?.get(i)?, f[i], slope))
    };
    let torque = |i: usize| of("T_fc_Nm").map_or_else(|| balance(i), |v| v.get(i).copied());
    (0..t.phases.len())
        .filter(|&i| t.phases[i] == 1 && f[i] - c[i] > 3.0 * LOCKED)
        .filter_map(|i| {
            let finite = |v: &[f64]| v.get(i).copied().filter(|v| v.is_finite());
            let (theta, modelled) = (of("theta_c_degC").and_then(finite), finite(&t.theta));
            let sample = Sample { torque: torque(i)?, x: *x.get(i)?, slip: f[i] - c[i], theta, modelled };
            (sample.torque.is_finite() && sample.x.is_finite()).then_some(sample)
        })
        .collect()
}
