//! Loggers whose rows repeat the latest sample received from sources that are slower than the logger.

use std::path::Path;

/// A logger that repeats samples.
pub struct Logger {
    pub name: &'static str,
    /// Channels of the slow source; if empty, all channels but time.
    channels: &'static [&'static str],
    /// Times at which their samples arrive.
    source: Source,
    /// Whether all of these channels arrive at the same time.
    together: bool,
}

enum Source {
    /// Samples at intervals of this many rows, also between rows.
    Every(f64),
    /// The same, but sampled at the next row.
    AtRows(f64),
    /// Samples at random in this share of the rows.
    Polled(f64),
}

const SPEEDS: &[&str] = &["omega_f_rad_s", "omega_c_rad_s"];

pub const LOGGERS: [Logger; 9] = [
    Logger { name: "both speeds every 2.5 rows", channels: SPEEDS, source: Source::Every(2.5), together: true },
    Logger { name: "both speeds every 3.3 rows", channels: SPEEDS, source: Source::Every(10.0 / 3.0), together: true },
    Logger { name: "both speeds every 1.25 rows", channels: SPEEDS, source: Source::AtRows(1.25), together: true },
    Logger { name: "the flywheel's speed every 2.5 rows", channels: &["omega_f_rad_s"], source: Source::AtRows(2.5), together: true },
    Logger { name: "all channels every 2.5 rows", channels: &[], source: Source::AtRows(2.5), together: true },
    Logger { name: "all channels every second row", channels: &[], source: Source::AtRows(2.0), together: true },
    Logger { name: "both speeds polled in 60 % of the rows", channels: SPEEDS, source: Source::Polled(0.6), together: true },
    Logger { name: "both speeds polled in 30 % of the rows", channels: SPEEDS, source: Source::Polled(0.3), together: true },
    Logger { name: "each speed polled in 30 % of the rows", channels: SPEEDS, source: Source::Polled(0.3), together: false },
];

impl Logger {
    /// Rewrites the recordings of a campaign.
    pub fn repeat_rows(&self, folder: &Path) {
        let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
        paths.retain(|p| p.extension().is_some_and(|e| e == "csv"));
        paths.sort();
        let mut draw = 1;
        for path in paths {
            let text = std::fs::read_to_string(&path).unwrap();
            let mut rows: Vec<Vec<String>> = text.lines().map(|l| l.split(',').map(str::to_string).collect()).collect();
            let header = rows.remove(0);
            let repeated = |h: &str| h != "time_s" && (self.channels.is_empty() || self.channels.contains(&h));
            let mut sources = self.source.rows(rows.len(), &mut draw);
            for column in (0..header.len()).filter(|k| repeated(&header[*k])) {
                if !self.together {
                    sources = self.source.rows(rows.len(), &mut draw);
                }
                let was: Vec<String> = rows.iter().map(|r| r[column].clone()).collect();
                for (row, at) in rows.iter_mut().zip(&sources) {
                    let (before, share) = (*at as usize, at.fract());
                    let value = |k: usize| was[k.min(was.len() - 1)].parse::<f64>().unwrap();
                    let between = || format!("{:.3}", (1.0 - share) * value(before) + share * value(before + 1));
                    row[column] = if share == 0.0 { was[before].clone() } else { between() };
                }
            }
            let lines = std::iter::once(header).chain(rows).map(|r| r.join(",") + "\n");
            std::fs::write(path, lines.collect::<String>()).unwrap();
        }
    }
}

impl Source {
    /// For each row, the row (fractional between two rows) whose sample it shows.
    fn rows(&self, count: usize, draw: &mut u32) -> Vec<f64> {
        let mut polled = 0.0;
        let row = |k: usize| match *self {
            Source::Every(rows) => (k as f64 / rows).floor() * rows,
            Source::AtRows(rows) => ((k as f64 / rows).floor() * rows).ceil(),
            Source::Polled(share) => {
                *draw = draw.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                if f64::from(*draw >> 8) < share * f64::from(1 << 24) {
                    polled = k as f64;
                }
                polled
            }
        };
        (0..count).map(row).collect()
    }
}
