//! Answers kept from an examination, so that an interrupted run can continue.
//!
//! Each answer is a file of its own, `diagnoses/case_001.json`, with one SHA-256 over the program and the campaign that it answers. If the build or the campaign of that name
//! has changed, the campaign is diagnosed anew.

use crate::cli::error::{CommandError, at};
use crate::cli::files::write_all;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

/// The folder of kept answers, and the hash of the program that computes them.
pub struct Kept {
    folder: PathBuf,
    program: Sha256,
}

impl Kept {
    /// Keeps the answers in the subfolder `diagnoses` of this folder of campaigns.
    ///
    /// # Errors
    /// A folder that cannot be created, or a program file that cannot be read.
    pub fn beside(campaigns: &Path) -> Result<Self, CommandError> {
        let folder = campaigns.join("diagnoses");
        std::fs::create_dir_all(&folder).map_err(at(&folder))?;
        let program = std::env::current_exe().map_err(at(Path::new("kisspoint")))?;
        let bytes = std::fs::read(&program).map_err(at(&program))?;
        Ok(Self { folder, program: Sha256::new_with_prefix(bytes) })
    }

    /// The answer to this campaign: the kept one if it is still valid, otherwise a new one, which is then kept.
    ///
    /// # Errors
    /// Errors of `diagnose`, and files that cannot be read or written.
    pub fn answer(&self, campaign: &Path, diagnose: impl FnOnce() -> Result<Value, CommandError>) -> Result<Value, CommandError> {
        let name = campaign.file_name().unwrap_or_default().to_string_lossy();
        let file = format!("{name}.json");
        let question = self.question(campaign).map_err(at(campaign))?;
        let kept = std::fs::read(self.folder.join(&file)).ok().and_then(|bytes| serde_json::from_slice::<Value>(&bytes).ok());
        if let Some(mut kept) = kept.filter(|kept| kept["question"] == question.as_str()) {
            return Ok(kept["answer"].take());
        }
        let answer = diagnose()?;
        let text = format!("{:#}\n", json!({"question": question, "answer": answer}));
        write_all(&self.folder, &[(&file, text.into_bytes())])?;
        Ok(answer)
    }

    /// SHA-256 of the program and of every file of the campaign.
    fn question(&self, campaign: &Path) -> std::io::Result<String> {
        let mut files: Vec<PathBuf> = std::fs::read_dir(campaign)?.map(|entry| entry.map(|e| e.path())).collect::<Result<_, _>>()?;
        files.sort();
        let mut sum = self.program.clone();
        for file in files {
            let bytes = std::fs::read(&file)?;
            sum.update(file.file_name().unwrap_or_default().as_encoded_bytes());
            sum.update((bytes.len() as u64).to_le_bytes());
            sum.update(bytes);
        }
        Ok(sum.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_is_kept_for_the_campaign_that_it_answers_alone() {
        let folder = tempfile::tempdir().unwrap();
        let campaign = folder.path().join("case_001");
        std::fs::create_dir(&campaign).unwrap();
        let write = |text: &str| std::fs::write(campaign.join("recordings.json"), text).unwrap();
        let kept = Kept::beside(folder.path()).unwrap();
        let ask = |answer: i32| kept.answer(&campaign, || Ok(answer.into())).unwrap();
        write("one");
        assert_eq!((ask(1), ask(2)), (1.into(), 1.into()), "the second time it is not asked");
        write("two");
        assert_eq!((ask(3), ask(4)), (3.into(), 3.into()), "another campaign is another question");
        std::fs::write(folder.path().join("diagnoses/case_001.json"), "{\"question\": ").unwrap();
        assert_eq!(ask(5), 5, "a damaged file is no answer");
        let other = Kept { program: Sha256::new_with_prefix("another program"), ..Kept::beside(folder.path()).unwrap() };
        assert_eq!(other.answer(&campaign, || Ok(6.into())).unwrap(), 6);
    }
}
