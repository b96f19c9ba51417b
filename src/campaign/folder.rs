//! The folder of a campaign: which file belongs to which recording, what is left out, and the fingerprint.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::assemble::{Assembled, assemble};
use super::error::{CampaignError, Defect, RecordingError};
use super::limits::{CAMPAIGN_ROWS, RECORDINGS, TEXT_BYTES};
use super::manifest::{self, Entry};
use super::pick;
use super::repeats::Repeats;
use super::table::{self, Format, file_name};
use super::{Campaign, ChannelMap, LeftOut, Note, ReadOptions, Recording};

/// Reads a campaign's folder.
pub fn read(dir: &Path, options: &ReadOptions) -> Result<Campaign, CampaignError> {
    read_telling(dir, options, &|_, _| {})
}

/// Like [`read`]; `tell` receives the name of the file that is being read, and the share of it that has been read.
pub fn read_telling(dir: &Path, options: &ReadOptions, tell: &dyn Fn(&str, f64)) -> Result<Campaign, CampaignError> {
    if dir.is_file() {
        return Err(CampaignError::IsFile(dir.to_path_buf()));
    }
    if !dir.is_dir() {
        return Err(CampaignError::NoFolder(dir.to_path_buf()));
    }
    let (vehicle_path, manifest_path) = (dir.join("vehicle.json"), dir.join("recordings.json"));
    if let Some(inner) = campaign_within(dir).filter(|_| !vehicle_path.exists()) {
        let remedy = format!("Give one of them, e.g. {}, or several", inner.display());
        return Err(CampaignError::Shape { file: dir.to_path_buf(), what: "is no campaign but holds some".to_string(), remedy });
    }
    let vehicle_text = text(&vehicle_path, "Add it: it holds the nominal vehicle that the recordings are compared with")?;
    let manifest_text =
        text(&manifest_path, "Add it: it names manoeuvre, sample_rate_Hz, theta_c0_degC and theta_b0_degC of each recording")?;
    let vehicle_json = manifest::json(&vehicle_path, &vehicle_text)?;
    if !vehicle_json.is_object() {
        let remedy = "Write one object with the groups friction, actuator, cushion_spring, thermal and driveline".to_string();
        return Err(CampaignError::Shape { file: vehicle_path, what: "is not an object".to_string(), remedy });
    }
    let entries = manifest::entries(&manifest_path, &manifest_text)?;
    let too_much = |what, count, most, remedy| Err(CampaignError::TooMuch { file: manifest_path.clone(), what, count, most, remedy });
    if entries.len() > RECORDINGS {
        return too_much("recordings", entries.len(), RECORDINGS, "Split the campaign, or keep the recordings that tell most");
    }
    let files = files(dir)?;
    let mut reading = Reading::new(dir, options, tell);
    reading.hash("vehicle.json", vehicle_text.as_bytes());
    reading.hash("recordings.json", manifest_text.as_bytes());
    for entry in &entries {
        let stem = files.get(stem(entry)).map_or(&[][..], Vec::as_slice);
        reading.recording(entry, stem)?;
        let rows = reading.read.iter().map(|(.., a)| a.recording.time.len()).sum();
        if rows > CAMPAIGN_ROWS {
            return too_much("rows", rows, CAMPAIGN_ROWS, "Keep the parts that matter with window_s, or export at a lower rate");
        }
    }
    let unlisted = files.iter().filter(|(stem, _)| entries.iter().all(|e| self::stem(e) != *stem)).flat_map(|(_, paths)| paths);
    // A text file that is not listed need not be a measurement.
    for path in unlisted.filter(|p| !p.extension().is_some_and(|e| e.eq_ignore_ascii_case("txt"))) {
        let name = file_name(path);
        reading.left_out.push(LeftOut { reason: Defect::NotListed.in_file(&name).to_string(), recording: name });
    }
    reading.again()?;
    reading.leave_out_still_torques()?;
    reading.leave_out_the_same_unit()?;
    if reading.read.is_empty() {
        return Err(CampaignError::NothingUsable { dir: dir.to_path_buf(), left_out: reading.left_out });
    }
    let fingerprint = reading.fingerprint();
    let (recordings, notes): (Vec<Recording>, Vec<Vec<Note>>) = reading.read.into_iter().map(|(.., a)| noted(a)).unzip();
    let notes = notes.concat();
    let (dir, left_out) = (dir.to_path_buf(), reading.left_out);
    Ok(Campaign { dir, vehicle_path, vehicle_json, fingerprint, recordings, left_out, notes })
}

