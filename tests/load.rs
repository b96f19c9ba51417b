//! The FMUs under load: ten thousand instances on 64 threads, with effects drawn at extremes and inputs that step wildly. Every output is finite, no memory is allocated, and
//! no plant gains more energy than was put in.
//!
//! `packaging/soak.sh` runs the same tests for an hour: `KISSPOINT_SOAK_S` is the duration in s; without it each test does a fixed amount of work.

use kisspoint::effects::{self, PARAMETERS, Parameters, param};
use kisspoint::fmi2::variables::{Causality, Description, Kind, Variability};
use kisspoint::fmi2::{controller, exports::*, plant, types::*};
use kisspoint::plant::{Inputs, Plant, Start};
use kisspoint::vehicle::Vehicle;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::ffi::{CString, c_void};
use std::ptr;
use std::time::{Duration, Instant};

mod random;
use random::Random;

const THREADS: usize = 64;
const INSTANCES: usize = 10_000;
const STEPS: usize = 10_000_000;
/// Number of plants whose energy is followed, and number of threads that share them.
const PLANTS: usize = 200;
const WORKERS: usize = 4;

struct Counting;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call is forwarded to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|n| n.set(n.get() + 1));
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Duration of the soak test, if one is given.
fn soak() -> Option<Duration> {
    let seconds = std::env::var("KISSPOINT_SOAK_S").ok()?;
    Some(Duration::from_secs(seconds.parse().expect("KISSPOINT_SOAK_S is a number of seconds")))
}

/// One of the bounds, or a value between them.
fn extreme(random: &mut Random, min: f64, max: f64) -> f64 {
    match (random.next() * 3.0) as u32 {
        0 => min,
        1 => max,
        _ => min + (max - min) * random.next(),
    }
}

fn make(guid: &str) -> *mut c_void {
    let guid = CString::new(guid).unwrap();
    let c = fmi2Instantiate(c"x".as_ptr(), CO_SIMULATION, guid.as_ptr(), ptr::null(), &CallbackFunctions::NONE, 0, 0);
    assert!(!c.is_null());
    begin(c);
    c
}

fn begin(c: *mut c_void) {
    assert_eq!((fmi2EnterInitializationMode(c), fmi2ExitInitializationMode(c)), (Status::Ok, Status::Ok));
}

struct Instance {
    component: *mut c_void,
    description: &'static Description,
    time: f64,
}

impl Instance {
    /// Sets what may be set while running: all inputs, and each tunable parameter with the probability `share`.
    fn unsettle(&self, random: &mut Random, share: f64) {
        for v in self.description.variables {
            let tunable = v.causality == Causality::Parameter && v.variability == Variability::Tunable;
            if v.kind != Kind::Real || !(v.causality == Causality::Input || tunable && random.next() < share) {
                continue;
            }
            // Shafts between rigid and soft are refused when they are set, and shafts that are too fast to be integrated at the next step.
            let least = if v.name == "effect.driveline_compliance.compliance" { 1e-4 } else { v.min };
            let value = extreme(random, least, v.max);
            assert_eq!(fmi2SetReal(self.component, &v.value_reference, 1, &value), Status::Ok, "{} = {value}", v.name);
        }
    }

    /// Makes one step. Returns false if the parameters make a plant that cannot be integrated; the instance is then reset.
    fn step(&mut self, h: f64) -> bool {
        let done = fmi2DoStep(self.component, self.time, h, 1) == Status::Ok;
        for v in self.description.variables.iter().filter(|v| v.causality == Causality::Output && v.kind == Kind::Real) {
            let mut x = f64::NAN;
            assert_eq!(fmi2GetReal(self.component, &v.value_reference, 1, &mut x), Status::Ok);
            assert!(x.is_finite() || !done, "{} is {x} after a step that was made", v.name);
        }
        if !done {
            assert_eq!(fmi2Reset(self.component), Status::Ok);
            begin(self.component);
        }
        self.time = if done { self.time + h } else { 0.0 };
        done
    }
}

/// Runs the instances of one thread. Returns the numbers of steps made and refused.
fn work(thread: usize, until: Option<Instant>) -> [usize; 2] {
    let models = [(plant::GUID, &plant::DESCRIPTION), (controller::GUID, &controller::DESCRIPTION)];
    // A plant's step takes several times as long as a controller's, so one of eight instances is a plant.
    let instance = |k: usize| {
        let (guid, description) = models[usize::from(k % 8 > 0)];
        Instance { component: make(guid), description, time: 0.0 }
    };
    let mut all: Vec<Instance> = (0..INSTANCES / THREADS + usize::from(thread < INSTANCES % THREADS)).map(instance).collect();
    let mut random = Random(0x9e37_79b9_7f4a_7c15 ^ (thread as u64 + 1).wrapping_mul(0x2545_f491_4f6c_dd1d));
    let (mut made, mut refused) = (0, 0);
    let before = COUNT.get();
    while until.map_or(made + refused < STEPS / THREADS, |until| Instant::now() < until) {
        for one in &mut all {
            let share = [0.0, 0.0, 0.02, 0.3][(random.next() * 4.0) as usize];
            one.unsettle(&mut random, share);
            for _ in 0..64 {
                let ok = one.step(10_f64.powf(-5.0 + 2.0 * random.next()));
                (made, refused) = (made + usize::from(ok), refused + usize::from(!ok));
            }
        }
    }
    assert_eq!(COUNT.get() - before, 0, "allocations in {made} steps");
    all.iter().for_each(|one| fmi2FreeInstance(one.component));
    [made, refused]
}

