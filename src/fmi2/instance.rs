//! One instance of a model, in safe Rust: values, life cycle, steps and saved states.

use super::call::CallState;
use super::log::{Category, Log};
use super::model::{Model, Registered, put_vehicle};
use super::refusal::Refusal;
use super::resource;
use super::types::Status;
use super::variables::{Causality, Description, Kind, Variability, Variable};
use super::words::{Reader, Words, Writer};
use crate::effects::{self, Parameters};
use crate::vehicle::{Vehicle, VehicleError};
use std::fs;
use std::ops::Range;

/// Longest communication step, s: it bounds the work of a call.
pub const LONGEST_STEP: f64 = 1000.0;

/// Rounding allowed between the importer's clock and ours: relative to the time, and to the step.
const CLOCK_TOLERANCE: f64 = 1e-9;
const CLOCK_SHARE_OF_STEP: f64 = 1e-6;

/// File with the vehicle's numbers in the resources.
const VEHICLE_FILE: &str = "vehicle.json";

/// Variables whose refused values are remembered: the inputs stand among the first.
const DOUBTABLE: usize = 64;

/// An instance.
pub struct Instance {
    /// What its model description says.
    pub description: &'static Description,
    /// Where it is in its life.
    pub call_state: CallState,
    /// Where its messages go.
    pub log: Log,
    model: Box<dyn Model>,
    /// Values after instantiation and reset.
    fresh: Box<[f64]>,
    values: Box<[f64]>,
    /// Values before the last step, to tell events.
    before: Box<[f64]>,
    /// Where the outputs stand among the values.
    outputs: Range<usize>,
    moving: Moving,
}

/// What an instance keeps beside its values and its model.
#[derive(Clone, Copy, Debug)]
struct Moving {
    /// End of the last step, s.
    time: f64,
    stop: f64,
    /// Bit k: the last value offered for variable k was refused.
    doubts: u64,
    /// The model has not yet started from the values that stand.
    stale: bool,
    /// Tunable parameters were set since the last step.
    tuned: bool,
}

const AT_REST: Moving = Moving { time: 0.0, stop: f64::MAX, doubts: 0, stale: false, tuned: false };

impl Instance {
    /// A new instance, with the vehicle of the resources; none if its file is there but wrong, which has then been logged.
    pub fn new(registered: &'static Registered, resource_location: Option<&str>, log: Log) -> Option<Self> {
        let description = registered.description;
        let mut fresh: Box<[f64]> = description.variables.iter().map(|v| v.start).collect();
        match vehicle_of_resources(resource_location) {
            Ok((vehicle, effects)) => put_vehicle(description, &vehicle, &effects, &mut fresh),
            Err(Missing::Absent(why)) => log.send(
                Status::Warning,
                Category::Warning,
                format_args!("{why}; the start values of the paper's car are used, unless others are set"),
            ),
            Err(Missing::Wrong(why)) => {
                log.send(Status::Error, Category::Error, format_args!("fmi2Instantiate: {why}"));
                return None;
            }
        }
        Some(Self::with_values(registered, fresh, log))
    }

    /// An instance that starts from these values.
    fn with_values(registered: &'static Registered, fresh: Box<[f64]>, log: Log) -> Self {
        let variables = registered.description.variables;
        let is_output = |v: &Variable| v.causality == Causality::Output;
        let first = variables.iter().position(is_output).unwrap_or(0);
        let last = variables.iter().rposition(is_output).map_or(0, |k| k + 1);
        let (values, before, call_state) = (fresh.clone(), fresh.clone(), CallState::Instantiated);
        let (description, model, outputs) = (registered.description, (registered.make)(), first..last);
        let mut made = Self { description, call_state, log, model, fresh, values, before, outputs, moving: AT_REST };
        made.reset();
        made
    }

    /// `fmi2SetupExperiment`.
    ///
    /// # Errors
    /// Times that make no experiment.
    pub fn setup(&mut self, start: f64, stop: Option<f64>, tolerance: Option<f64>) -> Result<Status, Refusal> {
        if !start.is_finite() {
            return Err(Refusal::Argument("startTime", start, "not finite"));
        }
        if let Some(stop) = stop.filter(|stop| !(stop.is_finite() && *stop > start)) {
            return Err(Refusal::Argument("stopTime", stop, "not after startTime"));
        }
        if let Some(tolerance) = tolerance.filter(|t| !(t.is_finite() && *t >= 0.0)) {
            return Err(Refusal::Argument("tolerance", tolerance, "not a tolerance"));
        }
        (self.moving.time, self.moving.stop) = (start, stop.unwrap_or(f64::MAX));
        Ok(Status::Ok)
    }

