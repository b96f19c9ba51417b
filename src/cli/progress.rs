//! A progress bar on long work: on a terminal only.

use super::output::width;
use indicatif::{ProgressBar, ProgressStyle};

/// Steps of the bar.
const STEPS: u64 = 100;

/// A bar that says what is being done.
pub struct Progress(ProgressBar);

impl Progress {
    /// A bar at its start; hidden when standard error is no terminal.
    pub fn new() -> Self {
        let bar = ProgressBar::new(STEPS);
        // On a narrow terminal what is being done needs the room more than the bar.
        let wide = width(true).clamp(40, 120) / 5;
        let template = format!("{{spinner}} {{bar:{wide}}} {{percent:>3}} %  {{elapsed:>4}}  {{wide_msg}}");
        bar.set_style(ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar()));
        // Some steps are long: the clock shows that work goes on.
        bar.enable_steady_tick(std::time::Duration::from_millis(250));
        Self(bar)
    }

    /// Says what is being done, and the share that is done.
    pub fn tell(&self, what: &str, share: f64) {
        self.say(what);
        self.0.set_position((share * STEPS as f64) as u64);
    }

    /// Says what is being done.
    pub fn say(&self, what: &str) {
        self.0.set_message(what.to_owned());
    }

    /// Says to standard error, terminal or not, what remains.
    pub fn line(&self, text: &str) {
        self.0.suspend(|| eprintln!("{text}"));
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.0.finish_and_clear();
    }
}

impl Drop for Progress {
    /// Whatever ends the work, what is written next finds a clean line.
    fn drop(&mut self) {
        self.finish();
    }
}

impl Default for Progress {
    fn default() -> Self {
        Self::new()
    }
}
