//! A measurement file as it is, channel by channel, for users who do not know yet which channel is which.

use std::path::Path;
use std::rc::Rc;

use super::clock;
use super::error::{CampaignError, Defect};
use super::guess;
use super::table::{self, Group};
use super::units::{self, Quantity};
use super::{Channel, doubt, raster};

/// A measurement file.
#[derive(Clone, Debug)]
pub struct Log {
    /// File name.
    pub file: String,
    /// Its numeric channels that have valid samples.
    pub channels: Vec<LogChannel>,
    /// What the reader noticed or left out.
    pub notes: Vec<String>,
}

/// A channel, in our unit for its quantity.
#[derive(Clone, Debug)]
pub struct LogChannel {
    /// Name in the file.
    pub name: String,
    /// Quantity, from the unit or the name; `None` if neither tells.
    pub quantity: Option<Quantity>,
    /// Time of each valid sample, s, on the file's clock.
    pub time: Rc<Vec<f64>>,
    /// Values of these samples.
    pub values: Vec<f64>,
    /// Which of our channels it seems to be.
    pub guess: Option<Channel>,
    /// Mean distance between samples outside gaps, s.
    pub step: f64,
    /// Standard deviation of that distance, s.
    pub jitter: f64,
    /// Gaps, as the times of the samples before and after, s.
    pub gaps: Vec<(f64, f64)>,
    /// Quantisation step; 0 for a constant.
    pub quantum: f64,
    /// Threshold below which a speed sensor reads 0, if it has a dead band.
    pub dead_band: Option<f64>,
}

/// Opens a file of any of the formats; a database (DBC) decodes the frames of a CAN bus. `tell` receives the share that has been read.
///
/// # Errors
/// The file can't be read, is damaged, or has a clock that does not run forward.
pub fn open(path: &Path, dbc: Option<&Path>, tell: &dyn Fn(f64)) -> Result<Log, CampaignError> {
    std::fs::metadata(path).map_err(|source| CampaignError::Io { file: path.to_path_buf(), source })?;
    let m = table::read(path, dbc, &|_| true, tell)?;
    let mut log = Log { file: m.file.clone(), channels: Vec::new(), notes: m.notes.clone() };
    let mut words: Vec<String> = Vec::new();
    for group in &m.groups {
        let Some(at) = guess::clock_of(group) else {
            return Err(m.defect(Defect::NoMaster).into());
        };
        let clock = &group.series[at];
        let factor = clock.unit.as_deref().and_then(units::parse).map_or(1.0, |u| u.factor);
        let time: Rc<Vec<f64>> = Rc::new(clock.values.iter().map(|t| t * factor).collect());
        clock::check(&time).map_err(|(defect, sample)| m.defect_at(defect, &clock.name, Some(sample)))?;
        let others = (0..group.series.len()).filter(|k| *k != at);
        for k in others {
            let text = group.series[k].text.as_ref();
            words.extend(text.map(|(_, word)| format!("{} (\"{word}\")", group.series[k].name)));
            log.channels.extend(channel(group, k, &time, &mut log.notes));
        }
    }
    if !words.is_empty() {
        log.notes.push(format!("left out, for they hold more than numbers: {}", words.join(", ")));
    }
    count_from_start(&mut log);
    let named: Vec<(&str, Option<&str>)> = log.channels.iter().map(|c| (c.name.as_str(), None)).collect();
    let guesses = guess::guess(&named);
    log.notes.extend(guess::shared(&named).into_iter().map(|(name, count, channel)| {
        format!("{count} channels are called {name}, so that none is taken for {}; rename all but one, or take the first with --engine or --road", channel.spec().column)
    }));
    for (channel, guess) in log.channels.iter_mut().zip(guesses) {
        channel.guess = guess.filter(|g| channel.quantity.is_none_or(|q| q == g.spec().quantity));
    }
    Ok(log)
}

/// Largest value of an engine speed that may be in rad/s (9549 1/min); larger values must be in 1/min.
const FASTEST_ENGINE: f64 = 1000.0;

impl LogChannel {
    /// Converts an engine speed without a unit from the one that its values imply, and returns a note on it.
    pub(crate) fn measure_as_engine(&mut self) -> Option<String> {
        if self.quantity.is_some() {
            return None;
        }
        let most = self.values.iter().copied().fold(0.0, f64::max);
        let (unit, factor) = if most > FASTEST_ENGINE { ("1/min", std::f64::consts::PI / 30.0) } else { ("rad/s", 1.0) };
        self.values.iter_mut().for_each(|v| *v *= factor);
        self.quantum *= factor;
        self.dead_band = self.dead_band.map(|threshold| threshold * factor);
        self.quantity = Some(Quantity::Speed);
        Some(format!("no unit is given for {}: with values up to {most:.0} it is taken as {unit}", self.name))
    }
}