/// Name of a recording's file without its extension.
fn stem(entry: &Entry) -> &str {
    let file = entry.file.as_deref().unwrap_or(&entry.name);
    let ending = file.rsplit_once('.').filter(|(_, e)| Format::from_ending(e).is_some());
    ending.map_or(file, |(stem, _)| stem)
}

/// Reads one recording from a file of any of the formats; `like` provides its name, manoeuvre, stated rate and start temperatures.
pub fn read_one(path: &Path, like: &Recording, map: &ChannelMap) -> Result<(Recording, Vec<Note>), CampaignError> {
    let entry = Entry {
        name: like.name.clone(),
        manoeuvre: like.manoeuvre.clone(),
        sample_rate_hz: Some(like.sample_rate_hz).filter(|rate| *rate > 0.0),
        theta_0: Some([like.theta_c0, like.theta_b0]),
        theta_0_sigma: like.theta_0_sigma,
        ..Entry::default()
    };
    Ok(noted(from_file(path, &entry, map, None, &|_| {})?))
}

fn noted(read: Assembled) -> (Recording, Vec<Note>) {
    let note = |text| Note { recording: read.recording.name.clone(), text };
    let notes = read.notes.into_iter().map(note).collect();
    (read.recording, notes)
}

fn from_file(
    path: &Path,
    entry: &Entry,
    map: &ChannelMap,
    all: Option<&Repeats>,
    tell: table::Tell<'_>,
) -> Result<Assembled, RecordingError> {
    let mut map = std::borrow::Cow::Borrowed(map);
    if let Some(over) = &entry.map {
        map = std::borrow::Cow::Owned(map.overlaid(over));
    }
    if let Some(ratio) = entry.ratio {
        map = std::borrow::Cow::Owned(map.with_ratio(ratio));
    }
    assemble(table::read(path, map.dbc(), &|name| pick::wanted(&map, name), tell)?, &map, entry, all)
}

/// What has been read so far.
struct Reading<'a> {
    dir: &'a Path,
    tell: &'a dyn Fn(&str, f64),
    strict: bool,
    map: std::borrow::Cow<'a, ChannelMap>,
    read: Vec<(PathBuf, Entry, Assembled)>,
    left_out: Vec<LeftOut>,
    /// Recordings that were left out because the unit of a channel can't be right, each with the channel as its file calls it.
    wrong_units: Vec<(String, String)>,
    /// File, recording and window of each recording so far.
    used: Vec<(String, String, Option<[f64; 2]>)>,
    /// Digests by file name; a map, so that the order of the directory does not matter.
    digests: BTreeMap<String, [u8; 32]>,
}

impl<'a> Reading<'a> {
    fn new(dir: &'a Path, options: &'a ReadOptions, tell: &'a dyn Fn(&str, f64)) -> Self {
        let map = options.channel_map.as_ref().map(std::borrow::Cow::Borrowed).unwrap_or_default();
        Reading {
            dir,
            tell,
            strict: options.strict,
            map,
            read: Vec::new(),
            left_out: Vec::new(),
            wrong_units: Vec::new(),
            used: Vec::new(),
            digests: BTreeMap::new(),
        }
    }

    fn hash(&mut self, name: &str, bytes: &[u8]) {
        self.digests.insert(name.to_string(), Sha256::digest(bytes).into());
    }

