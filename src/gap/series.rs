//! A recording made ready for the fit: at the rate of analysis, with the noise of every channel estimated.
//!
//! Two forms: [`Series::native`] keeps every sample, and only the residuals are averaged over blocks; [`Series::coarse`] averages
//! a fast recording down to [`ANALYSIS_RATE_HZ`]: inputs over each new sample's interval, which keeps their integral, speeds
//! around each new instant, which keeps their phase. The coarse form is for searching. It leaves out position and torque of a fast
//! recording, whose course within a block it cannot follow. A recording at the rate of analysis or below is the same in both.

use crate::campaign::Recording;

/// Rate of analysis, Hz; slower recordings keep their own.
pub const ANALYSIS_RATE_HZ: f64 = 100.0;

/// Channels that the plant predicts, in the order of [`Series::measured`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Channel {
    /// Flywheel speed, rad/s.
    OmegaF,
    /// Disc speed, rad/s.
    OmegaC,
    /// Bearing position, mm.
    XTo,
    /// Clutch torque, N·m.
    TFc,
    /// Disc temperature, °C.
    ThetaC,
}

impl Channel {
    /// All channels.
    pub const ALL: [Self; 5] = [Self::OmegaF, Self::OmegaC, Self::XTo, Self::TFc, Self::ThetaC];

    /// Name of the column in a recording.
    pub fn column(self) -> &'static str {
        match self {
            Self::OmegaF => "omega_f_rad_s",
            Self::OmegaC => "omega_c_rad_s",
            Self::XTo => "x_to_mm",
            Self::TFc => "T_fc_Nm",
            Self::ThetaC => "theta_c_degC",
        }
    }
}

/// A recording at the rate of analysis.
#[derive(Clone, Debug)]
pub struct Series {
    /// Name of the recording.
    pub name: String,
    /// Manoeuvre.
    pub manoeuvre: String,
    /// Sample interval, s.
    pub dt: f64,
    /// Samples whose residuals are averaged to one.
    pub block: usize,
    /// Temperatures at the start: disc, body, °C.
    pub theta_0: [f64; 2],
    /// Reported torque, N·m; held.
    pub t_e: Vec<f64>,
    /// Commanded position, mm; held.
    pub x_to: Vec<f64>,
    /// Housing air, °C; held.
    pub theta_h: Vec<f64>,
    /// What was measured, by [`Channel`]; empty where the channel is missing.
    pub measured: [Vec<f64>; 5],
    /// Standard deviation of the torque report's noise, N·m.
    pub torque_noise: f64,
    /// Share of the samples in which the clutch slips.
    pub slipping: f64,
    /// Samples around a lock-up, where the clutch torque jumps from its capacity to what is asked of it: a torque of such a sample says
    /// nothing, for it hangs on a fraction of a sample.
    pub locking: Vec<bool>,
    /// Standard deviation of each channel's noise at this rate.
    pub noise: [f64; 5],
    /// What residuals are divided by: the noise, with errors that stay for many samples spread over these.
    pub scale: [f64; 5],
}

impl Series {
    /// Every sample as it was recorded.
    pub fn native(recording: &Recording) -> Self {
        let optional = |v: &Option<Vec<f64>>| v.clone().unwrap_or_default();
        let r = recording;
        let measured = [r.omega_f.clone(), r.omega_c.clone(), optional(&r.x_to), optional(&r.t_fc), optional(&r.theta_c)];
        let inputs = [r.t_e.clone(), r.x_to_cmd.clone(), r.theta_h.clone()];
        Self::assemble(recording, measured, inputs, 1, reduction(recording))
    }

    /// At the rate of analysis.
    pub fn coarse(recording: &Recording) -> Self {
        let factor = reduction(recording);
        if factor == 1 {
            return Self::native(recording);
        }
        let r = recording;
        let theta_c = r.theta_c.as_deref().map(|v| centred_means(v, factor)).unwrap_or_default();
        let measured = [centred_means(&r.omega_f, factor), centred_means(&r.omega_c, factor), Vec::new(), Vec::new(), theta_c];
        let inputs = [&r.t_e, &r.x_to_cmd, &r.theta_h].map(|v| block_means(v, factor));
        Self::assemble(recording, measured, inputs, factor, 1)
    }

