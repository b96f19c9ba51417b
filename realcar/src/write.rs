//! The files of a campaign.

use crate::channels::Recording;
use crate::draw::Car;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::Path;

impl Car {
    /// Writes the campaign: `vehicle.json`, `recordings.json` and a CSV file for each recording.
    ///
    /// # Errors
    /// If the folder or a file can't be written.
    pub fn write(&self, dir: &Path) -> io::Result<()> {
        write_folder(dir, &self.campaign.vehicle_json, &self.campaign.recordings)
    }

    /// Writes the recordings that the campaign does not hold, in the same form.
    ///
    /// # Errors
    /// If the folder or a file can't be written.
    pub fn write_unseen(&self, dir: &Path) -> io::Result<()> {
        write_folder(dir, &self.campaign.vehicle_json, &self.unseen)
    }
}

fn write_folder(dir: &Path, vehicle: &str, recordings: &[Recording]) -> io::Result<()> {
    fs::create_dir_all(dir)?;
    fs::write(dir.join("vehicle.json"), vehicle)?;
    let mut index = Vec::new();
    for (i, r) in recordings.iter().enumerate() {
        let name = format!("r{:02}", i + 1);
        fs::write(dir.join(format!("{name}.csv")), csv(r))?;
        let mut about = json!({"manoeuvre": r.manoeuvre, "sample_rate_Hz": r.sample_rate_hz as u64,
            "theta_c0_degC": r.theta_c0_deg_c, "theta_b0_degC": r.theta_b0_deg_c});
        if let Some([c, b]) = r.theta_sigma_k {
            about["theta_c0_sigma_K"] = json!(c);
            about["theta_b0_sigma_K"] = json!(b);
        }
        index.push(format!("{}: {}", Value::from(name), about));
    }
    // Joined by hand, so that the recordings stay in their order.
    fs::write(dir.join("recordings.json"), format!("{{\n {}\n}}\n", index.join(",\n ")))
}

/// A recording as text.
pub fn csv(r: &Recording) -> String {
    let mut out = String::from("time_s,omega_f_rad_s,omega_c_rad_s,T_e_Nm,x_to_cmd_mm,theta_h_degC");
    out.push_str(if r.bench.is_some() { ",x_to_mm,T_fc_Nm,theta_c_degC" } else { "" });
    out.push_str(if r.brake.is_some() { ",brake\n" } else { "\n" });
    // A logger on the road writes position and temperature as coarsely as the bus has them.
    let (mm, kelvin) = if r.brake.is_some() { (2, 0) } else { (3, 1) };
    for i in 0..r.time_s.len() {
        let _ = write!(
            out,
            "{:.4},{:.3},{},{:.1},{:.mm$},{:.kelvin$}",
            r.time_s[i],
            r.omega_f_rad_s[i],
            cell(r.omega_c_rad_s[i]),
            r.t_e_nm[i],
            r.x_to_cmd_mm[i],
            r.theta_h_deg_c[i]
        );
        if let Some(b) = &r.bench {
            let _ = write!(out, ",{:.3},{:.2},{:.1}", b.x_to_mm[i], b.t_fc_nm[i], b.theta_c_deg_c[i]);
        }
        if let Some(brake) = &r.brake {
            let _ = write!(out, ",{}", u8::from(brake[i]));
        }
        out.push('\n');
    }
    out
}

/// A speed as text; blank where there is none.
fn cell(omega: f64) -> String {
    if omega.is_nan() { String::new() } else { format!("{omega:.3}") }
}

/// A value as text that people read.
pub(crate) fn pretty(value: &Value) -> String {
    format!("{value:#}\n")
}
