//! What is driven: five manoeuvres, each with its own start, length and references.
//!
//! A launch is a plan of the transferred torque; creep, chirp, open rev and locked drive are plans of position or torque
//! alone. Lengths and levels are those of test-bench practice with such cars.

use crate::effects::smooth;
use rand::{Rng, RngExt};

/// A launch of one strength.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Launch {
    /// Torque to be transferred, N·m.
    pub torque: f64,
    /// Time in which it is built up, s.
    pub ramp_s: f64,
    /// Time to close the gap before it, s.
    pub fill_s: f64,
    /// Engine torque once the clutch is closed, N·m.
    pub base: f64,
    /// Whether the clutch opens once more and slips under power.
    pub reopens: bool,
    /// Length of the recording, s.
    pub length_s: f64,
}

impl Launch {
    /// The same launch as another driver has it.
    pub fn vary(self, rng: &mut impl Rng) -> Self {
        let mut by = |part: f64| rng.random_range(1.0 - part..1.0 + part);
        let (torque, ramp) = (by(0.12), by(0.15));
        // A weaker one takes longer.
        let later = (1.0 / torque - 1.0).max(0.0) + (ramp - 1.0).max(0.0) * 0.3;
        Self {
            torque: self.torque * torque,
            base: self.base * torque,
            ramp_s: self.ramp_s * ramp,
            fill_s: self.fill_s * by(0.12),
            length_s: ((self.length_s * (1.0 + 0.7 * later)) * 100.0).round() / 100.0,
            ..self
        }
    }
}

/// One thing to be driven.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Manoeuvre {
    /// Set off and lock up.
    Launch(Launch),
    /// Slip slowly through the lower half of the torque map: upper turning point, -, and period, s.
    Creep(f64, f64),
    /// Rev up with the clutch open: speeds of engine and disc, rad/s.
    OpenRev(f64, f64),
    /// Position chirp under slip.
    Modulate,
    /// Drive with the clutch closed, from this speed, rad/s.
    LockedDrive(f64),
}

impl Manoeuvre {
    /// The contract's name.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Launch(_) => "launch",
            Self::Creep(..) => "creep",
            Self::OpenRev(..) => "open_rev",
            Self::Modulate => "modulate",
            Self::LockedDrive(_) => "locked_drive",
        }
    }

    /// Length of the recording, s.
    pub fn length_s(&self) -> f64 {
        match self {
            Self::Launch(l) => l.length_s,
            Self::Creep(..) => 5.5,
            Self::Modulate => 4.5,
            Self::OpenRev(..) | Self::LockedDrive(_) => 4.0,
        }
    }

    /// Flywheel and disc speed at the start, rad/s.
    pub fn start_speeds(&self) -> [f64; 2] {
        match *self {
            Self::Launch(_) | Self::Creep(..) => [104.72, 0.0],
            Self::OpenRev(f, c) => [f, c],
            Self::Modulate => [120.0, 0.0],
            Self::LockedDrive(w) => [w, w],
        }
    }
}

const fn launch(torque: f64, ramp_s: f64, fill_s: f64, base: f64, reopens: bool, length_s: f64) -> Launch {
    Launch { torque, ramp_s, fill_s, base, reopens, length_s }
}

/// The five launches of a full campaign, from cold to hot.
pub const LAUNCHES: [Launch; 5] = [
    launch(36.7, 0.80, 0.20, 23.3, false, 4.22),
    launch(61.3, 0.58, 0.18, 36.8, false, 3.80),
    launch(89.3, 0.37, 0.15, 52.2, false, 3.32),
    launch(53.5, 0.60, 0.18, 34.8, false, 3.86),
    launch(61.0, 0.52, 0.19, 40.6, true, 5.68),
];

/// The five launches of a campaign that holds nothing else.
pub const LAUNCHES_ALONE: [Launch; 5] = [
    launch(40.0, 0.74, 0.24, 25.2, false, 4.16),
    launch(64.4, 0.55, 0.20, 38.5, false, 3.74),
    launch(89.3, 0.37, 0.15, 52.2, false, 3.32),
    launch(56.5, 0.57, 0.18, 36.8, false, 3.80),
    launch(50.7, 0.60, 0.22, 31.0, true, 5.98),
];

/// Two launches of strengths that no campaign holds.
pub const LAUNCHES_UNSEEN: [Launch; 2] = [launch(46.0, 0.66, 0.19, 29.5, false, 4.0), launch(74.0, 0.47, 0.17, 44.5, false, 3.6)];

/// Engine torque that drives an open rev, N·m.
pub fn open_rev_torque(t: f64) -> f64 {
    levels(t, &[(0.0, 8.0), (0.51, 26.0), (1.61, -4.0), (2.82, 10.0)], 0.08)
}

/// Engine torque that drives a closed clutch, N·m.
pub fn locked_torque(t: f64) -> f64 {
    levels(t, &[(0.0, 15.0), (0.5, 60.0), (1.5, 0.0), (2.4, 50.0)], 0.06)
}

/// Levels that pass into each other over `blend` seconds from their start.
fn levels(t: f64, plan: &[(f64, f64)], blend: f64) -> f64 {
    let mut level = plan[0].1;
    for &(at, next) in &plan[1..] {
        level += (next - level) * smooth((t - at) / blend);
    }
    level
}

/// Normalised position of a creep after its start, from 0.30 to `top` and back.
pub fn creep_position(t: f64, top: f64, period_s: f64) -> f64 {
    0.5 * (0.30 + top) - 0.5 * (top - 0.30) * (std::f64::consts::TAU * (t - 0.3) / period_s).cos()
}

/// Normalised position of a chirp between 0.31 and 0.49, from 1.5 Hz to 6 Hz.
pub fn chirp_position(t: f64) -> f64 {
    let phase = |t: f64| std::f64::consts::TAU * (0.75 * t + 0.6 * t * t);
    let swing = 0.09 * smooth((t - 0.25) / 0.35).max(0.2);
    0.40 - swing * (phase(t) - phase(0.64)).cos()
}