/// Makes times count from the log's first stamp if the clock starts before 0 s or from 10⁴ s on: such times are hard to read.
fn count_from_start(log: &mut Log) {
    let start = log.channels.iter().filter_map(|c| c.time.first().copied()).fold(f64::INFINITY, f64::min);
    if !start.is_finite() || (0.0..1e4).contains(&start) {
        return;
    }
    log.notes.push(format!("the clock starts at {start} s; time counts from there"));
    for channel in &mut log.channels {
        channel.time = Rc::new(channel.time.iter().map(|t| t - start).collect());
        channel.gaps.iter_mut().for_each(|(from, to)| (*from, *to) = (*from - start, *to - start));
    }
}

/// A numeric channel without its missing samples; `None` if the series is text or has no valid sample.
fn channel(group: &Group, at: usize, clock: &Rc<Vec<f64>>, notes: &mut Vec<String>) -> Option<LogChannel> {
    let series = &group.series[at];
    let unit = series.unit.as_deref().and_then(units::parse).or_else(|| from_name(&series.name));
    let (scale, offset) = unit.map_or((1.0, 0.0), |u| (u.factor, u.offset));
    let speed = unit.is_some_and(|u| matches!(u.quantity, Quantity::Speed | Quantity::Velocity));
    let mut values: Vec<f64> = series.values.iter().map(|v| v * scale + offset).collect();
    let mut time = clock.clone();
    thin(&mut time, &mut values);
    // A series without a unit may be a counter or a state, whose jumps are not faults.
    let fault = unit.and_then(|u| doubt::faults_of((&series.name, u.quantity.unit()), &time, &mut values, speed));
    notes.extend(fault);
    notes.extend(if speed { raster::samples_of(&series.name, &time, &mut values) } else { None });
    thin(&mut time, &mut values);
    let spacing = clock::spacing(&time, &values).filter(|_| series.text.is_none())?;
    let dead_band = doubt::dead_band(&time, &values, doubt::LIKELY).filter(|_| speed).map(|(threshold, _)| threshold);
    Some(LogChannel {
        name: series.name.clone(),
        quantity: unit.map(|u| u.quantity),
        quantum: doubt::quantum(&values),
        dead_band,
        guess: None,
        step: spacing.step,
        jitter: spacing.jitter,
        gaps: spacing.gaps.iter().map(|g| (g.from, g.to)).collect(),
        time,
        values,
    })
}

/// Removes missing samples; a channel without missing samples shares its group's clock.
fn thin(time: &mut Rc<Vec<f64>>, values: &mut Vec<f64>) {
    if values.iter().any(|v| v.is_nan()) {
        *time = Rc::new(clock::valid(time, values).map(|(_, t, _)| t).collect());
        values.retain(|v| !v.is_nan());
    }
}

