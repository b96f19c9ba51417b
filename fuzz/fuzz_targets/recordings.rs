//! Recordings: CSV, MDF4 and Parquet files are refused with file and reason, or yield channels of equal length that contain only numbers.
#![no_main]

use kisspoint::campaign::{ChannelMap, Recording, inspect, read_one};
use libfuzzer_sys::fuzz_target;
use std::path::PathBuf;

/// A file for this process, in memory where the system supports that.
fn path() -> PathBuf {
    let memory = PathBuf::from("/dev/shm");
    let folder = if memory.is_dir() { memory } else { std::env::temp_dir() };
    folder.join(format!("kisspoint_fuzz_{}", std::process::id()))
}

fuzz_target!(init: {
    // The MDF4 reader catches panics of the library beneath it, so the hook is silenced. A panic that is not caught still ends the run.
    std::panic::set_hook(Box::new(|_| {}));
}, |data: &[u8]| {
    let path = path();
    std::fs::write(&path, data).expect("room for a small file");
    match inspect(&path, None, &|_| {}) {
        Ok(inspection) => _ = inspection.to_json().to_string(),
        Err(refused) => assert!(refused.to_string().contains("kisspoint_fuzz_"), "{refused}"),
    }
    let like = Recording { name: "fuzzed".into(), manoeuvre: "launch".into(), sample_rate_hz: 100.0, theta_c0: 25.0, theta_b0: 25.0, ..Recording::default() };
    match read_one(&path, &like, &ChannelMap::default()) {
        Ok((recording, _)) => {
            let r = &recording;
            assert!(r.time.windows(2).all(|w| w[1] > w[0]));
            for channel in [&r.t_e, &r.theta_h] {
                assert!(channel.len() == r.time.len() && channel.iter().all(|x| x.is_finite()));
            }
        }
        Err(refused) => assert!(refused.to_string().contains("kisspoint_fuzz_"), "{refused}"),
    }
});
