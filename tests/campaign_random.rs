//! Damaged recordings: files of all three formats, with bytes changed, repeated and cut at random, are refused with the name of the file or read as numbers, and quickly in
//! either case. The fuzz target `recordings` is the thorough version.

use kisspoint::campaign::{ChannelMap, Recording, inspect, read_one};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        // Marsaglia's xorshift.
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        ((self.0 >> 11) % n.max(1) as u64) as usize
    }
}

fn measurements() -> Vec<PathBuf> {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/campaign");
    let seeds = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds/recordings");
    let folders = [data.join("measurements"), data.join("seed"), seeds];
    let files = folders.iter().flat_map(|folder| std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()));
    let mut all: Vec<PathBuf> = files.filter(|p| p.extension().is_some_and(|e| e != "json")).collect();
    all.sort();
    all
}

fn damage(bytes: &mut Vec<u8>, random: &mut Random) {
    for _ in 0..=random.below(4) {
        let place = random.below(bytes.len());
        match random.below(6) {
            0 => bytes[place] ^= 1 << random.below(8),
            1 => bytes[place] = [0, 0x7f, 0x80, 0xff, b',', b'\n'][random.below(6)],
            2 => bytes.truncate(place + 1),
            3 => {
                let end = (place + 8).min(bytes.len());
                bytes[place..end].fill([0, 0xff][random.below(2)]);
            }
            4 => {
                let end = (place + random.below(200)).min(bytes.len());
                let part = bytes[place..end].to_vec();
                let at = random.below(bytes.len());
                bytes.splice(at..at, part);
            }
            _ => {
                // Headers and indices of these formats are at the beginning and at the end of a file.
                let near = random.below(64.min(bytes.len()));
                let place = if random.below(2) == 0 { near } else { bytes.len() - 1 - near };
                bytes[place] = random.below(256) as u8;
            }
        }
    }
}

#[test]
fn damaged_files_are_refused_or_read_as_numbers() {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("damaged_recording");
    let like = Recording {
        name: "damaged".into(),
        manoeuvre: "launch".into(),
        sample_rate_hz: 100.0,
        theta_c0: 25.0,
        theta_b0: 25.0,
        ..Recording::default()
    };
    // Libraries of file formats may panic on damaged files, which is caught; without backtraces the test is faster.
    std::panic::set_hook(Box::new(|info| eprintln!("{info}")));
    let mut random = Random(0xda3e_39cb_94b9_5bdb);
    let (mut refused, mut read) = (0, 0);
    let files = measurements();
    assert!(files.len() > 10);
    for file in &files {
        let whole = std::fs::read(file).unwrap();
        for _ in 0..150 {
            let mut bytes = whole.clone();
            damage(&mut bytes, &mut random);
            std::fs::write(&path, &bytes).unwrap();
            let begin = Instant::now();
            _ = inspect(&path, None, &|_| {}).map(|i| i.to_json());
            match read_one(&path, &like, &ChannelMap::default()) {
                Ok((r, _)) => {
                    read += 1;
                    assert!(r.time.windows(2).all(|w| w[1] > w[0]));
                    for channel in [&r.t_e, &r.theta_h] {
                        assert!(channel.len() == r.time.len() && channel.iter().all(|x| x.is_finite()), "{}", file.display());
                    }
                }
                Err(e) => {
                    refused += 1;
                    assert!(e.to_string().contains("damaged_recording"), "{e}");
                }
            }
            assert!(begin.elapsed() < Duration::from_secs(10), "a damaged {} took {:?}", file.display(), begin.elapsed());
        }
    }
    println!("{} files: {refused} refused, {read} read", files.len());
    assert!(refused > 100);
}
