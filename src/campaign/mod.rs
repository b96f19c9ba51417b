//! A campaign: one vehicle and several recordings of it.

/// One recording with uniform time from 0; all vectors have the length of `omega_f`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// Name of the recording: its file's stem.
    pub name: String,
    /// Manoeuvre as recordings.json names it.
    pub manoeuvre: String,
    /// Sample rate, Hz.
    pub sample_rate_hz: f64,
    /// Disc temperature at the start, °C.
    pub theta_c0: f64,
    /// Body temperature at the start, °C.
    pub theta_b0: f64,
    /// Flywheel speed as sensed, rad/s.
    pub omega_f: Vec<f64>,
    /// Disc speed as sensed, rad/s.
    pub omega_c: Vec<f64>,
    /// Engine torque as reported, N·m; held to the next sample.
    pub t_e: Vec<f64>,
    /// Throwout position as commanded, mm; held to the next sample.
    pub x_to_cmd: Vec<f64>,
    /// Housing air temperature, °C.
    pub theta_h: Vec<f64>,
    /// Throwout position as sensed, mm (bench only).
    pub x_to: Option<Vec<f64>>,
    /// Clutch torque transducer, N·m (bench only).
    pub t_fc: Option<Vec<f64>>,
    /// Disc thermocouple, °C (bench only).
    pub theta_c: Option<Vec<f64>>,
}
