//! No output is lost. Whatever interrupts a command, every file that it writes is either the old one or the new one, and so is the whole answer, unless the process is killed
//! during the renaming, which leaves a trace. Folders that are links, or have long or foreign names, or lie inside a campaign, are treated like any other folder.

use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

const EXAMPLE: &str = "tests/data/campaigns/example";

fn kisspoint(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_kisspoint"));
    command.args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn succeeds(arguments: &[&str]) -> Output {
    let output = kisspoint(arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", said(&output));
    output
}

/// A folder that is removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("kisspoint-outputs-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    fn path(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn copied_example(to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for item in std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join(EXAMPLE)).unwrap() {
        let path = item.unwrap().path();
        std::fs::copy(&path, to.join(path.file_name().unwrap())).unwrap();
    }
}

/// Names and contents of the files in a folder, and the number of half-written files that an interruption left.
fn contents(folder: &str) -> (BTreeMap<String, Vec<u8>>, usize) {
    let items = std::fs::read_dir(folder).unwrap().map(|item| item.unwrap().path());
    let all = items.map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(&path).unwrap()));
    let (partial, whole): (BTreeMap<_, _>, _) = all.partition(|(name, _): &(String, _)| name.starts_with('.'));
    (whole, partial.len())
}

/// A folder with an old answer under the names of the figures.
fn with_old_answer(folder: &Folder, name: &str, new: &BTreeMap<String, Vec<u8>>) -> String {
    let path = folder.path(name);
    std::fs::create_dir_all(&path).unwrap();
    new.keys().for_each(|file| std::fs::write(Path::new(&path).join(file), "old").unwrap());
    path
}

#[test]
fn a_run_that_is_killed_or_interrupted_leaves_the_old_answer_or_the_new_one() {
    // A kill during the renaming is rare and can be recognised, because the files that were not renamed yet remain.
    let amid = |found: &BTreeMap<String, Vec<u8>>, new: &BTreeMap<String, Vec<u8>>, partial: usize| {
        partial > 0 && found.keys().eq(new.keys()) && found.iter().all(|(name, text)| text == b"old" || text == &new[name])
    };
    let folder = Folder::new("killed");
    let whole = folder.path("whole");
    let begin = Instant::now();
    succeeds(&["launch", "--plots", &whole]);
    let lasts = begin.elapsed();
    let (new, _) = contents(&whole);
    assert_eq!(new.len(), 8);
    let mut ends = [0; 2];
    for (k, signal) in (0..16).flat_map(|k| [(k, "-KILL"), (k, "-INT")]) {
        let path = with_old_answer(&folder, "killed", &new);
        let mut child = kisspoint(&["launch", "--plots", &path]).spawn().unwrap();
        std::thread::sleep(lasts.mul_f64(f64::from(k) / 10.0).min(Duration::from_secs(5)));
        // Ctrl-C sends the latter of the two signals; a command that has finished by then no longer exists.
        let _ = Command::new("kill").args([signal, &child.id().to_string()]).stderr(Stdio::null()).status().unwrap();
        let ended = child.wait().unwrap();
        assert!(ended.success() || ended.code().is_none(), "{signal} ends it as a signal does: {ended}");
        let (found, partial) = contents(&path);
        let old = found.values().all(|text| text == b"old");
        if !old && found != new {
            assert!(amid(&found, &new, partial), "{signal} after {k}/10 of its time");
            succeeds(&["launch", "--plots", &path]);
            assert_eq!(contents(&path).0, new, "another run puts it right");
        }
        ends[usize::from(old)] += 1;
    }
    assert!(ends[1] > 0, "a kill at once leaves the old answer: {ends:?}");
}

#[test]
fn two_runs_into_one_folder_leave_the_answer_of_one() {
    let folder = Folder::new("two");
    let vehicle: Value = serde_json::from_slice(&succeeds(&["vehicle", "new", "--json"]).stdout).unwrap();
    let mut answers = Vec::new();
    let mut vehicles = Vec::new();
    for (k, factor) in [1.0, 1.2].into_iter().enumerate() {
        let mut other = vehicle.clone();
        other["driveline"]["J_c"] = (factor * vehicle["driveline"]["J_c"].as_f64().unwrap()).into();
        let path = folder.path(&format!("vehicle-{k}.json"));
        std::fs::write(&path, other.to_string()).unwrap();
        let figures = folder.path(&format!("figures-{k}"));
        succeeds(&["launch", "--vehicle", &path, "--plots", &figures]);
        answers.push(contents(&figures).0);
        vehicles.push(path);
    }
    assert_ne!(answers[0], answers[1]);
    let together = folder.path("together");
    for _ in 0..4 {
        let start = |k: usize| kisspoint(&["launch", "--vehicle", &vehicles[k % 2], "--plots", &together]).spawn().unwrap();
        let ends: Vec<Output> = (0..4).map(start).map(|child| child.wait_with_output().unwrap()).collect();
        assert!(ends.iter().all(|output| output.status.success()), "{}", said(&ends[0]));
        let (found, partial) = contents(&together);
        assert!(answers.contains(&found), "the figures are of two runs");
        assert_eq!(partial, 0);
    }
}

#[cfg(unix)]
#[test]
fn a_disk_that_is_full_leaves_the_old_answer_and_is_said() {
    let folder = Folder::new("full");
    let whole = folder.path("whole");
    succeeds(&["launch", "--plots", &whole]);
    let path = with_old_answer(&folder, "full", &contents(&whole).0);
    // No file may grow beyond this limit, so writing fails as on a full disk.
    let limited = r#"trap '' XFSZ; ulimit -f 8; exec "$0" launch --plots "$1""#;
    let output = Command::new("sh").args(["-c", limited, env!("CARGO_BIN_EXE_kisspoint"), &path]).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(said(&output).contains(".svg") && said(&output).contains("check path"), "{}", said(&output));
    let (found, partial) = contents(&path);
    assert!(found.values().all(|text| text == b"old"));
    assert_eq!(partial, 0, "what was half-written is gone");
}

