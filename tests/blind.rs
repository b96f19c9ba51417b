//! `kisspoint blind` as a command: refused options, kept answers, and files left behind.

use kisspoint::campaign::{self, ReadOptions};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// A folder of this test, removed when it is dropped.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("kisspoint_test_blind_{name}_{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn entries(&self) -> usize {
        std::fs::read_dir(&self.0).unwrap().count()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn blind(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_kisspoint"));
    command.arg("blind").args(arguments);
    command
}

fn draw(arguments: &[&str], folder: &Path) -> Output {
    blind(arguments).args(["--draw-only", "--json", "--keep"]).arg(folder).output().unwrap()
}

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap_or_else(|e| panic!("{}: {e}", folder.join(name).display()))
}

#[test]
fn no_cars_are_refused() {
    let output = blind(&["--cars", "0"]).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("--cars"), "{output:?}");
}

#[test]
fn campaigns_are_kept_with_their_answers_and_drawn_again_alike() {
    for kind in ["--road", "--altered"] {
        let (once, again) = (Folder::new(&format!("once{kind}")), Folder::new(&format!("again{kind}")));
        for folder in [&once, &again] {
            let output = draw(&[kind, "--cars", "3", "--seed", "5"], &folder.0);
            assert!(output.status.success(), "{output:?}");
            let said: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
            assert_eq!((&said["cars"], &said["seed"]), (&3.into(), &5.into()));
        }
        let answers: serde_json::Value = serde_json::from_str(&read(&once.0, "answers.json")).unwrap();
        assert_eq!(answers.as_object().unwrap().keys().collect::<Vec<_>>(), ["case_001", "case_002", "case_003"]);
        for file in ["answers.json", "case_002/vehicle.json", "case_002/recordings.json", "case_002/r01.csv"] {
            assert_eq!(read(&once.0, file), read(&again.0, file), "{kind} {file}");
        }
    }
}

/// The reader accepts what is drawn: drives without a remark, and degraded logs with nothing more than notes.
#[test]
fn drawn_campaigns_are_read_whole() {
    let (road, altered) = (Folder::new("road"), Folder::new("altered"));
    assert!(draw(&["--road", "--cars", "2", "--seed", "8"], &road.0).status.success());
    assert!(draw(&["--altered", "--cars", "14", "--seed", "8"], &altered.0).status.success());
    for (folder, cars, strict) in [(&road, 2, true), (&altered, 14, false)] {
        for k in 1..=cars {
            let path = folder.0.join(format!("case_{k:03}"));
            let options = ReadOptions { strict, ..ReadOptions::default() };
            let read = campaign::read(&path, &options).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            let index: serde_json::Value = serde_json::from_str(&self::read(&path, "recordings.json")).unwrap();
            assert_eq!((read.recordings.len(), read.left_out.len()), (index.as_object().unwrap().len(), 0), "{}", path.display());
        }
    }
}

/// Sends an interrupt, as Ctrl-C does, while cars are being diagnosed.
#[cfg(unix)]
#[test]
fn an_interruption_leaves_no_folder() {
    let temporary = Folder::new("interrupted");
    let mut child = blind(&["--cars", "500", "--seed", "1", "--threads", "1"])
        .env("TMPDIR", &temporary.0)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while temporary.entries() == 0 {
        assert!(begun.elapsed() < Duration::from_secs(60), "no folder appeared");
        std::thread::sleep(Duration::from_millis(10));
    }
    let sent = Command::new("sh").args(["-c", &format!("kill -INT {}", child.id())]).status().unwrap();
    assert!(sent.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(temporary.entries(), 0);
}