    /// `fmi2ExitInitializationMode`.
    ///
    /// # Errors
    /// Parameters that contradict each other; the mode stays.
    pub fn exit_initialization(&mut self) -> Result<Status, Refusal> {
        self.refresh()?;
        self.moving.tuned = false;
        self.call_state = CallState::StepComplete;
        Ok(Status::Ok)
    }

    /// `fmi2Reset`: as after instantiation.
    pub fn reset(&mut self) {
        self.values.copy_from_slice(&self.fresh);
        // The start values agree with each other: those of the XML do, and a vehicle file is checked when it is read.
        self.moving = Moving { stale: self.model.start(&mut self.values).is_err(), ..AT_REST };
        self.call_state = CallState::Instantiated;
    }

    /// Starts the model anew if a value was set since.
    fn refresh(&mut self) -> Result<(), Refusal> {
        if self.moving.stale {
            self.model.start(&mut self.values).map_err(Refusal::Parameters)?;
            self.moving.stale = false;
        }
        Ok(())
    }

    fn find(&self, reference: u32, kinds: &[Kind]) -> Result<(usize, &'static Variable), Refusal> {
        let index = self.description.find(reference).ok_or(Refusal::UnknownReference(reference))?;
        let variable = &self.description.variables[index];
        if kinds.contains(&variable.kind) { Ok((index, variable)) } else { Err(Refusal::WrongKind(variable)) }
    }

    /// Value of a variable of one of these kinds.
    ///
    /// # Errors
    /// No such variable; or, in initialization, parameters that contradict each other.
    #[inline]
    pub fn get(&mut self, reference: u32, kinds: &[Kind]) -> Result<f64, Refusal> {
        let (index, variable) = self.find(reference, kinds)?;
        if self.call_state == CallState::Initialization && variable.causality == Causality::Output {
            self.refresh()?;
        }
        Ok(self.values[index])
    }

    /// Sets all values, or none.
    ///
    /// # Errors
    /// The first variable or value that is refused.
    pub fn set(&mut self, kinds: &[Kind], pairs: impl Iterator<Item = (u32, f64)> + Clone) -> Result<Status, Refusal> {
        for (reference, value) in pairs.clone() {
            let (index, variable) = self.find(reference, kinds)?;
            if let Err(refusal) = self.check(variable, value) {
                if index < DOUBTABLE && variable.causality == Causality::Input {
                    self.moving.doubts |= 1 << index;
                }
                return Err(refusal);
            }
        }
        let running = self.call_state == CallState::StepComplete;
        for (reference, value) in pairs {
            let (index, variable) = self.find(reference, kinds)?;
            self.values[index] = value;
            if index < DOUBTABLE {
                self.moving.doubts &= !(1 << index);
            }
            self.moving.tuned |= running && variable.causality == Causality::Parameter;
        }
        self.moving.stale |= !running;
        Ok(Status::Ok)
    }

    fn check(&self, variable: &'static Variable, value: f64) -> Result<(), Refusal> {
        let running = self.call_state == CallState::StepComplete;
        let settable = match variable.causality {
            Causality::Input => true,
            Causality::Parameter => !running || variable.variability == Variability::Tunable,
            Causality::Output | Causality::Local => false,
        };
        if !settable {
            return Err(Refusal::NotSettable(variable));
        }
        if !value.is_finite() {
            return Err(Refusal::NotFinite(variable, value));
        }
        if value < variable.min || value > variable.max {
            return Err(Refusal::OutOfBounds(variable, value));
        }
        match self.model.objection(variable, value) {
            Some(why) => Err(Refusal::Inadmissible(variable, value, why)),
            None => Ok(()),
        }
    }

    /// `fmi2DoStep`.
    ///
    /// # Errors
    /// A step that is none, or that left no numbers.
    pub fn do_step(&mut self, point: f64, h: f64) -> Result<Status, Refusal> {
        let end = self.check_step(point, h)?;
        if self.moving.tuned {
            self.model.tune(&self.values)?;
            self.moving.tuned = false;
        }
        let logs_events = self.log.wants(Category::Events) || self.log.wants(Category::Warning);
        if logs_events {
            let outputs = self.outputs.clone();
            self.before[outputs.clone()].copy_from_slice(&self.values[outputs]);
        }
        self.model.step(&mut self.values, self.moving.doubts, h);
        // The importer's clock leads: ours would drift from it by the sum of all roundings.
        self.moving.time = end;
        if let Some(place) = self.values[self.outputs.clone()].iter().position(|v| !v.is_finite()) {
            let index = self.outputs.start + place;
            self.call_state = CallState::Failed;
            return Err(Refusal::Diverged(&self.description.variables[index], self.values[index]));
        }
        if logs_events && let Some(event) = self.model.event(&self.before, &self.values) {
            let (status, category) = if event.warning { (Status::Warning, Category::Warning) } else { (Status::Ok, Category::Events) };
            self.log.send(status, category, format_args!("step to {end} s: {}", event.what));
        }
        Ok(Status::Ok)
    }

