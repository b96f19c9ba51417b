//! Random values within their bounds, in random order: whatever an importer may legally set, a step ends in bounded time and yields numbers, or an error from which a reset
//! recovers.

use kisspoint::fmi2::variables::{Causality, Description, Kind, Variability};
use kisspoint::fmi2::{controller, exports::*, plant, types::*};
use std::ffi::{CString, c_void};
use std::ptr;
use std::time::{Duration, Instant};

mod random;
use random::Random;

impl Random {
    /// Usually a value that a working sensor would show, sometimes any value.
    fn measured(&mut self, start: f64) -> f64 {
        match (self.next() * 8.0) as u32 {
            0 => f64::NAN,
            1 => f64::NEG_INFINITY,
            2 => 1e300,
            3 => 2500.0 - 5000.0 * self.next(),
            _ => start + 100.0 * self.next(),
        }
    }

    /// Often a bound itself, often near the start value, otherwise any value between the bounds.
    fn within(&mut self, start: f64, min: f64, max: f64) -> f64 {
        match (self.next() * 6.0) as u32 {
            0 => min,
            1 => max,
            2 | 3 => (start * (0.8 + 0.4 * self.next())).clamp(min, max),
            _ => min + (max - min) * self.next(),
        }
    }
}

fn make(guid: &str) -> *mut c_void {
    let guid = CString::new(guid).unwrap();
    fmi2Instantiate(c"x".as_ptr(), CO_SIMULATION, guid.as_ptr(), ptr::null(), &CallbackFunctions::NONE, 0, 0)
}

fn set_some(c: *mut c_void, d: &Description, random: &mut Random, share: f64, running: bool) {
    for v in d.variables {
        let settable =
            v.causality == Causality::Input || v.causality == Causality::Parameter && (!running || v.variability == Variability::Tunable);
        if v.kind == Kind::Real && settable && random.next() < share {
            let value = if v.is_measurement() { random.measured(v.start) } else { random.within(v.start, v.min, v.max) };
            let status = fmi2SetReal(c, &v.value_reference, 1, &value);
            let shafts = v.name == "effect.driveline_compliance.compliance";
            assert!(status == Status::Ok || shafts, "{} = {value}", v.name);
        }
    }
}

/// How a run ended.
#[derive(PartialEq)]
enum End {
    Complete,
    /// Parameters that contradict each other, or that make the plant too fast to be integrated; refused before any result was computed.
    Refused,
    /// A step produced values that are not finite: the parameters describe a car that runs away.
    Diverged,
}

fn outputs_are_numbers(c: *mut c_void, d: &Description) -> bool {
    d.variables.iter().filter(|v| v.causality == Causality::Output && v.kind == Kind::Real).all(|v| {
        let mut x = f64::NAN;
        assert_eq!(fmi2GetReal(c, &v.value_reference, 1, &mut x), Status::Ok);
        x.is_finite()
    })
}

fn run(c: *mut c_void, d: &Description, random: &mut Random) -> End {
    assert_eq!(fmi2Reset(c), Status::Ok);
    let share = [0.0, 0.02, 0.1, 1.0][(random.next() * 4.0) as usize];
    set_some(c, d, random, share, false);
    assert_eq!(fmi2EnterInitializationMode(c), Status::Ok);
    if fmi2ExitInitializationMode(c) != Status::Ok {
        return End::Refused;
    }
    let mut t = 0.0;
    for _ in 0..30 {
        let tuned = if random.next() < 0.3 { share } else { 0.0 };
        set_some(c, d, random, tuned, true);
        let h = 10_f64.powf(-6.0 + 5.0 * random.next());
        let began = Instant::now();
        let status = fmi2DoStep(c, t, h, 1);
        assert!(began.elapsed() < Duration::from_secs(5), "a step of {h} s took {:?}", began.elapsed());
        if status != Status::Ok {
            return if outputs_are_numbers(c, d) { End::Refused } else { End::Diverged };
        }
        t += h;
        assert!(outputs_are_numbers(c, d), "a step that left no numbers was not refused");
    }
    End::Complete
}

#[test]
fn whatever_is_within_bounds_gives_numbers_in_time() {
    for (guid, d) in [(plant::GUID, &plant::DESCRIPTION), (controller::GUID, &controller::DESCRIPTION)] {
        let c = make(guid);
        let mut random = Random(0x2545_f491_4f6c_dd1d);
        let runs = 4000;
        let ends: Vec<End> = (0..runs).map(|_| run(c, d, &mut random)).collect();
        let count = |end| ends.iter().filter(|e| **e == end).count();
        let (completed, refused, diverged) = (count(End::Complete), count(End::Refused), count(End::Diverged));
        println!("{}: of {runs} runs {completed} completed, {refused} were refused, {diverged} ran away", d.name);
        assert!(completed > runs / 2, "{}: only {completed} of {runs}", d.name);
        assert!(diverged < runs / 100, "{}: {diverged} of {runs} ran away", d.name);
        fmi2FreeInstance(c);
    }
}