#[cfg(unix)]
#[test]
fn a_file_is_replaced_and_not_written_into() {
    let folder = Folder::new("replaced");
    let whole = folder.path("whole");
    succeeds(&["launch", "--plots", &whole]);
    let (new, _) = contents(&whole);
    let path = with_old_answer(&folder, "linked", &new);
    let name = new.keys().next().unwrap();
    std::fs::hard_link(Path::new(&path).join(name), folder.0.join("kept")).unwrap();
    succeeds(&["launch", "--plots", &path]);
    assert_eq!(contents(&path).0, new);
    assert_eq!(std::fs::read(folder.0.join("kept")).unwrap(), b"old", "who still reads the old file keeps it");
    use std::os::unix::fs::PermissionsExt;
    let mode = |path: PathBuf| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
    std::fs::write(folder.0.join("plain"), "").unwrap();
    assert_eq!(mode(Path::new(&path).join(name)), mode(folder.0.join("plain")), "readable to whom any file is");
}

#[cfg(unix)]
#[test]
fn links_unicode_and_long_paths_are_folders_like_any_other() {
    let folder = Folder::new("paths");
    let campaign = folder.0.join("Prüfstand – 離合器 'A' \"B\"");
    copied_example(&campaign);
    let plain = succeeds(&["replay", EXAMPLE, "--json"]).stdout;
    let gaps = |bytes: &[u8]| serde_json::from_slice::<Value>(bytes).unwrap()["gaps"].clone();
    assert_eq!(gaps(&succeeds(&["replay", campaign.to_str().unwrap(), "--json"]).stdout), gaps(&plain));
    std::os::unix::fs::symlink(&campaign, folder.0.join("link")).unwrap();
    assert_eq!(gaps(&succeeds(&["replay", &folder.path("link"), "--json"]).stdout), gaps(&plain));
    let linked = folder.0.join("linked");
    copied_example(&linked);
    std::fs::rename(linked.join("r01.csv"), folder.0.join("elsewhere.csv")).unwrap();
    std::os::unix::fs::symlink(folder.0.join("elsewhere.csv"), linked.join("r01.csv")).unwrap();
    assert_eq!(gaps(&succeeds(&["replay", linked.to_str().unwrap(), "--json"]).stdout), gaps(&plain));
    let deep = (0..20).fold(folder.0.clone(), |path, _| path.join("a-folder-with-a-name-of-its-own"));
    let figures = deep.display().to_string();
    succeeds(&["launch", "--plots", &figures]);
    assert_eq!(contents(&figures).0.len(), 8);
    let long = folder.path(&format!("{}.json", "v".repeat(250)));
    succeeds(&["vehicle", "new", "--out", &long]);
    std::os::unix::fs::symlink(&figures, folder.0.join("figures")).unwrap();
    succeeds(&["launch", "--plots", &folder.path("figures")]);
    assert!(std::fs::symlink_metadata(folder.0.join("figures")).unwrap().is_symlink(), "the link is still one");
}

#[test]
fn an_answer_inside_the_campaign_changes_nothing() {
    let folder = Folder::new("inside");
    let campaign = folder.0.join("campaign");
    copied_example(&campaign);
    let path = campaign.display().to_string();
    let before = succeeds(&["replay", &path, "--json"]).stdout;
    for place in [campaign.join("out"), campaign.clone()] {
        std::fs::create_dir_all(&place).unwrap();
        for file in ["diagnosis.json", "report.html", "plant.ssv", "DrivelinePlant.fmu"] {
            std::fs::write(place.join(file), "an answer").unwrap();
        }
        assert_eq!(succeeds(&["replay", &path, "--json"]).stdout, before, "with an answer in {}", place.display());
    }
}

#[test]
fn threads_that_no_machine_has_are_refused() {
    for threads in ["257", "1000", "100000000000", "two"] {
        let output = kisspoint(&["diagnose", EXAMPLE, "--json", "--threads", threads]).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{threads}: {}", said(&output));
        assert!(said(&output).contains("--threads"), "{}", said(&output));
    }
}

#[test]
fn campaigns_of_one_name_are_not_written_over_each_other() {
    let folder = Folder::new("names");
    let paths = ["a/car", "b/car"].map(|name| folder.path(name));
    paths.iter().for_each(|path| copied_example(Path::new(path)));
    let out = folder.path("out");
    let output = kisspoint(&["diagnose", &paths[0], &paths[1], "--json"]).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(said(&output).contains("have the same name") && said(&output).contains(&paths[1]), "{}", said(&output));
    assert!(!Path::new(&out).exists());
}

#[test]
fn of_two_that_make_a_file_at_once_one_is_told() {
    let folder = Folder::new("race");
    for k in 0..8 {
        let path = folder.path(&format!("vehicle-{k}.json"));
        let children: Vec<_> = (0..3).map(|_| kisspoint(&["vehicle", "new", "--out", &path]).spawn().unwrap()).collect();
        let ends: Vec<Output> = children.into_iter().map(|child| child.wait_with_output().unwrap()).collect();
        assert_eq!(ends.iter().filter(|output| output.status.success()).count(), 1);
        let refused = ends.iter().find(|output| !output.status.success()).unwrap();
        assert!(said(refused).contains("exists already"), "{}", said(refused));
    }
}
