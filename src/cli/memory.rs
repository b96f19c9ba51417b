//! Memory check: a diagnosis that does not fit is refused before hours of work, instead of being killed by the kernel halfway.

use super::error::CommandError;
use crate::campaign::Campaign;
use crate::gap::enough::most_rows;
use std::path::Path;

/// Upper bounds of the memory that a diagnosis takes per row of the campaign, bytes: for a row that is only read, and for a row that is fitted. On bench campaigns and drives
/// of 8 000 to 800 000 rows, 2.5 to 5 kB per row were measured (`benches/scale.sh`).
const BYTES_PER_ROW: [u64; 2] = [1_000, 5_000];

/// Checks that a diagnosis of this campaign fits into the free memory.
///
/// # Errors
/// A campaign whose diagnosis would take more memory than is free.
pub(super) fn has_room(path: &Path, campaign: &Campaign) -> Result<(), CommandError> {
    let rows = campaign.recordings.iter().map(|r| r.time.len() as u64).sum();
    let fitted = most_rows(campaign) as u64;
    match free() {
        Some(free) => fits(rows, fitted, free).map_err(|why| CommandError::Refused(format!("{}: {why}", path.display()))),
        None => Ok(()),
    }
}

fn fits(rows: u64, fitted: u64, free: u64) -> Result<(), String> {
    let [read, fit] = BYTES_PER_ROW;
    let needed = (rows - fitted) * read + fitted * fit;
    if needed <= free {
        return Ok(());
    }
    let gigabytes = |bytes: u64| bytes as f64 / 1e9;
    Err(format!(
        "its {rows} rows take up to {:.1} GB in a diagnosis, and {:.1} GB of memory are free. Leave out recordings, or record at a lower rate: 100 Hz is enough",
        gigabytes(needed),
        gigabytes(free)
    ))
}

/// Free memory in bytes: the smaller of that of the machine and that of the container. `None` if neither is known.
fn free() -> Option<u64> {
    let read = |path: &str| std::fs::read_to_string(path).ok();
    let machine = read("/proc/meminfo").and_then(|text| available(&text));
    let number = |path: &str| read(path)?.trim().parse::<u64>().ok();
    let container =
        number("/sys/fs/cgroup/memory.max").zip(number("/sys/fs/cgroup/memory.current")).map(|(most, now)| most.saturating_sub(now));
    [machine, container].into_iter().flatten().min()
}

/// The line `MemAvailable: 123 kB` of Linux's /proc/meminfo, in bytes.
fn available(meminfo: &str) -> Option<u64> {
    let line = meminfo.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kilobytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024 * kilobytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_told_with_both_sizes() {
        assert_eq!(fits(400_000, 400_000, 2_000_000_000), Ok(()));
        assert_eq!(fits(1_200_000, 200_000, 2_000_000_000), Ok(()));
        let why = fits(400_001, 400_001, 2_000_000_000).unwrap_err();
        assert!(why.contains("400001 rows take up to 2.0 GB") && why.contains("2.0 GB of memory are free"), "{why}");
    }

    #[test]
    fn free_memory_is_what_the_system_says() {
        assert_eq!(available("MemTotal:  9 kB\nMemAvailable:   23308020 kB\nBuffers: 1 kB\n"), Some(23_867_412_480));
        assert_eq!((available("MemFree: 1 kB"), available("MemAvailable: many")), (None, None));
    }
}