    /// End of the step, if it can be made.
    fn check_step(&self, point: f64, h: f64) -> Result<f64, Refusal> {
        if !point.is_finite() {
            return Err(Refusal::CommunicationPoint(point, self.moving.time));
        }
        let reason = match h {
            _ if !h.is_finite() => "not finite",
            _ if h <= 0.0 => "not positive",
            _ if h > LONGEST_STEP => "longer than 1000 s",
            _ => "",
        };
        if !reason.is_empty() {
            return Err(Refusal::StepSize(h, reason));
        }
        let time = self.moving.time;
        let tolerance = CLOCK_TOLERANCE * (1.0 + time.abs()) + CLOCK_SHARE_OF_STEP * h;
        if (point - time).abs() > tolerance {
            return Err(Refusal::CommunicationPoint(point, time));
        }
        let end = point + h;
        if end == point {
            return Err(Refusal::StepSize(h, "too short to move the clock"));
        }
        if end > self.moving.stop + tolerance {
            return Err(Refusal::BeyondStop(end, self.moving.stop));
        }
        Ok(end)
    }

    /// End of the last step, s.
    pub fn last_successful_time(&self) -> f64 {
        self.moving.time
    }

    /// Room that a saved state may need, in words.
    pub fn most_words(&self) -> usize {
        self.values.len() + 8 + self.model.most_words()
    }

    /// Appends everything that determines what follows.
    pub fn save(&self, payload: &mut Vec<u64>) {
        let mut writer = Writer(payload);
        writer.choice(&mut self.call_state.clone(), |s| s as u64, &[]);
        walk_moving(&mut self.moving.clone(), &mut writer);
        self.values.iter().for_each(|v| writer.real(&mut v.clone()));
        self.model.save(&mut writer);
    }

    /// Takes up what [`Instance::save`] appended.
    ///
    /// # Errors
    /// Words that no instance of this model saved; then the instance must be reset.
    pub fn load(&mut self, payload: &[u64]) -> Result<Status, Refusal> {
        let mut reader = Reader { words: payload, failed: false };
        let mut number = 0;
        reader.word(&mut number, |n| CallState::from_number(n).is_some());
        walk_moving(&mut self.moving, &mut reader);
        self.values.iter_mut().for_each(|v| reader.real(v));
        let variables = self.description.variables.iter();
        let out_of_bounds = variables.zip(&self.values).any(|(v, x)| v.causality != Causality::Output && (*x < v.min || *x > v.max));
        self.model.load(&self.values, &mut reader);
        if reader.failed || !reader.words.is_empty() || out_of_bounds {
            self.call_state = CallState::Failed;
            return Err(Refusal::DamagedState("its content is no state of this model"));
        }
        self.call_state = CallState::from_number(number).unwrap_or(CallState::Failed);
        Ok(Status::Ok)
    }

    /// Whether [`Instance::load`] would take this, tried on a scratch instance.
    ///
    /// # Errors
    /// As [`Instance::load`].
    pub fn check_state(&self, payload: &[u64]) -> Result<Status, Refusal> {
        let registered = super::model::find(self.description.guid).ok_or(Refusal::Panic)?;
        let silent = Log::new(None, std::ptr::null_mut(), std::ffi::CString::default(), false);
        Self::with_values(registered, self.fresh.clone(), silent).load(payload)
    }
}

fn walk_moving(moving: &mut Moving, words: &mut impl Words) {
    let Moving { time, stop, doubts, stale, tuned } = moving;
    words.real(time);
    words.real(stop);
    words.word(doubts, |_| true);
    words.flag(stale);
    words.flag(tuned);
}

enum Missing {
    /// There is none to read.
    Absent(String),
    /// It was read and is wrong.
    Wrong(String),
}

fn vehicle_of_resources(location: Option<&str>) -> Result<(Vehicle, Parameters), Missing> {
    let location = location.ok_or_else(|| Missing::Absent("fmuResourceLocation is NULL".into()))?;
    let folder = resource::folder(location)
        .ok_or_else(|| Missing::Absent(format!("fmuResourceLocation \"{location}\" names no folder on this machine")))?;
    let path = folder.join(VEHICLE_FILE);
    let text = fs::read_to_string(&path).map_err(|e| Missing::Absent(format!("{} cannot be read: {e}", path.display())))?;
    let wrong = |e: VehicleError| Missing::Wrong(format!("{}: {e}", path.display()));
    let document = serde_json::from_str(&text).map_err(|e| wrong(VehicleError::Json(e.to_string())))?;
    Ok((Vehicle::from_value(&document).map_err(wrong)?, effects::from_value(&document).map_err(wrong)?))
}
