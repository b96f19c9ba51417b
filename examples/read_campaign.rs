//! Prints the content of a campaign as it is read, as JSON: the channels of each recording, and what was left out. `cargo run --example read_campaign -- FOLDER [MAP]`

use kisspoint::campaign::{self, ChannelMap, ReadOptions, Recording};
use serde_json::{Value, json};
use std::path::Path;

/// Samples for JSON, in which a missing one is null.
fn values(samples: &[f64]) -> Vec<Option<f64>> {
    samples.iter().map(|x| x.is_finite().then_some(*x)).collect()
}

fn channels(r: &Recording) -> Value {
    let bench = |channel: &Option<Vec<f64>>| channel.as_deref().map(values);
    json!({
        "time_s": values(&r.time),
        "omega_f_rad_s": values(&r.omega_f),
        "omega_c_rad_s": values(&r.omega_c),
        "T_e_Nm": values(&r.t_e),
        "x_to_cmd_mm": values(&r.x_to_cmd),
        "theta_h_degC": values(&r.theta_h),
        "x_to_mm": bench(&r.x_to),
        "T_fc_Nm": bench(&r.t_fc),
        "theta_c_degC": bench(&r.theta_c),
    })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("give the folder of a campaign")?;
    let channel_map = arguments.next().map(|map| ChannelMap::from_file(Path::new(&map))).transpose()?;
    let read = campaign::read(Path::new(&folder), &ReadOptions { channel_map, ..ReadOptions::default() })?;
    let recordings: serde_json::Map<String, Value> = read.recordings.iter().map(|r| (r.name.clone(), channels(r))).collect();
    let left_out: Vec<Value> = read.left_out.iter().map(|l| json!([l.recording, l.reason])).collect();
    println!("{}", json!({"recordings": recordings, "left_out": left_out}));
    Ok(())
}