    /// Reads one recording, or leaves it out.
    fn recording(&mut self, entry: &Entry, paths: &[PathBuf]) -> Result<(), RecordingError> {
        let read = self.first(entry, paths);
        self.keep(entry, read)
    }

    fn keep(&mut self, entry: &Entry, read: Result<(PathBuf, Assembled), RecordingError>) -> Result<(), RecordingError> {
        match read {
            Ok((path, assembled)) => self.read.push((path, entry.clone(), assembled)),
            Err(error) if self.strict => return Err(error),
            Err(error) => {
                if let (Defect::UnitCannotBeRight { .. }, Some(channel)) = (&*error.defect, &error.place.channel) {
                    self.wrong_units.push((entry.name.clone(), channel.clone()));
                }
                self.left_out.push(LeftOut { recording: entry.name.clone(), reason: error.to_string() });
            }
        }
        Ok(())
    }

    /// Rereads the recordings whose repeated rows are judged differently by all recordings together than by each one alone.
    fn again(&mut self) -> Result<(), RecordingError> {
        let all = self.read.iter().fold(Repeats::default(), |all, (.., a)| all.with(&a.repeats));
        for (path, entry, assembled) in std::mem::take(&mut self.read) {
            let own = &assembled.repeats;
            let again = own.among(&all) != own.among(own);
            let tell = |share| (self.tell)(&file_name(&path), share);
            let read = if again { from_file(&path, &entry, &self.map, Some(&all), &tell) } else { Ok(assembled) };
            self.keep(&entry, read.map(|assembled| (path, assembled)))?;
        }
        Ok(())
    }

    /// Leaves out everything if the engine torque does not change in any recording. In a single one it may be constant, as at idle or under drag.
    fn leave_out_still_torques(&mut self) -> Result<(), RecordingError> {
        if !self.read.iter().all(|(.., a)| a.still_torque.is_some()) {
            return Ok(());
        }
        for (_, entry, assembled) in std::mem::take(&mut self.read) {
            if let Some(error) = assembled.still_torque {
                self.keep(&entry, Err(error))?;
            }
        }
        Ok(())
    }

    /// Leaves out everything if in most recordings the unit of a channel can't be right. What the others hold does not contradict that unit, but they come from the same logger.
    fn leave_out_the_same_unit(&mut self) -> Result<(), RecordingError> {
        let Some((first, channel)) = self.wrong_units.first().filter(|_| self.wrong_units.len() > self.read.len()).cloned() else {
            return Ok(());
        };
        for (path, entry, _) in std::mem::take(&mut self.read) {
            let error = Defect::SameUnitCannotBeRight { recording: first.clone(), channel: channel.clone() }.in_file(&file_name(&path));
            self.keep(&entry, Err(error))?;
        }
        Ok(())
    }

    fn first(&mut self, entry: &Entry, paths: &[PathBuf]) -> Result<(PathBuf, Assembled), RecordingError> {
        let [path] = paths else {
            let names: Vec<String> = paths.iter().map(|p| file_name(p)).collect();
            return Err(match names.as_slice() {
                [] => not_there(self.dir, entry),
                _ => Defect::SeveralFiles(names.join(", ")).in_file(&entry.name),
            });
        };
        let name = file_name(path);
        let unreadable = |e: std::io::Error| Defect::Unreadable(e.to_string()).in_file(&name);
        let digest = digest(path).map_err(unreadable)?;
        // One file may hold several recordings in windows that do not overlap.
        let apart = |other: &[f64; 2]| entry.window.is_some_and(|w| w[0] >= other[1] || w[1] <= other[0]);
        let shared = self.used.iter().find(|(file, _, window)| *file == name && !window.as_ref().is_some_and(apart));
        if let Some((_, recording, _)) = shared {
            return Err(Defect::SharedWindow(recording.clone()).in_file(&name));
        }
        self.used.push((name.clone(), entry.name.clone(), entry.window));
        let same = self.digests.iter().find(|(other, d)| **other != name && **d == digest);
        if let Some((other, _)) = same.filter(|_| path.metadata().is_ok_and(|m| m.len() > 0)) {
            return Err(Defect::SameAs(other.clone()).in_file(&name));
        }
        self.digests.insert(name.clone(), digest);
        Ok((path.clone(), from_file(path, entry, &self.map, None, &|share| (self.tell)(&name, share))?))
    }