#[test]
fn ten_thousand_instances_on_64_threads_give_numbers_and_take_no_memory() {
    let until = soak().map(|time| Instant::now() + time);
    let done: Vec<[usize; 2]> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..THREADS).map(|thread| scope.spawn(move || work(thread, until))).collect();
        threads.into_iter().map(|thread| thread.join().expect("no thread fails")).collect()
    });
    let [made, refused] = [0, 1].map(|k| done.iter().map(|d| d[k]).sum::<usize>());
    println!("{INSTANCES} instances on {THREADS} threads: {made} steps, {refused} refused");
    assert!(made + refused >= STEPS || until.is_some());
    assert!(refused < made / 100, "{refused} of {made} steps were refused");
}

/// Random effects, with a probability of one half also the tables of learned laws. Independently, with a probability of one half, they have five times the friction and a drag
/// of 100 N·m, in whose steep friction a plant once chattered.
fn effects_at_extremes(random: &mut Random) -> Parameters {
    let mut parameters = effects::null();
    let share = [0.1, 0.5, 1.0][(random.next() * 3.0) as usize];
    let [learned, steep] = [0; 2].map(|_| random.next() < 0.5);
    for (value, p) in parameters.iter_mut().zip(&PARAMETERS).filter(|(_, p)| learned || p.effect != "empirical") {
        if random.next() < share {
            *value = extreme(random, p.min, p.max);
        }
    }
    if steep {
        (parameters[param::friction_level::factor], parameters[param::clutch_drag::torque]) = (5.0, 100.0);
    }
    // Pulsations that advance by several radians per substep are not resolved.
    parameters[param::judder::order] = parameters[param::judder::order].min(3.0);
    let compliance = &mut parameters[param::driveline_compliance::compliance];
    *compliance = if *compliance < 1e-4 { 0.0 } else { *compliance };
    parameters
}

/// Statistics of the energy balance of a worker's plants.
struct Balance {
    plants: usize,
    steps: usize,
    /// Number of plants whose energy balances to a thousandth.
    balanced: usize,
    /// Largest energy in excess of the input, and largest decrease of dissipated heat, as shares of the energy that passed through.
    most: f64,
    fell: f64,
}

/// Draws plants one after the other, until their number or the time is reached.
fn balance(worker: usize, until: Option<Instant>) -> Balance {
    let mut random = Random(0x2545_f491_4f6c_dd1d ^ (worker as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let mut all = Balance { plants: 0, steps: 0, balanced: 0, most: 0.0, fell: 0.0 };
    while until.map_or(all.plants < PLANTS / WORKERS, |until| Instant::now() < until) {
        let vehicle = Vehicle::paper();
        let parameters = effects_at_extremes(&mut random);
        let omega_f = 300.0 * random.next();
        let start = Start { omega_f, omega_c: 300.0 * random.next() - 50.0, theta_c: 250.0 * random.next(), theta_b: 60.0 };
        let mut wild = || Inputs {
            x_to: 3.0 + 6.0 * random.next(),
            t_e_ref: 600.0 * random.next() - 300.0,
            theta_h: 25.0,
            t_load: 400.0 * random.next() - 200.0,
        };
        let mut plant = Plant::new(&vehicle, &parameters, &start, &wild());
        if plant.config().pace.check().is_err() {
            continue;
        }
        all.plants += 1;
        let first = plant.energy();
        // Energy that passed through is the reference, because otherwise the balance of a coasting plant would be relative to nothing.
        let (mut last, mut moved, mut off) = (first, first.stored, 0.0_f64);
        for _ in 0..50 {
            let inputs = wild();
            for _ in 0..20 {
                plant.step(&inputs, 2e-3);
                let now = plant.energy();
                moved += (now.work_in - last.work_in).abs() + (now.losses - last.losses).abs() + (now.dissipated - last.dissipated).abs();
                let beyond = now.stored - first.stored + now.losses - now.work_in;
                // Within a step, a Runge–Kutta method integrates the friction work of a fast transient less accurately than its motion; a tenth of the tolerance of the balance
                // is allowed.
                all.fell = all.fell.max((last.dissipated - now.dissipated) / moved);
                assert!(now.stored >= 0.0 && beyond.is_finite() && all.fell < 1e-4, "{}, {:?}", all.fell, effects::to_value(&parameters));
                all.most = all.most.max(beyond / moved);
                assert!(beyond < 1e-3 * moved, "{beyond} J of {moved} J beyond what was put in, {:?}", effects::to_value(&parameters));
                off = off.max((beyond + now.dissipated).abs() / moved);
                (last, all.steps) = (now, all.steps + 1);
            }
        }
        all.balanced += usize::from(off < 1e-3);
    }
    all
}

#[test]
fn no_plant_has_more_energy_than_was_put_in() {
    let until = soak().map(|time| Instant::now() + time);
    let all: Vec<Balance> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..WORKERS).map(|worker| scope.spawn(move || balance(worker, until))).collect();
        workers.into_iter().map(|worker| worker.join().expect("no worker fails")).collect()
    });
    let sum = |of: fn(&Balance) -> usize| all.iter().map(of).sum::<usize>();
    let most = |of: fn(&Balance) -> f64| all.iter().map(of).fold(0.0, f64::max);
    let (plants, balanced) = (sum(|b| b.plants), sum(|b| b.balanced));
    println!(
        "{plants} plants, {} steps: at most {:.1e} of the energy that passed beyond what was put in, {:.1e} of it heat taken back; \
         {balanced} balance to 1e-3",
        sum(|b| b.steps),
        most(|b| b.most),
        most(|b| b.fell)
    );
    // With friction so steep that a substep is only just stable, the heat is less accurate than the motion.
    assert!(plants >= PLANTS || until.is_some());
    assert!(100 * balanced > 95 * plants, "{balanced} of {plants} balance");
}
