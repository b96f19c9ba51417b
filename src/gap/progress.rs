//! Progress of a diagnosis: the work that is done, compared with the work that is still expected.
//!
//! Nearly all of the time goes into replays, so work is counted in rows that replays have stepped through, and measured in passes. One pass is a replay of every recording. The
//! number of passes that a stage takes is not known beforehand, only an expected number ([`STAGES`]). After w passes of a stage that is expected to take e, the number of remaining
//! passes is estimated as e·exp(−w/e), which falls but is never zero. The part of the bar that was empty when the stage began is filled to the share
//!
//! ```text
//! w / (w + e·exp(−w/e) + a),      a passes that the stages after it are expected to take.
//! ```
//!
//! The bar therefore never falls or jumps, and moves as long as work is done. A second search, which cannot be foreseen, makes it slower but does not stop it.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

/// Number of rows that replays may have stepped through before a search ends, which take some minutes of computing time.
pub const MOST_ROWS: u64 = 200_000_000;

/// Counter of the rows that replays have stepped through. Clones share the counter.
#[derive(Clone, Debug, Default)]
pub struct Work(Arc<Counted>);

#[derive(Debug, Default)]
struct Counted {
    rows: AtomicU64,
    cut_short: AtomicBool,
}

impl Work {
    /// Adds `rows` to the counter.
    pub fn add(&self, rows: usize) {
        self.0.rows.fetch_add(rows as u64, Ordering::Relaxed);
    }

    /// Rows replayed so far.
    pub fn rows(&self) -> u64 {
        self.0.rows.load(Ordering::Relaxed)
    }

    /// Whether a search may go on. It must be called where all threads have joined, so that the result does not depend on the number of threads.
    pub fn may_go_on(&self) -> bool {
        let may = self.rows() < MOST_ROWS;
        self.0.cut_short.fetch_or(!may, Ordering::Relaxed);
        may
    }

    /// Whether [`Work::may_go_on`] was ever false.
    pub fn was_cut_short(&self) -> bool {
        self.0.cut_short.load(Ordering::Relaxed)
    }
}

/// Stages of a diagnosis, in order, each with its expected number of passes: what the stage takes on practice campaigns, from a bench as well as from the road, plus a fifth.
const STAGES: [(&str, f64); 10] = [
    ("tolerances", 80.0),
    ("effects", 800.0),
    ("pairs", 300.0),
    ("triples", 200.0),
    ("exchange", 100.0),
    ("missing laws", 400.0),
    ("a law beyond the library", 30.0),
    ("where it was validated", 5.0),
    ("residual map", 5.0),
    ("what to measure next", 200.0),
];

/// Number of stages, from the first on, that may be repeated, and the number of passes that are expected for this: about one campaign in four is searched twice.
const REPEATED_STAGES: (usize, f64) = (6, 400.0);

/// Interval at which progress is reported.
const REPORT_INTERVAL: Duration = Duration::from_millis(100);

/// The current stage, and the state of work and bar at its beginning.
#[derive(Debug)]
struct Now {
    /// Index in [`STAGES`].
    stage: usize,
    begun_at: u64,
    share: f64,
}

/// Watches a diagnosis and reports its progress.
pub struct Watch<'a> {
    tell: &'a (dyn Fn(&str, f64) + Sync),
    work: &'a Work,
    /// Number of rows of one pass.
    pass: f64,
    now: Mutex<Now>,
}

impl Watch<'_> {
    /// Begins a stage, which may be a repeated one.
    pub fn begin(&self, what: &str) {
        let stage = STAGES.iter().position(|(name, _)| *name == what).expect("a stage of the list");
        let mut now = self.now();
        *now = Now { stage, share: self.share(&now), begun_at: self.work.rows() };
        drop(now);
        self.say();
    }

    /// Reports stage and share. No other thread reports at the same time, so that the shares come in order.
    fn say(&self) {
        let now = self.now();
        (self.tell)(STAGES[now.stage].0, self.share(&now));
    }

    fn now(&self) -> MutexGuard<'_, Now> {
        self.now.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn share(&self, now: &Now) -> f64 {
        let done = (self.work.rows() - now.begun_at) as f64 / self.pass;
        let expected = STAGES[now.stage].1;
        let after: f64 = STAGES[now.stage + 1..].iter().map(|(_, passes)| passes).sum();
        let after = after + if now.stage < REPEATED_STAGES.0 { REPEATED_STAGES.1 } else { 0.0 };
        now.share + (1.0 - now.share) * done / (done + expected * (-done / expected).exp() + after)
    }
}

/// Runs `run`, which announces the stages that it begins, and reports progress to `tell` meanwhile. `rows` is the number of rows of one pass.
pub fn watched<T>(tell: &(dyn Fn(&str, f64) + Sync), work: &Work, rows: usize, run: impl FnOnce(&Watch) -> T) -> T {
    let watch = Watch { tell, work, pass: rows.max(1) as f64, now: Mutex::new(Now { stage: 0, begun_at: work.rows(), share: 0.0 }) };
    let (working, waits) = channel::<()>();
    let watch = &watch;
    thread::scope(|scope| {
        let looks = move || {
            while waits.recv_timeout(REPORT_INTERVAL) == Err(RecvTimeoutError::Timeout) {
                watch.say();
            }
        };
        thread::Builder::new().spawn_scoped(scope, looks).ok();
        // The reporting thread ends when this sender is dropped, by a panic as well.
        let _working = working;
        run(watch)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A diagnosis with two searches, whose stages take 0.3 times, once or four times the expected number of passes.
    #[test]
    fn the_bar_moves_with_the_work_and_never_falls_or_is_full() {
        let work = Work::default();
        let told = Mutex::new(Vec::new());
        let tell = |_: &str, share: f64| told.lock().unwrap().push(share);
        watched(&tell, &work, 10, |watch| {
            for stage in [0, 1, 2, 1, 2, 4, 5, 6, 9] {
                watch.begin(STAGES[stage].0);
                let passes = STAGES[stage].1 * [0.3, 1.0, 4.0][stage % 3];
                for _ in 0..passes as usize {
                    work.add(10);
                    watch.say();
                }
            }
        });
        let told = told.into_inner().unwrap();
        let steps: Vec<f64> = told.windows(2).map(|w| w[1] - w[0]).collect();
        assert!(steps.iter().all(|s| (0.0..0.03).contains(s)), "{:?}", steps.iter().copied().fold(0.0, f64::max));
        assert!(told[0] == 0.0 && (0.8..1.0).contains(told.last().unwrap()), "{:?}", told.last());
    }
}