    /// One digest over all files and the channel map.
    fn fingerprint(&self) -> String {
        let mut hasher = Sha256::new();
        let map = Sha256::digest(self.map.text.as_bytes());
        let map = (!self.map.text.is_empty()).then_some(("channel map", map.as_slice()));
        for (name, digest) in self.digests.iter().map(|(n, d)| (n.as_str(), d.as_slice())).chain(map) {
            hasher.update((name.len() as u64).to_le_bytes());
            hasher.update(name.as_bytes());
            hasher.update(digest);
        }
        hasher.finalize().iter().map(|b| format!("{b:02x}")).collect()
    }
}

/// The first campaign among the subfolders of a folder.
fn campaign_within(dir: &Path) -> Option<PathBuf> {
    let folders = std::fs::read_dir(dir).ok()?.filter_map(|item| Some(item.ok()?.path()));
    folders.filter(|path| path.join("vehicle.json").is_file()).min()
}

/// Measurement files by stem, each list sorted.
fn files(dir: &Path) -> Result<BTreeMap<String, Vec<PathBuf>>, CampaignError> {
    let io = |source| CampaignError::Io { file: dir.to_path_buf(), source };
    let mut files: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for item in std::fs::read_dir(dir).map_err(io)? {
        let path = item.map_err(io)?.path();
        let known = path.extension().is_some_and(|e| Format::from_ending(&e.to_string_lossy()).is_some());
        if let Some(stem) = path.file_stem().filter(|_| known && path.is_file()) {
            files.entry(stem.to_string_lossy().into_owned()).or_default().push(path);
        }
    }
    files.values_mut().for_each(|paths| paths.sort());
    Ok(files)
}

/// Why a recording has no file: none exists, or only one of another kind.
fn not_there(dir: &Path, entry: &Entry) -> RecordingError {
    let begins = format!("{}.", stem(entry));
    let is_it = |path: &PathBuf| path.is_file() && file_name(path).starts_with(&begins);
    let others = std::fs::read_dir(dir).into_iter().flatten().filter_map(|item| Some(item.ok()?.path())).filter(is_it);
    match others.min() {
        None => Defect::NoFile.in_file(&entry.name),
        Some(path) => table::format(&path).err().unwrap_or_else(|| Defect::OtherEnding.in_file(&file_name(&path))),
    }
}

/// SHA-256 of a file, read as a stream.
fn digest(path: &Path) -> std::io::Result<[u8; 32]> {
    let (mut hasher, mut file) = (Sha256::new(), std::fs::File::open(path)?);
    let mut block = vec![0; 1 << 20];
    loop {
        match file.read(&mut block)? {
            0 => return Ok(hasher.finalize().into()),
            n => hasher.update(&block[..n]),
        }
    }
}

fn text(path: &Path, remedy: &'static str) -> Result<String, CampaignError> {
    if path.metadata().is_ok_and(|m| m.len() > TEXT_BYTES as u64) {
        let (what, remedy) =
            (format!("is larger than {} MB", TEXT_BYTES >> 20), "Check that it is the file that its name says".to_string());
        return Err(CampaignError::Shape { file: path.to_path_buf(), what, remedy });
    }
    let bytes = match std::fs::read(path) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => {
            return Err(CampaignError::NoFile { file: path.to_path_buf(), remedy });
        }
        Err(source) => return Err(CampaignError::Io { file: path.to_path_buf(), source }),
    };
    String::from_utf8(bytes).map_err(|_| CampaignError::Shape {
        file: path.to_path_buf(),
        what: "is not UTF-8 text".to_string(),
        remedy: "Save it as UTF-8".to_string(),
    })
}