/// Unit of a column of the contract, or the unit at the end of a name: `engine_speed_rpm`, `Engine RPM`. After a blank or a dot, or as the whole name, only a unit
/// of speed or torque is accepted: `plug in` is no length. A word that can only be a unit of speed may stand anywhere: `EngineRPM`, `SPEED_KMH_GPS`.
fn from_name(name: &str) -> Option<units::Unit> {
    if let Some(channel) = Channel::from_column(name) {
        return units::parse(channel.spec().unit);
    }
    let last = match name.rsplit_once('_') {
        Some((_, end)) => units::parse(end).filter(|_| end.len() > 1),
        None => {
            let word = name.rsplit([' ', '.']).next()?;
            units::parse(word).filter(|u| word.len() > 1 && matches!(u.quantity, Quantity::Speed | Quantity::Velocity | Quantity::Torque))
        }
    };
    let certain = |word: &&String| matches!(word.trim_end_matches(|c: char| c.is_ascii_digit()), "rpm" | "kmh" | "kph" | "mph");
    let inside =
        || guess::words(name).iter().find(certain).and_then(|word| units::parse(word.trim_end_matches(|c: char| c.is_ascii_digit())));
    last.or_else(inside)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(starts: &[f64]) -> Log {
        let one = |from: &f64| LogChannel {
            name: String::new(),
            quantity: None,
            time: Rc::new(vec![*from, from + 1.0, from + 3.0]),
            values: vec![0.0; 3],
            guess: None,
            step: 1.0,
            jitter: 0.0,
            gaps: vec![(from + 1.0, from + 3.0)],
            quantum: 0.0,
            dead_band: None,
        };
        Log { file: String::new(), channels: starts.iter().map(one).collect(), notes: Vec::new() }
    }

    #[test]
    fn an_engine_speed_without_a_unit_is_told_by_its_values() {
        for (most, factor, said) in
            [(3205.0, std::f64::consts::PI / 30.0, "up to 3205 it is taken as 1/min"), (335.6, 1.0, "taken as rad/s")]
        {
            let mut channel = log(&[0.0]).channels.remove(0);
            (channel.values, channel.quantum) = (vec![80.0, most, 90.0], 2.0);
            assert!(channel.measure_as_engine().unwrap().contains(said));
            assert_eq!((channel.values[1], channel.quantum, channel.quantity), (most * factor, 2.0 * factor, Some(Quantity::Speed)));
            assert_eq!(channel.measure_as_engine(), None);
        }
    }

    #[test]
    fn names_say_units() {
        for (name, factor) in [
            ("engine_rpm", std::f64::consts::PI / 30.0),
            ("Engine RPM", std::f64::consts::PI / 30.0),
            ("RPM_OBD", std::f64::consts::PI / 30.0),
            ("rpm1", std::f64::consts::PI / 30.0),
            ("EngineRPM", std::f64::consts::PI / 30.0),
            ("SPEED_KMH_GPS", 1.0 / 3.6),
            ("omega_f_rad_s", 1.0),
        ] {
            assert_eq!(from_name(name).map(|u| u.factor), Some(factor), "{name}");
        }
        for name in ["plug in", "EngineSpeed", "x_m1", "trpm", "gear_c"] {
            assert!(from_name(name).is_none(), "{name}");
        }
    }

    #[test]
    fn a_clock_of_another_age_counts_from_the_first_stamp() {
        for (starts, from) in [
            ([0.0, 2.0], None),
            ([9999.0, 1e5], None),
            ([1.7e9 + 2.0, 1.7e9], Some(1.7e9)),
            ([1e4, 2e4], Some(1e4)),
            ([-5.0, 0.0], Some(-5.0)),
        ] {
            let mut log = log(&starts);
            count_from_start(&mut log);
            assert_eq!(log.notes.len(), usize::from(from.is_some()), "{starts:?}");
            for (channel, start) in log.channels.iter().zip(starts) {
                let first = start - from.unwrap_or(0.0);
                assert_eq!((channel.time[0], channel.time[2], channel.gaps[0]), (first, first + 3.0, (first + 1.0, first + 3.0)));
            }
        }
        let mut none = log(&[]);
        count_from_start(&mut none);
        assert!(none.notes.is_empty());
    }

    /// A channel as read from a file with one group.
    fn read(name: &str, unit: Option<&str>, values: Vec<f64>) -> (Option<LogChannel>, Vec<String>) {
        let clock = Rc::new((0..values.len()).map(|k| 0.01 * k as f64).collect());
        let series = table::Series { name: name.into(), unit: unit.map(str::to_owned), values, text: None };
        let mut notes = Vec::new();
        (channel(&Group { series: vec![series], ..Group::default() }, 0, &clock, &mut notes), notes)
    }

    #[test]
    fn values_are_brought_to_our_unit_and_missing_ones_are_left_out() {
        let ramp = |k: usize| 30.0 * k as f64;
        let mut values: Vec<f64> = (0..200).map(ramp).collect();
        values[10] = f64::NAN;
        let (of_unit, of_name, bare) = (
            read("x", Some("rpm"), values.clone()).0.unwrap(),
            read("n_rpm", None, values.clone()).0.unwrap(),
            read("x", None, values).0.unwrap(),
        );
        for c in [&of_unit, &of_name] {
            assert_eq!(c.quantity, Some(Quantity::Speed));
            assert!((c.values[1] - std::f64::consts::PI).abs() < 1e-9 && (c.quantum - std::f64::consts::PI).abs() < 1e-9);
        }
        assert_eq!((bare.quantity, bare.values[1], bare.values.len(), bare.time.len()), (None, 30.0, 199, 199));
        assert!((bare.step - 0.01).abs() < 1e-9 && bare.gaps.len() == 1 && (bare.time[10] - 0.11).abs() < 1e-9);
        let celsius = read("oil", Some("K"), (0..20).map(|k| 300.0 + f64::from(k)).collect()).0.unwrap();
        assert!((celsius.values[0] - 26.85).abs() < 1e-9);
        assert_eq!(from_name("omega_f_rad_s").map(|u| u.quantity), Some(Quantity::Speed));
        let of = |name| from_name(name).map(|u| u.quantity);
        assert_eq!(
            ["rpm", "Engine RPM", "RPM limit", "Speed MPH", "Engine.Nm"].map(of),
            [Quantity::Speed, Quantity::Speed, Quantity::Speed, Quantity::Velocity, Quantity::Torque].map(Some)
        );
        assert_eq!(["plug in", "oil C", "lap min"].map(of), [None; 3]);
        assert!(from_name("torque").is_none() && from_name("speed_n").is_none() && from_name("a_m").is_none());
        assert!(read("x", None, vec![f64::NAN; 5]).0.is_none());
    }

    #[test]
    fn a_fault_is_one_where_a_unit_says_what_is_measured() {
        let with_spike = || (0..200).map(|k| if k == 77 { 900.0 } else { 0.4 * f64::from(k) }).collect::<Vec<f64>>();
        let (speed, notes) = read("x", Some("rad/s"), with_spike());
        assert!(speed.unwrap().values.len() == 199 && notes.len() == 1 && notes[0].contains("0.770 s"), "{notes:?}");
        let (counter, notes) = read("x", None, with_spike());
        assert!(counter.unwrap().values.len() == 200 && notes.is_empty());
        // Only a speed can have a threshold.
        let still = || (0..200).map(|k| (0.4 * f64::from(k)) * f64::from(u8::from(k > 20))).collect::<Vec<f64>>();
        assert!(
            read("x", Some("rad/s"), still()).0.unwrap().dead_band.is_some()
                && read("x", Some("Nm"), still()).0.unwrap().dead_band.is_none()
        );
    }
}