    fn assemble(recording: &Recording, measured: [Vec<f64>; 5], [t_e, x_to, theta_h]: [Vec<f64>; 3], factor: usize, block: usize) -> Self {
        let dt = factor as f64 / recording.sample_rate_hz;
        let noise: [f64; 5] =
            std::array::from_fn(|k| noise(&measured[k]).hypot(if factor > 1 { AVERAGING_ERROR[k] } else { 0.0 }).max(LEAST_NOISE[k]));
        let slips = slips(&measured, &noise);
        let slipping = slips.iter().filter(|s| **s).count() as f64 / slips.len().max(1) as f64;
        let (torque_noise, locking) = (self::noise(&t_e), locking(&slips));
        Self {
            name: recording.name.clone(),
            manoeuvre: recording.manoeuvre.clone(),
            dt,
            block,
            theta_0: [recording.theta_c0, recording.theta_b0],
            noise,
            scale: std::array::from_fn(|k| noise[k].hypot(LASTING_ERROR[k] / dt.sqrt())),
            t_e,
            x_to,
            theta_h,
            measured,
            torque_noise,
            slipping,
            locking,
        }
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.t_e.len()
    }

    /// Whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.t_e.is_empty()
    }
}

/// Least noise that is believed, by channel: a channel finer than this would only be fitted to numerics.
const LEAST_NOISE: [f64; 5] = [0.01, 0.01, 0.001, 0.05, 0.05];

/// Error of each channel that lasts for about a second. The housing air is noted in steps of half a kelvin, which keeps the
/// predicted temperature off for as long as it drives it.
const LASTING_ERROR: [f64; 5] = [0.0, 0.0, 0.0, 0.0, 0.1];

/// Samples of a recording per sample of the analysis.
fn reduction(recording: &Recording) -> usize {
    (recording.sample_rate_hz / ANALYSIS_RATE_HZ).round().max(1.0) as usize
}

/// What averaging over a block adds to the error of each channel, where the inputs move within it.
const AVERAGING_ERROR: [f64; 5] = [0.05, 0.03, 0.0, 0.0, 0.1];

/// Slip in units of its noise that counts as locked.
const LOCKED: f64 = 6.0;

/// Samples in which the measured speeds differ.
fn slips(measured: &[Vec<f64>; 5], noise: &[f64; 5]) -> Vec<bool> {
    let most = LOCKED * noise[0].hypot(noise[1]);
    measured[0].iter().zip(&measured[1]).map(|(f, c)| (f - c).abs() > most).collect()
}

/// Marks the samples around every lock-up: from two before the measured slip is gone to one after.
fn locking(slips: &[bool]) -> Vec<bool> {
    let mut marked = vec![false; slips.len()];
    for k in (1..slips.len()).filter(|&k| slips[k - 1] && !slips[k]) {
        let last = marked.len() - 1;
        marked[k.saturating_sub(2)..=(k + 1).min(last)].fill(true);
    }
    marked
}

fn block_means(v: &[f64], factor: usize) -> Vec<f64> {
    v.chunks(factor).map(|c| c.iter().sum::<f64>() / c.len() as f64).collect()
}

fn centred_means(v: &[f64], factor: usize) -> Vec<f64> {
    let reach = factor / 2;
    (0..v.len())
        .step_by(factor)
        .map(|k| {
            // Near the ends the window shrinks on both sides alike, or a ramp would be biased.
            let reach = reach.min(k).min(v.len() - 1 - k);
            let window = &v[k - reach..=k + reach];
            window.iter().sum::<f64>() / window.len() as f64
        })
        .collect()
}

/// Standard deviation of white noise on a smooth signal, from its third differences; their median keeps kinks out.
fn noise(v: &[f64]) -> f64 {
    let mut d: Vec<f64> = v.windows(4).map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs()).collect();
    if d.is_empty() {
        return 0.0;
    }
    d.sort_by(f64::total_cmp);
    // Third differences of unit white noise have the variance 20; 0.6745 is the median of a half-normal one. Zero differences
    // (quantisation) pull the median down, so the mean of the lower three quarters joins in.
    let median = d[d.len() / 2] / 0.6745;
    let kept = &d[..d.len() - d.len() / 10];
    let mean = kept.iter().sum::<f64>() / kept.len() as f64 / 0.6667;
    median.max(mean) / 20.0_f64.sqrt()
}
